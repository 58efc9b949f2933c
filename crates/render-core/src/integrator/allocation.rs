//! How the effort of a camera sample is allocated between techniques.

use clerestory_film::TileGrid;

/// How much each technique gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Allocation {
    /// Light subpaths of the light plane for each camera sample.
    pub(super) splats: u32,
    /// Whether each camera sample is connected to a light subpath of its own.
    pub(super) is_connected: bool,
    pub(super) sharing: Sharing,
}

/// With which other techniques light subpaths share the paths that they find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sharing {
    /// With all that find them.
    All,
    /// With chance. What specular methods and next event estimation find is theirs alone.
    Chance,
    /// With none. So methods look for light only where light subpaths leave no splats: where the camera sees through or
    /// off something.
    None,
}

impl Allocation {
    /// No light subpaths.
    pub(super) const NONE: Self = Self { splats: 0, is_connected: false, sharing: Sharing::All };

    /// What is chosen where the pilot does not show that something else is better.
    pub(super) const USUAL: Self = Self { splats: 1, is_connected: true, sharing: Sharing::All };

    /// Light tracing alone, beside which methods and chance find what it leaves.
    pub(super) const fn alone(splats: u32) -> Self {
        Self { splats, is_connected: false, sharing: Sharing::None }
    }

    /// The same on a film that may lack a light plane: then connections bring the light.
    pub(super) fn on(self, grid: &TileGrid) -> Self {
        if grid.has_light_plane || self.splats == 0 { self } else { Self { splats: 0, ..Self::USUAL } }
    }

    /// In words, for an image's metadata.
    pub(super) fn describe(self) -> String {
        let Self { splats, is_connected, sharing } = self;
        let traced = match (splats, is_connected) {
            (0, false) => return "no light subpaths are traced: other methods have less noise".to_owned(),
            (0, true) => "each camera sample is connected to a light subpath".to_owned(),
            (1, _) => "a light subpath for each camera sample leaves splats".to_owned(),
            _ => format!("{splats} light subpaths for each camera sample leave splats"),
        };
        let connected = if splats > 0 && is_connected { ", and it is connected to one of its own" } else { "" };
        match sharing {
            Sharing::All => format!("{traced}{connected}"),
            Sharing::Chance => format!("{traced}{connected}, of light that other methods leave to chance alone"),
            Sharing::None => format!("{traced}{connected}, of all light on surfaces that the camera sees straight"),
        }
    }
}
