//! The vertices of light subpaths, and what is known of the paths from them to the light.

use std::cell::OnceCell;

use arrayvec::ArrayVec;
use glam::DVec3;

use crate::bsdf::{Bsdf, SurfacePoint};
use crate::document::PathEvent;
use crate::integrator::light_subpaths::{FromLight, On, SUBPATHS, Start};
use crate::specular::Link;
use crate::specular::scope::MOST_SPECULAR_VERTICES;

/// The light subpaths of a camera sample.
pub(super) type LightSubpath<'a> = ArrayVec<OneSubpath<'a>, { SUBPATHS as usize }>;

/// A light subpath that has reached a surface which scatters light into a solid angle.
pub(super) struct OneSubpath<'a> {
    pub(super) start: Start,
    /// The specular vertices between its first vertex and the light, from there.
    pub(super) links: ArrayVec<Link, MOST_SPECULAR_VERTICES>,
    /// Density with which its first vertex was found, for each unit of area and of solid angle, and the part of it that
    /// is due to choices at the links.
    pub(super) density: f64,
    pub(super) choices: f64,
    pub(super) vertices: Vec<LightVertex<'a>>,
    /// What happens from the light on.
    pub(super) events: Vec<PathEvent>,
    /// How densely the method finds the light at the first vertex, if that is the camera's first diffuse vertex, its
    /// second, or a later one.
    pub(super) found: [OnceCell<FoundBy>; 3],
}

impl OneSubpath<'_> {
    /// Whether its light is caustic. A light subpath goes over no other glass before its first vertex than the pane on
    /// which it begins, and over panes behind that.
    pub(super) fn is_caustic(&self) -> bool {
        matches!(self.start.on, On::Face(_))
    }
}

/// How else than by a light subpath the light at the first vertex of one is found.
#[derive(Clone, Copy, Debug)]
pub(super) enum FoundBy {
    /// By a method, with this density for each unit of solid angle.
    Method(f64),
    /// By a method that shares it with none.
    MethodAlone,
    /// By chance.
    Chance,
    /// Not at all.
    Nothing,
    /// Straight from the light, by next event estimation with this density, and by chance if the light can be met.
    Straight(f64),
}

/// A vertex of a light subpath.
pub(super) struct LightVertex<'a> {
    pub(super) bsdf: &'a dyn Bsdf,
    pub(super) at: SurfacePoint,
    pub(super) position: DVec3,
    pub(super) triangle: u32,
    /// Unit direction in which light arrives.
    pub(super) incident: DVec3,
    /// Light that arrives, over its density and the cosine at which it does.
    pub(super) weight: DVec3,
    /// What other techniques find of the path; none at the first vertex.
    pub(super) by_camera: Option<FromLight>,
    /// Density with which the camera's walk would go on from here, known once light goes on.
    pub(super) of_camera: f64,
    /// Unit direction in which light goes on.
    pub(super) outgoing: DVec3,
    /// How many events there are up to here, without its own.
    pub(super) events: usize,
    /// Vertices between the light and this one, with it.
    pub(super) depth: u32,
}

impl LightVertex<'_> {
    /// BSDF times cosine towards the light, from a direction towards the camera.
    pub(super) fn eval(&self, towards_camera: DVec3) -> DVec3 {
        self.bsdf.eval(&self.at, -towards_camera, -self.incident)
    }

    /// Density with which a camera's walk from there would go on to the light.
    pub(super) fn of_camera(&self, towards_camera: DVec3) -> f64 {
        self.bsdf.pdf(&self.at, -towards_camera, -self.incident)
    }

    /// Density with which light goes on in a direction.
    pub(super) fn of_light(&self, towards_camera: DVec3) -> f64 {
        self.bsdf.pdf(&self.at, self.incident, towards_camera)
    }

    pub(super) fn cosine(&self, direction: DVec3) -> f64 {
        self.at.normals.geometric.dot(direction).abs()
    }
}
