//! The light plane, as the weights of techniques see it.

use clerestory_film::TileGrid;

/// Light subpaths of the light plane, as the weights of techniques see them.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightPlane {
    /// How many there are for a sample of each pixel.
    pub(super) subpaths: f64,
    /// The same where paths are shared by it.
    pub(super) shared_by: f64,
}

/// A number of subpaths beside which other techniques have no share in what these find.
const ALL: f64 = 1e100;

impl LightPlane {
    /// With this number of light subpaths for each camera sample. What they find is theirs alone if `is_alone`.
    pub(super) fn new(splats: u32, is_alone: bool, grid: &TileGrid) -> Self {
        let for_each = if grid.has_light_plane { splats } else { 0 };
        let subpaths = f64::from(for_each) * f64::from(grid.width) * f64::from(grid.height);
        Self { subpaths, shared_by: if is_alone && for_each > 0 { ALL } else { subpaths } }
    }
}
