//! A chain: the specular vertices that light meets on its way from a shading point, traced through the scene.
//!
//! A ray from the shading point is followed as the path tracer would follow it, but with what happens at each vertex
//! given beforehand. The last vertex is joined to a point of a light, and need not obey Snell's law there. A manifold
//! walk (`manifold`) needs the defect of that law, and its derivative by the first vertex.

use crate::specular::constraint::ManifoldConstraint;
use glam::{DMat2, DVec2, DVec3};
use smallvec::SmallVec;

use super::SpecularEvent;
use super::block_tridiagonal::{Row, solve};
use super::caster::SeenCaster;
use super::constraint::{Bend, Residual, Vertex};
use super::side::unit_normal;
use crate::math::absorption;
use crate::scene::ShadingPoint;
use crate::{
    bsdf::fresnel::{reflect, refract},
    bsdf::polarisation::{Fresnel, Polarisation},
    geometry::{Face, Hit, PaneBoundary, PaneHit, Ray, Surface, SurfaceDifferential, SurfaceId},
    light::Source,
    scene::{Scene, visibility::straight},
};
use clerestory_film::counters::Counters;

/// A value for each vertex of a chain. The two of a pane fit inline, so that a search through panes allocates nothing,
/// and moving a chain, which walks do in every step, moves little. More go to the heap.
pub(super) type ByVertex<T> = SmallVec<[T; 2]>;

/// A value for each segment, of which there is one more.
type BySegment<T> = SmallVec<[T; 3]>;

/// A specular vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChainVertex {
    /// The surface, to be skipped by a ray that leaves it.
    pub(super) surface: SurfaceId,
    /// The pane in whose glass light goes on, as [`SurfaceId`] when it starts there.
    pub(super) inside: Option<u32>,
    /// The surface around the vertex.
    pub(super) at: SurfaceDifferential,
    /// What happens there.
    pub(super) bend: Bend,
}

/// The specular vertices between a shading point and a light.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    /// From the shading point on; at least one.
    pub(super) vertices: ByVertex<ChainVertex>,
    /// What radiance from the light is multiplied by at all vertices and in the glass between them.
    pub(super) throughput: DVec3,
    /// Of light that is unpolarised at the shading point.
    polarisation: Polarisation,
    /// Unit direction into which the last vertex sends light.
    pub(super) exit: DVec3,
}

/// One vertex of a chain that obeys its law, and where light goes from there.
struct Step {
    vertex: ChainVertex,
    factor: DVec3,
    polarisation: Polarisation,
    next: DVec3,
}

/// The way of light between its ends, from the shading point to the light.
#[derive(Clone, Debug)]
pub(super) struct Segments {
    /// Unit directions.
    pub(super) directions: BySegment<DVec3>,
    /// Lengths, metres; the last is infinite for a light at infinity.
    pub(super) lengths: BySegment<f64>,
}

impl Segments {
    /// Direction of the last one.
    pub(super) fn last(&self) -> DVec3 {
        self.directions[self.directions.len() - 1]
    }

