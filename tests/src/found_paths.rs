//! Paths of light over panes, found without a specular method or by the complete search, as the path tracer describes
//! them.

use clerestory_film::counters::Counters;
use clerestory_render_core::bsdf::fresnel::{reflect, refract};
use clerestory_render_core::geometry::{Face, PaneBoundary, Ray, Surface, SurfaceId};
use clerestory_render_core::light::{Source, SourceSample};
use clerestory_render_core::scene::Scene;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::fnee::PathSearch;
use clerestory_render_core::specular::newton::Root;
use clerestory_render_core::specular::side::{PaneSide, unit_normal};
use clerestory_render_core::specular::{Link, SpecularEvent, SpecularPath};
use glam::DVec3;

/// A path from a shading point over panes to a light, with nothing in the way.
#[derive(Clone, Debug)]
pub struct FoundPath {
    /// The specular vertices, from the shading point on.
    pub links: Vec<Link>,
    /// Index of the light.
    pub light: u32,
    /// Where on the light it ends.
    pub source: Source,
    /// Unit direction towards the light behind the last vertex.
    pub last_direction: DVec3,
}

/// Directions that lead to places of a vertex as near to each other, relative to the shortest part of the path, are the
/// same.
const SAME_PATH: f64 = 1e-6;

impl FoundPath {
    /// The path as methods are asked about it.
    pub fn described(&self) -> SpecularPath<'_> {
        let Self { light, source, last_direction, ref links } = *self;
        SpecularPath { light, source, triangle: None, last_direction, links }
    }

    /// Whether light that arrives from a direction at the path's end comes along it.
    pub fn is_in_direction(&self, point: &ShadingPoint, direction: DVec3) -> bool {
        let first = self.links[0].position - point.position;
        let inner = self.links.windows(2).map(|pair| pair[0].position.distance(pair[1].position));
        let shortest = inner.fold(first.length(), f64::min);
        first.dot(direction) > 0.0 && first.cross(direction).length() <= SAME_PATH * shortest
    }

    /// The path of a root of a search through a pane. With it comes its irradiance of the red channel over the density
    /// of its point on the light. `None` when it is no path of light or is blocked.
    pub fn of_root(
        scene: &Scene,
        point: &ShadingPoint,
        [light, pane]: [u32; 2],
        sample: &SourceSample,
        search: &PathSearch<'_>,
        root: &Root,
        counters: &mut Counters,
    ) -> Option<(Self, f64)> {
        let through = search.transmission(root, counters)?;
        let PaneSide { near, far, pane: geometry, .. } = *search.side();
        let directions = root.path.directions.map(|direction| geometry.frame.vector_to_world(direction));
        let [entry, exit] = root.path.vertices.map(|vertex| geometry.frame.point_to_world(vertex));
        let [first, _, last] = directions;
        let ray_origin = SurfaceId::Pane { index: pane, face: far };
        if scene.blocked_through_pane(point, entry, pane, near, &exit, counters)
            || scene.blocked(&Ray::new(exit, last), root.path.lengths[2], ray_origin, None, Some(light), counters)
        {
            return None;
        }
        let link = |face, position, direction| Link {
            event: SpecularEvent::Transmission,
            surface: SurfaceId::Pane { index: pane, face },
            position,
            direction,
        };
        let links = vec![link(near, entry, first), link(far, exit, directions[1])];
        let light_cosine = sample.normal.map_or(1.0, |normal| -normal.dot(last)).max(0.0);
        let factor = root.path.geometry_factor(root.determinant) * light_cosine;
        let irradiance = sample.weight.x * through.transmittance.x * factor * first.dot(point.normal).max(0.0);
        Some((Self { links, light, source: sample.source, last_direction: last }, irradiance))
    }

    /// The path of light from a shading point in a direction, with exactly these events at panes, until it meets a
    /// light. That is any light, or the given one at a known place.
    pub fn followed(
        scene: &Scene,
        point: &ShadingPoint,
        direction: DVec3,
        events: &[SpecularEvent],
        end: Option<(u32, Source)>,
    ) -> Option<Self> {
        let counters = &mut Counters::default();
        let mut ray = Ray::new(point.position, direction);
        let mut ray_origin = point.surface;
        let mut inside: Option<(u32, Face)> = None;
        let mut links = Vec::new();
        for &event in events {
            let hit = match inside {
                Some((pane, face)) => scene.accelerator().closest_hit_inside(pane, &ray, Some(face), counters),
                None => scene.accelerator().closest_hit(&ray, f64::INFINITY, ray_origin, counters),
            }?;
            if inside.is_none() && scene.blocked_by_light(&ray, hit.distance, None) {
                return None;
            }
            let Surface::Pane { index, hit: pane_hit } = hit.surface else { return None };
            let PaneBoundary::Face(face) = pane_hit.boundary else { return None };
            let pane = &scene.panes()[index as usize];
            let normal = pane.frame.vector_to_world(unit_normal(pane_hit.gradient));
            let indices = [1.0, pane.index_of_refraction];
            let [before, behind] = if inside.is_some() { [indices[1], indices[0]] } else { indices };
            let next = match event {
                SpecularEvent::Transmission => refract(ray.direction, normal, before, behind)?.direction,
                SpecularEvent::Reflection => reflect(ray.direction, normal),
            };
            ray_origin = SurfaceId::Pane { index, face };
            let goes_in = (event == SpecularEvent::Transmission) == inside.is_none();
            inside = goes_in.then_some((index, face));
            let position = pane.frame.point_to_world(pane_hit.point);
            links.push(Link { event, surface: ray_origin, position, direction: ray.direction });
            ray = Ray::new(position, next);
        }
        if let Some((light, source)) = end {
            let last_direction = match source {
                Source::Point(place) => (place - ray.origin).normalize(),
                Source::Direction(direction) => direction,
            };
            return inside.is_none().then_some(Self { links, light, source, last_direction });
        }
        let lights = (0u32..).zip(scene.lights());
        let mut met = lights.filter_map(|(index, light)| Some((index, light.intersect(&ray)?)));
        let (light, hit) = met.find(|(_, hit)| hit.radiance != DVec3::ZERO)?;
        if inside.is_some() || scene.blocked(&ray, hit.distance, ray_origin, None, Some(light), counters) {
            return None;
        }
        let (source, _) = scene.lights()[light as usize].source_at(&ray, &hit);
        Some(Self { links, light, source, last_direction: ray.direction })
    }
}

