//! Options that change a scene before it is rendered.

use std::path::Path;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use clerestory_render_core::scene::description::{
    ConicSearch, FilmDescription, FneeSolver, IntegratorDescription, ManifoldConstraint, ManifoldEstimator,
    MissedPaths, PaneSelection, SamplingDescription, SceneDescription, WalkSteps,
};
use clerestory_render_core::scene::{self, SceneBundle};

use crate::failure::Failure;
use crate::numbers::whole;

/// Most pixels along an edge of an image.
const MOST_PIXELS: u32 = 16384;

/// Most samples in a pass and in a block, as in a scene.
const MOST_SAMPLES: u32 = 65536;

/// Options that change the scene.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct SceneOverrides {
    /// Integrator to use instead of the scene's.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) integrator: Option<IntegratorName>,
    /// How the integrator fnee searches for paths.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) solver: Option<SolverName>,
    /// Which panes the integrators fnee and sms search.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) selection: Option<SelectionName>,
    /// Trials after which the integrators fnee and sms cut off an estimate of an inverse probability.
    #[arg(long, value_name = "N", value_parser = whole(1..=10_000_000_u32))]
    pub(crate) max_trials: Option<u32>,
    /// Sum the distinct paths that so many walks of the integrator sms find, instead of an estimate without bias.
    #[arg(long, value_name = "N", conflicts_with = "max_trials", value_parser = whole(1..=10_000_u32))]
    pub(crate) walks: Option<u32>,
    /// What a vertex of the integrator sms has to obey.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) constraint: Option<ConstraintName>,
    /// Where walks of the integrator sms go that leave a pane.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) steps: Option<StepsName>,
    /// Chains of refractions (T) and reflections (R) from a surface to a light that the integrators sms, mnee and conic
    /// look for, such as T,TT.
    #[arg(long, value_name = "CHAINS", value_delimiter = ',')]
    pub(crate) chains: Vec<String>,
    /// Panes and smooth meshes on which the chains of the integrators sms, mnee and conic begin, by name.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) casters: Vec<String>,
    /// Meshes on which the integrators sms, mnee and conic gather the light of their chains, by name.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) receivers: Vec<String>,
    /// Which of the paths over a mesh the integrator conic finds.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) search: Option<SearchName>,
    /// What happens to paths that the walk of the integrator mnee does not find.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) missed: Option<MissedName>,
    /// Let the integrator fnee look for light that the outside of a pane reflects, too.
    #[arg(long)]
    pub(crate) reflected: bool,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N", value_parser = whole(0..=u64::MAX))]
    pub(crate) seed: Option<u64>,
    /// Size of the image in pixels.
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<Size>,
}

/// Options that group the samples in another way than the scene.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(crate) struct SamplingOverrides {
    /// Samples per pixel in a pass, the smallest piece of work: another `sampling.samples_per_pass` than the scene's, which is 16
    /// unless it says otherwise.
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST_SAMPLES))]
    samples_per_pass: Option<u32>,
    /// Samples per pixel in a block, a power of two times those in a pass: another `sampling.samples_per_block` than the scene's,
    /// which is 256 unless it says otherwise. The standard error comes from the means of blocks, so it takes two of them.
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST_SAMPLES))]
    samples_per_block: Option<u32>,
}

/// Names of the integrators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum IntegratorName {
    /// Path tracing alone.
    Path,
    /// Light through glass by sampling the cone from which it can come.
    Cone,
    /// Light through glass by Fermat next event estimation.
    Fnee,
    /// Light through glass by specular manifold sampling.
    Sms,
    /// Light through glass by one manifold walk from the straight line to the light.
    Mnee,
    /// All light over one smooth mesh, such as the surface of water.
    Conic,
}

/// Names of the ways in which `fnee` searches for paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SolverName {
    /// Enumerates minima, saddles and maxima of the optical length.
    Complete,
    /// The algorithm of the paper, which finds minima almost exclusively.
    Published,
}

/// Names of the selections of panes that `fnee` and `sms` search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SelectionName {
    /// Every pane.
    All,
    /// The first pane on the straight line to the light.
    Sharp,
    /// One pane at random whenever something blocks the straight line.
    Bleed,
    /// One pane at random.
    Random,
}

/// Names of the constraints of manifold walks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ConstraintName {
    /// The outgoing direction is that of the refracted or mirrored ray.
    AngleDifference,
    /// The half vector is the normal.
    HalfVector,
}

/// Names of where manifold walks go that leave a pane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum StepsName {
    /// To its border, where that helps.
    OnPanes,
    /// Half as far, as in the paper.
    Published,
}