    /// Length of the shortest one, metres.
    pub(super) fn shortest(&self) -> f64 {
        self.lengths.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

impl Chain {
    /// A chain without vertices.
    fn start(direction: DVec3) -> Self {
        let (throughput, polarisation) = (DVec3::ONE, Polarisation::NONE);
        Self { vertices: ByVertex::new(), throughput, polarisation, exit: direction }
    }

    /// The chain that a ray in `direction` from the shading point meets, when that begins on `caster` and each vertex
    /// can do what `events` says.
    pub(super) fn trace(
        scene: &Scene,
        point: &ShadingPoint,
        direction: DVec3,
        caster: &SeenCaster,
        events: &[SpecularEvent],
        counters: &mut Counters,
    ) -> Option<Self> {
        let mut chain = Self::start(direction);
        let mut ray = Ray::new(point.position, direction);
        for event in events {
            let hit = match chain.vertices.last() {
                None => caster.first_hit(scene, &ray, point.surface, counters),
                Some(last) => next_hit(scene, &ray, last.inside, last.surface, f64::INFINITY, counters),
            }?;
            let step = chain.meet(scene, &ray, &hit, *event, counters)?;
            chain.throughput *= step.factor;
            chain.polarisation = step.polarisation;
            chain.vertices.push(step.vertex);
            chain.exit = step.next;
            ray = Ray::new(step.vertex.at.position, step.next);
        }
        Some(chain)
    }

    /// The chain over one place of a specular triangle, given as well by the weights of its second and third corner;
    /// `None` where something is in the way, or the event cannot happen.
    pub(super) fn over_place(
        scene: &Scene,
        point: &ShadingPoint,
        triangle: u32,
        place: DVec3,
        weights: DVec2,
        event: SpecularEvent,
        counters: &mut Counters,
    ) -> Option<Self> {
        let offset = place - point.position;
        let distance = offset.length();
        let ray = Ray::new(point.position, offset / distance);
        if scene.accelerator().solid().occluded_before(&ray, distance, point.surface, triangle, counters) {
            return None;
        }
        let mut chain = Self::start(ray.direction);
        let hit = Hit { distance, surface: Surface::Triangle { index: triangle, barycentric: weights.into() } };
        let step = chain.meet(scene, &ray, &hit, event, counters)?;
        chain.vertices.push(step.vertex);
        Some(Self { throughput: step.factor, exit: step.next, ..chain })
    }

    /// The vertices at which the straight line from the shading point to the source crosses specular surfaces,
    /// refracting at none; `None` when they are not as many as `count`, or anything else is in the way.
    pub(super) fn along_straight_line(
        scene: &Scene,
        point: &ShadingPoint,
        (source, triangle): (Source, Option<u32>),
        count: usize,
        counters: &mut Counters,
    ) -> Option<Self> {
        let (mut ray, mut distance) = straight(point.position, source, triangle);
        let mut chain = Self::start(ray.direction);
        loop {
            let (inside, ray_origin) =
                chain.vertices.last().map_or((None, point.surface), |last| (last.inside, last.surface));
            let Some(hit) = next_hit(scene, &ray, inside, ray_origin, distance, counters) else { break };
            let vertex = chain.cross(scene, &ray, &hit, counters)?;
            if chain.vertices.len() == count {
                return None;
            }
            chain.vertices.push(vertex);
            (ray, distance) = straight(vertex.at.position, source, triangle);
        }
        (chain.vertices.len() == count && chain.vertices.last()?.inside.is_none()).then_some(chain)
    }

    /// The vertex where a ray has met a surface, and what the event makes of the ray.
    fn meet(&self, scene: &Scene, ray: &Ray, hit: &Hit, event: SpecularEvent, counters: &mut Counters) -> Option<Step> {
        if is_immersed(scene, hit) {
            return None;
        }
        match &hit.surface {
            Surface::Triangle { index, barycentric } => {
                if self.vertices.last().is_some_and(|last| last.inside.is_some()) {
                    return None;
                }
                let interface = scene.delta_bsdf(*index)?;
                let place = scene.surface_point(*index, *barycentric);
                let body = scene.bsdf(*index).absorption();
                let leaves = ray.direction.dot(place.normals.geometric) > 0.0;
                let kept = if leaves && body != DVec3::ZERO { absorption(body, hit.distance) } else { DVec3::ONE };
                let light = self.polarisation.incident(ray.direction, place.normals.shading);
                let (bend, factor, polarisation, next) = match event {
                    SpecularEvent::Transmission => {
                        let crossing = interface.transmit(ray.direction, &place.normals)?;
                        let (part, behind) = light.after(crossing.fresnel.transmission());
                        let factor = DVec3::splat(crossing.radiance_factor(part));
                        (Bend::Transmission { ratio: crossing.ratio }, factor, behind, crossing.direction)
                    }
                    SpecularEvent::Reflection => {
                        let mirrored = interface.reflect(ray.direction, &place)?;
                        let (part, before) = light.after(mirrored.fresnel.reflection());
                        (Bend::Reflection, mirrored.colour * part, before, mirrored.direction)
                    }
                };
                let at = scene.differential(*index, ray.at(hit.distance), *barycentric);
                let vertex = ChainVertex { surface: SurfaceId::Triangle(*index), inside: None, at, bend };
                Some(Step { vertex, factor: kept * factor, polarisation, next })
            }
            Surface::Pane { index, hit: pane_hit } => {
                let pane = &scene.panes()[*index as usize];
                let glass = if pane_hit.inside { absorption(pane.absorption, hit.distance) } else { DVec3::ONE };
                let normal = pane.frame.vector_to_world(unit_normal(pane_hit.gradient));
                let (before, behind) =
                    if pane_hit.inside { (pane.index_of_refraction, 1.0) } else { (1.0, pane.index_of_refraction) };
                let refraction = refract(ray.direction, normal, before, behind);
                let light = self.polarisation.incident(ray.direction, normal);
                let PaneBoundary::Face(face) = pane_hit.boundary else { return None };
                let layer = |inside: DVec3| pane.layer(face, inside.dot(normal));
                let within = if pane_hit.inside { layer(ray.direction) } else { DVec3::ONE };
                let crossed = match (event, refraction) {
                    (SpecularEvent::Transmission, Some(refraction)) if !pane_hit.inside => layer(refraction.direction),
                    (SpecularEvent::Transmission, _) => within,
                    // Light that is reflected in the glass crosses the layer twice.
                    (SpecularEvent::Reflection, _) => within * within,
                };
                let (bend, surface, next, stays) = match event {
                    SpecularEvent::Transmission => {
                        let refraction = refraction?;
                        let bend = Bend::Transmission { ratio: behind / before };
                        (bend, refraction.fresnel.transmission(), refraction.direction, !pane_hit.inside)
                    }
                    SpecularEvent::Reflection => {
                        let fresnel = refraction.map_or(Fresnel::TOTAL, |refraction| refraction.fresnel);
                        (Bend::Reflection, fresnel.reflection(), reflect(ray.direction, normal), pane_hit.inside)
                    }
                };
                let (fraction, polarisation) = light.after(surface);
                let vertex = face_vertex(scene, *index, pane_hit, bend, stays, counters)?;
                Some(Step { vertex, factor: glass * crossed * fraction, polarisation, next })
            }
        }
    }

    /// The vertex where a ray goes straight through a surface.
    fn cross(&self, scene: &Scene, ray: &Ray, hit: &Hit, counters: &mut Counters) -> Option<ChainVertex> {
        if is_immersed(scene, hit) {
            return None;
        }
        match &hit.surface {
            Surface::Triangle { index, barycentric } => {
                if self.vertices.last().is_some_and(|last| last.inside.is_some()) {
                    return None;
                }
                let normals = scene.normals(*index, *barycentric);
                let ratio = scene.delta_bsdf(*index)?.ratio(ray.direction, &normals)?;
                let at = scene.differential(*index, ray.at(hit.distance), *barycentric);
                let bend = Bend::Transmission { ratio };
                Some(ChainVertex { surface: SurfaceId::Triangle(*index), inside: None, at, bend })
            }
            Surface::Pane { index, hit: pane_hit } => {
                let glass = scene.panes()[*index as usize].index_of_refraction;
                let ratio = if pane_hit.inside { 1.0 / glass } else { glass };
                face_vertex(scene, *index, pane_hit, Bend::Transmission { ratio }, !pane_hit.inside, counters)
            }
        }
    }

    /// Directions and lengths of the segments when the last vertex is joined to the source.
    pub(super) fn segments(&self, origin: DVec3, source: Source) -> Segments {
        let mut segments = Segments { directions: BySegment::new(), lengths: BySegment::new() };
        let mut from = origin;
        for vertex in &self.vertices {
            let offset = vertex.at.position - from;
            let length = offset.length();
            segments.directions.push(offset / length);
            segments.lengths.push(length);
            from = vertex.at.position;
        }
        let (last, length) = straight(from, source, None);
        segments.directions.push(last.direction);
        segments.lengths.push(length);
        segments
    }

    /// The constraints at all vertices; `None` where light is totally reflected both ways.
    pub(super) fn residuals(&self, segments: &Segments, constraint: ManifoldConstraint) -> Option<ByVertex<Residual>> {
        let mut residuals = ByVertex::new();
        for (k, vertex) in self.vertices.iter().enumerate() {
            let to_previous = -segments.directions[k];
            let to_next = segments.directions[k + 1];
            residuals
                .push(Vertex { surface: &vertex.at, to_previous, to_next, bend: vertex.bend }.residual(constraint)?);
        }
        Some(residuals)
    }

    /// The linearised constraints, each vertex moving along its surface, with right-hand sides for their numbers.
    pub(super) fn rows<R>(
        &self,
        segments: &Segments,
        residuals: &[Residual],
        right: impl Fn(usize) -> R,
    ) -> ByVertex<Row<R>> {
        let by_segment = |gradients: &[DVec3; 2], segment: usize, vertex: usize| {
            let tangents = &self.vertices[vertex].at.tangents;
            turned(gradients, segments.directions[segment], segments.lengths[segment], tangents)
        };
        let last = self.vertices.len() - 1;
        let row = |(k, residual): (usize, &Residual)| Row {
            before: if k > 0 { by_segment(&residual.by_previous, k, k - 1) } else { DMat2::ZERO },
            // Moving a vertex turns the directions to its neighbours the other way.
            own: residual.by_normal - by_segment(&residual.by_previous, k, k) - by_segment(&residual.by_next, k + 1, k),
            after: if k < last { by_segment(&residual.by_next, k + 1, k + 1) } else { DMat2::ZERO },
            right: right(k),
        };
        residuals.iter().enumerate().map(row).collect()
    }

    /// The generalised geometry factor of a chain that obeys the constraints everywhere, with its sign: solid angle at
    /// the shading point for each area, perpendicular to the path, at a light point, or for each solid angle of a light
    /// at infinity (Jakob and Marschner 2012, section 5.1). `None` on a fold.
    pub(super) fn geometry_factor(&self, segments: &Segments, residuals: &[Residual]) -> Option<f64> {
        let last = self.vertices.len() - 1;
        let direction = segments.directions[last + 1];
        let (u, v) = direction.any_orthonormal_pair();
        let length = segments.lengths[last + 1];
        let scale = if length.is_finite() { 1.0 / length } else { 1.0 };
        // How the first vertex moves when the light's end of the last segment does.
        let [first, second] = &residuals[last].by_next;
        let of_light = [u, v].map(|across| -DVec2::new(first.dot(across), second.dot(across)) * scale);
        let right = |k| if k == last { DMat2::from_cols(of_light[0], of_light[1]) } else { DMat2::ZERO };
        let mut rows = self.rows(segments, residuals, right);
        solve(&mut rows)?;
        let moved = rows[0].right;
        let towards = segments.directions[0];
        let (u, v) = towards.any_orthonormal_pair();
        let turned = turned(&[u, v], towards, segments.lengths[0], &self.vertices[0].at.tangents);
        let factor = (turned * moved).determinant();
        factor.is_finite().then_some(factor)
    }
}

/// Whether a ray has met a body that meets others: such paths are left to chance.
fn is_immersed(scene: &Scene, hit: &Hit) -> bool {
    scene.is_immersed(match hit.surface {
        Surface::Triangle { index, .. } => SurfaceId::Triangle(index),
        Surface::Pane { index, .. } => SurfaceId::Pane { index, face: Face::Front },
    })
}

/// What a ray meets next, in the glass of a pane or in the air.
fn next_hit(
    scene: &Scene,
    ray: &Ray,
    inside: Option<u32>,
    ray_origin: SurfaceId,
    distance: f64,
    counters: &mut Counters,
) -> Option<Hit> {
    match (inside, ray_origin) {
        (Some(pane), SurfaceId::Pane { face, .. }) => {
            let hit = scene.accelerator().solid().closest_hit_inside(pane, ray, Some(face), counters);
            hit.filter(|hit| hit.distance < distance)
        }
        _ => scene.accelerator().solid().closest_hit(ray, distance, ray_origin, counters),
    }
}

/// A vertex on a face of a pane; `None` on its edge.
fn face_vertex(
    scene: &Scene,
    index: u32,
    hit: &PaneHit,
    bend: Bend,
    stays_inside: bool,
    counters: &mut Counters,
) -> Option<ChainVertex> {
    let PaneBoundary::Face(face) = hit.boundary else { return None };
    let pane = &scene.panes()[index as usize];
    counters.height_evaluations += 1;
    let jet = pane.surface(face).jet(hit.point.truncate());
    let position = pane.frame.point_to_world(hit.point);
    let at = SurfaceDifferential::of_face(&pane.frame, position, &jet);
    Some(ChainVertex { surface: SurfaceId::Pane { index, face }, inside: stays_inside.then_some(index), at, bend })
}

/// Derivatives of two components, given by their gradients with respect to a direction, when the far end of a segment
/// with this direction (of either sign) and this length moves along two tangents.
fn turned(gradients: &[DVec3; 2], direction: DVec3, length: f64, tangents: &[DVec3; 2]) -> DMat2 {
    let across = gradients.map(|gradient| (gradient - direction * direction.dot(gradient)) / length);
    let column = |tangent: DVec3| DVec2::new(across[0].dot(tangent), across[1].dot(tangent));
    DMat2::from_cols(column(tangents[0]), column(tangents[1]))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde_json::json;

    use super::*;
    use crate::document::{SceneBundle, SceneDescription};
    use crate::specular::caster::Caster;
    use crate::specular::testing::{pair, random};

    /// Two panes over the origin and a curved mirror above them, of one triangle.
    fn panes_and_mirror() -> Scene {
        let pane = |name: &str, height: f64, profile: serde_json::Value| {
            json!({
                "name": name, "centre": [0, 0, height], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0.1],
                "width": 0.4, "height": 0.4,
                "thickness": 0.003, "index_of_refraction": 1.52, "front": profile, "back": profile})
        };
        let normals = [[-0.2, 0.1, -1.0], [0.3, 0.1, -1.0], [0.05, -0.4, -1.0]];
        let description = json!({
            "version": 1, "name": "panes and a mirror", "film": {"width": 4, "height": 4},
            "camera": {"orthographic": {"position": [0, 0, -1], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1}},
            "integrator": {"path": {}},
            "materials": {"mirror": {"mirror": {"reflectance": [0.9, 0.9, 0.9]}}},
            "meshes": [{"name": "mirror", "material": "mirror", "source": {"inline": {
                "positions": [[-2, -2, 1.2], [2, -2, 1.2], [0, 3, 1.5]], "normals": normals,
                "triangles": [[0, 1, 2]]}}}],
            "panes": [
                pane("near", 0.5, json!({"hammered": {"wavelength": 0.03, "amplitude": 3e-5, "seed": 3}})),
                pane("far", 0.8, json!({"crown": {"centre": [0.1, 0.15], "wavelength": 0.02, "amplitude": 1e-5}}))],
            "lights": [{"point": {"name": "lamp", "position": [0, 0, 3], "intensity": [1, 1, 1]}}],
        });
        let description = SceneDescription::parse(description.to_string().as_bytes()).unwrap();
        SceneBundle::from_parts(description, BTreeMap::new()).unwrap().build_scene().unwrap()
    }

    #[test]
    fn the_geometry_factor_is_that_of_rays_beside_the_chain() {
        let scene = panes_and_mirror();
        let point = ShadingPoint { position: DVec3::ZERO, normal: DVec3::Z, surface: SurfaceId::Nothing, bounces: 0 };
        let caster = Caster::Pane(0).seen_from(&scene, &point).unwrap();
        let counters = &mut Counters::default();
        let mut random = random(12);
        for letters in ["R", "TT", "TRT", "TRRT", "TTTT", "TTTTR"] {
            let events: Vec<SpecularEvent> = letters
                .chars()
                .map(|letter| if letter == 'R' { SpecularEvent::Reflection } else { SpecularEvent::Transmission })
                .collect();
            let mut checked = 0;
            for _ in 0..40 {
                let target = (0.2 * (pair(&mut random) - 0.5)).extend(0.5);
                let mut trace =
                    |towards: DVec3| Chain::trace(&scene, &point, towards.normalize(), &caster, &events, counters);
                let Some(chain) = trace(target) else { continue };
                let first = target.normalize();
                let (u, v) = first.any_orthonormal_pair();
                let across = chain.exit;
                let (a, b) = across.any_orthonormal_pair();
                let step = 1e-6;
                let mut beside = |axis: DVec3| Some([trace(first + axis * step)?, trace(first - axis * step)?]);
                let [Some(along_u), Some(along_v)] = [u, v].map(&mut beside) else { continue };
                let last = chain.vertices.last().unwrap().at.position;
                let light = last + chain.exit * 1.5;
                let place_on_light = |chain: &Chain| {
                    let from = chain.vertices.last().unwrap().at.position;
                    let offset = from + chain.exit * ((light - from).dot(across) / chain.exit.dot(across)) - light;
                    DVec2::new(offset.dot(a), offset.dot(b))
                };
                let direction = |chain: &Chain| DVec2::new(chain.exit.dot(a), chain.exit.dot(b));
                let spread = |place: &dyn Fn(&Chain) -> DVec2| {
                    let column = |[ahead, behind]: &[Chain; 2]| (place(ahead) - place(behind)) / (2.0 * step);
                    DMat2::from_cols(column(&along_u), column(&along_v)).determinant()
                };
                for (source, spread) in [
                    (Source::Point(light), spread(&place_on_light)),
                    (Source::Direction(chain.exit), spread(&direction)),
                ] {
                    for constraint in [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector] {
                        let segments = chain.segments(point.position, source);
                        let residuals = chain.residuals(&segments, constraint).unwrap();
                        let factor = chain.geometry_factor(&segments, &residuals).unwrap();
                        assert!(
                            (factor * spread - 1.0).abs() < 1e-5,
                            "{letters}, {constraint:?}, {source:?}: {factor} is not one over {spread}"
                        );
                    }
                }
                checked += 1;
            }
            assert!(checked > 20, "{letters}: {checked} chains only");
        }
    }
}
