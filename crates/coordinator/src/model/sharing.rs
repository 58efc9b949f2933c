//! Pass sharing: the passes of the tiles of an adaptive job.

use std::collections::BTreeMap;
use std::sync::Arc;

use clerestory_film::{Adaptation, Share};

/// The passes of each tile of a job at each round.
#[derive(Clone, Debug, Default)]
pub(crate) struct TilePasses {
    /// The shares by frame, or `None` when every tile has all passes.
    shares: Option<Arc<Shares>>,
}

#[derive(Debug)]
struct Shares {
    adaptation: Adaptation,
    by_frame: BTreeMap<u32, Vec<Share>>,
}

impl TilePasses {
    /// The passes that shares make, by frame, in the order of the tiles.
    pub(crate) fn shared(adaptation: Adaptation, by_frame: BTreeMap<u32, Vec<Share>>) -> Self {
        Self { shares: Some(Arc::new(Shares { adaptation, by_frame })) }
    }

    /// Whether tiles have their own.
    pub(crate) fn are_shared(&self) -> bool {
        self.shares.is_some()
    }

    /// Passes of a tile at the round of `round_passes`.
    pub(crate) fn at(&self, frame: u32, tile: u32, round_passes: u32) -> u32 {
        let Some(Shares { adaptation, by_frame }) = self.shares.as_deref() else { return round_passes };
        let share = by_frame.get(&frame).and_then(|shares| shares.get(tile as usize));
        share.map_or(round_passes, |share| adaptation.passes(*share, round_passes))
    }
}
