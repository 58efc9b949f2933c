//! How often methods look for light in ways that no counter of a render counts: what a pilot needs to tell their cost.
//!
//! The counters of a render ([`clerestory_film::counters`]) are what papers compare, and a farm stores them. These are
//! of no interest beyond the process. So each thread counts its own.

use std::cell::Cell;
use std::ops::{AddAssign, Sub};

/// How often.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Looks {
    /// Vertices at which a path is scattered into a solid angle.
    pub(crate) vertices: u64,
    /// Rounds in which a window was narrowed.
    pub(crate) windows: u64,
    /// Nodes of trees over panes.
    pub(crate) nodes: u64,
    /// Panes that an environment was looked for through.
    pub(crate) portals: u64,
}

thread_local! {
    static LOOKS: Cell<Looks> = const { Cell::new(Looks { vertices: 0, windows: 0, nodes: 0, portals: 0 }) };
}

impl Looks {
    /// What this thread has counted so far.
    pub(crate) fn so_far() -> Self {
        LOOKS.get()
    }

    /// Counts some more, on this thread.
    pub(crate) fn count(change: impl FnOnce(&mut Self)) {
        let mut looks = LOOKS.get();
        change(&mut looks);
        LOOKS.set(looks);
    }
}

impl AddAssign for Looks {
    fn add_assign(&mut self, other: Self) {
        self.vertices += other.vertices;
        self.windows += other.windows;
        self.nodes += other.nodes;
        self.portals += other.portals;
    }
}

impl Sub for Looks {
    type Output = Self;

    fn sub(self, earlier: Self) -> Self {
        Self {
            vertices: self.vertices - earlier.vertices,
            windows: self.windows - earlier.windows,
            nodes: self.nodes - earlier.nodes,
            portals: self.portals - earlier.portals,
        }
    }
}
