//! What is around a scene, infinitely far away: one colour, a picture of all directions, or a sky.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::environment_map::{EnvironmentMap, Partner, SPHERE};
use super::environment_sky::SkySettings;
use super::{
    Body, EmissionCone, Emitter, LiSample, LightAssets, LightBounds, LightHit, LightSettings, Receiver, Source,
    SourceSample,
};
use crate::exchange::{LightModel, RadianceModel};
use crate::geometry::rotation::rotation;
use crate::geometry::{Frame, Ray};
use crate::settings::check::{Numbers, check_asset_name, check_range, check_triple};
use crate::settings::limits::{MAX_EMISSION, MAX_PICTURE_RADIANCE};
use crate::settings::{Check, JsonPath, SceneError, Triple};
use crate::texture::Bitmaps;

/// What is around the scene, infinitely far away: a sky, or a picture of a whole surrounding. It is behind everything,
/// suns included, whose light is added to its own. A scene has one at the most.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct EnvironmentLight {
    /// A short name, used in messages; no two lights share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Emitted radiance, W/(m2 sr).
    pub radiance: EnvironmentRadiance,
    /// By what radiance is multiplied, 0 to 1000000.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 1e6))]
    pub scale: f64,
    /// Rotation of the picture about the fixed axes x, then y, then z, degrees; positive angles turn counterclockwise
    /// for whoever looks against the axis.
    #[serde(default)]
    pub rotate: Triple,
}

/// Radiance from all directions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum EnvironmentRadiance {
    /// The same from all directions.
    Colour(#[schemars(inner(range(min = 0.0)))] Triple),
    /// A picture by longitude and latitude. Seen from inside and with +z up, its middle lies towards +x and what is
    /// left of the middle towards +y; its top row is up. So does Blender have it.
    Picture {
        /// OpenEXR (channels R, G, B or Y) or Radiance file (.hdr), relative to the scene file.
        file: String,
    },
    /// A sky by a model of its luminance.
    Sky(SkySettings),
}

/// The largest scale: the largest radiance is no more than that of other lights.
const MAX_SCALE: f64 = MAX_EMISSION / MAX_PICTURE_RADIANCE;

fn one() -> f64 {
    1.0
}

impl LightSettings for EnvironmentLight {
    fn name(&self) -> &str {
        &self.name
    }

    fn place(&self) -> Option<&'static str> {
        None
    }

    fn is_environment(&self) -> bool {
        true
    }

    fn picture(&self) -> Option<(String, &str)> {
        match &self.radiance {
            EnvironmentRadiance::Colour(_) | EnvironmentRadiance::Sky(_) => None,
            EnvironmentRadiance::Picture { file } => Some(("radiance.picture.file".to_owned(), file)),
        }
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        let radiance = path.member("radiance");
        match &self.radiance {
            EnvironmentRadiance::Colour(colour) => {
                check_triple(*colour, 0.0, MAX_PICTURE_RADIANCE, &radiance.member("colour"))?;
            }
            EnvironmentRadiance::Picture { file } => {
                check_asset_name(file, &radiance.member("picture").member("file"))?;
            }
            EnvironmentRadiance::Sky(sky) => {
                sky.check(&radiance.member("sky"))?;
                if self.rotate != [0.0; 3] {
                    let expected = "[0, 0, 0] with a sky, whose own up and sun say how it lies";
                    return Err(SceneError::value(&path.member("rotate"), Numbers(&self.rotate), expected));
                }
            }
        }
        check_range(self.scale, 0.0, MAX_SCALE, &path.member("scale"))?;
        check_triple(self.rotate, -36_000.0, 36_000.0, &path.member("rotate"))
    }

    fn model(&self, _: &Bitmaps<'_>) -> Option<LightModel> {
        let radiance = match &self.radiance {
            EnvironmentRadiance::Colour(colour) => RadianceModel::Colour(colour.map(|channel| channel * self.scale)),
            EnvironmentRadiance::Picture { file } => {
                let axes = rotation(self.rotate);
                RadianceModel::Picture {
                    file: file.clone(),
                    scale: self.scale,
                    middle: axes.x_axis.to_array(),
                    left: axes.y_axis.to_array(),
                    up: axes.z_axis.to_array(),
                }
            }
            EnvironmentRadiance::Sky(_) => return None,
        };
        Some(LightModel::Environment { radiance })
    }

    fn build(&self, assets: &LightAssets) -> Arc<dyn Emitter> {
        let (scale, frame) = (self.scale, Frame { origin: DVec3::ZERO, axes: rotation(self.rotate) });
        let surrounding = match &self.radiance {
            EnvironmentRadiance::Colour(colour) => Surrounding::Uniform(DVec3::from(*colour) * scale),
            EnvironmentRadiance::Picture { file } => {
                let map = assets.environments.get(file).expect("every picture is decoded before lights are built");
                Surrounding::Map { map: Arc::clone(map), scale, frame }
            }
            EnvironmentRadiance::Sky(settings) => {
                let sky = settings.build();
                let frame = sky.frame;
                Surrounding::Map { map: Arc::new(EnvironmentMap::of_sky(sky)), scale, frame }
            }
        };
        Arc::new(Environment { surrounding })
    }
}

