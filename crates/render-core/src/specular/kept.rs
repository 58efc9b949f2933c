//! What methods keep between scenes that differ in their view, their lights or their settings alone.

use std::any::{Any, TypeId};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// What methods look things up in, by its type. A scene has one for as long as its things stay the same.
#[derive(Debug, Default)]
pub struct Kept {
    by_type: Mutex<BTreeMap<TypeId, Arc<dyn Any + Send + Sync>>>,
}

impl Kept {
    /// What is kept of this type, made when it is asked for first.
    pub fn of<T: Any + Send + Sync>(&self, make: impl FnOnce() -> T) -> Arc<T> {
        let mut by_type = self.by_type.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = by_type.get(&TypeId::of::<T>()).and_then(|kept| Arc::clone(kept).downcast().ok()) {
            return kept;
        }
        let made = Arc::new(make());
        by_type.insert(TypeId::of::<T>(), Arc::clone(&made) as Arc<dyn Any + Send + Sync>);
        made
    }
}
