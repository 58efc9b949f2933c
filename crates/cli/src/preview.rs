//! Options for the look of an image as a PNG.

use clap::{Args, ValueEnum};
use clerestory_film::{Exposure, PreviewSettings, ToneCurve};

/// Largest exposure in either direction, as on a farm.
const MOST_STOPS: f64 = 32.0;

/// How a PNG is made. By default it is as bright as a photograph of the same light.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct PreviewArguments {
    /// Exposure of the PNG: `auto`, stops over it such as `auto+1.5`, or a number of stops; 0 shows radiance 1 as
    /// white.
    #[arg(long, value_name = "STOPS|auto", default_value = "auto", value_parser = parse_exposure,
          allow_negative_numbers = true, requires = "png")]
    exposure: Exposure,
    /// Tone curve of the PNG.
    #[arg(long, value_enum, value_name = "NAME", default_value = "filmic", requires = "png")]
    curve: CurveName,
}

/// Names of the tone curves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CurveName {
    /// Rolls highlights off.
    Filmic,
    /// Cuts off what is brighter than 1.
    Srgb,
}

impl CurveName {
    /// The curve in the renderer's words.
    pub(crate) fn curve(self) -> ToneCurve {
        match self {
            Self::Filmic => ToneCurve::Filmic,
            Self::Srgb => ToneCurve::Srgb,
        }
    }
}

impl PreviewArguments {
    /// The settings in the renderer's words.
    pub(crate) fn settings(&self) -> PreviewSettings {
        PreviewSettings { exposure: self.exposure, curve: self.curve.curve() }
    }
}

/// Reads an exposure: `auto`, `auto+1.5`, `auto-2`, or a number of stops.
pub(crate) fn parse_exposure(text: &str) -> Result<Exposure, String> {
    let stops = |text: &str| text.parse().ok().filter(|stops| (-MOST_STOPS..=MOST_STOPS).contains(stops));
    let exposure = match text.strip_prefix("auto") {
        Some("") => Some(Exposure::Automatic),
        Some(over) if over.starts_with(['+', '-']) => stops(over).map(Exposure::OverAutomatic),
        Some(_) => None,
        None => stops(text).map(Exposure::Stops),
    };
    exposure.ok_or_else(|| {
        format!(
            "expected `auto`, stops over it such as `auto+1.5`, or a number of stops from -{MOST_STOPS} to {MOST_STOPS}"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exposure_is_automatic_or_over_it_or_a_number_of_stops() {
        assert_eq!(parse_exposure("auto"), Ok(Exposure::Automatic));
        assert_eq!(parse_exposure("-1.5"), Ok(Exposure::Stops(-1.5)));
        assert_eq!(parse_exposure("auto+0.5"), Ok(Exposure::OverAutomatic(0.5)));
        assert_eq!(parse_exposure("auto-2"), Ok(Exposure::OverAutomatic(-2.0)));
        for text in ["33", "-33", "nan", "inf", "bright", "Auto", "", "auto1", "auto+", "auto+-1", "auto+33"] {
            assert!(parse_exposure(text).is_err_and(|message| message.contains("auto")), "{text}");
        }
    }
}
