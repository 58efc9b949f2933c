//! Materials: one file for each kind, with its settings in the scene file, their checks, and how it scatters light.
//!
//! `registry` lists the kinds. Everything else sees a material through [`Bsdf`] and never asks for its kind.
//!
//! A mesh has two normals. That of the triangle says on which side a ray is. The interpolated one says where the ray
//! goes.

mod albedo_table;
mod conductor;
mod dielectric;
mod diffuse;
mod diffuse_transmission;
#[cfg(test)]
mod example;
pub mod fresnel;
mod glossy;
#[cfg(test)]
mod laws;
mod metallic_roughness;
mod microfacet;
mod mirror;
mod opacity;
pub mod polarisation;
mod registry;
mod rough_dielectric;
mod shading_frame;
#[cfg(test)]
mod tests;
mod thin_wall;

use std::fmt;
use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;

use polarisation::{Fresnel, Polarisation};

pub use conductor::ConductorMaterial;
pub use dielectric::DielectricMaterial;
pub(crate) use dielectric::{check_priority, crown_glass};
pub use diffuse::DiffuseMaterial;
pub use diffuse_transmission::DiffuseTransmissionMaterial;
pub use metallic_roughness::MetallicRoughnessMaterial;
pub use mirror::MirrorMaterial;
pub use opacity::Opacity;
pub use registry::MaterialDescription;
pub use rough_dielectric::RoughDielectricMaterial;
pub use thin_wall::ThinWallMaterial;

use crate::exchange::{CoverModel, SurfaceModel};
use crate::settings::{Check, JsonPath};
use crate::texture::{
    Bitmaps, ColourDescription, NormalMap, NormalMapDescription, TextureCoordinates, TextureUse, ValueDescription,
};

/// The settings of a material in the scene file.
pub trait MaterialSettings {
    /// Checks them.
    ///
    /// # Errors
    ///
    /// The first setting that makes no sense, with its place, what stands there and what would be right.
    fn check(&self, path: &JsonPath<'_>) -> Check;

    /// Whether it scatters into single directions ([`Bsdf::is_delta`]).
    fn is_delta(&self) -> bool;

    /// Whether specular methods look for light by way of it ([`Bsdf::as_delta`]).
    fn is_searched(&self) -> bool {
        self.is_delta()
    }

    /// Whether light goes straight through it ([`Bsdf::as_straight`]).
    fn is_straight(&self) -> bool {
        false
    }

    /// Whether it may send light into single directions as glass or water does. Then images have the layer `caustic`.
    fn makes_caustics(&self) -> bool {
        false
    }

    /// Whether light is scattered at the interpolated normals of a mesh rather than at those of its triangles.
    fn uses_normals(&self) -> bool {
        self.is_delta()
    }

    /// The normal map that it names.
    fn normal_map(&self) -> Option<&NormalMapDescription> {
        None
    }

    /// Whether the colours at the vertices of a mesh count.
    fn uses_colours(&self) -> bool {
        false
    }

    /// The pictures that it names.
    fn textures(&self) -> Vec<TextureUse<'_>> {
        Vec::new()
    }

    /// How much of the surface is there, with pictures that have been decoded; `None` where all of it is.
    fn opacity(&self, _bitmaps: &Bitmaps<'_>) -> Option<Opacity> {
        None
    }

    /// What it is for other programs, with pictures that have been decoded; `None` if no model describes it.
    fn model(&self, _bitmaps: &Bitmaps<'_>) -> Option<SurfaceModel> {
        None
    }

    /// What lies over it, for other programs, with pictures that have been decoded.
    fn cover(&self, _bitmaps: &Bitmaps<'_>) -> CoverModel {
        CoverModel::NONE
    }

    /// What it has beyond its model, in words.
    fn beyond_model(&self) -> Vec<&'static str> {
        Vec::new()
    }

    /// The material, from settings that have been checked and with pictures that have been decoded.
    fn build(&self, bitmaps: &Bitmaps<'_>) -> Arc<dyn Bsdf>;
}

/// The pictures of colours, with their places below the settings of which the colours are members.
fn textures<'a>(colours: &[(&str, &'a ColourDescription)]) -> Vec<TextureUse<'a>> {
    colours.iter().filter_map(|(member, colour)| colour.texture(member)).collect()
}

/// All of something, by default.
fn one() -> ValueDescription {
    ValueDescription::number(1.0)
}

