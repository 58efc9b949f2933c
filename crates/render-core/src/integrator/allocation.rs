//! How the effort of a camera sample is allocated between techniques.

use clerestory_film::TileGrid;

/// Light subpaths of the light plane for each camera sample, in sixteenths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Splats(u32);

impl Splats {
    const SIXTEENTHS: u32 = 16;

    /// No light plane.
    pub(super) const NONE: Self = Self(0);

    /// One for sixteen samples: enough for light that is there at all, and hardly any work.
    pub(super) const FEW: Self = Self(1);

    /// A number for each sample.
    pub(super) const fn each(number: u32) -> Self {
        Self(number.saturating_mul(Self::SIXTEENTHS))
    }

    pub(super) fn is_none(self) -> bool {
        self == Self::NONE
    }

    /// For each sample.
    pub(super) fn ratio(self) -> f64 {
        f64::from(self.0) / f64::from(Self::SIXTEENTHS)
    }

    /// For some samples: a whole number, rounded up.
    pub(super) fn of(self, samples: u64) -> u64 {
        samples.saturating_mul(self.0.into()).div_ceil(Self::SIXTEENTHS.into())
    }
}

/// How much each technique gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Allocation {
    /// Light subpaths of the light plane for each camera sample.
    pub(super) splats: Splats,
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
    pub(super) const NONE: Self = Self { splats: Splats::NONE, is_connected: false, sharing: Sharing::All };

    /// What is chosen where the pilot does not show that something else is better.
    pub(super) const USUAL: Self = Self { splats: Splats::each(1), is_connected: true, sharing: Sharing::All };

    /// Light tracing alone, beside which methods and chance find what it leaves.
    pub(super) const fn alone(splats: u32) -> Self {
        Self { splats: Splats::each(splats), is_connected: false, sharing: Sharing::None }
    }

    /// The same on a film that may lack a light plane: then connections bring the light.
    pub(super) fn on(self, grid: &TileGrid) -> Self {
        if grid.has_light_plane || self.splats.is_none() { self } else { Self { splats: Splats::NONE, ..Self::USUAL } }
    }

    /// In words, for an image's metadata.
    pub(super) fn describe(self) -> String {
        let Self { splats, is_connected, sharing } = self;
        let traced = match (splats, is_connected) {
            (Splats::NONE, false) => return "no light subpaths are traced: other methods have less noise".to_owned(),
            (Splats::NONE, true) => "each camera sample is connected to a light subpath".to_owned(),
            (Splats::FEW, _) => "a light subpath for sixteen camera samples leaves splats".to_owned(),
            _ if splats == Splats::each(1) => "a light subpath for each camera sample leaves splats".to_owned(),
            _ => format!("{} light subpaths for each camera sample leave splats", splats.ratio()),
        };
        let connected = if !splats.is_none() && is_connected { ", and it is connected to one of its own" } else { "" };
        match sharing {
            Sharing::All => format!("{traced}{connected}"),
            Sharing::Chance => format!("{traced}{connected}, of light that other methods leave to chance alone"),
            Sharing::None => format!("{traced}{connected}, of all light on surfaces that the camera sees straight"),
        }
    }
}
