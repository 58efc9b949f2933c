//! The light plane, as the weights of techniques see it.

use clerestory_film::TileGrid;

use crate::integrator::allocation::{Allocation, Sharing, Splats};

/// Light subpaths of the light plane, as the weights of techniques see them.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightPlane {
    /// How many there are for a sample of each pixel.
    pub(super) subpaths: f64,
    /// The same where paths are shared by it.
    pub(super) shared_by: f64,
    /// Whether it has what it finds alone, so that no method looks for that.
    pub(super) is_alone: bool,
}

/// A number of subpaths beside which other techniques have no share in what these find.
const ALL: f64 = 1e100;

impl LightPlane {
    /// With the light subpaths of an allocation.
    pub(super) fn new(allocation: &Allocation, grid: &TileGrid) -> Self {
        let for_each = if grid.has_light_plane { allocation.splats } else { Splats::NONE };
        let is_alone = allocation.sharing == Sharing::None && !for_each.is_none();
        let subpaths = for_each.ratio() * f64::from(grid.width) * f64::from(grid.height);
        Self { subpaths, shared_by: if is_alone { ALL } else { subpaths }, is_alone }
    }
}
