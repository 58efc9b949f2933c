//! Splats: the vertices of a light subpath that the camera sees.

use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;
use glam::DVec3;

use super::light_vertex::OneSubpath;
use super::{PathTracer, Walk};
use crate::document::PathFilter;
use crate::geometry::SurfaceId;
use crate::integrator::light_subpaths::{FromCamera, splat_share};

/// Light that arrives at a pixel.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrator) struct Splat {
    /// Column and row.
    pub(in crate::integrator) pixel: [u32; 2],
    /// Over the number of light subpaths for a sample of each pixel, W/(m2 sr).
    pub(in crate::integrator) radiance: DVec3,
    /// Whether it is caustic.
    pub(in crate::integrator) is_caustic: bool,
}

impl PathTracer<'_> {
    /// Traces a light subpath, and gives its splats.
    pub(in crate::integrator) fn splat(
        &self,
        stream: &mut SampleStream,
        counters: &mut Counters,
        mut put: impl FnMut(Splat),
    ) {
        let Some(subpath) = self.one_subpath(stream, counters) else { return };
        for number in 0..subpath.vertices.len() {
            if let Some(splat) = self.splat_of(&subpath, number, counters) {
                put(splat);
            }
        }
    }

    fn splat_of(&self, subpath: &OneSubpath<'_>, number: usize, counters: &mut Counters) -> Option<Splat> {
        let vertex = &subpath.vertices[number];
        let sight = self.scene.camera().sight(vertex.position)?;
        let state = self.filter.map(PathFilter::start);
        if !self.accepts_light(state, &subpath.events[..=vertex.events]) {
            return None;
        }
        let (around, body) = self.start.around(self.scene, &sight.ray);
        if !around.is_air() || body != DVec3::ZERO {
            return None;
        }
        let towards_camera = -sight.ray.direction;
        let seen = sight.density * vertex.cosine(towards_camera);
        if seen == 0.0 {
            return None;
        }
        let scattered = vertex.eval(towards_camera) * vertex.bsdf.scale(&vertex.at) * vertex.weight;
        if scattered == DVec3::ZERO {
            return None;
        }
        let from = SurfaceId::Nothing;
        if self.scene.blocked_from_triangle(&sight.ray, sight.distance, from, vertex.triangle, counters) {
            return None;
        }
        let by_camera =
            self.by_camera(subpath, number, towards_camera, (number as u32, !self.light_plane.is_alone), counters)?;
        let share = splat_share(self.light_plane.shared_by, seen, by_camera);
        let radiance = scattered * (seen * share / self.light_plane.subpaths);
        Some(Splat { pixel: sight.pixel, radiance, is_caustic: subpath.is_caustic() })
    }

    /// What the light plane finds of a path whose first vertex is `position`, where the camera sees it at a cosine.
    pub(super) fn seen_by_light(&self, walk: &Walk, cosine: f64, position: DVec3) -> FromCamera {
        let is_splatted = self.light_plane.shared_by > 0.0 && walk.depth == 1 && walk.stretch.is_straight();
        if !is_splatted || walk.body != DVec3::ZERO {
            return FromCamera::default();
        }
        let sight = self.scene.camera().sight(position);
        sight
            .map_or(FromCamera::default(), |sight| FromCamera::seen(self.light_plane.shared_by, sight.density * cosine))
    }
}
