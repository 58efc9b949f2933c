//! Light subpaths of a camera sample: how one is traced, and how the camera's vertices are connected to it.
//!
//! A light subpath follows light from a face of a pane, from an opening or from a lamp. It keeps a vertex wherever
//! light is scattered into a solid angle. It ends at whatever light subpaths do not go through: bodies of glass,
//! mirrors, thin walls, places where bodies meet, and lights. Each vertex knows what there is to know of the path from
//! there to the light. So one sum over all pairs of vertices is left. Directions are drawn as the camera draws them,
//! and the BSDF is that of the path from the camera: shading normals make no difference.

use arrayvec::ArrayVec;
use glam::DVec3;

use super::caustic::Gathered;
use super::light_vertex::{FoundBy, LightSubpath, LightVertex, OneSubpath};
use super::lobe::{Lobe, absorption_before, absorption_behind};
use super::media::{Around, Meeting};
use super::stretch::{Origin, Stretch};
use super::{PathTracer, Walk};
use crate::bsdf::polarisation::Polarisation;
use crate::bsdf::{SampleKind, SurfacePoint};
use crate::document::{FilterState, PathEvent};
use crate::geometry::{Hit, PaneBoundary, PaneHit, Ray, Surface, SurfaceId};
use crate::integrator::light_subpaths::{Edge, FromCamera, FromLight, On, PlaceOnFace, SUBPATHS, connection_share};
use crate::light::{LightHit, Receiver, Side};
use crate::math::absorption;
use crate::scene::ShadingPoint;
use crate::scene::looks::Looks;
use crate::specular::scope::MOST_SPECULAR_VERTICES;
use crate::specular::{Arrival, Link, SpecularPath};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

