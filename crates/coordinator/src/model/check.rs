//! Check selection: which nodes a second worker renders too.

use clerestory_api::{JobId, Quarantine, WorkerId};
use clerestory_film::NodeAddress;

use crate::model::node::Removed;

/// The key that selects nodes for [checks](is_selected). Only the coordinators of the farm know it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct CheckKey(pub(crate) [u8; 32]);

impl std::fmt::Debug for CheckKey {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("CheckKey")
    }
}

/// Whether a second worker renders a node too, when `fraction` of all nodes are checked.
pub(crate) fn is_selected(key: &CheckKey, job: JobId, node: &NodeAddress, fraction: f64) -> bool {
    let NodeAddress { frame, tile, level, index } = *node;
    let hash = blake3::keyed_hash(&key.0, format!("check {job} {frame} {tile} {level} {index}").as_bytes());
    let [a, b, c, d, ..] = *hash.as_bytes();
    f64::from(u32::from_le_bytes([a, b, c, d])) < fraction * (f64::from(u32::MAX) + 1.0)
}

/// The outcome of checks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct CheckOutcome {
    /// Whether there are checks to do.
    pub(crate) has_work: bool,
    /// Whether checks have ended.
    pub(crate) has_ended: bool,
    /// Workers whose nodes were wrong, and why.
    pub(crate) quarantined: Vec<(WorkerId, Quarantine)>,
    /// Jobs of which nodes are rendered again.
    pub(crate) redone: Vec<JobId>,
    /// What was removed from their films.
    pub(crate) removed: Removed,
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    #[test]
    fn a_hundredth_of_all_nodes_is_chosen() {
        let job = JobId::from(Uuid::nil());
        let keys = [1, 2].map(|byte| CheckKey([byte; 32]));
        let chosen_by = |key: &CheckKey, fraction: f64| {
            let nodes = (0..100_000).map(|tile| NodeAddress { frame: 0, tile, level: 0, index: 3 });
            nodes.filter(|node| is_selected(key, job, node, fraction)).collect::<Vec<_>>()
        };
        let chosen = |fraction: f64| chosen_by(&keys[0], fraction).len();
        // Of 100 000 draws, 1000 and at most five standard errors of 31.5.
        assert!((843..=1157).contains(&chosen(0.01)), "{}", chosen(0.01));
        assert_eq!((chosen(0.0), chosen(1.0)), (0, 100_000));
        let others = chosen_by(&keys[1], 0.01);
        let by_both = chosen_by(&keys[0], 0.01).iter().filter(|node| others.contains(node)).count();
        // 10 by chance.
        assert!(by_both < 30, "{by_both} nodes are chosen by both of two keys");
    }
}
