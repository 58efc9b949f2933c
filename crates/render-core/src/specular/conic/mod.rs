//! `conic`: all paths over one interface, a triangle mesh with interpolated normals (Granizo-Hidalgo and Holzschuch
//! 2024). They lie on the curves along which the shading point, the light and the normal are in one plane.
//!
//! Published is a walk along one curve, from the straight line to the light to the first path. Here all triangles that
//! may hold a path are opened (`facet_tree`), and all paths on each are found (`curve`). This needs no derivative of a
//! path, no start, and no random number. So the light of a point over one interface has no noise. Reflections are found
//! like refractions. Where waves focus a light that has an extent, a ray is sent as well (`focus`).

#[cfg(test)]
mod any_mesh;
#[cfg(test)]
mod certified;
mod curve;
#[cfg(test)]
mod degenerate;
mod ends;
mod facet;
mod facet_leaf;
mod facet_paths;
mod facet_tree;
mod facet_trees;
mod focus;
mod neighbours;
#[cfg(test)]
mod published_equations;
#[cfg(test)]
mod scale;
mod seen_ends;
mod settings;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod walk;

use std::sync::Arc;

use crate::specular::cache::MethodCache;
use crate::specular::constraint::ManifoldConstraint;
use crate::specular::manifold::WalkSteps;
use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};
use smallvec::SmallVec;

use self::{
    ends::Ends,
    facet_tree::May,
    facet_trees::{FacetTrees, facet, prefetch_facet},
    focus::{Focus, STRONG},
    walk::first_path,
};
use super::caster::Caster;
use super::light_view::light_bounds;
use super::manifold::{ManifoldWalk, SolvedChain};
use super::scope::Scope;
use super::window::SourceBounds;
use super::{Arrival, SpecularEvent, SpecularMethod, SpecularPath};
use crate::scene::ShadingPoint;
use crate::{
    geometry::{Frame, PaneBoundary, Ray, Surface, SurfaceId},
    light::{Light, Source, SourceSample},
    scene::{Scene, visibility::straight},
};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

pub(crate) use self::settings::through_one_interface;
pub use self::settings::{ConicSearch, ConicSettings};

/// Light over one specular mesh.
#[derive(Clone, Debug)]
pub struct Conic {
    /// Which of the paths over it are found.
    pub search: ConicSearch,
    /// Which paths are looked for; their chains have one vertex, which is on a mesh.
    pub scope: Scope,
    trees: Arc<FacetTrees>,
}

impl Conic {
    /// The search in a scene. What it looks the meshes of its scope up in is made now, so that no sample waits for it.
    pub fn new(scene: &Scene, search: ConicSearch, scope: Scope, cache: &MethodCache) -> Self {
        let trees = cache.get_or_make(|| FacetTrees::new(scene));
        for caster in &scope.casters {
            if let Caster::Mesh(mesh) = *caster {
                match search {
                    ConicSearch::Complete | ConicSearch::WithoutRays => _ = trees.tree(scene, mesh),
                    ConicSearch::Published => _ = trees.neighbours(scene, mesh),
                }
            }
        }
        Self { search, scope, trees }
    }
}

impl SpecularMethod for Conic {
    fn chains(&self) -> Vec<Vec<SpecularEvent>> {
        self.scope.chains.clone()
    }

    fn sample_li(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        events: &[SpecularEvent],
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let Some(sample) = self.scope.light_sample(scene, point, light, stream) else { return };
        for &caster in &self.scope.casters {
            let (Caster::Mesh(mesh), [event]) = (caster, events) else { continue };
            let Some(seen) = caster.seen_from(scene, point) else { continue };
            let (constraint, steps) = (ManifoldConstraint::AngleDifference, WalkSteps::default());
            let walk = ManifoldWalk { scene, point, source: sample.source, caster: seen, events, constraint, steps };
            let connection = Connection { trees: &self.trees, mesh, event: *event, light, sample: &sample, walk };
            match self.search {
                ConicSearch::Complete => connection.all(Some(stream), counters, arrive),
                ConicSearch::WithoutRays => connection.all(None, counters, arrive),
                ConicSearch::Published => connection.first(counters, arrive),
            }
        }
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, _counters: &mut Counters) -> bool {
        self.scope.holds(scene, point, path)
    }
}

/// A shading point, a mesh and a point of a light.
struct Connection<'a> {
    trees: &'a FacetTrees,
    mesh: u32,
    event: SpecularEvent,
    light: u32,
    sample: &'a SourceSample,
    walk: ManifoldWalk<'a>,
}

