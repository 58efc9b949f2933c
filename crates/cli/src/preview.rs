//! Options for the look of an image as a PNG.

use clap::{Args, ValueEnum};
use clerestory_film::{Exposure, PreviewSettings, ToneCurve};

/// Largest exposure in either direction, as on a farm.
const MOST_STOPS: f64 = 32.0;

/// How a PNG is made. By default it is as bright as a photograph of the same light.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct PreviewArguments {
    /// Exposure of the PNG: `auto`, or a number of stops; 0 shows radiance 1 as white.
    #[arg(long, value_name = "STOPS|auto", default_value = "auto", value_parser = parse_exposure,
          allow_negative_numbers = true, requires = "png")]
    exposure: Exposure,
    /// Tone curve of the PNG.
    #[arg(long, value_enum, value_name = "NAME", default_value = "filmic", requires = "png")]
    curve: CurveName,
}

/// Names of the tone curves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum CurveName {
    /// Rolls highlights off.
    Filmic,
    /// Cuts off what is brighter than 1.
    Srgb,
}

impl PreviewArguments {
    /// The settings in the renderer's words.
    pub(crate) fn settings(&self) -> PreviewSettings {
        let curve = match self.curve {
            CurveName::Filmic => ToneCurve::Filmic,
            CurveName::Srgb => ToneCurve::Srgb,
        };
        PreviewSettings { exposure: self.exposure, curve }
    }
}

fn parse_exposure(text: &str) -> Result<Exposure, String> {
    if text == "auto" {
        return Ok(Exposure::Automatic);
    }
    let stops = text.parse().ok().filter(|stops| (-MOST_STOPS..=MOST_STOPS).contains(stops));
    stops
        .map(Exposure::Stops)
        .ok_or_else(|| format!("expected `auto` or a number of stops from -{MOST_STOPS} to {MOST_STOPS}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exposure_is_automatic_or_a_number_of_stops() {
        assert_eq!(parse_exposure("auto"), Ok(Exposure::Automatic));
        assert_eq!(parse_exposure("-1.5"), Ok(Exposure::Stops(-1.5)));
        for text in ["33", "-33", "nan", "inf", "bright", "Auto", ""] {
            assert!(parse_exposure(text).is_err_and(|message| message.contains("auto")), "{text}");
        }
    }
}
