//! How the effort of a camera sample is allocated between techniques.

use clerestory_film::TileGrid;

/// How much each technique gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Allocation {
    /// Light subpaths of the light plane for each camera sample.
    pub(super) splats: u32,
    /// Whether each camera sample is connected to a light subpath of its own.
    pub(super) is_connected: bool,
    /// Whether splats have all of the light that they find, so that no method looks for it.
    pub(super) is_alone: bool,
}

impl Allocation {
    /// No light subpaths.
    pub(super) const NONE: Self = Self { splats: 0, is_connected: false, is_alone: false };

    /// What is chosen where the pilot does not show that something else is better.
    pub(super) const USUAL: Self = Self { splats: 1, is_connected: true, is_alone: false };

    /// Light tracing alone, beside which camera samples find what it leaves.
    pub(super) const fn alone(splats: u32) -> Self {
        Self { splats, is_connected: false, is_alone: true }
    }

    /// The same on a film that may lack a light plane: then connections bring the light.
    pub(super) fn on(self, grid: &TileGrid) -> Self {
        if grid.has_light_plane || self.splats == 0 { self } else { Self { splats: 0, ..Self::USUAL } }
    }

    /// In words, for an image's metadata.
    pub(super) fn describe(self) -> String {
        let Self { splats, is_connected, is_alone } = self;
        match (splats, is_connected) {
            _ if is_alone => {
                format!("{splats} light subpaths for each camera sample find most light, and chance the rest")
            }
            (0, false) => "no light subpaths are traced: other methods have less noise".to_owned(),
            (0, true) => "each camera sample is connected to a light subpath".to_owned(),
            (_, false) => format!("{splats} light subpaths for each camera sample leave splats"),
            (_, true) => format!(
                "{splats} light subpaths for each camera sample leave splats, and it is connected to one of its own"
            ),
        }
    }
}
