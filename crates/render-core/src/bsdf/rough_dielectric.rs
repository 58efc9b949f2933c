//! A rough boundary between air and a clear dielectric: ground glass (Walter et al. 2007, "Microfacet Models for
//! Refraction through Rough Surfaces").
//!
//! Each microfacet reflects and refracts as a smooth boundary does, by the exact Fresnel equations. Light that meets
//! several facets is left out. So the boundary scatters less light than arrives; the scene format has a table of the
//! loss. Reflected light is masked as heights correlate, transmitted light as if both sides were independent.
//!
//! A boundary whose facets spread less than [`MIN_ALPHA`] is a smooth one.

use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::dielectric::{Dielectric, MAX_ABSORPTION, beyond_body, check_priority, crown_glass};
use super::fresnel::{fresnel, reflect, refract};
use super::microfacet::{Ggx, MIN_ALPHA};
use super::shading_frame::ShadingFrame;
use super::{Bsdf, BsdfSample, Interior, MaterialSettings, SampleKind, SurfacePoint};
use crate::exchange::SurfaceModel;
use crate::settings::check::{check_range, check_triple};
use crate::settings::{Check, JsonPath, Triple, is_default};
use crate::texture::Bitmaps;

/// A rough boundary of a clear dielectric, such as ground glass: the outside is on the side to which the triangles'
/// normals point, from which their corners are seen counterclockwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct RoughDielectricMaterial {
    /// Index of refraction behind the surface, 1 to 3.
    #[serde(default = "crown_glass")]
    #[schemars(range(min = 1.0, max = 3.0))]
    pub index_of_refraction: f64,
    /// Roughness, 0 (smooth) to 1. Its square is the width of the distribution of microfacets (GGX).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub roughness: f64,
    /// What the body absorbs, per metre: light over a distance d in it is multiplied by `exp(-absorption * d)`.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(inner(range(min = 0.0, max = MAX_ABSORPTION)))]
    pub absorption: Triple,
    /// Where bodies overlap, the place belongs to the one with the highest priority, -1000 to 1000.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(range(min = -1000, max = 1000))]
    pub priority: i32,
}

/// Nearer to 1 than this, an index of refraction bends light too little to spread it.
const LEAST_BENDING: f64 = 1e-3;

impl RoughDielectricMaterial {
    fn alpha(&self) -> f64 {
        self.roughness * self.roughness
    }
}

impl MaterialSettings for RoughDielectricMaterial {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_range(self.index_of_refraction, 1.0, 3.0, &path.member("index_of_refraction"))?;
        check_range(self.roughness, 0.0, 1.0, &path.member("roughness"))?;
        check_triple(self.absorption, 0.0, MAX_ABSORPTION, &path.member("absorption"))?;
        check_priority(self.priority, path)
    }

    fn is_delta(&self) -> bool {
        self.alpha() < MIN_ALPHA || self.index_of_refraction - 1.0 < LEAST_BENDING
    }

    fn uses_normals(&self) -> bool {
        true
    }

    fn model(&self, _: &Bitmaps<'_>) -> Option<SurfaceModel> {
        let index_of_refraction = self.index_of_refraction;
        Some(match self.is_delta() {
            true => SurfaceModel::Dielectric { index_of_refraction },
            false => SurfaceModel::RoughDielectric { index_of_refraction, roughness: self.roughness },
        })
    }

    fn beyond_model(&self) -> Vec<&'static str> {
        beyond_body(self.absorption, self.priority)
    }

    fn build(&self, _: &Bitmaps<'_>) -> Arc<dyn Bsdf> {
        let (index_of_refraction, absorption) = (self.index_of_refraction, DVec3::from(self.absorption));
        let priority = self.priority;
        if self.is_delta() {
            return Arc::new(Dielectric { index_of_refraction, absorption, priority });
        }
        let facets = Ggx { alpha: self.alpha() };
        Arc::new(RoughDielectric { index_of_refraction, absorption, priority, facets })
    }
}

/// A boundary of microfacets.
#[derive(Clone, Copy, Debug, PartialEq)]
struct RoughDielectric {
    index_of_refraction: f64,
    absorption: DVec3,
    priority: i32,
    facets: Ggx,
}

/// The boundary as a path meets it.
struct SeenBoundary {
    frame: ShadingFrame,
    facets: Ggx,
    /// Index of refraction behind the boundary over that before it.
    ratio: f64,
}

/// A direction in which the boundary scatters, with the facet that does it.
struct Scattered {
    light: DVec3,
    /// Unit normal, on the side of the view.
    facet: DVec3,
    is_transmitted: bool,
    /// The part of light that the facet reflects.
    reflectance: f64,
}

