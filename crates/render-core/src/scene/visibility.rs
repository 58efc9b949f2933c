//! What lies between two points of a scene: triangles, panes and lights.

use glam::DVec3;
use smallvec::SmallVec;

use super::Scene;
use crate::bsdf::polarisation::Polarisation;
use crate::geometry::{Face, Hit, Ray, Surface, SurfaceId};
use crate::light::{Source, SourceSample};
use crate::scene::ShadingPoint;
use clerestory_film::counters::Counters;

/// Things on one ray whose distances differ by less than this part are in the same place.
pub(crate) const SAME_PLACE: f64 = 1e-9;

/// Triangles of thin walls on a straight way, at most [`MOST_PASSED`](crate::geometry::MOST_PASSED).
pub(crate) type Walls = SmallVec<[u32; 4]>;

/// A straight way along a ray, which nothing blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct StraightWay {
    /// The fraction of the light that the walls on it let through.
    pub transmittance: DVec3,
    /// The walls that it goes through, in the order of the ray.
    pub(crate) walls: Walls,
}

impl StraightWay {
    /// Through no walls.
    pub(crate) fn clear() -> Self {
        Self { transmittance: DVec3::ONE, walls: Walls::new() }
    }
}

impl Scene {
    /// Whether anything blocks the ray before `max_distance`, apart from the pane and the light that are named. A light
    /// that lies on a surface is in front of it. Thin walls block the ray, too.
    pub fn blocked(
        &self,
        ray: &Ray,
        max_distance: f64,
        ray_origin: SurfaceId,
        ignored_pane: Option<u32>,
        target_light: Option<u32>,
        counters: &mut Counters,
    ) -> bool {
        let clear = if target_light.is_some() { max_distance * (1.0 - SAME_PLACE) } else { max_distance };
        self.blocked_by_light(ray, max_distance, target_light)
            || self.accelerator().occluded(ray, clear, ray_origin, ignored_pane, counters)
    }

    /// The straight way along a ray to a light at `distance`, through any thin walls; `None` where anything else stands
    /// in the way.
    pub fn straight_way(
        &self,
        ray: &Ray,
        distance: f64,
        ray_origin: SurfaceId,
        light: u32,
        counters: &mut Counters,
    ) -> Option<StraightWay> {
        if !self.has_straight_meshes() {
            let blocked = self.blocked(ray, distance, ray_origin, None, Some(light), counters);
            return (!blocked).then(StraightWay::clear);
        }
        if self.blocked_by_light(ray, distance, Some(light)) {
            return None;
        }
        self.way_through_walls(ray, distance, ray_origin, counters)
    }

    /// What light along a ray meets first that is no thin wall, and its way to there; `None` where it meets nothing, or
    /// too many walls. Lights that are no surfaces of the scene are not looked for.
    pub fn first_behind_walls(&self, ray: &Ray, counters: &mut Counters) -> Option<(Hit, StraightWay)> {
        if !self.has_straight_meshes() {
            let hit = self.accelerator().closest_hit(ray, f64::INFINITY, SurfaceId::Nothing, counters)?;
            return Some((hit, StraightWay::clear()));
        }
        let passes = |triangle| self.straight_bsdf(triangle).is_some();
        let hit = self.accelerator().closest_hit_past(ray, SurfaceId::Nothing, &passes, counters)?;
        let way = self.way_through_walls(ray, hit.distance, SurfaceId::Nothing, counters)?;
        Some((hit, way))
    }

    /// The way along a ray to a place at `distance`, through thin walls alone.
    fn way_through_walls(
        &self,
        ray: &Ray,
        distance: f64,
        ray_origin: SurfaceId,
        counters: &mut Counters,
    ) -> Option<StraightWay> {
        let passes = |triangle| self.straight_bsdf(triangle).is_some();
        let clear = distance * (1.0 - SAME_PLACE);
        let walls = self.accelerator().passed(ray, clear, ray_origin, &passes, counters)?;
        let mut polarisation = Polarisation::NONE;
        // In the order along the ray: a product of other order has other bits.
        let transmittance = walls.iter().fold(DVec3::ONE, |product, wall| {
            let at = self.surface_point(wall.index, wall.barycentric);
            let wall = self.straight_bsdf(wall.index);
            let of_wall = wall.map(|wall| wall.transmittance(&at, ray.direction, &mut polarisation));
            product * of_wall.unwrap_or(DVec3::ZERO)
        });
        Some(StraightWay { transmittance, walls: walls.iter().map(|wall| wall.index).collect() })
    }

