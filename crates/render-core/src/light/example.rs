//! An example of a light of its own: an ellipse. `docs/extending.md` leads here; only tests compile it.
//!
//! A light that is to stay also gets a line in `registry.rs`: `"ellipse" => Ellipse(EllipseLight),`.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::flat::{FlatLight, FlatShape};
use super::{Emitter, LightAssets, LightSettings};
use crate::geometry::Frame;
use crate::settings::check::{check_above, check_direction, check_triple};
use crate::settings::limits::{MAX_EMISSION, MAX_LIGHT_COORDINATE};
use crate::settings::{Check, JsonPath, Triple};

/// An ellipse that shines to the side to which `normal` points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub(super) struct EllipseLight {
    /// A short name, used in messages; no two lights share one.
    pub(super) name: String,
    /// Its centre.
    pub(super) centre: Triple,
    /// Direction to which it shines, perpendicular to it.
    pub(super) normal: Triple,
    /// Half its axes, metres.
    pub(super) half_axes: [f64; 2],
    /// Emitted radiance, W/(m2 sr).
    pub(super) radiance: Triple,
}

impl LightSettings for EllipseLight {
    fn name(&self) -> &str {
        &self.name
    }

    fn place(&self) -> Option<&'static str> {
        Some("centre")
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_triple(self.centre, -MAX_LIGHT_COORDINATE, MAX_LIGHT_COORDINATE, &path.member("centre"))?;
        check_direction(self.normal, &path.member("normal"))?;
        for (index, half_axis) in self.half_axes.into_iter().enumerate() {
            check_above(half_axis, 0.0, MAX_LIGHT_COORDINATE, &path.member("half_axes").element(index))?;
        }
        check_triple(self.radiance, 0.0, MAX_EMISSION, &path.member("radiance"))
    }

    fn build(&self, _: &LightAssets) -> Arc<dyn Emitter> {
        Arc::new(FlatLight {
            frame: Frame { origin: self.centre.into(), ..Frame::around(DVec3::from(self.normal).normalize()) },
            shape: Ellipse { half_axes: self.half_axes.into() },
            radiance: self.radiance.into(),
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Ellipse {
    half_axes: DVec2,
}

impl FlatShape for Ellipse {
    fn area(&self) -> f64 {
        PI * self.half_axes.x * self.half_axes.y
    }

    fn extent(&self) -> f64 {
        self.half_axes.max_element()
    }

    fn half_extents(&self, frame: &Frame) -> DVec3 {
        let [along, across] = [frame.axes.x_axis * self.half_axes.x, frame.axes.y_axis * self.half_axes.y];
        (along * along + across * across).map(f64::sqrt)
    }

    fn sample(&self, random: DVec2) -> DVec2 {
        let (sin, cos) = libm::sincos(2.0 * PI * random.y);
        DVec2::new(cos, sin) * self.half_axes * random.x.sqrt()
    }

    fn holds(&self, point: DVec2) -> bool {
        (point / self.half_axes).length_squared() <= 1.0
    }

    fn corners(&self) -> Vec<DVec2> {
        let corner = |step: u32| {
            let (sin, cos) = libm::sincos(2.0 * PI * f64::from(step) / 64.0);
            DVec2::new(cos, sin) * self.half_axes
        };
        (0..64).map(corner).collect()
    }
}
