//! The planes of a scene's film, and whether it has the layer `caustic`.

use clerestory_film::{MOST_LIGHT_PIXELS, TileGrid};

use super::{PathFilter, SceneDescription};
use crate::specular::settings::LightSubpaths;

/// The paths that light subpaths may find: with an edge between two surfaces that scatter light, or between one and the
/// camera.
const FOUND: &str = "(D (D|R|T)* L)|((D|R|T)* D D (D|R|T)* L)";

/// What follows the name of a method where digests of the probe are of images with the layer `caustic`.
pub const WITH_CAUSTIC: &str = " with caustic";

/// The paths that may be caustic.
const CAUSTIC: &str = ".*D (R|T)+ L";

impl SceneDescription {
    /// How the film is cut into tiles of an edge. It has a light plane where the integrator wants one, light subpaths
    /// may begin somewhere, and the frame is not too large for it.
    pub fn grid(&self, tile_size: u32) -> TileGrid {
        let has_glass = !(self.panes.is_empty() && self.windows.is_empty() && self.imports.is_empty());
        let has_openings = self.materials.values().any(|material| material.is_straight());
        let has_starts = has_glass || has_openings || self.lights.iter().any(|light| !light.is_environment());
        let has_light_plane = has_starts && self.fits_light_plane() && self.has_light_subpaths();
        TileGrid::new(self.film.width, self.film.height, tile_size)
            .with_light_plane(has_light_plane)
            .with_caustic(self.has_caustic())
    }

    /// Whether the frame is small enough for a light plane.
    pub(super) fn fits_light_plane(&self) -> bool {
        u64::from(self.film.width) * u64::from(self.film.height) <= MOST_LIGHT_PIXELS
    }

    /// Whether the scene may have glass or water, and the path filter leaves light that comes over it.
    fn has_caustic(&self) -> bool {
        let is_glass = |name: &String| self.materials.get(name).is_some_and(|material| material.makes_caustics());
        let has_glass = !(self.panes.is_empty() && self.windows.is_empty() && self.imports.is_empty())
            || self.meshes.iter().any(|mesh| is_glass(&mesh.material));
        has_glass && self.shares_paths_with(CAUSTIC)
    }

    /// Whether the path filter leaves any of the paths of an expression.
    fn shares_paths_with(&self, expression: &str) -> bool {
        match (self.compiled_path_filter(), PathFilter::parse(expression)) {
            (Ok(Some(filter)), Ok(paths)) => filter.shares_a_path(&paths),
            _ => true,
        }
    }

    /// Whether the integrator wants light subpaths, and the path filter leaves them paths to find.
    pub(crate) fn has_light_subpaths(&self) -> bool {
        self.integrator.light_subpaths() != LightSubpaths::None && self.shares_paths_with(FOUND)
    }
}
