//! What methods look things up in. It is kept between scenes that differ in their view, lights or settings alone.

use std::any::{Any, TypeId};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Something that a method has cached.
type Cached = Arc<dyn Any + Send + Sync>;

/// What methods look things up in, by its type. A scene has one cache for as long as its meshes and panes stay the
/// same.
#[derive(Debug, Default)]
pub struct MethodCache {
    by_type: Mutex<BTreeMap<TypeId, Arc<OnceLock<Cached>>>>,
}

impl MethodCache {
    /// What is cached of this type. The first call makes it; calls for other types go on meanwhile.
    pub fn get_or_make<T: Any + Send + Sync>(&self, make: impl FnOnce() -> T) -> Arc<T> {
        let entry = {
            let mut by_type = self.by_type.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(by_type.entry(TypeId::of::<T>()).or_default())
        };
        let cached = Arc::clone(entry.get_or_init(|| Arc::new(make())));
        cached.downcast().expect("the key is the type")
    }
}