/// The paths through one pane from a point to a point of a light that the complete search lists, without dark ones.
/// Their irradiance is as in [`FoundPath::of_root`].
pub fn listed_paths(
    scene: &Scene,
    point: &ShadingPoint,
    light: u32,
    sample: &SourceSample,
    counters: &mut Counters,
) -> Vec<(FoundPath, f64)> {
    let mut paths = Vec::new();
    for pane in 0..scene.panes().len() as u32 {
        let Some(search) = search_through(scene, point, sample.source, pane, FneeSolver::Complete) else { continue };
        let roots = search.enumerate(counters).roots;
        let found = |root| FoundPath::of_root(scene, point, [light, pane], sample, &search, root, counters);
        paths.extend(roots.iter().filter_map(found).filter(|(_, irradiance)| *irradiance > 0.0));
    }
    paths
}

/// The search of `fnee` from a point to a source through a pane; `None` when no path leads through it.
pub fn search_through<'a>(
    scene: &'a Scene,
    point: &ShadingPoint,
    source: Source,
    pane: u32,
    solver: FneeSolver,
) -> Option<PathSearch<'a>> {
    let geometry = &scene.panes()[pane as usize];
    let origin = geometry.frame.point_to_local(point.position);
    let source = match source {
        Source::Point(place) => Source::Point(geometry.frame.point_to_local(place)),
        Source::Direction(direction) => Source::Direction(geometry.frame.vector_to_local(direction)),
    };
    PathSearch::new(PaneSide::facing(geometry, origin)?, origin, source, solver)
}
