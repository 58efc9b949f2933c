//! Lambertian reflection and Lambertian transmission: paper, cloth, paint on glass (`DiffuseTransmission` of pbrt-v4).

use std::f64::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Bsdf, BsdfSample, MaterialSettings, Opacity, SampleKind, SurfacePoint, is_one, one, opacity, textures};
use crate::exchange::{ColourModel, CoverModel, SurfaceModel};
use crate::geometry::Frame;
use crate::settings::check::Number;
use crate::settings::{Check, JsonPath, SceneError};
use crate::texture::{Bitmaps, Colour, ColourDescription, TextureUse, ValueDescription};

/// Lambertian reflection and transmission, alike from both sides: a thin layer that scatters all that it lets through.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct DiffuseTransmissionMaterial {
    /// Fraction of light that is scattered back.
    pub reflectance: ColourDescription,
    /// Fraction of light that is scattered to the other side. With `reflectance` it is at most 1 in each channel; where
    /// pictures say more, both are scaled down.
    pub transmittance: ColourDescription,
    /// The part of the surface that is there, 0 to 1. As much of all light goes by it unchanged.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub opacity: ValueDescription,
    /// Opacity, 0 to 1, from which on all of the surface is there; below it there is none. Without it, parts are there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opacity_threshold: Option<f64>,
}

/// By how much the sum of both fractions may exceed 1: decimal numbers round.
const ROUNDING: f64 = 1e-9;

impl MaterialSettings for DiffuseTransmissionMaterial {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        self.reflectance.check(&path.member("reflectance"))?;
        self.transmittance.check(&path.member("transmittance"))?;
        if let (ColourDescription::Colour(back), ColourDescription::Colour(through)) =
            (&self.reflectance, &self.transmittance)
        {
            for (channel, (back, through)) in back.iter().zip(through).enumerate() {
                if back + through > 1.0 + ROUNDING {
                    let place = path.member("transmittance");
                    let place = place.member("colour");
                    let expected = format!("at most 1 together with the reflectance, {}", Number(*back));
                    return Err(SceneError::value(&place.element(channel), Number(*through), expected));
                }
            }
        }
        opacity::check(&self.opacity, self.opacity_threshold, path)
    }

    fn is_delta(&self) -> bool {
        false
    }

    fn textures(&self) -> Vec<TextureUse<'_>> {
        let mut all = textures(&[("reflectance", &self.reflectance), ("transmittance", &self.transmittance)]);
        all.extend(self.opacity.texture("opacity"));
        all
    }

    fn opacity(&self, bitmaps: &Bitmaps<'_>) -> Option<Opacity> {
        Opacity::build(&self.opacity, self.opacity_threshold, bitmaps)
    }

    fn model(&self, bitmaps: &Bitmaps<'_>) -> Option<SurfaceModel> {
        let [reflectance, transmittance] =
            [&self.reflectance, &self.transmittance].map(|colour| ColourModel::of(&colour.build(bitmaps)));
        Some(SurfaceModel::DiffuseTransmission { reflectance, transmittance })
    }

    fn cover(&self, bitmaps: &Bitmaps<'_>) -> CoverModel {
        CoverModel::of_opacity(&self.opacity.build(bitmaps), self.opacity_threshold)
    }

    fn build(&self, bitmaps: &Bitmaps<'_>) -> Arc<dyn Bsdf> {
        let [reflectance, transmittance] = [&self.reflectance, &self.transmittance].map(|colour| colour.build(bitmaps));
        Arc::new(DiffuseTransmission { reflectance, transmittance })
    }
}

/// The BSDF `reflectance / pi` on the side from which light comes, and `transmittance / pi` on the other.
#[derive(Debug)]
struct DiffuseTransmission {
    reflectance: Colour,
    transmittance: Colour,
}

/// What is scattered at a point.
struct Parts {
    back: DVec3,
    through: DVec3,
    /// Probability with which a direction on the other side is drawn.
    chance_through: f64,
}

impl DiffuseTransmission {
    fn parts(&self, at: &SurfacePoint) -> Parts {
        let [back, through] = [&self.reflectance, &self.transmittance].map(|colour| colour.at(at.texture));
        let scale = (back + through).max(DVec3::ONE).recip();
        let [most_back, most_through] = [back, through].map(DVec3::max_element);
        let sum = most_back + most_through;
        let chance_through = if sum > 0.0 { most_through / sum } else { 0.0 };
        Parts { back: back * scale, through: through * scale, chance_through }
    }
}

impl Bsdf for DiffuseTransmission {
    fn transmits(&self) -> bool {
        true
    }

    fn gathers_behind(&self) -> bool {
        true
    }

    fn albedo(&self, at: &SurfacePoint) -> DVec3 {
        let Parts { back, through, .. } = self.parts(at);
        back + through
    }

    fn scale(&self, _: &SurfacePoint) -> DVec3 {
        DVec3::splat(FRAC_1_PI)
    }

    fn eval(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> DVec3 {
        let cosine = outgoing.dot(at.normals.facing(incident));
        let Parts { back, through, .. } = self.parts(at);
        if cosine > 0.0 { back * cosine } else { through * -cosine }
    }

    fn pdf(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> f64 {
        let cosine = outgoing.dot(at.normals.facing(incident));
        let chance_through = self.parts(at).chance_through;
        let chance = if cosine > 0.0 { 1.0 - chance_through } else { chance_through };
        chance * cosine.abs() * FRAC_1_PI
    }

    fn sample(&self, at: &SurfacePoint, incident: DVec3, stream: &mut SampleStream) -> Option<BsdfSample> {
        let (random, side) = (stream.next_2d(), stream.next_1d());
        let cosine = (1.0 - random.x).sqrt();
        let (sin, cos) = libm::sincos(2.0 * PI * random.y);
        let sine = random.x.sqrt();
        let local = DVec3::new(sine * cos, sine * sin, cosine);
        let Parts { back, through, chance_through } = self.parts(at);
        let facing = at.normals.facing(incident);
        let (normal, light, chance) = if side < chance_through {
            (-facing, through, chance_through)
        } else {
            (facing, back, 1.0 - chance_through)
        };
        (cosine > 0.0 && light != DVec3::ZERO).then(|| BsdfSample {
            direction: Frame::around(normal).vector_to_world(local),
            weight: light / chance,
            kind: SampleKind::Density(chance * cosine * FRAC_1_PI),
        })
    }
}
