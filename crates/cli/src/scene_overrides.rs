//! Options that change a scene before it is rendered.

use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use clap::{Args, ValueEnum};
use clerestory_render_core::scene::description::{
    FilmDescription, FneeSolver, IntegratorDescription, PaneSelection, SceneDescription,
};
use clerestory_render_core::scene::{self, SceneBundle};

use crate::failure::Failure;

/// Samples per pixel where neither a number nor a time is given: one block.
const DEFAULT_SAMPLES_PER_PIXEL: u32 = 256;

/// Samples per pixel that a time limit alone never reaches.
const UNREACHABLE_SAMPLES_PER_PIXEL: u32 = 1 << 24;

/// Longest time that can be given, in seconds: ten years, as on a farm.
const MOST_SECONDS: f64 = 10.0 * 365.0 * 24.0 * 3600.0;

/// Options that change the scene and how much of it is rendered.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct SceneOverrides {
    /// Samples per pixel, rounded up to whole passes [default: 256, or as many as --time allows].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(UNREACHABLE_SAMPLES_PER_PIXEL)))]
    pub(crate) spp: Option<u32>,
    /// Stop after this time; what is complete then is the image.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub(crate) time: Option<Duration>,
    /// Integrator to use instead of the scene's.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) integrator: Option<IntegratorName>,
    /// How the integrator fnee searches for paths.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) solver: Option<SolverName>,
    /// Which panes the integrator fnee searches.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) selection: Option<SelectionName>,
    /// Trials after which the integrator fnee cuts off an estimate of an inverse probability.
    #[arg(long, value_name = "N")]
    pub(crate) max_trials: Option<u32>,
    /// Seed of the random numbers.
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Size of the image in pixels.
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<Size>,
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
}

/// Names of the ways in which `fnee` searches for paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SolverName {
    /// Enumerates minima, saddles and maxima of the optical length.
    Complete,
    /// The algorithm of the paper, which finds minima almost exclusively.
    Published,
}

/// Names of the selections of panes that `fnee` searches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SelectionName {
    /// Every pane.
    All,
    /// The first pane on the straight line to the light.
    Sharp,
    /// One pane at random whenever something blocks the straight line.
    Bleed,
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
        let size = text
            .split_once(['x', 'X'])
            .and_then(|(width, height)| Some(Self { width: width.parse().ok()?, height: height.parse().ok()? }));
        size.ok_or_else(|| "expected width and height in pixels, for instance 640x480".to_owned())
    }
}

pub(crate) fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| *seconds > 0.0 && *seconds <= MOST_SECONDS);
    seconds
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        // A farm counts milliseconds, and none at all is no limit.
        .map(|time| time.max(Duration::from_millis(1)))
        .ok_or_else(|| format!("expected a positive number of seconds, at most {MOST_SECONDS} (ten years)"))
}

impl SceneOverrides {
    /// Loads a scene and changes it.
    pub(crate) fn load(&self, file: &Path) -> Result<SceneBundle, Failure> {
        let failure = |source| Failure::scene(file, source);
        let bundle = scene::load(file).map_err(failure)?;
        let description = self.apply(bundle.description().clone())?;
        bundle.with_description(description).map_err(failure)
    }

    /// Samples per pixel to render at most.
    pub(crate) fn samples_per_pixel(&self) -> u32 {
        let default = if self.time.is_some() { UNREACHABLE_SAMPLES_PER_PIXEL } else { DEFAULT_SAMPLES_PER_PIXEL };
        self.spp.unwrap_or(default)
    }

    /// The time to render at most, in milliseconds, as a farm wants it.
    pub(crate) fn time_limit_ms(&self) -> Option<i64> {
        self.time.map(|time| i64::try_from(time.as_millis()).unwrap_or(i64::MAX))
    }

    fn apply(&self, mut description: SceneDescription) -> Result<SceneDescription, Failure> {
        if let Some(name) = self.integrator {
            description = description.with_integrator_named(name.name()).expect("every name is that of an integrator");
        }
        self.apply_to_fnee(&mut description.integrator)?;
        if let Some(seed) = self.seed {
            description.seed = seed;
        }
        if let Some(Size { width, height }) = self.size {
            description.film = FilmDescription { width, height };
        }
        Ok(description)
    }

    /// Changes the settings that only `fnee` has.
    fn apply_to_fnee(&self, integrator: &mut IntegratorDescription) -> Result<(), Failure> {
        if let IntegratorDescription::Fnee { solver, selection, max_trials, .. } = integrator {
            *solver = self.solver.map_or(*solver, SolverName::setting);
            *selection = self.selection.map_or(*selection, SelectionName::setting);
            *max_trials = self.max_trials.unwrap_or(*max_trials);
            return Ok(());
        }
        let given = [
            ("--solver", self.solver.is_some()),
            ("--selection", self.selection.is_some()),
            ("--max-trials", self.max_trials.is_some()),
        ];
        match given.into_iter().find(|(_, is_given)| *is_given) {
            None => Ok(()),
            Some((option, _)) => Err(Failure::Usage(format!(
                "{option} is for the integrator fnee, and the image is made by {}: expected --integrator fnee beside it",
                integrator.name()
            ))),
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
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_two_numbers_around_an_x() {
        assert_eq!("640x480".parse(), Ok(Size { width: 640, height: 480 }));
        for text in ["640", "640x", "x480", "640x480x1", "-1x5", "640 480", ""] {
            assert!(text.parse::<Size>().is_err_and(|message| message.contains("640x480")), "{text}");
        }
    }

    #[test]
    fn a_time_is_a_positive_number_of_seconds() {
        assert_eq!(parse_seconds("2.5"), Ok(Duration::from_millis(2500)));
        assert_eq!(parse_seconds("0.0004"), Ok(Duration::from_millis(1)));
        assert_eq!(parse_seconds("315360000"), Ok(Duration::from_secs(315_360_000)));
        for text in ["0", "-1", "nan", "inf", "1e17", "1e300", "315360001", "ten", ""] {
            assert!(parse_seconds(text).is_err_and(|message| message.contains("at most 315360000")), "{text}");
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
    fn settings_of_fnee_change_what_is_named_and_are_an_error_elsewhere() {
        let overrides =
            SceneOverrides { solver: Some(SolverName::Published), max_trials: Some(50), ..SceneOverrides::default() };
        let mut integrator = IntegratorDescription::Fnee {
            max_depth: 7,
            solver: FneeSolver::Complete,
            selection: PaneSelection::Sharp,
            max_trials: 9,
            reflected: false,
        };
        overrides.apply_to_fnee(&mut integrator).unwrap();
        let expected = IntegratorDescription::Fnee {
            max_depth: 7,
            solver: FneeSolver::Published,
            selection: PaneSelection::Sharp,
            max_trials: 50,
            reflected: false,
        };
        assert_eq!(integrator, expected);
        let message =
            overrides.apply_to_fnee(&mut IntegratorDescription::Cone { max_depth: 7 }).unwrap_err().to_string();
        assert!(message.contains("--solver") && message.contains("cone"), "{message}");
    }
}
