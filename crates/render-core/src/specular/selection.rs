//! Which casters a method searches for paths from a shading point to a point on a light (Huan et al. 2023, section
//! 3.3).

use super::SpecularPath;
use super::caster::Caster;
use crate::scene::ShadingPoint;
use crate::{
    light::{Source, SourceSample},
    scene::{Scene, visibility::straight},
};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which panes are searched for paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PaneSelection {
    /// Every pane through which light can arrive.
    #[default]
    All,
    /// The pane that the straight line to the light meets first.
    Sharp,
    /// A pane at random whenever anything blocks the straight line to the light.
    Bleed,
    /// A pane at random.
    Random,
}

/// The casters to search.
pub(super) enum Choice {
    /// All of them.
    All,
    /// One, with certainty.
    One(Caster),
    /// The one with this index of all, with equal probability for each.
    AtRandom(usize),
    /// None.
    None,
}

impl PaneSelection {
    /// The casters to search, of which there are `count`.
    pub(super) fn choose(
        self,
        scene: &Scene,
        point: &ShadingPoint,
        sample: &SourceSample,
        count: usize,
        stream: &mut SampleStream,
        counters: &mut Counters,
    ) -> Choice {
        let place = (sample.source, sample.triangle);
        match self {
            Self::All => Choice::All,
            Self::Sharp => first_caster_towards(scene, point, place, counters).map_or(Choice::None, Choice::One),
            Self::Bleed | Self::Random => {
                let pick = ((stream.next_1d() * count as f64) as usize).min(count.saturating_sub(1));
                if count > 0 && (self == Self::Random || scene.is_blocked_towards(point, place, counters)) {
                    Choice::AtRandom(pick)
                } else {
                    Choice::None
                }
            }
        }
    }

    /// Whether a caster may be chosen: a function of these alone.
    pub(super) fn may_choose(
        self,
        scene: &Scene,
        point: &ShadingPoint,
        path: &SpecularPath<'_>,
        caster: Caster,
        counters: &mut Counters,
    ) -> bool {
        let place = (path.source, path.triangle);
        match self {
            Self::All | Self::Random => true,
            Self::Sharp => first_caster_towards(scene, point, place, counters) == Some(caster),
            Self::Bleed => scene.is_blocked_towards(point, place, counters),
        }
    }
}

/// The caster that the straight line from `point` to a source meets before anything else. The source may be on a
/// triangle of the scene.
fn first_caster_towards(
    scene: &Scene,
    point: &ShadingPoint,
    (source, triangle): (Source, Option<u32>),
    counters: &mut Counters,
) -> Option<Caster> {
    let (ray, distance) = straight(point.position, source, triangle);
    let hit = scene.accelerator().solid().closest_hit(&ray, distance, point.surface, counters)?;
    Caster::of_surface(scene, &hit.surface)
}