impl PathTracer<'_> {
    /// The light subpaths of a camera sample.
    pub(super) fn light_subpath(&self, stream: &mut SampleStream, counters: &mut Counters) -> LightSubpath<'_> {
        let one = |_| self.one_subpath(stream, counters);
        (0..SUBPATHS).filter_map(one).collect()
    }

    pub(super) fn one_subpath(&self, stream: &mut SampleStream, counters: &mut Counters) -> Option<OneSubpath<'_>> {
        let start = self.starts?.sample(self.scene, stream, counters)?;
        let mut walk = Walk {
            ray: start.ray,
            ray_origin: SurfaceId::Nothing,
            inside: None,
            around: Around::default(),
            body: DVec3::ZERO,
            throughput: DVec3::ONE,
            polarisation: Polarisation::NONE,
            stretch: Stretch::new(None),
            asks_methods: false,
            filter: None,
            depth: 0,
        };
        let mut first = None;
        let events = match &start.on {
            On::Face(PlaceOnFace { pane, face, point, gradient, .. }) => {
                let boundary = PaneBoundary::Face(*face);
                let met = PaneHit { distance: 0.0, point: *point, boundary, gradient: *gradient, inside: false };
                let hit = Hit { distance: 0.0, surface: Surface::Pane { index: *pane, hit: met } };
                walk.depth = 1;
                if !self.glass(&mut walk, *pane, &hit, stream) {
                    return None;
                }
                walk.stretch.links.iter().map(|link| PathEvent::from(link.event)).collect()
            }
            On::Straight { hit, way, .. } => {
                // At panes begin other light subpaths.
                let is_pane = matches!(hit.surface, Surface::Pane { .. });
                let is_left = self.leaves_methods || is_pane;
                if is_left || self.scene.blocked_by_light(&walk.ray, hit.distance, Some(start.light)) {
                    return None;
                }
                walk.throughput = way.transmittance;
                walk.depth = way.walls.len() as u32;
                first = Some(*hit);
                vec![PathEvent::Transmission; way.walls.len()]
            }
        };
        let mut subpath = OneSubpath {
            links: ArrayVec::new(),
            density: 0.0,
            choices: 0.0,
            vertices: Vec::new(),
            events,
            found: Default::default(),
            start,
        };
        while walk.depth < self.max_depth {
            let Some(hit) = first.take().or_else(|| self.next_hit(&walk, counters)) else { break };
            if !self.meets(&mut walk, &mut subpath, &hit, stream) {
                break;
            }
        }
        (!subpath.vertices.is_empty()).then_some(subpath)
    }

    /// What a light subpath meets next; `None` if that is nothing, or a light.
    fn next_hit(&self, walk: &Walk, counters: &mut Counters) -> Option<Hit> {
        let hit = self.closest_hit(walk, counters)?;
        let meets_light = walk.inside.is_none() && self.nearest_light(walk, hit.distance).is_some();
        (!meets_light).then_some(hit)
    }

    /// Takes a light subpath to what it has met; false when it ends.
    fn meets<'s>(
        &'s self,
        walk: &mut Walk,
        subpath: &mut OneSubpath<'s>,
        hit: &Hit,
        stream: &mut SampleStream,
    ) -> bool {
        if !matches!(self.meeting(walk, hit), Meeting::Plain) {
            return false;
        }
        walk.depth += 1;
        match hit.surface {
            Surface::Pane { index, .. } => {
                let goes_on = self.glass(walk, index, hit, stream) && walk.stretch.is_open();
                subpath.events.extend(walk.stretch.links.last().map(|link| PathEvent::from(link.event)));
                goes_on && self.survives(walk, stream)
            }
            Surface::Triangle { index, barycentric } => {
                walk.inside.is_none()
                    && self.light_at(walk, subpath, (index, barycentric), hit.distance)
                    && self.scatter_light(walk, subpath, stream)
                    && self.survives(walk, stream)
            }
        }
    }

    /// Keeps a vertex where light has met a triangle; false where light subpaths have none.
    fn light_at<'s>(
        &'s self,
        walk: &mut Walk,
        subpath: &mut OneSubpath<'s>,
        (triangle, barycentric): (u32, [f64; 2]),
        distance: f64,
    ) -> bool {
        let bsdf = self.scene.bsdf(triangle);
        let at = self.scene.surface_point(triangle, barycentric);
        if bsdf.is_delta() || bsdf.scale(&at) == DVec3::ZERO {
            return false;
        }
        let incident = walk.ray.direction;
        let position = walk.ray.at(distance);
        let cosine = at.normals.geometric.dot(incident).abs();
        if cosine == 0.0 {
            return false;
        }
        let leaves = incident.dot(at.normals.geometric) > 0.0;
        let absorbs = absorption_before(bsdf, leaves, walk.body);
        if absorbs != DVec3::ZERO {
            walk.throughput *= absorption(absorbs, distance);
        }
        walk.body = absorbs;
        let by_camera = match subpath.vertices.last() {
            None => {
                subpath.links = backwards(&walk.stretch.links, incident);
                subpath.choices = walk.stretch.choices;
                subpath.density = subpath.start.density * cosine * walk.stretch.choices;
                None
            }
            Some(before) => {
                let is_connected = self.is_connected && walk.stretch.is_straight();
                let straight = is_connected.then(|| before.position.distance_squared(position));
                let cosines = [before.cosine(before.outgoing), cosine];
                Some(FromLight::behind(&Edge { straight, cosines, pdf: before.of_light(before.outgoing) }))
            }
        };
        let weight = subpath.start.weight * walk.throughput / cosine;
        Looks::count(|looks| looks.vertices += 1);
        subpath.vertices.push(LightVertex {
            bsdf,
            at,
            position,
            triangle,
            incident,
            weight,
            by_camera,
            of_camera: 0.0,
            outgoing: DVec3::ZERO,
            events: subpath.events.len(),
            depth: walk.depth,
        });
        subpath.events.push(PathEvent::Diffuse);
        true
    }

    /// Sends light on from the last vertex; false when it ends there.
    fn scatter_light(&self, walk: &mut Walk, subpath: &mut OneSubpath<'_>, stream: &mut SampleStream) -> bool {
        let Some(vertex) = subpath.vertices.last_mut() else { return false };
        walk.polarisation = Polarisation::NONE;
        let Some(next) = vertex.bsdf.sample(&vertex.at, vertex.incident, stream) else { return false };
        let SampleKind::Density(pdf) = next.kind else { return false };
        let towards = vertex.cosine(next.direction);
        let scattered = vertex.eval(next.direction) * vertex.bsdf.scale(&vertex.at);
        if !(scattered.max_element() > 0.0 && towards > 0.0 && pdf > 0.0) {
            return false;
        }
        vertex.outgoing = next.direction;
        vertex.of_camera = vertex.of_camera(next.direction);
        walk.throughput *= scattered * (towards / (vertex.cosine(vertex.incident) * pdf));
        let normal = vertex.at.normals.geometric;
        let leaves = vertex.incident.dot(normal) > 0.0;
        if next.direction.dot(normal) * vertex.incident.dot(normal) > 0.0 {
            walk.body = absorption_behind(vertex.bsdf, leaves, walk.body);
        }
        walk.ray_origin = SurfaceId::Triangle(vertex.triangle);
        walk.ray = Ray::new(vertex.position, next.direction);
        walk.stretch = Stretch::new(None);
        true
    }

    /// What light subpaths find of a path that has come to a surface.
    pub(super) fn by_light(&self, walk: &Walk, at: &SurfacePoint, position: DVec3) -> FromCamera {
        let last = at.normals.geometric.dot(walk.ray.direction).abs();
        let is_open = walk.stretch.is_open() && !walk.stretch.is_left_to_chance;
        if self.starts.is_none() || !is_open || last == 0.0 {
            return FromCamera::default();
        }
        let Some(origin) = walk.stretch.from else { return self.seen_by_light(walk, last, position) };
        let is_connected = self.is_connected && walk.stretch.is_straight();
        let straight = is_connected.then(|| origin.point.position.distance_squared(position));
        let cosines = [origin.cosine, last];
        FromCamera::behind(&Edge { straight, cosines, pdf: origin.pdf }, origin.by_light)
    }

    /// The share of a specular method in a path that it has found.
    pub(super) fn share_of_method(&self, arrival: &Arrival, light: u32, asked: f64, lobe: &Lobe<'_>) -> f64 {
        let starts = self.starts.filter(|_| !self.leaves_methods);
        let (Some(starts), Some(path)) = (starts, &arrival.path) else { return 1.0 };
        let by_light = lobe.by_light(arrival.direction);
        if by_light == 0.0 {
            return 1.0;
        }
        let start = starts.density(self.scene, light, path.surface, &path.exit, &path.hit);
        let others = start * path.transmitted * lobe.cosine(arrival.direction) * by_light;
        let found = path.density * asked;
        if others == 0.0 { 1.0 } else { found / (found + others) }
    }

    /// The share of chance in a path to a light over specular surfaces that no method owns.
    pub(super) fn share_of_chance(&self, origin: &Origin, walk: &Walk, light: u32, hit: &LightHit) -> f64 {
        let (Some(starts), Some(last)) = (self.starts, walk.stretch.links.last()) else { return 1.0 };
        if origin.by_light == 0.0 || !walk.stretch.is_open() {
            return 1.0;
        }
        // Both densities have the factor of what was chosen at the links.
        let start = starts.density(self.scene, light, last.surface, &walk.ray, hit);
        origin.pdf / (origin.pdf + start * origin.cosine * origin.by_light)
    }

    /// What light subpaths find of a path that goes straight to a light, through thin walls at the most, of which a
    /// camera's vertex has found the ray: the cosine there, and what they find up to it.
    pub(super) fn straight_by_light(
        &self,
        light: u32,
        walls: &[u32],
        (to_light, hit): (&Ray, &LightHit),
        cosine: f64,
        by_light: f64,
    ) -> f64 {
        let Some(starts) = self.starts.filter(|_| by_light > 0.0 && !self.leaves_methods) else { return 0.0 };
        starts.straight_density(self.scene, light, walls, to_light, hit) * cosine * by_light
    }

    /// Light that a vertex receives from those of light subpaths, over the scale of its BSDF.
    pub(super) fn connected_light(
        &self,
        walk: &Walk,
        point: &ShadingPoint,
        lobe: &Lobe<'_>,
        subpaths: &LightSubpath<'_>,
        counters: &mut Counters,
    ) -> Gathered {
        let mut sum = Gathered::default();
        for subpath in subpaths {
            for number in 0..subpath.vertices.len() {
                sum.add(self.connection(walk, point, lobe, (subpath, number), counters), subpath.is_caustic());
            }
        }
        Gathered { all: sum.all / f64::from(SUBPATHS), caustic: sum.caustic / f64::from(SUBPATHS) }
    }

    fn connection(
        &self,
        walk: &Walk,
        point: &ShadingPoint,
        lobe: &Lobe<'_>,
        (subpath, number): (&OneSubpath<'_>, usize),
        counters: &mut Counters,
    ) -> DVec3 {
        let vertex = &subpath.vertices[number];
        if walk.depth + vertex.depth > self.max_depth
            || !self.accepts_light(walk.filter, &subpath.events[..=vertex.events])
        {
            return DVec3::ZERO;
        }
        let offset = vertex.position - point.position;
        let squared = offset.length_squared();
        let distance = squared.sqrt();
        let direction = offset / distance;
        let cosines = [lobe.cosine(direction), vertex.cosine(direction)];
        if !(distance > 0.0 && cosines[0].min(cosines[1]) > 0.0) {
            return DVec3::ZERO;
        }
        let by_light = lobe.by_light(direction);
        // Where methods are not asked, light subpaths of the light plane have all that they find.
        if !walk.asks_methods && by_light > 0.0 {
            return DVec3::ZERO;
        }
        let scattered = lobe.eval(direction);
        if scattered == DVec3::ZERO {
            return DVec3::ZERO;
        }
        let received = vertex.eval(-direction) * vertex.bsdf.scale(&vertex.at) * vertex.weight;
        if received == DVec3::ZERO {
            return DVec3::ZERO;
        }
        let ray = Ray::new(point.position, direction);
        if self.scene.blocked_from_triangle(&ray, distance, point.surface, vertex.triangle, counters) {
            return DVec3::ZERO;
        }
        let bounces = point.bounces + number as u32 + 1;
        let by_camera = self.by_camera(subpath, number, -direction, (bounces, walk.asks_methods), counters);
        let Some(by_camera) = by_camera else {
            return DVec3::ZERO;
        };
        let share = connection_share(
            cosines,
            squared,
            [(by_light, lobe.pdf(direction)), (by_camera, vertex.of_light(-direction))],
        );
        lobe.kept(direction, distance) * scattered * received * (cosines[1] / squared * share)
    }

    /// What other techniques find of the path from a vertex of a light subpath to the light, if it goes on from there
    /// towards the camera; `None` where what finds the light shares it with none. `bounces` are those of the vertex
    /// next to the light, and `asks_methods` says whether methods look for light at the vertices of that camera's path.
    pub(super) fn by_camera(
        &self,
        subpath: &OneSubpath<'_>,
        number: usize,
        towards_camera: DVec3,
        (bounces, asks_methods): (u32, bool),
        counters: &mut Counters,
    ) -> Option<f64> {
        let first = &subpath.vertices[0];
        let onwards = |vertex: &LightVertex<'_>, index: usize| {
            if index == number { vertex.of_camera(towards_camera) } else { vertex.of_camera }
        };
        let outgoing = if number == 0 { towards_camera } else { first.outgoing };
        let found = self.found_by(subpath, outgoing, (bounces, asks_methods), counters);
        let mut sum = match found {
            FoundBy::MethodAlone => return None,
            FoundBy::Method(density) => density / subpath.density,
            FoundBy::Chance => onwards(first, 0) * subpath.choices / subpath.density,
            FoundBy::Nothing => 0.0,
            FoundBy::Straight(density) => {
                let is_met = !self.scene.lights()[subpath.start.light as usize].is_delta();
                (density + if is_met { onwards(first, 0) } else { 0.0 }) / subpath.density
            }
        };
        if self.leaves_methods && sum > 0.0 && !matches!(found, FoundBy::Chance) {
            return None;
        }
        for (index, vertex) in subpath.vertices[..=number].iter().enumerate() {
            if let Some(by_camera) = &vertex.by_camera {
                sum = by_camera.total(onwards(vertex, index), sum);
            }
        }
        Some(sum)
    }

    /// How else the light at the first vertex is found, if it goes on from there towards the camera.
    fn found_by(
        &self,
        subpath: &OneSubpath<'_>,
        towards_camera: DVec3,
        (bounces, asks_methods): (u32, bool),
        counters: &mut Counters,
    ) -> FoundBy {
        let first = &subpath.vertices[0];
        let normal = first.at.normals.facing(-towards_camera);
        let sample = match &subpath.start.on {
            On::Face(PlaceOnFace { sample, .. }) => *sample,
            On::Straight { behind, .. } => {
                let found =
                    subpath.found[0].get_or_init(|| FoundBy::Straight(self.asked_density(subpath, *behind, normal)));
                return *found;
            }
        };
        let gathers_behind = first.bsdf.gathers_behind();
        // A point is met by no path.
        let is_point = self.scene.lights()[subpath.start.light as usize].is_delta();
        let by_chance = if is_point { FoundBy::Nothing } else { FoundBy::Chance };
        // Light from behind is left to chance, whatever the method finds in front.
        if !asks_methods || !gathers_behind && first.incident.dot(normal) >= 0.0 {
            return by_chance;
        }
        let surface = SurfaceId::Triangle(first.triangle);
        let point = ShadingPoint { position: first.position, normal, surface, bounces };
        *subpath.found[bounces.min(2) as usize].get_or_init(|| {
            let (light, ray) = (subpath.start.light, &subpath.start.ray);
            let path = SpecularPath {
                light,
                source: sample.source,
                triangle: sample.triangle,
                last_direction: -ray.direction,
                links: &subpath.links,
            };
            let Some(point) = self.owner(point, gathers_behind, &path, counters) else { return by_chance };
            let density = self.method.and_then(|method| method.density(self.scene, &point, &path, counters));
            let asked = self.scene.light_sampler().probability(light, &Receiver::anywhere(first.position));
            density.map_or(FoundBy::MethodAlone, |density| FoundBy::Method(density * asked))
        })
    }

    /// Density with which next event estimation finds the light at the first vertex of a subpath that comes straight
    /// from it, which is so far behind the subpath's beginning.
    pub(super) fn asked_density(&self, subpath: &OneSubpath<'_>, behind: f64, normal: DVec3) -> f64 {
        let first = &subpath.vertices[0];
        let side = if first.bsdf.transmits() { Side::Both(normal) } else { Side::Front(normal) };
        let receiver = Receiver { position: first.position, side };
        let light = subpath.start.light;
        let source = &self.scene.lights()[light as usize];
        let asked = self.scene.light_sampler().probability(light, &receiver);
        let squared = first.position.distance_squared(subpath.start.ray.origin);
        if source.is_delta() {
            return asked * squared;
        }
        let to_light = Ray::new(first.position, -first.incident);
        let hit = LightHit { distance: squared.sqrt() + behind, radiance: DVec3::ZERO, triangle: None };
        asked * self.scene.pdf_li(light, &receiver, &to_light, &hit)
    }

    /// Whether a path is rendered that is followed by events, which are given from the light on.
    pub(super) fn accepts_light(&self, state: Option<FilterState>, events: &[PathEvent]) -> bool {
        let (Some(filter), Some(state)) = (self.filter, state) else { return true };
        let state = events.iter().rev().fold(state, |state, event| filter.step(state, *event));
        filter.accepts(state, &[PathEvent::Light])
    }
}

/// Links from the light on, as a path to the light meets them that comes against `incident`.
fn backwards(links: &[Link], incident: DVec3) -> ArrayVec<Link, MOST_SPECULAR_VERTICES> {
    let mut onwards = incident;
    let turned = links.iter().rev().map(|link| {
        let turned = Link { direction: -onwards, ..*link };
        onwards = link.direction;
        turned
    });
    turned.collect()
}
