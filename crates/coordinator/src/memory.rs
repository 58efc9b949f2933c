//! Budgets of memory: work whose size is known waits until as many bytes are free.

use std::sync::Arc;

use tokio::sync::{AcquireError, OwnedSemaphorePermit, Semaphore, SemaphorePermit};

/// Permits for a number of bytes, one for each kibibyte.
pub(crate) fn permits(bytes: u64) -> u32 {
    u32::try_from(bytes >> 10).unwrap_or(u32::MAX).max(1)
}

/// A number of bytes that concurrent work shares. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct MemoryBudget {
    semaphore: Arc<Semaphore>,
    bytes: u64,
}

impl MemoryBudget {
    /// A budget of which everything is free.
    pub(crate) fn new(bytes: u64) -> Self {
        Self { semaphore: Arc::new(Semaphore::new(permits(bytes) as usize)), bytes }
    }

    /// All of it, in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Waits until these bytes are free and reserves them until the answer is dropped. Work that needs more than the
    /// whole budget reserves all of it.
    pub(crate) async fn reserve(&self, bytes: u64) -> SemaphorePermit<'_> {
        never_closed(self.semaphore.acquire_many(self.permits(bytes)).await)
    }

    /// As [`Self::reserve`], for a task that outlives the caller.
    pub(crate) async fn reserve_owned(&self, bytes: u64) -> OwnedSemaphorePermit {
        never_closed(Arc::clone(&self.semaphore).acquire_many_owned(self.permits(bytes)).await)
    }

    /// Reserves these bytes, or `None` when they are not free now.
    pub(crate) fn try_reserve(&self, bytes: u64) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.semaphore).try_acquire_many_owned(self.permits(bytes)).ok()
    }

    /// Permits that are free now.
    #[cfg(test)]
    pub(crate) fn available_permits(&self) -> usize {
        self.semaphore.available_permits()
    }

    fn permits(&self, bytes: u64) -> u32 {
        permits(bytes.min(self.bytes))
    }
}

fn never_closed<T>(acquired: Result<T, AcquireError>) -> T {
    acquired.expect("the budget never closes its semaphore")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn work_that_needs_more_than_the_budget_runs_alone() {
        let budget = MemoryBudget::new(8 << 10);
        let large = budget.reserve(1 << 20).await;
        assert!(budget.try_reserve(1).is_none());
        drop(large);
        assert!(budget.try_reserve(8 << 10).is_some());
    }
}
