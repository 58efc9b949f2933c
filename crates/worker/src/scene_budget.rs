//! The memory that the scenes of a worker may take together.

use std::sync::Arc;

use tokio::sync::watch;

use crate::machine::machine_memory;

/// A limit for the memory of scenes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MemoryLimit {
    /// Bytes.
    pub(crate) bytes: u64,
    /// The advice in the error of a scene that needs more.
    pub(crate) way_out: &'static str,
}

/// The memory that scenes may take, and the part that scenes take now.
pub(crate) struct SceneBudget {
    limit: Option<MemoryLimit>,
    taken: Arc<watch::Sender<u64>>,
}

impl SceneBudget {
    /// A budget of `bytes`, or of the machine's memory. Where neither is known there is no limit.
    pub(crate) fn new(share: Option<u64>) -> Self {
        let of_share = |bytes| MemoryLimit { bytes, way_out: "a worker that may take more memory" };
        let of_machine = |bytes| MemoryLimit { bytes, way_out: "a machine with more memory" };
        let limit = share.map(of_share).or_else(|| machine_memory().map(of_machine));
        Self { limit, taken: Arc::new(watch::Sender::new(0)) }
    }

    /// The limit, if there is one.
    pub(crate) fn limit(&self) -> Option<MemoryLimit> {
        self.limit
    }

    /// Free bytes.
    pub(crate) fn spare(&self) -> u64 {
        self.limit.map_or(u64::MAX, |limit| limit.bytes.saturating_sub(*self.taken.borrow()))
    }

    /// Reserves memory for a scene. While there is too little, `drop_scene` drops one scene at a time, until it returns
    /// false. Then this waits for scenes that are still being rendered. Only one task may call this at a time.
    pub(crate) async fn reserve(&self, bytes: u64, mut drop_scene: impl FnMut() -> bool) -> Reservation {
        while !self.fits(bytes) && drop_scene() {}
        let mut changes = self.taken.subscribe();
        while !self.fits(bytes) {
            // It fails only when the sender is gone, and `self` owns the sender.
            let _ = changes.changed().await;
        }
        self.taken.send_modify(|taken| *taken += bytes);
        Reservation { bytes, taken: Arc::clone(&self.taken) }
    }

    /// Whether a scene fits beside the others. A scene without others always fits, because waiting would not help it.
    fn fits(&self, bytes: u64) -> bool {
        let taken = *self.taken.borrow();
        taken == 0 || bytes <= self.spare()
    }
}

/// Memory of one scene, released when this is dropped.
pub(crate) struct Reservation {
    bytes: u64,
    taken: Arc<watch::Sender<u64>>,
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.taken.send_modify(|taken| *taken -= self.bytes);
    }
}

#[cfg(test)]
mod tests {
    use std::pin::pin;
    use std::time::Duration;

    use super::*;

    #[tokio::test]
    async fn scenes_are_dropped_until_the_next_fits_and_no_more() {
        let budget = SceneBudget::new(Some(10));
        let mut kept = vec![budget.reserve(3, || false).await];
        for _ in 0..2 {
            kept.push(budget.reserve(3, || unreachable!("there is room")).await);
        }
        let _next = budget.reserve(6, || kept.pop().is_some()).await;
        assert_eq!((kept.len(), budget.spare()), (1, 1));
    }

    #[tokio::test]
    async fn a_scene_that_is_still_rendered_is_waited_for() {
        let budget = SceneBudget::new(Some(10));
        let rendered = budget.reserve(6, || false).await;
        let mut next = pin!(budget.reserve(6, || false));
        assert!(tokio::time::timeout(Duration::ZERO, &mut next).await.is_err());
        drop(rendered);
        let _next = tokio::time::timeout(Duration::from_secs(60), next).await.expect("there is room now");
        assert_eq!(budget.spare(), 4);
    }
}