/// A light at infinity in all directions.
#[derive(Clone, Debug)]
struct Environment {
    surrounding: Surrounding,
}

#[derive(Clone, Debug)]
enum Surrounding {
    Uniform(DVec3),
    /// A picture, times `scale`; +z of the frame is its top.
    Map {
        map: Arc<EnvironmentMap>,
        scale: f64,
        frame: Frame,
    },
}

impl Environment {
    fn radiance(&self, direction: DVec3) -> DVec3 {
        match &self.surrounding {
            Surrounding::Uniform(radiance) => *radiance,
            Surrounding::Map { map, scale, frame } => map.radiance(frame.vector_to_local(direction)) * *scale,
        }
    }

    fn sample(&self, partner: Partner, random: DVec2) -> DVec3 {
        match &self.surrounding {
            Surrounding::Uniform(_) => {
                let height = 1.0 - 2.0 * random.x;
                let (sin, cos) = libm::sincos(2.0 * std::f64::consts::PI * random.y);
                let radius = ((1.0 - height) * (1.0 + height)).max(0.0).sqrt();
                DVec3::new(radius * cos, radius * sin, height)
            }
            Surrounding::Map { map, frame, .. } => frame.vector_to_world(map.sample(partner, random)),
        }
    }

    fn pdf(&self, partner: Partner, direction: DVec3) -> f64 {
        match &self.surrounding {
            Surrounding::Uniform(_) => 1.0 / SPHERE,
            Surrounding::Map { map, frame, .. } => map.pdf(partner, frame.vector_to_local(direction)),
        }
    }
}

impl Emitter for Environment {
    fn emission(&self) -> DVec3 {
        match &self.surrounding {
            Surrounding::Uniform(radiance) => *radiance,
            Surrounding::Map { map, scale, .. } => map.brightest() * *scale,
        }
    }

    fn power(&self) -> f64 {
        let mean = match &self.surrounding {
            Surrounding::Uniform(radiance) => *radiance,
            Surrounding::Map { map, scale, .. } => map.mean() * *scale,
        };
        SPHERE * (mean.element_sum() / 3.0)
    }

    fn emission_cone(&self) -> EmissionCone {
        EmissionCone::EVERYWHERE
    }

    fn bounds(&self) -> LightBounds {
        LightBounds::Everywhere
    }

    fn body(&self) -> Option<Body> {
        None
    }

    fn largest_solid_angle(&self, _: [DVec3; 2]) -> Option<f64> {
        Some(SPHERE)
    }

    fn sample_source(&self, _: DVec3, _: f64, random: DVec2) -> SourceSample {
        let direction = self.sample(Partner::None, random);
        let weight = self.radiance(direction) / self.pdf(Partner::None, direction);
        SourceSample { source: Source::Direction(direction), normal: None, triangle: None, weight }
    }

    fn source_density(&self, _: DVec3, _: f64, source: Source) -> f64 {
        match source {
            Source::Direction(direction) => self.pdf(Partner::None, direction),
            Source::Point(_) => 0.0,
        }
    }

    fn source_at(&self, ray: &Ray, _: &LightHit) -> (Source, f64) {
        (Source::Direction(ray.direction), 1.0)
    }

    fn normal_at(&self, _: Source, _: &LightHit) -> Option<DVec3> {
        None
    }

    fn sample_li(&self, _: &Receiver, random: DVec2) -> Option<LiSample> {
        let direction = self.sample(Partner::Bsdf, random);
        let pdf = self.pdf(Partner::Bsdf, direction);
        (pdf > 0.0).then(|| LiSample {
            direction,
            distance: f64::INFINITY,
            weight: self.radiance(direction) / pdf,
            pdf: Some(pdf),
        })
    }

    fn pdf_li(&self, _: &Receiver, ray: &Ray, _: &LightHit) -> f64 {
        self.pdf(Partner::Bsdf, ray.direction)
    }

    fn intersect(&self, ray: &Ray) -> Option<LightHit> {
        Some(LightHit { distance: f64::INFINITY, radiance: self.radiance(ray.direction), triangle: None })
    }
}
