//! Which light is caustic: between a light and the surface that scatters it first, it has met glass or water.
//!
//! Glass and water are panes and the smooth boundaries of bodies. A thin wall is glass where it mirrors light. Light
//! that goes straight through it is not caustic. Mirrors of metal make no caustics either.

use glam::DVec3;

use super::{PathSample, PathTracer};
use crate::bsdf::Bsdf;
use crate::geometry::{Ray, Surface, SurfaceId};
use crate::scene::{Scene, ShadingPoint};
use crate::specular::SpecularEvent;
use clerestory_film::counters::Counters;

/// Light that a vertex gathers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Gathered {
    /// All of it.
    pub(super) all: DVec3,
    /// The part that is caustic.
    pub(super) caustic: DVec3,
}

/// Which specular things of a scene mirror light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mirrors {
    /// Glass and water alone.
    Glass,
    /// Metal alone.
    Metal,
    /// Both.
    Both,
}

impl Gathered {
    pub(super) fn add(&mut self, light: DVec3, is_caustic: bool) {
        self.all += light;
        if is_caustic {
            self.caustic += light;
        }
    }
}

impl PathSample {
    pub(super) fn add(&mut self, light: DVec3, is_caustic: bool) {
        self.radiance += light;
        if is_caustic {
            self.caustic += light;
        }
    }
}

impl Mirrors {
    pub(super) fn of(scene: &Scene) -> Self {
        let specular = || scene.meshes().iter().filter(|mesh| mesh.is_specular());
        let has_glass = !scene.panes().is_empty() || specular().any(|mesh| mesh.interior().is_some());
        match (specular().any(|mesh| mesh.interior().is_none()), has_glass) {
            (false, _) => Self::Glass,
            (true, false) => Self::Metal,
            (true, true) => Self::Both,
        }
    }
}

/// Whether light that a surface sends into a single direction has met glass or water there.
pub(super) fn is_glass(bsdf: &dyn Bsdf, event: SpecularEvent) -> bool {
    let is_mirrored_by_wall = bsdf.as_straight().is_some() && event == SpecularEvent::Reflection;
    bsdf.interior().is_some() || is_mirrored_by_wall
}

impl PathTracer<'_> {
    /// Whether a path that a method has found from a point in a direction, over a chain, goes over glass or water.
    pub(super) fn is_over_glass(&self, point: &ShadingPoint, direction: DVec3, events: &[SpecularEvent]) -> bool {
        // No mirror of metal transmits light, and methods do not search thin walls.
        if events.contains(&SpecularEvent::Transmission) {
            return true;
        }
        match self.mirrors {
            Mirrors::Glass => true,
            Mirrors::Metal => false,
            Mirrors::Both => self.is_mirrored_by_glass(point, direction, events.len()),
        }
    }

    /// Whether one of the mirrors is of glass or water that a ray meets one after the other.
    fn is_mirrored_by_glass(&self, point: &ShadingPoint, direction: DVec3, mirrors: usize) -> bool {
        // These rays are no work of the method.
        let counters = &mut Counters::default();
        let (mut ray, mut origin) = (Ray::new(point.position, direction), point.surface);
        for _ in 0..mirrors {
            let hit = self.scene.accelerator().closest_hit(&ray, f64::INFINITY, origin, counters);
            let Some(hit) = hit else { return false };
            let Surface::Triangle { index, barycentric } = hit.surface else { return true };
            if self.scene.bsdf(index).interior().is_some() {
                return true;
            }
            let at = self.scene.surface_point(index, barycentric);
            let Some(mirrored) = self.scene.delta_bsdf(index).and_then(|bsdf| bsdf.reflect(ray.direction, &at)) else {
                return false;
            };
            (ray, origin) = (Ray::new(ray.at(hit.distance), mirrored.direction), SurfaceId::Triangle(index));
        }
        false
    }
}
