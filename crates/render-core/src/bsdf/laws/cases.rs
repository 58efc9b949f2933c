//! What the laws are tested on: materials as scene files have them, seen at many angles, and materials with a fault.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;
use serde_json::{Value, json};

use super::super::example::ParchmentMaterial;
use super::super::fresnel::{reflect, refract};
use super::super::{Bsdf, BsdfSample, DeltaBsdf, MaterialDescription, MaterialSettings, Normals, SurfacePoint};
use super::cells::Cells;
use crate::settings::JsonPath;
use crate::texture::TextureCoordinates;

/// Widths of the distribution of microfacets.
pub(super) const ALPHAS: [f64; 5] = [0.02, 0.1, 0.3, 0.6, 1.0];

/// Cosines of the direction to the viewer.
pub(super) const COSINES: [f64; 5] = [0.05, 0.2, 0.5, 0.8, 1.0];

/// Index of refraction of the dielectrics.
pub(super) const GLASS: f64 = 1.5;

/// A material, as a path meets it.
#[derive(Clone, Debug)]
pub(super) struct Case {
    pub(super) name: String,
    pub(super) bsdf: Arc<dyn Bsdf>,
    pub(super) at: SurfacePoint,
    pub(super) incident: DVec3,
    /// About how far its narrowest lobe goes, radians.
    pub(super) width: f64,
    /// Index of refraction behind the surface.
    pub(super) index_behind: f64,
}

/// The material of a scene file.
pub(super) fn material(description: Value) -> Arc<dyn Bsdf> {
    let material: MaterialDescription = serde_json::from_value(description).unwrap();
    material.check(&JsonPath::Root).unwrap();
    material.build(&BTreeMap::new())
}

/// The example of docs/extending.md.
fn parchment() -> Arc<dyn Bsdf> {
    let example: ParchmentMaterial = serde_json::from_value(json!({"albedo": [0.8, 0.7, 0.6]})).unwrap();
    example.check(&JsonPath::Root).unwrap();
    example.build(&BTreeMap::new())
}

pub(super) fn diffuse() -> Arc<dyn Bsdf> {
    material(json!({"diffuse": {"reflectance": {"colour": [0.6, 0.5, 0.4]}}}))
}

/// A layer that lets more blue light through than it reflects, and less red light.
pub(super) fn translucent() -> Arc<dyn Bsdf> {
    material(json!({"diffuse_transmission": {
        "reflectance": {"colour": [0.6, 0.3, 0.1]}, "transmittance": {"colour": [0.3, 0.35, 0.4]}
    }}))
}

/// A conductor that reflects all light.
pub(super) fn white_conductor(alpha: f64) -> Arc<dyn Bsdf> {
    material(json!({"conductor": {"reflectance": {"colour": [1, 1, 1]}, "roughness": alpha.sqrt()}}))
}

fn copper(alpha: f64) -> Arc<dyn Bsdf> {
    material(json!({"conductor": {"reflectance": {"colour": [0.95, 0.64, 0.54]}, "roughness": alpha.sqrt()}}))
}

pub(super) fn rough_glass(alpha: f64) -> Arc<dyn Bsdf> {
    material(json!({"rough_dielectric": {"index_of_refraction": GLASS, "roughness": alpha.sqrt()}}))
}

/// A material of glTF with some members besides its roughness.
pub(super) fn metallic_roughness(alpha: f64, members: &Value) -> Arc<dyn Bsdf> {
    let mut settings = members.clone();
    settings["roughness"] = json!(alpha.sqrt());
    material(json!({"metallic_roughness": settings}))
}

pub(super) fn plastic(alpha: f64) -> Arc<dyn Bsdf> {
    metallic_roughness(alpha, &json!({"metallic": 0, "base_colour": {"colour": [0.7, 0.4, 0.1]}}))
}

/// A thin wall that lets a part of the light through.
pub(super) fn frosted(alpha: f64) -> Arc<dyn Bsdf> {
    let members = json!({
        "metallic": 0.2, "base_colour": {"colour": [0.9, 0.6, 0.3]}, "specular": 0.8, "transmission": 0.7
    });
    metallic_roughness(alpha, &members)
}

pub(super) fn half_metal(alpha: f64) -> Arc<dyn Bsdf> {
    let specular_colour = json!({"colour": [0.9, 1, 0.5]});
    let members = json!({
        "metallic": 0.5, "base_colour": {"colour": [0.7, 0.4, 0.1]}, "index_of_refraction": 2.2, "specular": 0.6,
        "specular_colour": specular_colour
    });
    metallic_roughness(alpha, &members)
}

/// A normal that is along no axis.
fn normal() -> DVec3 {
    DVec3::new(0.2, -0.3, 0.9).normalize()
}

/// A surface whose interpolated normal is turned by an angle, degrees.
pub(super) fn tilted(degrees: f64) -> SurfacePoint {
    let geometric = normal();
    let (across, _) = geometric.any_orthonormal_pair();
    let (sin, cos) = libm::sincos(degrees.to_radians());
    let shading = if degrees == 0.0 { geometric } else { geometric * cos + across * sin };
    SurfacePoint { normals: Normals { geometric, shading }, texture: TextureCoordinates::default(), colour: DVec3::ONE }
}

/// A direction away from a flat surface with this cosine to its normal.
pub(super) fn direction(cosine: f64, turn: f64) -> DVec3 {
    let (u, v) = normal().any_orthonormal_pair();
    let (sin, cos) = libm::sincos(turn);
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    (u * (sine * cos) + v * (sine * sin) + normal() * cosine).normalize()
}

