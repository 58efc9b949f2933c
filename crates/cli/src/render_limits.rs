//! Options for how much of a scene is rendered.

use std::time::Duration;

use clap::Args;
use clerestory_film::{Adaptation, InvalidTarget, Sampling, Targets};

use crate::failure::Failure;
use crate::numbers::whole;

/// Default samples per pixel without a time limit or a target: one block.
pub(crate) const DEFAULT_SAMPLES_PER_PIXEL: u32 = 256;

/// Samples per pixel that a time limit or a target never reaches.
pub(crate) const UNREACHABLE_SAMPLES_PER_PIXEL: u32 = 1 << 24;

/// Longest time that can be given, in seconds: ten years, as on a farm.
const MOST_SECONDS: f64 = 10.0 * 365.0 * 24.0 * 3600.0;

/// How much of a scene is rendered.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct RenderLimits {
    /// Samples per pixel, rounded up to whole passes of 16 samples, or as many as the scene says [default: 256, or as
    /// many as --time or a target takes].
    #[arg(long, value_name = "N", value_parser = whole(1..=UNREACHABLE_SAMPLES_PER_PIXEL))]
    pub(crate) spp: Option<u32>,
    /// Stop after this wall-clock time, on any number of cores. The image has the passes that are complete then.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub(crate) time: Option<Duration>,
    /// Stop at the first round whose mean squared error against the reference is at most this. Noise of the reference
    /// is subtracted where it is known.
    #[arg(long, value_name = "MSE", value_parser = parse_target)]
    pub(crate) target_mse: Option<f64>,
    /// Stop at the first round whose mean squared error, as estimated from the image's own noise, is at most this. The
    /// estimate counts from four blocks of samples on.
    #[arg(long, value_name = "MSE", value_parser = parse_target)]
    pub(crate) target_estimated_mse: Option<f64>,
    /// Render more where the image is noisy. A pilot of a few discarded passes measures the noise of each tile. The
    /// noisiest tile gets all passes, and a quiet one an eighth. Each tile gets at least two blocks of samples, or four
    /// with --target-estimated-mse. The default of 256 samples is too few, so give --spp or --time beside it.
    #[arg(long)]
    pub(crate) adaptive: bool,
}

pub(crate) fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| *seconds > 0.0 && *seconds <= MOST_SECONDS);
    seconds
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        // A farm counts milliseconds, and 0 means no limit.
        .map(|time| time.max(Duration::from_millis(1)))
        .ok_or_else(|| format!("expected a positive number of seconds, at most {MOST_SECONDS} (ten years)"))
}

fn parse_target(text: &str) -> Result<f64, String> {
    let target = text.parse().ok().filter(|target: &f64| target.is_finite() && *target > 0.0);
    target.ok_or_else(|| "expected a positive number, such as 1e-4".to_owned())
}

impl RenderLimits {
    /// Samples per pixel to render at most.
    pub(crate) fn samples_per_pixel(&self) -> u32 {
        let has_other_end = self.time.is_some() || self.targets() != Targets::default();
        let default = if has_other_end { UNREACHABLE_SAMPLES_PER_PIXEL } else { DEFAULT_SAMPLES_PER_PIXEL };
        self.spp.unwrap_or(default)
    }

    /// The errors at which the render stops.
    pub(crate) fn targets(&self) -> Targets {
        Targets { mse: self.target_mse, estimated_mse: self.target_estimated_mse }
    }

    /// Checks the targets of a render with or without a reference. The mean square of the reference's standard errors
    /// is given where it is known.
    pub(crate) fn check_targets(&self, has_reference: bool, reference_noise: Option<f64>) -> Result<(), Failure> {
        self.targets().check(has_reference, reference_noise).map_err(|InvalidTarget { field, value, expected }| {
            Failure::Usage(format!("--{} {value:e} cannot be used: expected {expected}", field.replace('_', "-")))
        })
    }

    /// How `passes` passes are shared out among tiles, if the render is adaptive.
    pub(crate) fn adaptation(&self, sampling: Sampling, passes: u32) -> Result<Option<Adaptation>, Failure> {
        let adaptation = self.adaptive.then(|| self.targets().adaptation(sampling, passes)).transpose();
        adaptation.map_err(|fewest| {
            Failure::Usage(format!(
                "--adaptive with {} samples in each pixel has nothing to share out: expected --spp of at least \
                 {fewest} beside it, \
                 since every pixel gets {} at least; or --time without --spp",
                self.samples_per_pixel(),
                fewest.saturating_sub(1)
            ))
        })
    }

    /// The time limit in milliseconds, as a farm takes it.
    pub(crate) fn time_limit_ms(&self) -> Option<i64> {
        self.time.map(|time| i64::try_from(time.as_millis()).unwrap_or(i64::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn a_target_is_a_positive_number_and_lifts_the_usual_number_of_samples() {
        assert_eq!(parse_target("2.5e-4"), Ok(2.5e-4));
        for text in ["0", "-1e-3", "nan", "inf", "1e999", "little", ""] {
            assert!(parse_target(text).is_err_and(|message| message.contains("a positive number")), "{text}");
        }
        let limits = RenderLimits { target_estimated_mse: Some(1e-3), ..RenderLimits::default() };
        assert_eq!(limits.samples_per_pixel(), UNREACHABLE_SAMPLES_PER_PIXEL);
        assert_eq!(RenderLimits { spp: Some(64), ..limits }.samples_per_pixel(), 64);
        assert_eq!(RenderLimits::default().samples_per_pixel(), DEFAULT_SAMPLES_PER_PIXEL);
    }
}
