//! A rectangle of uniform radiance that shines to one side.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::flat::{FlatLight, FlatShape};
use super::{Emitter, LightAssets, LightSettings};
use crate::exchange::LightModel;
use crate::geometry::Frame;
use crate::settings::check::{MIN_SINE, Numbers, check_direction, check_triple};
use crate::settings::limits::{MAX_EMISSION, MAX_LIGHT_COORDINATE};
use crate::settings::{Check, JsonPath, SceneError, Triple};
use crate::texture::Bitmaps;

/// A rectangle that shines to the side to which `edge_u` cross `edge_v` points; its other side is black.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct RectangleLight {
    /// A short name, used in messages; no two lights share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Its centre.
    pub centre: Triple,
    /// One edge, metres.
    pub edge_u: Triple,
    /// The other edge, metres, perpendicular to `edge_u`.
    pub edge_v: Triple,
    /// Emitted radiance, W/(m2 sr).
    #[schemars(inner(range(min = 0.0)))]
    pub radiance: Triple,
}

impl LightSettings for RectangleLight {
    fn name(&self) -> &str {
        &self.name
    }

    fn place(&self) -> Option<&'static str> {
        Some("centre")
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_triple(self.centre, -MAX_LIGHT_COORDINATE, MAX_LIGHT_COORDINATE, &path.member("centre"))?;
        let u = check_direction(self.edge_u, &path.member("edge_u"))?;
        let v = check_direction(self.edge_v, &path.member("edge_v"))?;
        if u.dot(v).abs() > MIN_SINE {
            let expected = format!("a vector perpendicular to edge_u ({})", Numbers(&self.edge_u));
            return Err(SceneError::value(&path.member("edge_v"), Numbers(&self.edge_v), expected));
        }
        check_triple(self.radiance, 0.0, MAX_EMISSION, &path.member("radiance"))
    }

    fn model(&self, _: &Bitmaps<'_>) -> Option<LightModel> {
        let Self { centre, edge_u, edge_v, radiance, .. } = *self;
        Some(LightModel::Rectangle { centre, edge_u, edge_v, radiance })
    }

    fn build(&self, _: &LightAssets) -> Arc<dyn Emitter> {
        let (edge_u, edge_v) = (DVec3::from(self.edge_u), DVec3::from(self.edge_v));
        let normal = edge_u.cross(edge_v).normalize();
        let x = edge_u.normalize();
        Arc::new(FlatLight {
            // The second edge is perpendicular only as far as decimal numbers could say.
            frame: Frame::new(DVec3::from(self.centre), x, normal.cross(x)),
            shape: Rectangle { half_size: [edge_u.length() / 2.0, edge_v.length() / 2.0] },
            radiance: self.radiance.into(),
        })
    }
}

/// A rectangle along x and y.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rectangle {
    /// Half the extent along x and y, metres.
    half_size: [f64; 2],
}

impl FlatShape for Rectangle {
    fn area(&self) -> f64 {
        4.0 * self.half_size[0] * self.half_size[1]
    }

    fn extent(&self) -> f64 {
        let [x, y] = self.half_size;
        (x * x + y * y).sqrt()
    }

    fn half_extents(&self, frame: &Frame) -> DVec3 {
        frame.axes.x_axis.abs() * self.half_size[0] + frame.axes.y_axis.abs() * self.half_size[1]
    }

    fn sample(&self, random: DVec2) -> DVec2 {
        let [x, y] = self.half_size;
        DVec2::new((2.0 * random.x - 1.0) * x, (2.0 * random.y - 1.0) * y)
    }

    fn holds(&self, point: DVec2) -> bool {
        point.x.abs() <= self.half_size[0] && point.y.abs() <= self.half_size[1]
    }

    fn corners(&self) -> Vec<DVec2> {
        let [x, y] = self.half_size;
        [[-x, -y], [x, -y], [x, y], [-x, y]].map(DVec2::from).into()
    }
}
