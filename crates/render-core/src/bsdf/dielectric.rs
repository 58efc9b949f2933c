//! The boundary of a body of a clear dielectric, such as glass or water. Around it is air, or another body
//! (`scene/media.rs`).
//!
//! The two normals of a point may disagree so much that a reflected ray would go through the surface, or a refracted
//! one would not. There the surface is black.

use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fresnel::{Refraction, reflect, refract};
use super::polarisation::{Fresnel, Polarisation};
use super::{
    Bsdf, BsdfSample, Crossing, DeltaBsdf, Interior, MaterialSettings, Mirrored, Normals, SurfacePoint, sample_delta,
};
use crate::exchange::SurfaceModel;
use crate::settings::check::{check_range, check_triple};
use crate::settings::{Check, JsonPath, Triple, is_default};
use crate::texture::Bitmaps;

/// A smooth boundary of a clear dielectric, such as glass or water: the outside is on the side to which the triangles'
/// normals point, from which their corners are seen counterclockwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct DielectricMaterial {
    /// Index of refraction behind the surface, 1 to 3.
    #[serde(default = "crown_glass")]
    #[schemars(range(min = 1.0, max = 3.0))]
    pub index_of_refraction: f64,
    /// What the body absorbs, per metre: light over a distance d in it is multiplied by `exp(-absorption * d)`.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(inner(range(min = 0.0, max = MAX_ABSORPTION)))]
    pub absorption: Triple,
    /// Where bodies overlap, the place belongs to the one with the highest priority, -1000 to 1000.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(range(min = -1000, max = 1000))]
    pub priority: i32,
}

/// Largest absorption, per metre.
pub(super) const MAX_ABSORPTION: f64 = 1e9;

/// Largest priority of a body, and least with the other sign.
pub(crate) const MAX_PRIORITY: i32 = 1000;

/// Index of refraction of crown glass.
pub(crate) fn crown_glass() -> f64 {
    1.52
}

impl MaterialSettings for DielectricMaterial {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_range(self.index_of_refraction, 1.0, 3.0, &path.member("index_of_refraction"))?;
        check_triple(self.absorption, 0.0, MAX_ABSORPTION, &path.member("absorption"))?;
        check_priority(self.priority, path)
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn makes_caustics(&self) -> bool {
        true
    }

    fn model(&self, _: &Bitmaps<'_>) -> Option<SurfaceModel> {
        Some(SurfaceModel::Dielectric { index_of_refraction: self.index_of_refraction })
    }

    fn beyond_model(&self) -> Vec<&'static str> {
        beyond_body(self.absorption, self.priority)
    }

    fn build(&self, _: &Bitmaps<'_>) -> Arc<dyn Bsdf> {
        let (index_of_refraction, absorption) = (self.index_of_refraction, self.absorption.into());
        Arc::new(Dielectric { index_of_refraction, absorption, priority: self.priority })
    }
}

/// A boundary between air, on the side to which the normal points, and a clear dielectric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Dielectric {
    /// Index of refraction behind the boundary.
    pub(super) index_of_refraction: f64,
    /// What the body behind it absorbs, per metre.
    pub(super) absorption: DVec3,
    /// That of the body behind it.
    pub(super) priority: i32,
}

/// What a body has beyond the models of other programs.
pub(super) fn beyond_body(absorption: Triple, priority: i32) -> Vec<&'static str> {
    let absorbs = (absorption != [0.0; 3]).then_some("it absorbs nothing");
    absorbs.into_iter().chain((priority != 0).then_some("it has no priority")).collect()
}

/// Checks the member `priority` of what `path` names.
pub(crate) fn check_priority(priority: i32, path: &JsonPath<'_>) -> Check {
    check_range(priority, -MAX_PRIORITY, MAX_PRIORITY, &path.member("priority"))
}

impl DeltaBsdf for Dielectric {
    fn index_of_refraction(&self) -> Option<f64> {
        Some(self.index_of_refraction)
    }

    fn transmit(&self, direction: DVec3, normals: &Normals) -> Option<Crossing> {
        let ratio = self.ratio(direction, normals).filter(|_| normals.agree(direction))?;
        let Refraction { direction: refracted, fresnel } = refract(direction, normals.shading, 1.0, ratio)?;
        let goes_through = refracted.dot(normals.geometric) * direction.dot(normals.geometric) > 0.0;
        goes_through.then_some(Crossing { direction: refracted, ratio, fresnel })
    }

    fn reflect(&self, direction: DVec3, at: &SurfacePoint) -> Option<Mirrored> {
        let normals = &at.normals;
        let reflected = reflected(direction, normals)?;
        let ratio = self.ratio(direction, normals)?;
        let refraction = refract(direction, normals.shading, 1.0, ratio);
        let fresnel = refraction.map_or(Fresnel::TOTAL, |refraction| refraction.fresnel);
        Some(Mirrored { direction: reflected, colour: DVec3::ONE, fresnel })
    }
}

/// The mirrored direction; `None` where the normals contradict each other, or it would go through the triangle.
pub(super) fn reflected(direction: DVec3, normals: &Normals) -> Option<DVec3> {
    if !normals.agree(direction) {
        return None;
    }
    let reflected = reflect(direction, normals.shading);
    let comes_back = reflected.dot(normals.geometric) * direction.dot(normals.geometric) < 0.0;
    comes_back.then_some(reflected)
}

impl Bsdf for Dielectric {
    fn as_delta(&self) -> Option<&dyn DeltaBsdf> {
        Some(self)
    }

    fn absorption(&self) -> DVec3 {
        self.absorption
    }

    fn interior(&self) -> Option<Interior> {
        let Self { index_of_refraction, absorption, priority } = *self;
        Some(Interior { index_of_refraction, absorption, priority })
    }

    fn between(&self, ratio: f64) -> Option<Arc<dyn Bsdf>> {
        Some(Arc::new(Self { index_of_refraction: ratio, ..*self }))
    }

    fn transmits(&self) -> bool {
        true
    }

    fn albedo(&self, _: &SurfacePoint) -> DVec3 {
        DVec3::ONE
    }

    fn scale(&self, _: &SurfacePoint) -> DVec3 {
        DVec3::ONE
    }

    fn eval(&self, _: &SurfacePoint, _: DVec3, _: DVec3) -> DVec3 {
        DVec3::ZERO
    }

    fn pdf(&self, _: &SurfacePoint, _: DVec3, _: DVec3) -> f64 {
        0.0
    }

    fn sample(&self, at: &SurfacePoint, incident: DVec3, stream: &mut SampleStream) -> Option<BsdfSample> {
        sample_delta(self, at, incident, &mut { Polarisation::NONE }, stream)
    }
}
