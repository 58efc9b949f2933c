//! What has happened in all histories together, so that they cannot come to test nothing without a word.

use std::collections::{BTreeMap, BTreeSet};

/// Sizes of nodes that are given out, at least.
const FEWEST_LEVELS: usize = 3;

/// Something that the histories are there for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Event {
    /// More work was cut after the first claim.
    Refilled,
    /// Tiles of one round were cut to nodes of different sizes, as rates became known.
    CutByPace,
    /// A lease of several nodes was as large as the worker's pace allowed.
    LeasedByPace,
    /// A node was split for a worker for which it was too large.
    Split,
    /// A worker for which nothing was free got what another held.
    TakenOver,
    /// A worker got what another had held for too long without bringing any of it.
    TakenOverdue,
    /// A worker got nothing because it had failed.
    Rested,
    /// A node was accepted.
    Accepted,
    /// A node was accepted that was pending as smaller ones.
    AcceptedInParts,
    /// The rest of a node became free, because the worker that held it brought the whole node.
    FreedRest,
    /// A node was brought that was there.
    Duplicate,
    /// A half of a leased node was brought.
    RefusedHalf,
    /// A node was brought of which a half was leased.
    RefusedParent,
    /// Somebody else's node was brought.
    RefusedOther,
    /// A leased node was brought that does not wait to be rendered any more, or as part of a larger one.
    RefusedOwn,
    /// A call came under a lease that was over.
    RefusedLate,
    /// Calls came with a token that was not that of their lease.
    RefusedToken,
    /// A lease ran out.
    Expired,
    /// A lease was given back.
    Returned,
    /// A lease was taken back because its work failed.
    Failed,
    /// A job failed.
    JobFailed,
    /// Nodes were merged.
    Merged,
    /// A round was recorded.
    Recorded,
    /// What a worker may have rendered was to be rendered again.
    Redone,
    /// A job began again, since nothing was left of it.
    BegunAgain,
    /// The database was closed and opened again.
    Reopened,
}

impl Event {
    /// What must not be missing.
    const NEEDED: [Self; 25] = [
        Self::Refilled,
        Self::CutByPace,
        Self::LeasedByPace,
        Self::Split,
        Self::TakenOver,
        Self::TakenOverdue,
        Self::Rested,
        Self::Accepted,
        Self::AcceptedInParts,
        Self::FreedRest,
        Self::Duplicate,
        Self::RefusedHalf,
        Self::RefusedParent,
        Self::RefusedOther,
        Self::RefusedLate,
        Self::RefusedToken,
        Self::Expired,
        Self::Returned,
        Self::Failed,
        Self::JobFailed,
        Self::Merged,
        Self::Recorded,
        Self::Redone,
        Self::BegunAgain,
        Self::Reopened,
    ];
}

/// How often what has happened.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    events: BTreeMap<Event, u64>,
    /// Levels of the nodes that were given out.
    levels: BTreeSet<u32>,
}

impl Seen {
    pub(super) fn note(&mut self, event: Event) {
        *self.events.entry(event).or_default() += 1;
    }

    pub(super) fn note_level(&mut self, level: u32) {
        self.levels.insert(level);
    }

    /// Adds what has happened in another history.
    pub(super) fn add(&mut self, other: &Self) {
        for (event, count) in &other.events {
            *self.events.entry(*event).or_default() += count;
        }
        self.levels.extend(&other.levels);
    }

    /// Makes sure that nothing was left out.
    pub(super) fn assert_all(&self) {
        let missing: Vec<Event> = Event::NEEDED.into_iter().filter(|event| !self.events.contains_key(event)).collect();
        assert!(missing.is_empty(), "in no history: {missing:?}; in all of them: {self:?}");
        assert!(self.levels.len() >= FEWEST_LEVELS, "too few sizes of nodes: {self:?}");
    }
}
