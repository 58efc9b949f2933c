//! Options that change a scene before it is rendered.

use std::path::Path;
use std::str::FromStr;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use clerestory_render_core::document::{
    self, Override, OverrideError, SamplingDescription, SceneBundle, SceneDescription, is_model, scene_around,
};
use clerestory_render_core::scene::description::FilmDescription;
use clerestory_render_core::specular::registry::IntegratorDescription;

use crate::failure::Failure;
use crate::model_options::FileOptions;
use crate::moment_options::MomentOptions;
use crate::numbers::whole;
use crate::progress::Progress;

/// Most pixels along an edge of an image.
const MOST_PIXELS: u32 = 16384;

/// Most samples in a pass and in a block, as in a scene.
const MOST_SAMPLES: u32 = 65536;

/// Options that change the scene.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct SceneOverrides {
    /// Integrator to use instead of the scene's.
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(integrators()))]
    pub(crate) integrator: Option<String>,
    /// Another value for a member of the scene, by its path: `integrator.fnee.max_trials=50`,
    /// `lights[sun].direction=[0,1,1]`, `panes[*].thickness=0.004`. Values are JSON; text that is none is a string. Can
    /// be given several times.
    #[arg(long, value_name = "PATH=VALUE", value_parser = change)]
    pub(crate) set: Vec<Override>,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", value_parser = whole(0..=u64::MAX))]
    pub(crate) seed: Option<u64>,
    /// Size of the image in pixels.
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<Size>,
    #[command(flatten)]
    moment: MomentOptions,
    #[command(flatten)]
    file: FileOptions,
}

/// A scene, and what was assumed where its file does not say.
pub(crate) struct LoadedScene {
    pub(crate) bundle: SceneBundle,
    /// One sentence each; none for a scene file.
    pub(crate) assumptions: Vec<String>,
}

/// Options that group the samples in another way than the scene.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(crate) struct SamplingOverrides {
    /// Samples per pixel in a pass, the smallest piece of work: another `sampling.samples_per_pass` than the scene's,
    /// which is 16 unless it says otherwise.
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST_SAMPLES))]
    samples_per_pass: Option<u32>,
    /// Samples per pixel in a block, a power of two times those in a pass: another `sampling.samples_per_block` than
    /// the scene's, which is 256 unless it says otherwise. The standard error comes from the means of blocks, so it
    /// takes two of them.
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST_SAMPLES))]
    samples_per_block: Option<u32>,
}

/// Width and height in pixels, written `640x480`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let edge = |text: &str| text.parse().ok().filter(|pixels| (1..=MOST_PIXELS).contains(pixels));
        let size = text
            .split_once(['x', 'X'])
            .and_then(|(width, height)| Some(Self { width: edge(width)?, height: edge(height)? }));
        size.ok_or_else(|| format!("expected width and height in pixels, 1 to {MOST_PIXELS}, for instance 640x480"))
    }
}

impl SceneOverrides {
    /// Loads a scene and changes it.
    pub(crate) fn load(&self, file: &Path, sampling: SamplingOverrides) -> Result<LoadedScene, Failure> {
        let LoadedScene { bundle, assumptions } = self.read(file)?;
        let mut description = self.apply(bundle.description().clone())?;
        sampling.apply(&mut description.sampling);
        // The scene in the file was valid, so the fault lies in the changes.
        let changed = bundle.with_description(description);
        let bundle = changed.map_err(|source| Failure::Overrides { file: file.to_owned(), source })?;
        Ok(LoadedScene { bundle, assumptions })
    }

    /// Loads a scene at the moment that the options name, without other changes.
    pub(crate) fn load_at_moment(&self, file: &Path) -> Result<LoadedScene, Failure> {
        let LoadedScene { bundle, assumptions } = self.read(file)?;
        let mut description = bundle.description().clone();
        self.moment.apply(&mut description)?;
        let changed = bundle.with_description(description);
        let bundle = changed.map_err(|source| Failure::Overrides { file: file.to_owned(), source })?;
        Ok(LoadedScene { bundle, assumptions })
    }