    /// Whether anything blocks the ray to a point of a light, at `distance`. The triangle on which that point lies does
    /// not, wherever rounding puts it.
    pub fn blocked_from_light(
        &self,
        ray: &Ray,
        distance: f64,
        ray_origin: SurfaceId,
        light: u32,
        sample: &SourceSample,
        counters: &mut Counters,
    ) -> bool {
        let Some(triangle) = sample.triangle else {
            return self.blocked(ray, distance, ray_origin, None, Some(light), counters);
        };
        self.blocked_by_light(ray, distance, Some(light))
            || self.is_before_triangle(ray, distance, ray_origin, triangle, counters)
    }

    /// Whether anything blocks the ray to a point of a triangle, at `distance`, wherever rounding puts that.
    pub fn blocked_from_triangle(
        &self,
        ray: &Ray,
        distance: f64,
        ray_origin: SurfaceId,
        triangle: u32,
        counters: &mut Counters,
    ) -> bool {
        self.blocked_by_light(ray, distance * (1.0 - SAME_PLACE), None)
            || self.is_before_triangle(ray, distance, ray_origin, triangle, counters)
    }

    fn is_before_triangle(
        &self,
        ray: &Ray,
        distance: f64,
        ray_origin: SurfaceId,
        triangle: u32,
        counters: &mut Counters,
    ) -> bool {
        let is_before = |hit: Hit| !matches!(hit.surface, Surface::Triangle { index, .. } if index == triangle);
        let clear = distance * (1.0 - SAME_PLACE);
        self.accelerator().closest_hit(ray, clear, ray_origin, counters).is_some_and(is_before)
    }

    /// Whether a light stands on the ray before `max_distance`, apart from the one that is named, and from those that
    /// are surfaces of the scene.
    pub fn blocked_by_light(&self, ray: &Ray, max_distance: f64, target_light: Option<u32>) -> bool {
        self.light_sampler().on_ray(ray, max_distance, &mut |index| {
            let hit = || self.lights()[index as usize].intersect(ray);
            Some(index) != target_light
                && hit().is_some_and(|hit| hit.distance < max_distance && hit.distance.is_finite())
        })
    }

    /// Whether anything but the pane blocks the way from `point` to `entry` on its near face, or stands in the glass
    /// between `entry` and `exit`.
    pub fn blocked_through_pane(
        &self,
        point: &ShadingPoint,
        entry: DVec3,
        pane: u32,
        near: Face,
        exit: &DVec3,
        counters: &mut Counters,
    ) -> bool {
        let (first, first_length) = segment(point.position, entry);
        let (inner, inner_length) = segment(entry, *exit);
        self.blocked(&first, first_length, point.surface, Some(pane), None, counters)
            || self.blocked(
                &inner,
                inner_length,
                SurfaceId::Pane { index: pane, face: near },
                Some(pane),
                None,
                counters,
            )
    }

    /// The pane that the straight line from `point` to a source meets before anything else that is solid. The source
    /// may be on a triangle of the scene.
    pub fn first_pane_towards(
        &self,
        point: &ShadingPoint,
        (source, triangle): (Source, Option<u32>),
        counters: &mut Counters,
    ) -> Option<u32> {
        let (ray, distance) = straight(point.position, source, triangle);
        let hit = self.accelerator().solid().closest_hit(&ray, distance, point.surface, counters)?;
        match hit.surface {
            Surface::Pane { index, .. } => Some(index),
            Surface::Triangle { .. } => None,
        }
    }

    /// Whether anything solid blocks the straight line from `point` to a source. The source may be on a triangle of the
    /// scene.
    pub fn is_blocked_towards(
        &self,
        point: &ShadingPoint,
        (source, triangle): (Source, Option<u32>),
        counters: &mut Counters,
    ) -> bool {
        let (ray, distance) = straight(point.position, source, triangle);
        self.accelerator().solid().occluded(&ray, distance, point.surface, counters)
    }
}

fn segment(from: DVec3, to: DVec3) -> (Ray, f64) {
    let offset = to - from;
    let length = offset.length();
    (Ray::new(from, offset / length), length)
}

/// The part of a straight line to a surface that shines which does not reach that surface, however it is rounded.
const BEFORE_SURFACE: f64 = 1.0 - 1e-6;

/// The straight line from a point to a source, and its length. It ends before the triangle on which the source is.
pub(crate) fn straight(from: DVec3, source: Source, triangle: Option<u32>) -> (Ray, f64) {
    match source {
        Source::Point(position) => {
            let (ray, length) = segment(from, position);
            (ray, if triangle.is_some() { length * BEFORE_SURFACE } else { length })
        }
        Source::Direction(direction) => (Ray::new(from, direction), f64::INFINITY),
    }
}