impl Connection<'_> {
    /// The light over all places of the mesh, with rays to where it is focused if there are random numbers for them.
    fn all(&self, stream: Option<&mut SampleStream>, counters: &mut Counters, arrive: &mut dyn FnMut(Arrival)) {
        let ManifoldWalk { scene, point, source, .. } = self.walk;
        let Some(tree) = self.trees.tree(scene, self.mesh) else { return };
        let ways = |source| ways(scene, point, source, self.mesh, self.event);
        let whole = (stream.is_some() && point.bounces == 0)
            .then(|| whole(&scene.lights()[self.light as usize], point.position))
            .flatten();
        let mut wholes =
            whole.iter().flat_map(|(source, spread)| ways(*source).into_iter().map(|ends| ends.spread(*spread)));
        let mut paths: Vec<SolvedChain> = Vec::new();
        let mut focus = Focus::default();
        let mut opened: SmallVec<[(u32, May); USUAL]> = SmallVec::new();
        for ends in &ways(source) {
            // Triangles lie all over the memory: all are on their way before the first is looked at.
            let mut open = |triangle, may| {
                prefetch_facet(scene, self.mesh, triangle);
                opened.push((triangle, may));
            };
            let whole = wholes.next();
            match &whole {
                Some(whole) => tree.visit_whole(whole, ends, STRONG, open),
                None => tree.visit(ends, |triangle| open(triangle, May { hold: true, focus: false })),
            };
            for (triangle, may) in opened.drain(..) {
                let facet = facet(scene, self.mesh, triangle);
                if may.focus
                    && let Some(whole) = &whole
                {
                    focus.consider(triangle, &facet, whole);
                }
                if !may.hold {
                    continue;
                }
                for weights in facet.paths(ends) {
                    if let Some(path) = self.walk.path_over(triangle, facet.place(weights), weights, counters)
                        && !paths.iter().any(|known| known.same(&path))
                    {
                        paths.push(path);
                    }
                }
            }
        }
        for path in &paths {
            self.weighted(path, self.sample, &focus, counters, arrive);
        }
        if let Some(stream) = stream.filter(|_| whole.is_some()) {
            let (choice, place) = (stream.next_1d(), stream.next_2d());
            if let Some((triangle, weights)) = focus.draw(choice, place) {
                self.ray(triangle, facet(scene, self.mesh, triangle).place(weights), &focus, counters, arrive);
            }
        }
    }

    /// The light that a ray through a place of a triangle meets.
    fn ray(
        &self,
        triangle: u32,
        place: DVec3,
        focus: &Focus,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let ManifoldWalk { scene, .. } = self.walk;
        let light = &scene.lights()[self.light as usize];
        let Some(chain) = self.walk.trace(place, counters) else { return };
        let last = &chain.vertices[chain.vertices.len() - 1];
        if last.surface != SurfaceId::Triangle(triangle) {
            return;
        }
        let ray = Ray::new(last.at.position, chain.exit);
        let Some(hit) = light.intersect(&ray) else { return };
        let (centre, radius) = scene.specular_ball();
        let sample = light.sample_at(centre, radius, &ray, &hit);
        let walk = ManifoldWalk { source: sample.source, ..self.walk };
        if let Some(path) = walk.solved(chain) {
            self.weighted(&path, &sample, focus, counters, arrive);
        }
    }

    /// The light along a path that both the search and a ray may find, by the balance heuristic (Veach and Guibas
    /// 1995).
    fn weighted(
        &self,
        path: &SolvedChain,
        sample: &SourceSample,
        focus: &Focus,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let ManifoldWalk { scene, point, .. } = self.walk;
        let Some(arrival) = path.arrival(scene, point, self.light, sample, counters) else { return };
        let SurfaceId::Triangle(triangle) = path.first_surface() else { return };
        let drawn = focus.share(triangle);
        let share = if drawn > 0.0 {
            let by_ray =
                drawn * focus::density(&facet(scene, self.mesh, triangle), point.position, path.first_vertex());
            let (centre, radius) = scene.specular_ball();
            let of_light = scene.lights()[self.light as usize].source_density(centre, radius, sample.source);
            of_light / (of_light + by_ray * path.magnification(sample))
        } else {
            1.0
        };
        arrive(Arrival { weight: arrival.weight * share, ..arrival });
    }

    /// The light along the first path on the curve from the straight line to the light.
    fn first(&self, counters: &mut Counters, arrive: &mut dyn FnMut(Arrival)) {
        let ManifoldWalk { scene, point, source, .. } = self.walk;
        let Some(start) = on_straight_line(scene, point, (source, self.sample.triangle), self.mesh, counters) else {
            return;
        };
        let facet = |triangle| facet(scene, self.mesh, triangle);
        let (triangle, weights) = start;
        let started = facet(triangle);
        let mut paths: Vec<SolvedChain> = Vec::new();
        for ends in ways(scene, point, source, self.mesh, self.event) {
            if !ends.may_see(started.normal(weights).dot(point.position - started.place(weights)), 0.0) {
                continue;
            }
            if let Some((triangle, weights)) = first_path(start, facet, self.trees.neighbours(scene, self.mesh), &ends)
                && let Some(path) = self.walk.path_over(triangle, facet(triangle).place(weights), weights, counters)
                && !paths.iter().any(|known| known.same(&path))
            {
                paths.push(path);
            }
        }
        for path in paths {
            if let Some(arrival) = path.arrival(scene, point, self.light, self.sample, counters) {
                arrive(arrival);
            }
        }
    }
}

