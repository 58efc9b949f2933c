//! What a scene file says of its place on earth, its hour, and their light.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::light::SkyModel;
use crate::settings::Triple;

/// Luminous turbidity of clear air, if none is given.
const TURBIDITY: f64 = 3.0;

/// Where the scene is on earth, and how it lies there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SiteDescription {
    /// Degrees, -90 to 90; north is positive.
    #[schemars(range(min = -90.0, max = 90.0))]
    pub latitude: f64,
    /// Degrees, -180 to 180; east is positive.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub longitude: f64,
    /// Above sea level, m, -500 to 9000.
    #[serde(default)]
    #[schemars(range(min = -500.0, max = 9000.0))]
    pub elevation: f64,
    /// Direction to the zenith.
    #[serde(default = "z_axis")]
    pub up: Triple,
    /// A direction of the scene whose azimuth is known, such as the axis of a church. Its part along `up` does not
    /// count.
    #[serde(default = "y_axis")]
    pub axis: Triple,
    /// Azimuth of `axis`, degrees from north by east, -360 to 360.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0))]
    pub azimuth: f64,
}

/// When the scene is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MomentDescription {
    /// A date or a feast, and an hour: `1250-12-25T08:30`, `1250-christmas terce`, `2003-10-17T12:30:30-07:00`.
    pub at: String,
    /// Calendar of the date: `gregorian`, `julian`, `rome`, `france`, `britain`, `russia`, or the first Gregorian day
    /// of one that changed. Default: `gregorian`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calendar: Option<String>,
    /// Kind of time of an hour without a zone: `utc`, `mean`, `apparent`, `seasonal`, `italian`, `babylonian`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// When a canonical hour is: `beginning`, `middle` or `end` of its twelfth of the day. Default: `end`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hour_reading: Option<String>,
}

/// The light of the sun and of the sky at the site and the moment of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DaylightDescription {
    /// How strong sunlight is.
    #[serde(default)]
    pub sun: SunStrength,
    /// How the luminance of the sky is distributed; the model `perez` also says how strong the sun is by its
    /// irradiances, if `sun` is `perez`.
    #[serde(default = "clear_sky")]
    pub sky: SkyModel,
    /// Illuminance of a free horizontal surface by the sky alone, lux, 0 to 1000000. Default: that of `perez` by its
    /// irradiances, and that of a clear sky for all others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub sky_illuminance: Option<f64>,
    /// What the ground outside reflects of the light of the sky and the sun, 0 to 1.
    #[serde(default = "usual_ground")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ground_reflectance: f64,
}

/// How strong sunlight is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SunStrength {
    /// Clear air of a luminous turbidity, 1 to 20: 2.5 is very clear, 4 usual, 6 hazy.
    Turbidity(#[schemars(range(min = 1.0, max = 20.0))] f64),
    /// Illuminance of a surface that faces the sun, lux, 0 to 150000.
    Illuminance(#[schemars(range(min = 0.0, max = 150_000.0))] f64),
    /// That of the irradiances of the sky `perez`.
    Perez,
    /// Clouds are before the sun.
    None,
}

impl Default for SunStrength {
    fn default() -> Self {
        Self::Turbidity(TURBIDITY)
    }
}

fn z_axis() -> Triple {
    [0.0, 0.0, 1.0]
}

fn y_axis() -> Triple {
    [0.0, 1.0, 0.0]
}

fn clear_sky() -> SkyModel {
    SkyModel::Cie(12)
}

fn usual_ground() -> f64 {
    0.2
}