impl Case {
    /// A flat surface, seen from a direction with this cosine to its normal: negative from behind.
    pub(super) fn flat(name: &str, bsdf: Arc<dyn Bsdf>, alpha: f64, cosine: f64) -> Self {
        let name = format!("{name} with alpha {alpha} at cosine {cosine}");
        Self { name, bsdf, at: tilted(0.0), incident: -direction(cosine, 0.7), width: alpha, index_behind: GLASS }
    }

    /// The cells of reflection and of transmission.
    pub(super) fn cells(&self) -> [Cells; 2] {
        let side = self.at.normals.facing(self.incident);
        let normal = self.at.normals.shading;
        let ratio = if self.incident.dot(self.at.normals.geometric) < 0.0 {
            self.index_behind
        } else {
            1.0 / self.index_behind
        };
        let refracted = refract(self.incident, normal, 1.0, ratio).map_or(self.incident, |found| found.direction);
        // Reflection opens a lobe to twice the width, and a thin wall transmits its mirror image.
        let reflected = Cells::new(reflect(self.incident, normal), 2.0 * self.width, side);
        let width = if self.index_behind == 1.0 { 2.0 * self.width } else { self.width };
        [reflected, Cells::new(refracted, width, -side)]
    }

    /// The value of the BSDF times cosine.
    pub(super) fn value(&self, outgoing: DVec3) -> DVec3 {
        self.bsdf.scale(&self.at) * self.bsdf.eval(&self.at, self.incident, outgoing)
    }

    /// The same surface with another material.
    pub(super) fn with(&self, name: &str, bsdf: Arc<dyn Bsdf>) -> Self {
        Self { name: format!("{}: {name}", self.name), bsdf, ..self.clone() }
    }
}

/// All materials that scatter into a solid angle, at all angles, widths and sides.
pub(super) fn scattering() -> Vec<Case> {
    let mut cases = Vec::new();
    for cosine in COSINES {
        cases.push(Case::flat("diffuse", diffuse(), 1.0, cosine));
        cases.push(Case::flat("parchment", parchment(), 1.0, -cosine));
        cases.push(Case::flat("diffuse layer from the front", translucent(), 1.0, cosine));
        cases.push(Case::flat("diffuse layer from behind", translucent(), 1.0, -cosine));
        for alpha in ALPHAS {
            cases.push(Case::flat("copper", copper(alpha), alpha, -cosine));
            cases.push(Case::flat("glass from outside", rough_glass(alpha), alpha, cosine));
            cases.push(Case::flat("glass from inside", rough_glass(alpha), alpha, -cosine));
            cases.push(Case::flat("plastic", plastic(alpha), alpha, cosine));
            cases.push(Case::flat("half metal", half_metal(alpha), alpha, cosine));
            cases.push(Case { index_behind: 1.0, ..Case::flat("frosted", frosted(alpha), alpha, -cosine) });
        }
    }
    for (name, bsdf) in [("copper", copper(0.3)), ("glass", rough_glass(0.3)), ("plastic", plastic(0.3))] {
        for cosine in [0.2, 0.8] {
            let flat = Case::flat(&format!("tilted {name}"), bsdf.clone(), 0.3, cosine);
            cases.push(Case { at: tilted(40.0), ..flat });
        }
    }
    cases
}

/// What a fault makes of a number of the material, given the point and both directions.
type Fault<T> = Box<dyn Fn(T, &SurfacePoint, DVec3, DVec3) -> T + Send + Sync>;

/// A material with a fault.
pub(super) struct Faulty {
    inner: Arc<dyn Bsdf>,
    pdf: Fault<f64>,
    eval: Fault<DVec3>,
}

impl Faulty {
    /// Directions are drawn with another density than stated.
    pub(super) fn of_pdf(
        inner: Arc<dyn Bsdf>,
        fault: impl Fn(f64, &SurfacePoint, DVec3, DVec3) -> f64 + Send + Sync + 'static,
    ) -> Arc<dyn Bsdf> {
        Arc::new(Self { inner, pdf: Box::new(fault), eval: Box::new(|value, _, _, _| value) })
    }

    /// Light is scattered otherwise than it should.
    pub(super) fn of_eval(
        inner: Arc<dyn Bsdf>,
        fault: impl Fn(DVec3, &SurfacePoint, DVec3, DVec3) -> DVec3 + Send + Sync + 'static,
    ) -> Arc<dyn Bsdf> {
        Arc::new(Self { inner, pdf: Box::new(|value, _, _, _| value), eval: Box::new(fault) })
    }
}

impl fmt::Debug for Faulty {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:?} with a fault", self.inner)
    }
}

impl Bsdf for Faulty {
    fn as_delta(&self) -> Option<&dyn DeltaBsdf> {
        None
    }

    fn transmits(&self) -> bool {
        self.inner.transmits()
    }

    fn albedo(&self, at: &SurfacePoint) -> DVec3 {
        self.inner.albedo(at)
    }

    fn scale(&self, at: &SurfacePoint) -> DVec3 {
        self.inner.scale(at)
    }

    fn eval(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> DVec3 {
        (self.eval)(self.inner.eval(at, incident, outgoing), at, incident, outgoing)
    }

    fn pdf(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> f64 {
        (self.pdf)(self.inner.pdf(at, incident, outgoing), at, incident, outgoing)
    }

    fn sample(&self, at: &SurfacePoint, incident: DVec3, stream: &mut SampleStream) -> Option<BsdfSample> {
        self.inner.sample(at, incident, stream)
    }
}