/// Triangles that are opened without allocating memory.
const USUAL: usize = 16;

/// Lights that look larger than this from the shading point, radians about, get no rays: what they would be sent to is
/// most of the mesh, and the folds of their caustics are blurred.
const LARGE: f64 = 0.2;

/// The middle of a light and how far its points are from there, metres or the chord between unit directions; `None` for
/// points and large lights.
fn whole(light: &Light, point: DVec3) -> Option<(Source, f64)> {
    let (source, spread, size) = match light_bounds(light, &Frame::WORLD)? {
        SourceBounds::Ball { centre, radius } => (Source::Point(centre), radius, radius / (centre - point).length()),
        SourceBounds::Cap { direction, sin_radius } => {
            let cosine = (1.0 - sin_radius * sin_radius).max(0.0).sqrt();
            let chord = sin_radius * (2.0 / (1.0 + cosine)).sqrt();
            (Source::Direction(direction), chord, chord)
        }
    };
    (spread > 0.0 && size < LARGE).then_some((source, spread))
}

/// The ends of paths over a mesh, for each side of it on which the shading point can be.
fn ways(scene: &Scene, point: &ShadingPoint, source: Source, mesh: u32, event: SpecularEvent) -> ArrayVec<Ends, 2> {
    let first = scene.meshes()[mesh as usize].triangle_range().start;
    let Some(delta) = scene.delta_bsdf(first) else { return ArrayVec::new() };
    match (event, delta.index_of_refraction()) {
        (SpecularEvent::Transmission, Some(index)) => {
            [true, false].into_iter().map(|outside| Ends::refracted(point.position, source, index, outside)).collect()
        }
        (SpecularEvent::Transmission, None) => ArrayVec::new(),
        (SpecularEvent::Reflection, _) => [Ends::mirrored(point.position, source)].into_iter().collect(),
    }
}

/// Surfaces on the straight line to a light that are passed over in search of a mesh. Without an end, a line through an
/// edge would meet its two triangles in turn for ever.
const MOST_PASSED: usize = 32;

/// Where the straight line from `point` to a source first meets a mesh, whatever else it meets: triangle and weights of
/// its second and third corner.
fn on_straight_line(
    scene: &Scene,
    point: &ShadingPoint,
    (source, triangle): (Source, Option<u32>),
    mesh: u32,
    counters: &mut Counters,
) -> Option<(u32, DVec2)> {
    let (mut ray, mut distance) = straight(point.position, source, triangle);
    let mut ray_origin = point.surface;
    for _ in 0..MOST_PASSED {
        let hit = scene.accelerator().closest_hit(&ray, distance, ray_origin, counters)?;
        if let Surface::Triangle { index, barycentric } = hit.surface
            && scene.mesh_of(index) == mesh
        {
            return Some((index, barycentric.into()));
        }
        ray_origin = match hit.surface {
            Surface::Triangle { index, .. } => SurfaceId::Triangle(index),
            Surface::Pane { index, hit } => match hit.boundary {
                PaneBoundary::Face(face) => SurfaceId::Pane { index, face },
                PaneBoundary::Edge => return None,
            },
        };
        (ray, distance) = straight(ray.at(hit.distance), source, triangle);
    }
    None
}
