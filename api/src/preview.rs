//! Previews: how an image looks as a PNG.

use bytes::Bytes;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

/// Header of a preview that says how many nodes of the job had been accepted when it was begun.
pub const ACCEPTED_NODES_HEADER: &str = "clerestory-accepted-nodes";

/// A preview of a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Preview {
    /// The image as PNG.
    pub png: Bytes,
    /// How many nodes of the job had been accepted when it was begun: all of these are in it, but for nodes with a gap
    /// before them.
    pub accepted_nodes: u64,
}

/// How a preview is made from the film; by default as `clerestory render --png` makes it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema, IntoParams)]
#[serde(deny_unknown_fields, default)]
#[into_params(parameter_in = Query)]
pub struct PreviewQuery {
    /// `auto` (the default), or a number of stops between -32 and 32: radiance is multiplied by 2 to this power.
    #[schema(value_type = String)]
    #[param(value_type = String)]
    pub exposure: PreviewExposure,
    /// Curve from linear light to the display; `filmic` is the default.
    pub curve: ToneCurve,
}

/// How bright a preview is, written `auto` or as a number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum PreviewExposure {
    /// As bright as a photograph of the same light would be.
    #[default]
    Auto,
    /// Radiance is multiplied by 2 to this power.
    Stops(f64),
}

impl TryFrom<String> for PreviewExposure {
    type Error = &'static str;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        match text.as_str() {
            "auto" => Ok(Self::Auto),
            text => text
                .parse()
                .map(Self::Stops)
                .map_err(|_| "neither `auto` nor a number, expected `auto` or a number of stops"),
        }
    }
}

impl From<PreviewExposure> for String {
    fn from(exposure: PreviewExposure) -> Self {
        match exposure {
            PreviewExposure::Auto => "auto".to_owned(),
            PreviewExposure::Stops(stops) => stops.to_string(),
        }
    }
}

/// Curve from linear light to the display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ToneCurve {
    /// The sRGB transfer function; brighter than 1 is clipped.
    Srgb,
    /// A filmic curve that rolls highlights off.
    #[default]
    Filmic,
}