    /// Reads a scene file, or a file of another program, for which a scene is assumed. The user is told of what.
    fn read(&self, file: &Path) -> Result<LoadedScene, Failure> {
        if !is_model(file) {
            if !self.file.is_empty() {
                let expected = "--unit and --up are for glTF and OBJ files: expected a .glb, .gltf or .obj file";
                return Err(Failure::Usage(expected.to_owned()));
            }
            let bundle = document::load(file).map_err(|source| Failure::scene(file, source))?;
            return Ok(LoadedScene { bundle, assumptions: Vec::new() });
        }
        let model = scene_around(file, &self.file.model()).map_err(|source| Failure::scene(file, source))?;
        Progress::new().assumptions(&model.assumptions);
        Ok(LoadedScene { bundle: model.bundle, assumptions: model.assumptions })
    }

    fn apply(&self, mut description: SceneDescription) -> Result<SceneDescription, Failure> {
        if let Some(name) = &self.integrator {
            description = description.with_integrator_named(name).expect("every name is that of an integrator");
        }
        description =
            document::apply(&self.set, &description).map_err(|error| Failure::Usage(format!("--set {error}")))?;
        self.moment.apply(&mut description)?;
        if let Some(seed) = self.seed {
            description.seed = seed;
        }
        if let Some(Size { width, height }) = self.size {
            description.film = FilmDescription { width, height };
        }
        Ok(description)
    }
}

/// The integrators, with a line on each.
fn integrators() -> Vec<PossibleValue> {
    let summaries = IntegratorDescription::SUMMARIES.iter();
    summaries.map(|(name, summary)| PossibleValue::new(*name).help(*summary)).collect()
}

/// Reads a change of the scene.
fn change(text: &str) -> Result<Override, String> {
    text.parse().map_err(|error: OverrideError| error.to_string())
}

impl SamplingOverrides {
    fn apply(self, sampling: &mut SamplingDescription) {
        let SamplingDescription { samples_per_pass, samples_per_block } = *sampling;
        *sampling = SamplingDescription {
            samples_per_pass: self.samples_per_pass.unwrap_or(samples_per_pass),
            samples_per_block: self.samples_per_block.unwrap_or(samples_per_block),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_two_numbers_around_an_x() {
        assert_eq!("640x480".parse(), Ok(Size { width: 640, height: 480 }));
        for text in ["640", "640x", "x480", "640x480x1", "-1x5", "0x480", "640x16385", "640 480", ""] {
            assert!(text.parse::<Size>().is_err_and(|message| message.contains("640x480")), "{text}");
        }
    }

    #[test]
    fn every_integrator_can_replace_the_scenes_own() {
        let scene = include_bytes!("../../../scenes/references/flat-point.json");
        let description = SceneDescription::parse(scene).unwrap();
        for name in IntegratorDescription::NAMES {
            let overrides = SceneOverrides { integrator: Some((*name).to_owned()), ..SceneOverrides::default() };
            let changed = overrides.apply(description.clone()).unwrap().integrator;
            assert_eq!((changed.kind(), changed.max_depth()), (*name, description.integrator.max_depth()));
        }
    }

    #[test]
    fn settings_are_set_in_the_integrator_that_is_chosen_beside_them() {
        let scene = include_bytes!("../../../scenes/references/flat-point.json");
        let description = SceneDescription::parse(scene).unwrap();
        let set = |changes: &[&str]| SceneOverrides {
            integrator: Some("sms".to_owned()),
            set: changes.iter().map(|text| text.parse().unwrap()).collect(),
            ..SceneOverrides::default()
        };
        let changes =
            ["integrator.sms.estimator.biased.trials=4", "integrator.sms.chains=[\"T\"]", "integrator.steps=published"];
        let changed = serde_json::to_value(set(&changes).apply(description.clone()).unwrap().integrator).unwrap();
        let sms = &changed["sms"];
        assert_eq!(sms["estimator"], serde_json::json!({"biased": {"trials": 4}}));
        assert_eq!((&sms["chains"], &sms["steps"]), (&serde_json::json!(["T"]), &"published".into()));
        let message = set(&["integrator.fnee.solver=published"]).apply(description).unwrap_err().to_string();
        assert!(message.contains("integrator is sms") && message.contains("integrator fnee beside it"), "{message}");
    }
}
