//! How densely the search finds a path, for each unit of solid angle at the shading point.
//!
//! That is the density of the path's point on the light, over the geometry factor. Each path is found once on average,
//! whatever its estimated inverse probability. On a fold the factor has no bound, and the search finds nothing.

use glam::DVec3;

use crate::geometry::Ray;
use crate::light::{LightHit, Source};
use crate::scene::{Scene, ShadingPoint};
use crate::specular::SpecularPath;
use crate::specular::fermat::Connection;
use crate::specular::side::PaneSide;
use clerestory_film::counters::Counters;

/// Of a path through a pane, whose vertices in the pane's frame are given, and whose last segment meets the light.
pub(super) fn through_pane(
    scene: &Scene,
    light: u32,
    side: &PaneSide<'_>,
    origin: DVec3,
    vertices: [DVec3; 2],
    (exit, hit): (&Ray, &LightHit),
) -> f64 {
    let (met, cosine) = scene.lights()[light as usize].source_at(exit, hit);
    let connection = Connection::new(side, origin, met.in_frame(&side.pane.frame));
    let path = connection.path(&vertices.map(DVec3::truncate), &mut Counters::default());
    let factor = path.hessian().factorise().map(|hessian| path.geometry_factor(hessian.determinant) * cosine);
    factor.map_or(0.0, |factor| of_light(scene, light, met) / factor)
}

/// Of a point on a light.
pub(super) fn of_light(scene: &Scene, light: u32, source: Source) -> f64 {
    let (centre, radius) = scene.specular_ball();
    scene.lights()[light as usize].source_density(centre, radius, source)
}

/// Of a path through a pane, as the path tracer has found it.
pub(super) fn of_path_through(scene: &Scene, point: &ShadingPoint, pane: u32, path: &SpecularPath<'_>) -> Option<f64> {
    let [entry, exit] = path.links else { return None };
    let pane = &scene.panes()[pane as usize];
    let origin = pane.frame.point_to_local(point.position);
    let side = PaneSide::facing(pane, origin)?;
    let vertices = [entry, exit].map(|link| pane.frame.point_to_local(link.position));
    Some(through_pane(scene, path.light, &side, origin, vertices, last_segment(path)?.parts()))
}

/// The last segment of a path, and where it meets the light.
pub(super) struct LastSegment {
    pub(super) ray: Ray,
    pub(super) hit: LightHit,
}

impl LastSegment {
    fn parts(&self) -> (&Ray, &LightHit) {
        (&self.ray, &self.hit)
    }
}

/// That of a path that the path tracer has found.
pub(super) fn last_segment(path: &SpecularPath<'_>) -> Option<LastSegment> {
    let from = path.links.last()?.position;
    let distance = match path.source {
        Source::Point(source) => from.distance(source),
        Source::Direction(_) => f64::INFINITY,
    };
    let hit = LightHit { distance, radiance: DVec3::ZERO, triangle: path.triangle };
    Some(LastSegment { ray: Ray::new(from, path.last_direction), hit })
}