impl RoughDielectric {
    fn seen(&self, at: &SurfacePoint, incident: DVec3) -> SeenBoundary {
        let leaves = incident.dot(at.normals.geometric) > 0.0;
        let ratio = if leaves { 1.0 / self.index_of_refraction } else { self.index_of_refraction };
        SeenBoundary { frame: ShadingFrame::new(at, incident), facets: self.facets, ratio }
    }
}

impl SeenBoundary {
    /// What scatters light into a direction; `None` where nothing does.
    fn scattered(&self, outgoing: DVec3) -> Option<Scattered> {
        let view = self.frame.view;
        if let Some(light) = self.frame.reflected(outgoing) {
            let facet = (view + light).normalize();
            let reflectance = fresnel(view.dot(facet), self.ratio).reflectance();
            return Some(Scattered { light, facet, is_transmitted: false, reflectance });
        }
        let light = self.frame.transmitted(outgoing)?;
        let sum = (view + light * self.ratio).try_normalize()?;
        let facet = if sum.z < 0.0 { -sum } else { sum };
        let goes_through = view.dot(facet) > 0.0 && light.dot(facet) < 0.0;
        let reflectance = fresnel(view.dot(facet), self.ratio).reflectance();
        goes_through.then_some(Scattered { light, facet, is_transmitted: true, reflectance })
    }

    /// BSDF times cosine, for radiance that is carried back along the path.
    fn eval(&self, outgoing: DVec3) -> f64 {
        let Some(Scattered { light, facet, is_transmitted, reflectance }) = self.scattered(outgoing) else {
            return 0.0;
        };
        let (view, facets) = (self.frame.view, self.facets);
        if !is_transmitted {
            return reflectance * facets.distribution(facet) * facets.visibility(view, light) * light.z;
        }
        // Equation 21 of Walter et al.; the radiance before the boundary is that behind it over the squared ratio.
        (1.0 - reflectance) * facets.visible_density(view, facet) * facets.masking(light) * -light.dot(facet)
            / self.bending(view, light, facet)
    }

    fn pdf(&self, outgoing: DVec3) -> f64 {
        let Some(Scattered { light, facet, is_transmitted, reflectance }) = self.scattered(outgoing) else {
            return 0.0;
        };
        let (view, facets) = (self.frame.view, self.facets);
        if !is_transmitted {
            return reflectance * facets.distribution(facet) * facets.masking_over_cosine(view) * 0.25;
        }
        let jacobian = self.ratio * self.ratio * -light.dot(facet) / self.bending(view, light, facet);
        (1.0 - reflectance) * facets.visible_density(view, facet) * jacobian
    }

    /// The squared denominator of equations 17 and 21 of Walter et al.
    fn bending(&self, view: DVec3, light: DVec3, facet: DVec3) -> f64 {
        let sum = view.dot(facet) + self.ratio * light.dot(facet);
        sum * sum
    }

    fn sample(&self, stream: &mut SampleStream) -> Option<BsdfSample> {
        let (choice, random) = (stream.next_1d(), stream.next_2d());
        let view = self.frame.view;
        let facet = self.facets.sample_visible(view, random);
        let (local, is_transmitted) = match refract(-view, facet, 1.0, self.ratio) {
            Some(refraction) if choice < refraction.transmittance() => (refraction.direction, true),
            _ => (-reflect(view, facet), false),
        };
        // A tilted facet may refract light to the front of the surface, or mirror it behind. The model leaves it out.
        if is_transmitted != (local.z < 0.0) {
            return None;
        }
        let direction = self.frame.vector_to_world(local).normalize();
        let density = self.pdf(direction);
        (density > 0.0).then(|| BsdfSample {
            direction,
            weight: DVec3::splat(self.eval(direction) / density),
            kind: SampleKind::Density(density),
        })
    }
}

impl Bsdf for RoughDielectric {
    fn absorption(&self) -> DVec3 {
        self.absorption
    }

    fn interior(&self) -> Option<Interior> {
        let Self { index_of_refraction, absorption, priority, .. } = *self;
        Some(Interior { index_of_refraction, absorption, priority })
    }

    fn between(&self, ratio: f64) -> Option<Arc<dyn Bsdf>> {
        let Self { absorption, priority, facets, .. } = *self;
        if (ratio - 1.0).abs() < LEAST_BENDING {
            return Some(Arc::new(Dielectric { index_of_refraction: ratio, absorption, priority }));
        }
        Some(Arc::new(Self { index_of_refraction: ratio, absorption, priority, facets }))
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

    fn eval(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> DVec3 {
        DVec3::splat(self.seen(at, incident).eval(outgoing))
    }

    fn pdf(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> f64 {
        self.seen(at, incident).pdf(outgoing)
    }

    fn sample(&self, at: &SurfacePoint, incident: DVec3, stream: &mut SampleStream) -> Option<BsdfSample> {
        self.seen(at, incident).sample(stream)
    }
}
