//! The light plane, as the weights of techniques see it.

use clerestory_film::TileGrid;

use crate::specular::settings::LightSubpaths;

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
    pub(super) fn new(settings: LightSubpaths, grid: &TileGrid) -> Self {
        let for_each = if grid.has_light_plane { settings.splatted() } else { 0 };
        let subpaths = f64::from(for_each) * f64::from(grid.width) * f64::from(grid.height);
        let is_alone = matches!(settings, LightSubpaths::Alone(_)) && grid.has_light_plane;
        Self { subpaths, shared_by: if is_alone { ALL } else { subpaths } }
    }
}
