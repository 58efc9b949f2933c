//! The planes of a scene's film.

use clerestory_film::{MOST_LIGHT_PIXELS, TileGrid};

use super::{PathFilter, SceneDescription};
use crate::specular::settings::LightSubpaths;

/// The paths that light subpaths may find: with an edge between two surfaces that scatter light, or between one and the
/// camera.
const FOUND: &str = "(D (D|R|T)* L)|((D|R|T)* D D (D|R|T)* L)";

impl SceneDescription {
    /// How the film is cut into tiles of an edge. It has a light plane where the integrator wants one, light subpaths
    /// may begin somewhere, and the frame is not too large for it.
    pub fn grid(&self, tile_size: u32) -> TileGrid {
        let has_glass = !(self.panes.is_empty() && self.windows.is_empty() && self.imports.is_empty());
        let has_starts = has_glass || self.lights.iter().any(|light| !light.is_environment());
        let has_light_plane = has_starts && self.fits_light_plane() && self.has_light_subpaths();
        TileGrid::new(self.film.width, self.film.height, tile_size).with_light_plane(has_light_plane)
    }

    /// Whether the frame is small enough for a light plane.
    pub(super) fn fits_light_plane(&self) -> bool {
        u64::from(self.film.width) * u64::from(self.film.height) <= MOST_LIGHT_PIXELS
    }

    /// Whether the integrator wants light subpaths, and the path filter leaves them paths to find.
    pub(crate) fn has_light_subpaths(&self) -> bool {
        let finds_any = || match (self.compiled_path_filter(), PathFilter::parse(FOUND)) {
            (Ok(Some(filter)), Ok(found)) => filter.shares_a_path(&found),
            _ => true,
        };
        self.integrator.light_subpaths() != LightSubpaths::None && finds_any()
    }
}
