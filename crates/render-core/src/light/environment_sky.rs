//! A sky around a scene, by a model of its luminance.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::Frame;
use crate::settings::check::{check_direction, check_range};
use crate::settings::{Check, JsonPath, SceneError, Triple};
use crate::site::{LUMINOUS_EFFICACY, PerezSky, SkyDistribution};

/// Least cosine of the sun with the zenith: a sky with a sun has it above the horizon.
const LEAST_COSINE: f64 = 1e-6;

/// A grey sky by a model of its luminance, with a ground below its horizon.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkySettings {
    /// How luminance is distributed.
    pub model: SkyModel,
    /// Direction to the zenith.
    #[serde(default = "z_axis")]
    pub up: Triple,
    /// Direction to the sun, above the horizon; models whose luminance does not depend on it need none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sun: Option<Triple>,
    /// Illuminance of a free horizontal surface by the sky alone, lux, 0 to 1000000. The model `perez` has it from its
    /// irradiances, unless it is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub illuminance: Option<f64>,
    /// Luminance of the ground below the horizon, cd/m2, 0 to 1000000.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub ground_luminance: f64,
}

/// How the luminance of a sky is distributed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SkyModel {
    /// The general sky of ISO 15469 (CIE S 011) of a type, 1 to 15: 1 is overcast, 5 uniform, 12 clear.
    Cie(#[schemars(range(min = 1, max = 15))] u32),
    /// The traditional overcast sky of the CIE, three times as bright in the zenith as at the horizon.
    Overcast,
    /// The intermediate sky of Matsuura.
    Intermediate,
    /// The all-weather sky of Perez.
    Perez {
        /// Irradiance of a surface that faces the sun, by the sun alone, W/m2, 0 to 1500.
        #[schemars(range(min = 0.0, max = 1500.0))]
        direct_normal: f64,
        /// Irradiance of a horizontal surface by the sky alone, W/m2, 1 to 1500.
        #[schemars(range(min = 1.0, max = 1500.0))]
        diffuse_horizontal: f64,
    },
}

fn z_axis() -> Triple {
    [0.0, 0.0, 1.0]
}

impl SkyModel {
    /// Checks its numbers.
    pub(crate) fn check(&self, path: &JsonPath<'_>) -> Check {
        match self {
            Self::Cie(kind) => check_range(*kind, 1, SkyDistribution::TYPES, &path.member("cie")),
            Self::Perez { direct_normal, diffuse_horizontal } => {
                let perez = path.member("perez");
                check_range(*direct_normal, 0.0, 1500.0, &perez.member("direct_normal"))?;
                check_range(*diffuse_horizontal, 1.0, 1500.0, &perez.member("diffuse_horizontal"))
            }
            Self::Overcast | Self::Intermediate => Ok(()),
        }
    }

    /// The sky of its irradiances, for a sun at an altitude in degrees and a distance in astronomical units; `None` for
    /// other models.
    pub(crate) fn perez(&self, altitude: f64, distance: f64) -> Option<PerezSky> {
        match self {
            Self::Perez { direct_normal, diffuse_horizontal } => {
                PerezSky::new([*direct_normal, *diffuse_horizontal], (90.0 - altitude).to_radians(), distance)
            }
            Self::Cie(_) | Self::Overcast | Self::Intermediate => None,
        }
    }

    fn needs_sun(&self) -> bool {
        match self {
            // Types 1, 3 and 5 are even around the zenith.
            Self::Cie(kind) => ![1, 3, 5].contains(kind),
            Self::Overcast => false,
            Self::Intermediate | Self::Perez { .. } => true,
        }
    }
}

impl SkySettings {
    /// Checks all members.
    pub(super) fn check(&self, path: &JsonPath<'_>) -> Check {
        self.model.check(&path.member("model"))?;
        let up = check_direction(self.up, &path.member("up"))?;
        match self.sun {
            Some(sun) => {
                let cosine = check_direction(sun, &path.member("sun"))?.dot(up);
                if cosine < LEAST_COSINE {
                    let found = format!("a sun {:.3} degrees from up", libm::acos(cosine.max(-1.0)).to_degrees());
                    return Err(SceneError::value(&path.member("sun"), found, "a direction above the horizon"));
                }
            }
            None if self.model.needs_sun() => {
                return Err(SceneError::value(
                    &path.member("sun"),
                    "nothing",
                    "the direction to the sun for this model",
                ));
            }
            None => {}
        }
        match self.illuminance {
            Some(illuminance) => check_range(illuminance, 0.0, 1e6, &path.member("illuminance"))?,
            None if !matches!(self.model, SkyModel::Perez { .. }) => {
                let expected = "lux on a free horizontal surface, for this model";
                return Err(SceneError::value(&path.member("illuminance"), "nothing", expected));
            }
            None => {}
        }
        check_range(self.ground_luminance, 0.0, 1e6, &path.member("ground_luminance"))
    }

