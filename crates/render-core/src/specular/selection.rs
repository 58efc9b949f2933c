//! Which panes a method searches for paths from a shading point to a point on a light (Huan et al. 2023, section 3.3).

use std::ops::Range;

use super::{PanePath, ShadingPoint};
use crate::{
    counters::Counters,
    film::SampleStream,
    optics::Source,
    scene::{Scene, description::PaneSelection},
};

/// The panes to search.
pub(super) struct Chosen {
    /// Their indices in the scene.
    pub(super) panes: Range<usize>,
    /// One over the probability with which each of them was chosen.
    pub(super) inverse_probability: f64,
}

impl PaneSelection {
    /// The panes to search; `None` when there are none.
    pub(super) fn choose(
        self,
        scene: &Scene,
        point: &ShadingPoint,
        source: Source,
        stream: &mut SampleStream,
        counters: &mut Counters,
    ) -> Option<Chosen> {
        let count = scene.accelerator().panes().len();
        match self {
            Self::All => Some(Chosen { panes: 0..count, inverse_probability: 1.0 }),
            Self::Sharp => {
                let pane = scene.first_pane_towards(point, source, counters)? as usize;
                Some(Chosen { panes: pane..pane + 1, inverse_probability: 1.0 })
            }
            Self::Bleed => {
                let pick = ((stream.next_1d() * count as f64) as usize).min(count.saturating_sub(1));
                let is_searched = count > 0 && scene.is_blocked_towards(point, source, counters);
                is_searched.then_some(Chosen { panes: pick..pick + 1, inverse_probability: count as f64 })
            }
        }
    }

    /// Whether the pane of a path from `point` may be chosen: a function of these alone.
    pub(super) fn may_choose(
        self,
        scene: &Scene,
        point: &ShadingPoint,
        path: &PanePath,
        counters: &mut Counters,
    ) -> bool {
        match self {
            Self::All => true,
            Self::Sharp => scene.first_pane_towards(point, path.source, counters) == Some(path.pane),
            Self::Bleed => scene.is_blocked_towards(point, path.source, counters),
        }
    }
}