/// Names of the searches of `conic`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SearchName {
    /// All, with rays to where a surface focuses a light that has an extent.
    Complete,
    /// All, without these rays.
    WithoutRays,
    /// The first along the curve from the straight line to the light, as in the paper.
    Published,
}

/// Names of what happens to paths that a walk misses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MissedName {
    /// They count when chance finds them.
    LeftToChance,
    /// They are dropped.
    Dropped,
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
    pub(crate) fn load(&self, file: &Path, sampling: SamplingOverrides) -> Result<SceneBundle, Failure> {
        let bundle = scene::load(file).map_err(|source| Failure::scene(file, source))?;
        let mut description = self.apply(bundle.description().clone())?;
        sampling.apply(&mut description.sampling);
        // The scene was valid as it is in its file.
        bundle.with_description(description).map_err(|source| Failure::Overrides { file: file.to_owned(), source })
    }

    fn apply(&self, mut description: SceneDescription) -> Result<SceneDescription, Failure> {
        if let Some(name) = self.integrator {
            description = description.with_integrator_named(name.name()).expect("every name is that of an integrator");
        }
        self.apply_to_integrator(&mut description.integrator)?;
        if let Some(seed) = self.seed {
            description.seed = seed;
        }
        if let Some(Size { width, height }) = self.size {
            description.film = FilmDescription { width, height };
        }
        Ok(description)
    }

    /// Changes the settings of the integrator.
    fn apply_to_integrator(&self, integrator: &mut IntegratorDescription) -> Result<(), Failure> {
        use IntegratorDescription::{Conic, Fnee, Mnee, Sms};
        let unsuited = |option: &str, suited: &[&str], integrator: &IntegratorDescription| {
            let expected: Vec<String> = suited.iter().map(|name| format!("--integrator {name}")).collect();
            Err(Failure::Usage(format!(
                "{option} is not for the integrator {}, which makes the image: expected {} beside it",
                integrator.name(),
                expected.join(" or ")
            )))
        };
        if let Some(name) = self.solver {
            match integrator {
                Fnee { solver, .. } => *solver = name.setting(),
                other => return unsuited("--solver", &["fnee"], other),
            }
        }
        if let Some(name) = self.selection {
            match integrator {
                Fnee { selection, .. } | Sms { selection, .. } => *selection = name.setting(),
                other => return unsuited("--selection", &["fnee", "sms"], other),
            }
        }
        if let Some(most) = self.max_trials {
            match integrator {
                Fnee { max_trials, .. } => *max_trials = most,
                Sms { estimator, .. } => *estimator = ManifoldEstimator::Unbiased { max_trials: most },
                other => return unsuited("--max-trials", &["fnee", "sms"], other),
            }
        }
        if let Some(trials) = self.walks {
            match integrator {
                Sms { estimator, .. } => *estimator = ManifoldEstimator::Biased { trials },
                other => return unsuited("--walks", &["sms"], other),
            }
        }
        if let Some(name) = self.constraint {
            match integrator {
                Sms { constraint, .. } => *constraint = name.setting(),
                other => return unsuited("--constraint", &["sms"], other),
            }
        }
        if let Some(name) = self.steps {
            match integrator {
                Sms { steps, .. } => *steps = name.setting(),
                other => return unsuited("--steps", &["sms"], other),
            }
        }
        if !self.chains.is_empty() {
            match integrator {
                Sms { chains, .. } | Mnee { chains, .. } | Conic { chains, .. } => chains.clone_from(&self.chains),
                other => return unsuited("--chains", &["sms", "mnee", "conic"], other),
            }
        }
        if !self.casters.is_empty() {
            match integrator {
                Sms { casters, .. } | Mnee { casters, .. } | Conic { casters, .. } => {
                    *casters = Some(self.casters.clone())
                }
                other => return unsuited("--casters", &["sms", "mnee", "conic"], other),
            }
        }
        if !self.receivers.is_empty() {
            match integrator {
                Sms { receivers, .. } | Mnee { receivers, .. } | Conic { receivers, .. } => {
                    *receivers = Some(self.receivers.clone());
                }
                other => return unsuited("--receivers", &["sms", "mnee", "conic"], other),
            }
        }
        if let Some(name) = self.search {
            match integrator {
                Conic { search, .. } => *search = name.setting(),
                other => return unsuited("--search", &["conic"], other),
            }
        }
        if let Some(name) = self.missed {
            match integrator {
                Mnee { missed, .. } => *missed = name.setting(),
                other => return unsuited("--missed", &["mnee"], other),
            }
        }
        if self.reflected {
            match integrator {
                Fnee { reflected, .. } => *reflected = true,
                other => return unsuited("--reflected", &["fnee"], other),
            }
        }
        Ok(())
    }
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

