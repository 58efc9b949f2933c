//! A disk of uniform radiance that shines to one side.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::flat::{FlatLight, FlatShape};
use super::{Emitter, LightAssets, LightSettings};
use crate::exchange::LightModel;
use crate::geometry::Frame;
use crate::settings::check::{check_above, check_direction, check_triple};
use crate::settings::limits::{MAX_EMISSION, MAX_LIGHT_COORDINATE};
use crate::settings::{Check, JsonPath, Triple};
use crate::texture::Bitmaps;

/// Corners of the polygon that stands for a disk: it lies in it, and lacks 0.04 percent of its radius.
const CORNERS: u32 = 128;

/// A disk that shines to the side to which `normal` points; its other side is black.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct DiskLight {
    /// A short name, used in messages; no two lights share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Its centre.
    pub centre: Triple,
    /// Direction to which it shines, perpendicular to it.
    pub normal: Triple,
    /// Its radius, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
    /// Emitted radiance, W/(m2 sr).
    #[schemars(inner(range(min = 0.0)))]
    pub radiance: Triple,
}

impl LightSettings for DiskLight {
    fn name(&self) -> &str {
        &self.name
    }

    fn place(&self) -> Option<&'static str> {
        Some("centre")
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_triple(self.centre, -MAX_LIGHT_COORDINATE, MAX_LIGHT_COORDINATE, &path.member("centre"))?;
        check_direction(self.normal, &path.member("normal"))?;
        check_above(self.radius, 0.0, MAX_LIGHT_COORDINATE, &path.member("radius"))?;
        check_triple(self.radiance, 0.0, MAX_EMISSION, &path.member("radiance"))
    }

    fn model(&self, _: &Bitmaps<'_>) -> Option<LightModel> {
        Some(LightModel::Disk {
            centre: self.centre,
            normal: DVec3::from(self.normal).normalize().to_array(),
            radius: self.radius,
            radiance: self.radiance,
        })
    }

    fn build(&self, _: &LightAssets) -> Arc<dyn Emitter> {
        Arc::new(FlatLight {
            frame: Frame { origin: self.centre.into(), ..Frame::around(DVec3::from(self.normal).normalize()) },
            shape: Disk { radius: self.radius },
            radiance: self.radiance.into(),
        })
    }
}

/// A disk of a radius in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Disk {
    radius: f64,
}

impl FlatShape for Disk {
    fn area(&self) -> f64 {
        PI * self.radius * self.radius
    }

    fn extent(&self) -> f64 {
        self.radius
    }

    fn half_extents(&self, frame: &Frame) -> DVec3 {
        let normal = frame.axes.z_axis;
        (DVec3::ONE - normal * normal).max(DVec3::ZERO).map(f64::sqrt) * self.radius
    }

    fn sample(&self, random: DVec2) -> DVec2 {
        let (sin, cos) = libm::sincos(2.0 * PI * random.y);
        DVec2::new(cos, sin) * (self.radius * random.x.sqrt())
    }

    fn holds(&self, point: DVec2) -> bool {
        point.length_squared() <= self.radius * self.radius
    }

    fn corners(&self) -> Vec<DVec2> {
        let corner = |step: u32| {
            let (sin, cos) = libm::sincos(2.0 * PI * f64::from(step) / f64::from(CORNERS));
            DVec2::new(self.radius * cos, self.radius * sin)
        };
        (0..CORNERS).map(corner).collect()
    }
}