    /// The sky, of settings that have been checked.
    pub(super) fn build(&self) -> Sky {
        let up = DVec3::from(self.up).normalize();
        let sun = self.sun.map_or(up, |sun| DVec3::from(sun).normalize());
        let angle = libm::acos(sun.dot(up).clamp(-1.0, 1.0));
        let measured = self.model.perez(90.0 - angle.to_degrees(), 1.0);
        let distribution = match self.model {
            SkyModel::Cie(kind) => SkyDistribution::general(kind, angle),
            SkyModel::Overcast => SkyDistribution::overcast(),
            SkyModel::Intermediate => SkyDistribution::matsuura(angle),
            // Settings that have been checked have a sky.
            SkyModel::Perez { .. } => measured.map_or_else(SkyDistribution::overcast, |sky| sky.distribution),
        };
        let measured = measured.map(|sky| sky.diffuse_illuminance);
        let irradiance = self.illuminance.or(measured).unwrap_or_default() / LUMINOUS_EFFICACY;
        let frame = Frame { origin: DVec3::ZERO, axes: axes(up, sun) };
        let ground = self.ground_luminance / LUMINOUS_EFFICACY;
        let horizontal = distribution.horizontal();
        let scale = if horizontal > 0.0 { irradiance / horizontal } else { 0.0 };
        Sky { distribution, sun: frame.vector_to_local(sun), scale, ground, frame }
    }
}

/// A sky.
#[derive(Clone, Debug)]
pub(super) struct Sky {
    distribution: SkyDistribution,
    /// Direction to the sun in the frame.
    sun: DVec3,
    /// Radiance for each unit of relative luminance.
    scale: f64,
    /// Radiance of the ground.
    ground: f64,
    /// Its z axis is the zenith.
    pub(super) frame: Frame,
}

impl Sky {
    /// Columns and rows in which the radiance of the sky is nearly even. The horizon is between two rows.
    pub(super) const SIZE: [usize; 2] = [512, 256];

    /// Radiance from a direction of the frame, W/(m2 sr), the same in all channels.
    pub(super) fn radiance(&self, direction: DVec3) -> DVec3 {
        let above = direction.z > 0.0;
        let radiance = match above {
            true => self.scale * self.distribution.relative(direction.z, direction.dot(self.sun)),
            false => self.ground,
        };
        DVec3::splat(radiance)
    }

    /// Radiance around the sun, where skies are brightest.
    pub(super) fn at_the_sun(&self) -> DVec3 {
        self.radiance(self.sun)
    }
}

/// Axes with z upwards, and the sun over x.
fn axes(up: DVec3, sun: DVec3) -> glam::DMat3 {
    let across = sun - up * sun.dot(up);
    let x = if across.length() > 1e-6 { across.normalize() } else { up.any_orthonormal_vector() };
    glam::DMat3::from_cols(x, up.cross(x), up)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use serde_json::{Value, json};

    use super::*;

    fn sky(settings: Value) -> Result<SkySettings, String> {
        let settings: SkySettings = serde_json::from_value(settings).map_err(|error| error.to_string())?;
        settings.check(&JsonPath::Root.member("sky")).map_err(|error| error.to_string())?;
        Ok(settings)
    }

    #[test]
    fn a_horizontal_surface_has_the_given_illuminance_and_the_ground_its_luminance() {
        for model in [json!({"cie": 12}), json!("overcast"), json!("intermediate"), json!({"cie": 5})] {
            let up = DVec3::new(0.2, 0.9, -0.1).normalize();
            let settings = json!({"model": model, "up": up.to_array(), "sun": [0.5, 0.8, 0.3], "illuminance": 10_000,
                "ground_luminance": 700});
            let sky = sky(settings).unwrap().build();
            let (rows, columns) = (200, 200);
            let mut illuminance = 0.0;
            for row in 0..rows {
                let cos = (f64::from(row) + 0.5) / f64::from(rows);
                for column in 0..columns {
                    let (sin, across) = libm::sincos(2.0 * PI * (f64::from(column) + 0.5) / f64::from(columns));
                    let radius = (1.0 - cos * cos).sqrt();
                    illuminance += sky.radiance(DVec3::new(radius * across, radius * sin, cos)).x * cos;
                }
            }
            illuminance *= LUMINOUS_EFFICACY * 2.0 * PI / f64::from(rows * columns);
            assert!((illuminance / 10_000.0 - 1.0).abs() < 1e-3, "{illuminance}");
            let ground = sky.radiance(DVec3::new(0.6, 0.0, -0.8)).x * LUMINOUS_EFFICACY;
            assert!((ground / 700.0 - 1.0).abs() < 1e-9, "{ground}");
            assert!((sky.frame.vector_to_world(DVec3::Z) - up).length() < 1e-12);
        }
    }

    #[test]
    fn what_no_sky_can_have_is_refused_with_its_place() {
        let refused = |settings: Value, parts: &[&str]| {
            let error = sky(settings).unwrap_err();
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        };
        refused(json!({"model": {"cie": 16}, "illuminance": 1}), &["sky.model.cie", "16", "15"]);
        refused(json!({"model": {"cie": 12}, "illuminance": 1}), &["sky.sun", "direction"]);
        refused(
            json!({"model": {"cie": 12}, "illuminance": 1, "sun": [1, 0, -0.1]}),
            &["sky.sun", "above the horizon"],
        );
        refused(json!({"model": "overcast"}), &["sky.illuminance", "lux"]);
        refused(json!({"model": "overcast", "illuminance": -1}), &["sky.illuminance", "-1"]);
        refused(
            json!({"model": {"perez": {"direct_normal": 9999, "diffuse_horizontal": 1}}, "sun": [0, 0, 1]}),
            &["sky.model.perez.direct_normal", "9999"],
        );
        assert!(
            sky(json!({"model": {"perez": {"direct_normal": 700, "diffuse_horizontal": 100}}, "sun": [1, 0, 1]}))
                .is_ok()
        );
    }
}