impl StepsName {
    fn setting(self) -> WalkSteps {
        match self {
            Self::OnPanes => WalkSteps::OnPanes,
            Self::Published => WalkSteps::Published,
        }
    }
}

impl SolverName {
    fn setting(self) -> FneeSolver {
        match self {
            Self::Complete => FneeSolver::Complete,
            Self::Published => FneeSolver::Published,
        }
    }
}

impl SelectionName {
    fn setting(self) -> PaneSelection {
        match self {
            Self::All => PaneSelection::All,
            Self::Sharp => PaneSelection::Sharp,
            Self::Bleed => PaneSelection::Bleed,
            Self::Random => PaneSelection::Random,
        }
    }
}

impl ConstraintName {
    fn setting(self) -> ManifoldConstraint {
        match self {
            Self::AngleDifference => ManifoldConstraint::AngleDifference,
            Self::HalfVector => ManifoldConstraint::HalfVector,
        }
    }
}

impl SearchName {
    fn setting(self) -> ConicSearch {
        match self {
            Self::Complete => ConicSearch::Complete,
            Self::WithoutRays => ConicSearch::WithoutRays,
            Self::Published => ConicSearch::Published,
        }
    }
}

impl MissedName {
    fn setting(self) -> MissedPaths {
        match self {
            Self::LeftToChance => MissedPaths::LeftToChance,
            Self::Dropped => MissedPaths::Dropped,
        }
    }
}

impl IntegratorName {
    fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::Cone => "cone",
            Self::Fnee => "fnee",
            Self::Sms => "sms",
            Self::Mnee => "mnee",
            Self::Conic => "conic",
        }
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
        for name in IntegratorName::value_variants() {
            let overrides = SceneOverrides { integrator: Some(*name), ..SceneOverrides::default() };
            let changed = overrides.apply(description.clone()).unwrap().integrator;
            assert_eq!((changed.name(), changed.max_depth()), (name.name(), description.integrator.max_depth()));
        }
    }

    #[test]
    fn settings_change_what_is_named_and_are_an_error_with_other_integrators() {
        let scene = include_bytes!("../../../scenes/references/flat-point.json");
        let description = SceneDescription::parse(scene).unwrap();
        let none = SceneOverrides::default();
        let integrator = |overrides: SceneOverrides, name| {
            let overrides = SceneOverrides { integrator: Some(name), ..overrides };
            Ok::<_, Failure>(serde_json::to_value(overrides.apply(description.clone())?.integrator).unwrap())
        };
        let fnee = SceneOverrides { solver: Some(SolverName::Published), max_trials: Some(50), ..none.clone() };
        let changed = integrator(fnee.clone(), IntegratorName::Fnee).unwrap();
        assert_eq!((&changed["fnee"]["solver"], &changed["fnee"]["max_trials"]), (&"published".into(), &50.into()));
        let sms = SceneOverrides {
            selection: Some(SelectionName::Sharp),
            walks: Some(4),
            constraint: Some(ConstraintName::HalfVector),
            steps: Some(StepsName::Published),
            chains: vec!["T".into(), "TT".into()],
            ..none.clone()
        };
        let changed = integrator(sms.clone(), IntegratorName::Sms).unwrap();
        let expected = serde_json::json!({"sms": {"max_depth": changed["sms"]["max_depth"], "constraint": "half_vector",
            "steps": "published", "estimator": {"biased": {"trials": 4}}, "selection": "sharp", "chains": ["T", "TT"]}});
        assert_eq!(changed, expected);
        let chains = SceneOverrides {
            chains: vec!["TTTT".into()],
            casters: vec!["north".into(), "south".into()],
            receivers: vec!["floor".into()],
            missed: Some(MissedName::Dropped),
            ..none.clone()
        };
        let changed = integrator(chains.clone(), IntegratorName::Mnee).unwrap();
        let expected = serde_json::json!({"mnee": {"max_depth": changed["mnee"]["max_depth"], "missed": "dropped",
            "chains": ["TTTT"], "casters": ["north", "south"], "receivers": ["floor"]}});
        assert_eq!(changed, expected);
        let reflected = SceneOverrides { reflected: true, ..none };
        assert_eq!(integrator(reflected.clone(), IntegratorName::Fnee).unwrap()["fnee"]["reflected"], true);
        for (overrides, name, option) in [
            (fnee, IntegratorName::Sms, "--solver"),
            (sms, IntegratorName::Mnee, "--selection"),
            (chains, IntegratorName::Cone, "--chains"),
            (reflected, IntegratorName::Path, "--reflected"),
        ] {
            let message = integrator(overrides, name).unwrap_err().to_string();
            assert!(message.contains(option) && message.contains(name.name()), "{message}");
        }
    }
}
