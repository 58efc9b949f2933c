//! What methods look things up in. It is kept between scenes that differ in their view, lights or settings alone.

use std::any::{Any, TypeId};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// What methods look things up in, by its type. A scene has one cache for as long as its meshes and panes stay the
/// same.
#[derive(Debug, Default)]
pub struct MethodCache {
    by_type: Mutex<BTreeMap<TypeId, Arc<dyn Any + Send + Sync>>>,
}

impl MethodCache {
    /// What is cached of this type. The first call makes it.
    pub fn get_or_make<T: Any + Send + Sync>(&self, make: impl FnOnce() -> T) -> Arc<T> {
        let mut by_type = self.by_type.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = by_type.get(&TypeId::of::<T>()).and_then(|known| Arc::clone(known).downcast().ok()) {
            return known;
        }
        let made = Arc::new(make());
        by_type.insert(TypeId::of::<T>(), Arc::clone(&made) as Arc<dyn Any + Send + Sync>);
        made
    }
}