fn is_one(value: &ValueDescription) -> bool {
    *value == one()
}

/// That light fades out before the terminator of the triangles, by default.
fn soft() -> bool {
    true
}

/// The normals at a point of a mesh, on the same side of it. Unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normals {
    /// That of the triangle.
    pub geometric: DVec3,
    /// That which is interpolated between the triangle's corners, and which a normal map has bent.
    pub shading: DVec3,
}

impl Normals {
    /// Whether a ray comes from the same side of both planes.
    fn agree(&self, direction: DVec3) -> bool {
        direction.dot(self.geometric) * direction.dot(self.shading) > 0.0
    }

    /// The triangle's normal on the side from which a ray comes.
    pub fn facing(&self, incident: DVec3) -> DVec3 {
        if self.geometric.dot(incident) > 0.0 { -self.geometric } else { self.geometric }
    }
}

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Its normals.
    pub normals: Normals,
    /// Its texture coordinates.
    pub texture: TextureCoordinates,
    /// The colour that is interpolated between the vertices of the mesh, linear; white where it has none.
    pub colour: DVec3,
}

/// What light does at a specular vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SpecularEvent {
    /// It is mirrored.
    Reflection,
    /// It is refracted.
    Transmission,
}

/// A direction drawn at random, in which a path goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Unit vector away from the surface.
    pub direction: DVec3,
    /// BSDF times cosine over density.
    pub weight: DVec3,
    /// How the direction was drawn.
    pub kind: SampleKind,
}

/// How a direction was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SampleKind {
    /// From a density per solid angle.
    Density(f64),
    /// As one of the single directions of a delta distribution.
    Delta(SpecularEvent),
}

/// A body of glass or water behind a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interior {
    /// Its index of refraction; that of air is 1.
    pub index_of_refraction: f64,
    /// What it absorbs, per metre.
    pub absorption: DVec3,
    /// Where bodies overlap, the place belongs to the one with the highest priority.
    pub priority: i32,
}

/// How a surface scatters light. A path comes along `incident` and goes on along `outgoing`, both unit vectors in the
/// direction of travel. Radiance is carried along the path's reverse.
pub trait Bsdf: fmt::Debug + Send + Sync {
    /// The scattering into single directions by which specular methods look for light; `None` where light is scattered
    /// into a solid angle, and where all light over the surface is left to chance.
    fn as_delta(&self) -> Option<&dyn DeltaBsdf> {
        None
    }

    /// The way straight through for light that it neither bends nor scatters (null transmission), by which a shadow
    /// ray goes on; `None` where a shadow ray ends. It is all that the surface transmits.
    fn as_straight(&self) -> Option<&dyn StraightBsdf> {
        None
    }

    /// Whether light is scattered into single directions, so that no connection to a light can be evaluated. Delta
    /// surfaces that no method searches say so themselves.
    fn is_delta(&self) -> bool {
        self.as_delta().is_some()
    }

    /// The map of normals over the surface.
    fn normal_map(&self) -> Option<&NormalMap> {
        None
    }

    /// What the body behind the surface absorbs, per metre: light over a distance d in it is multiplied by
    /// `exp(-absorption * d)`.
    fn absorption(&self) -> DVec3 {
        DVec3::ZERO
    }

    /// The body behind the surface; `None` where the surface bounds no body that refracts light.
    fn interior(&self) -> Option<Interior> {
        None
    }

    /// The same boundary between other media: the index of refraction behind it over that in front of it is `ratio`.
    /// `None` where it bounds no body.
    fn between(&self, _ratio: f64) -> Option<Arc<dyn Bsdf>> {
        None
    }

    /// Whether light goes through the surface, so that lights behind it count.
    fn transmits(&self) -> bool;

    /// Whether light that specular surfaces send to its back is gathered there, too, rather than left to chance. It is
    /// for thin layers: both sides of them are in the same medium.
    fn gathers_behind(&self) -> bool {
        false
    }

    /// The fraction of light that is scattered, for the image's albedo layer.
    fn albedo(&self, at: &SurfacePoint) -> DVec3;

    /// A factor of [`Self::eval`] that all directions share, so that sums over lights are multiplied by it once.
    fn scale(&self, at: &SurfacePoint) -> DVec3;

