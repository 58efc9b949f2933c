//! The scenes of the experiments, which are part of the program: no checkout is needed to measure again.

use std::collections::BTreeMap;
use std::path::Path;

use clerestory_render_core::document::SamplingDescription;
use clerestory_render_core::document::water::{WaterSettings, pool};
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::scene::description::FilmDescription;
use clerestory_render_core::scene::{Asset, SceneError};
use clerestory_render_core::specular::registry::IntegratorDescription;

use crate::error::ExperimentError;

/// A scene in the program.
pub(crate) struct EmbeddedScene {
    /// Its file below `scenes/`, without the extension.
    pub(crate) name: &'static str,
    json: &'static [u8],
    /// The files that it names, and their contents.
    assets: &'static [(&'static str, &'static [u8])],
}

/// The scene file `scenes/$name.json` and the files that it names.
macro_rules! embedded {
    ($name:literal $(, $asset:literal)*) => {
        EmbeddedScene {
            name: $name,
            json: include_bytes!(concat!("../../../scenes/", $name, ".json")),
            assets: &[$(($asset, include_bytes!(concat!("../../../scenes/", $asset)))),*],
        }
    };
}

/// The window of the FNEE paper's figures 9 and 10: four panes of different profiles before a small sphere.
pub(crate) const FOUR_PANES: EmbeddedScene = embedded!("four-panes");

/// The same window before a point of light.
pub(crate) const FOUR_PANES_POINT: EmbeddedScene = embedded!("four-panes-point");

/// A leaded window in a stone room.
pub(crate) const ROOM: EmbeddedScene = embedded!("room", "room/stone.png", "room/walls.obj", "room/cames.obj");

/// A slab without folds, for comparison with the authors of specular manifold sampling.
pub(crate) const SLAB: EmbeddedScene = embedded!("slab", "slab/front.exr", "slab/back.exr");

/// A pool whose water throws caustics, in the manner of the authors of specular manifold sampling.
pub(crate) const POOL: EmbeddedScene = embedded!("pool", "pool/water.ply");

/// A nave with 4 panes.
pub(crate) const NAVE_4: EmbeddedScene = embedded!("nave/nave-4");

/// The same nave with 16 panes.
pub(crate) const NAVE_16: EmbeddedScene = embedded!("nave/nave-16");

/// The same nave with leaded windows of diamonds.
pub(crate) const NAVE_DIAMONDS: EmbeddedScene = embedded!("nave/nave-diamonds");

/// The same nave with 64 panes.
pub(crate) const NAVE_64: EmbeddedScene = embedded!("nave/nave-64");

/// The same nave with 256 panes.
pub(crate) const NAVE_256: EmbeddedScene = embedded!("nave/nave-256");

/// Samples of one pass, so that a render ends soon after its time, and with a scramble of their own.
pub(crate) const SAMPLING: SamplingDescription = SamplingDescription { samples_per_pass: 1, samples_per_block: 256 };

impl EmbeddedScene {
    /// The scene in a size, with passes of one sample.
    pub(crate) fn bundle(&self, size: [u32; 2]) -> Result<SceneBundle, ExperimentError> {
        self.load(size).map_err(|source| self.failure(source))
    }

    /// The failure of this scene.
    pub(crate) fn failure(&self, source: SceneError) -> ExperimentError {
        ExperimentError::scene(Path::new(&format!("scenes/{}.json", self.name)), source)
    }

    fn load(&self, [width, height]: [u32; 2]) -> Result<SceneBundle, SceneError> {
        let description = SceneDescription::parse(self.json)?.with_size(width, height)?;
        let assets: BTreeMap<String, Asset> =
            self.assets.iter().map(|(name, bytes)| ((*name).to_owned(), Asset::new(*bytes))).collect();
        SceneBundle::from_parts(SceneDescription { sampling: SAMPLING, ..description }, assets)
    }
}

/// A pool of computed water in a size, with passes of one sample.
pub(crate) fn computed_pool(settings: &WaterSettings, [width, height]: [u32; 2]) -> Result<SceneBundle, SceneError> {
    let film = FilmDescription { width, height };
    SceneBundle::from_parts(SceneDescription { film, sampling: SAMPLING, ..pool(settings) }, BTreeMap::new())
}

/// A scene with another integrator, seed and sampling.
pub(crate) fn changed(
    bundle: &SceneBundle,
    integrator: IntegratorDescription,
    seed: u64,
    sampling: SamplingDescription,
) -> Result<SceneBundle, SceneError> {
    let description = SceneDescription { integrator, seed, sampling, ..bundle.description().clone() };
    bundle.clone().with_description(description)
}