    /// BSDF times cosine, over [`Self::scale`].
    fn eval(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> DVec3;

    /// Density per solid angle with which [`Self::sample`] draws a direction.
    fn pdf(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> f64;

    /// Draws a direction for unpolarised light; `None` where the path ends.
    fn sample(&self, at: &SurfacePoint, incident: DVec3, stream: &mut SampleStream) -> Option<BsdfSample>;

    /// Draws a direction for light of a polarisation, which it changes; `None` where the path ends. Scattering into a
    /// solid angle depolarises.
    fn sample_polarised(
        &self,
        at: &SurfacePoint,
        incident: DVec3,
        polarisation: &mut Polarisation,
        stream: &mut SampleStream,
    ) -> Option<BsdfSample> {
        if let Some(delta) = self.as_delta() {
            return sample_delta(delta, at, incident, polarisation, stream);
        }
        *polarisation = Polarisation::NONE;
        self.sample(at, incident, stream)
    }
}

/// A boundary that scatters into single directions: what the specular methods ask of a material.
pub trait DeltaBsdf {
    /// Index of refraction behind the surface, on the side to which the normal does not point; `None` where nothing is
    /// transmitted.
    fn index_of_refraction(&self) -> Option<f64>;

    /// Index of refraction behind the boundary over that before it, for a ray along `direction`.
    fn ratio(&self, direction: DVec3, normals: &Normals) -> Option<f64> {
        let index = self.index_of_refraction()?;
        Some(if direction.dot(normals.geometric) < 0.0 { index } else { 1.0 / index })
    }

    /// The ray that is refracted; `None` where nothing is transmitted, at total reflection, and where the normals
    /// contradict each other.
    fn transmit(&self, direction: DVec3, normals: &Normals) -> Option<Crossing>;

    /// The ray that is reflected; `None` where the normals contradict each other.
    fn reflect(&self, direction: DVec3, at: &SurfacePoint) -> Option<Mirrored>;
}

/// A surface that light passes without a change of direction.
pub trait StraightBsdf {
    /// The fraction of light along `direction`, a unit vector, that goes straight on, by its polarisation, which
    /// changes.
    fn transmittance(&self, at: &SurfacePoint, direction: DVec3, polarisation: &mut Polarisation) -> DVec3;
}

/// A ray that goes through a boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Unit direction behind the boundary.
    pub direction: DVec3,
    /// Index of refraction behind the boundary over that before it.
    pub ratio: f64,
    /// What the boundary does to light.
    pub fresnel: Fresnel,
}

impl Crossing {
    /// What radiance from behind the boundary is multiplied by on its way back to where the ray came from, if this part
    /// of the power is transmitted: it is proportional to the square of the index of refraction.
    pub fn radiance_factor(&self, transmittance: f64) -> f64 {
        transmittance / (self.ratio * self.ratio)
    }
}

/// A ray that a boundary reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirrored {
    /// Unit direction.
    pub direction: DVec3,
    /// A factor of the light that is reflected.
    pub colour: DVec3,
    /// What the boundary does to light besides.
    pub fresnel: Fresnel,
}

/// Draws one of the directions of a delta distribution, by its share of the power.
fn sample_delta(
    bsdf: &dyn DeltaBsdf,
    at: &SurfacePoint,
    incident: DVec3,
    polarisation: &mut Polarisation,
    stream: &mut SampleStream,
) -> Option<BsdfSample> {
    let light = polarisation.incident(incident, at.normals.shading);
    let crossing = bsdf.transmit(incident, &at.normals);
    let through = crossing.map(|crossing| light.after(crossing.fresnel.transmission()));
    let transmitted = through.map_or(0.0, |(part, _)| part);
    let choice = stream.next_1d();
    match (crossing, through) {
        (Some(crossing), Some((_, behind))) if choice < transmitted => {
            *polarisation = behind;
            Some(BsdfSample {
                direction: crossing.direction,
                weight: DVec3::splat(crossing.radiance_factor(transmitted) / transmitted),
                kind: SampleKind::Delta(SpecularEvent::Transmission),
            })
        }
        _ => {
            let mirrored = bsdf.reflect(incident, at)?;
            let (part, before) = light.after(mirrored.fresnel.reflection());
            *polarisation = before;
            Some(BsdfSample {
                direction: mirrored.direction,
                // The part of the light that is transmitted is that which is not drawn, or lost.
                weight: mirrored.colour * part / (1.0 - transmitted),
                kind: SampleKind::Delta(SpecularEvent::Reflection),
            })
        }
    }
}
