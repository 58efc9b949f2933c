//! The path tracer: next event estimation, specular methods for light through glass, and everything else by chance.
//!
//! Light that arrives at a diffuse vertex is split by path. Direct light comes from next event estimation, combined
//! with BSDF sampling by the balance heuristic. Light over specular vertices comes from the specular method, for the
//! paths that it owns ([`crate::specular::coverage`]). The path tracer finds the rest by following the path.
//!
//! A path may go straight through thin walls from a diffuse vertex to a light. That is direct light, as if there were
//! no walls: next event estimation finds it, too. Both techniques count each wall as a vertex.

mod among_bodies;
mod caustic;
mod from_light;
mod gathering;
mod light_plane;
mod light_vertex;
mod lobe;
mod media;
mod splats;
mod stretch;

use arrayvec::ArrayVec;
use glam::DVec3;

use self::caustic::Mirrors;
use self::light_plane::LightPlane;
use self::light_vertex::LightSubpath;
use self::lobe::{Lobe, absorption_before, absorption_behind, sides, through_body};
use self::media::{Around, Interface, Meeting, Start};
use self::stretch::{Origin, Stretch};
use super::allocation::{Allocation, Sharing};
use super::light_subpaths::{FromCamera, Starts};
use super::prepared::PreparedScene;
use crate::bsdf::SampleKind;
use crate::bsdf::fresnel::{reflect, refract};
use crate::bsdf::polarisation::{Fresnel, Polarisation};
use crate::document::{FilterState, PathEvent, PathFilter};
use crate::geometry::{Face, Hit, PaneBoundary, Ray, Surface, SurfaceId};
use crate::light::{LightHit, Receiver, Side, Source};
use crate::math::absorption;
use crate::scene::looks::Looks;
use crate::scene::visibility::SAME_PLACE;
use crate::scene::{Scene, ShadingPoint};
use crate::specular::side::unit_normal;
use crate::specular::{Link, SpecularEvent, SpecularMethod, SpecularPath};
use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, TileGrid};

/// What one camera sample sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathSample {
    /// Radiance, W/(m2 sr).
    pub radiance: DVec3,
    /// The part of it that is caustic: glass or water has sent it to the surface that scatters it first.
    pub caustic: DVec3,
    /// Reflectance of the first surface; 1 for glass, 0 for lights and where there is nothing.
    pub albedo: DVec3,
    /// Unit normal of the first surface, towards the camera; zero where there is nothing.
    pub normal: DVec3,
    /// Distance to the first surface, metres; 0 where there is nothing.
    pub depth: f64,
}

/// Vertices after which a path may be ended at random.
const ROULETTE_START: u32 = 4;

/// Upper bound of the survival probability, so that paths inside perfect mirrors end.
const MAX_SURVIVAL: f64 = 0.95;

/// A path tracer for one scene.
pub struct PathTracer<'a> {
    scene: &'a Scene,
    filter: Option<&'a PathFilter>,
    method: Option<&'a dyn SpecularMethod>,
    chains: Vec<Chain>,
    /// Where light subpaths begin, if there are any.
    starts: Option<&'a Starts>,
    /// Whether camera samples are connected to light subpaths.
    is_connected: bool,
    /// Whether specular methods and next event estimation share nothing with light subpaths.
    leaves_methods: bool,
    light_plane: LightPlane,
    mirrors: Mirrors,
    max_depth: u32,
    start: Start,
}

/// A chain of specular vertices that the specular method looks for.
struct Chain {
    events: Vec<SpecularEvent>,
    /// The same for the path filter, with the light at its end.
    with_light: Vec<PathEvent>,
}

/// A path on its way.
struct Walk {
    ray: Ray,
    ray_origin: SurfaceId,
    /// The pane in whose glass the ray is, if that meets nothing else.
    inside: Option<(u32, Face)>,
    /// The bodies around the ray that meet others.
    around: Around,
    /// What the body absorbs that the path has entered, per metre; zero in air.
    body: DVec3,
    throughput: DVec3,
    /// Of the light that it carries, since the camera or the last vertex that scatters into a solid angle.
    polarisation: Polarisation,
    stretch: Stretch,
    /// Whether methods look for light at its vertices.
    asks_methods: bool,
    filter: Option<FilterState>,
    /// Vertices so far, at most as many as the scene allows between camera and light.
    depth: u32,
}

impl<'a> PathTracer<'a> {
    /// A path tracer that leaves the paths that the scene's method owns to it, for a film that is cut as `grid` says.
    pub fn new(prepared: &'a PreparedScene, grid: &TileGrid) -> Self {
        Self::with(prepared, grid, prepared.allocation().on(grid))
    }

    /// The same with an allocation of effort to light subpaths.
    pub(super) fn with(prepared: &'a PreparedScene, grid: &TileGrid, allocation: Allocation) -> Self {
        let chain = |events: Vec<SpecularEvent>| {
            let with_light = events.iter().map(|event| PathEvent::from(*event)).chain([PathEvent::Light]).collect();
            Chain { events, with_light }
        };
        let method = prepared.method();
        let chains = method.map_or(Vec::new(), |method| method.chains().into_iter().map(chain).collect());
        let max_depth = prepared.description().integrator.max_depth();
        let scene = prepared.scene();
        let light_plane = LightPlane::new(&allocation, grid);
        Self {
            scene,
            filter: prepared.path_filter(),
            method,
            chains,
            starts: prepared.starts(),
            is_connected: allocation.is_connected,
            leaves_methods: allocation.sharing == Sharing::Chance,
            light_plane,
            mirrors: if grid.has_caustic { Mirrors::of(scene) } else { Mirrors::Metal },
            max_depth,
            start: Start::of(scene),
        }
    }

    /// Traces one path from the camera.
    pub fn sample(&self, ray: Ray, stream: &mut SampleStream, counters: &mut Counters) -> PathSample {
        let mut sample = PathSample::default();
        let from_light =
            if self.is_connected { self.light_subpath(&mut stream.sibling(), counters) } else { ArrayVec::new() };
        let (around, body) = self.start.around(self.scene, &ray);
        let mut walk = Walk {
            ray,
            ray_origin: SurfaceId::Nothing,
            inside: None,
            around,
            body,
            throughput: DVec3::ONE,
            polarisation: Polarisation::NONE,
            stretch: Stretch::new(None),
            asks_methods: true,
            filter: self.filter.map(PathFilter::start),
            depth: 0,
        };
        loop {
            let hit = self.closest_hit(&walk, counters);
            let distance = hit.as_ref().map_or(f64::INFINITY, |hit| hit.distance);
            if walk.inside.is_none()
                && let Some((index, light_hit)) = self.nearest_light(&walk, distance)
            {
                sample.add(self.emission(&walk, index, &light_hit, counters), walk.stretch.is_caustic());
                if walk.depth == 0 {
                    sample.depth += light_hit.distance;
                }
                return sample;
            }
            if walk.inside.is_none() && hit.is_none() {
                sample.add(self.emission_from_infinity(&walk, counters), walk.stretch.is_caustic());
            }
            let Some(hit) = hit else { return sample };
            if walk.inside.is_none()
                && let Some((light, light_hit)) = self.scene.light_on(&hit)
            {
                sample.add(self.emission(&walk, light, &light_hit, counters), walk.stretch.is_caustic());
            }
            let meeting = self.meeting(&walk, &hit);
            if let Meeting::Straight(after) = meeting {
                if walk.depth == 0 {
                    sample.depth += hit.distance;
                }
                if self.go_straight(&mut walk, &hit, after) {
                    continue;
                }
                return sample;
            }
            if walk.depth == 0 {
                self.describe_first_hit(&walk.ray, &hit, &mut sample);
            }
            if walk.depth >= self.max_depth {
                return sample;
            }
            walk.depth += 1;
            let goes_on = match (meeting, hit.surface) {
                (Meeting::Face(face), _) => self.smooth_interface(&mut walk, &hit, face, stream),
                (meeting, Surface::Triangle { index, barycentric }) => {
                    let interface = if let Meeting::Surface(interface) = meeting { Some(interface) } else { None };
                    let triangle = (index, barycentric, interface);
                    self.surface(&mut walk, hit.distance, triangle, &from_light, &mut sample, stream, counters)
                }
                (Meeting::Black, _) => false,
                (_, Surface::Pane { index, .. }) => self.glass(&mut walk, index, &hit, stream),
            };
            if !goes_on || !self.survives(&mut walk, stream) {
                return sample;
            }
        }
    }

    /// What a path meets next.
    fn closest_hit(&self, walk: &Walk, counters: &mut Counters) -> Option<Hit> {
        let accelerator = self.scene.accelerator();
        match walk.inside {
            Some((pane, face)) => accelerator.closest_hit_inside(pane, &walk.ray, Some(face), counters),
            None if !walk.around.is_air() => self.closest_hit_among_bodies(walk, f64::INFINITY, counters),
            None => accelerator.closest_hit(&walk.ray, f64::INFINITY, walk.ray_origin, counters),
        }
    }

    fn describe_first_hit(&self, ray: &Ray, hit: &Hit, sample: &mut PathSample) {
        sample.depth += hit.distance;
        let (normal, albedo) = match &hit.surface {
            Surface::Triangle { index, barycentric } => {
                let at = self.scene.surface_point(*index, *barycentric);
                (at.normals.shading, self.scene.bsdf(*index).albedo(&at))
            }
            Surface::Pane { index, hit } => {
                let pane = &self.scene.accelerator().panes()[*index as usize];
                let albedo = if hit.boundary == PaneBoundary::Edge { DVec3::ZERO } else { DVec3::ONE };
                (pane.frame.vector_to_world(unit_normal(hit.gradient)), albedo)
            }
        };
        sample.albedo = albedo;
        sample.normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
    }

    /// The nearest light on the ray before `distance`. Suns are behind everything; a light that lies on a surface
    /// covers it on the side to which it shines.
    fn nearest_light(&self, walk: &Walk, distance: f64) -> Option<(u32, LightHit)> {
        let mut nearest: Option<(u32, LightHit)> = None;
        self.scene.light_sampler().on_ray(&walk.ray, distance * (1.0 + SAME_PLACE), &mut |index| {
            let Some(hit) = self.scene.lights()[index as usize].intersect(&walk.ray) else { return false };
            let covered = if hit.radiance == DVec3::ZERO { -SAME_PLACE } else { SAME_PLACE };
            let end = distance * (1.0 + covered);
            // Of lights in the same place, the first in the scene.
            let is_nearer = nearest
                .as_ref()
                .map_or(hit.distance < end, |(other, other_hit)| (hit.distance, index) < (other_hit.distance, *other));
            if is_nearer && hit.distance < end {
                nearest = Some((index, hit));
            }
            false
        });
        nearest
    }

    /// Light that the path carries back when it meets nothing: that of all suns in its direction and of the
    /// environment. They cover each other no more than they cast shadows.
    fn emission_from_infinity(&self, walk: &Walk, counters: &mut Counters) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for index in self.scene.light_sampler().infinite() {
            if let Some(hit) = self.scene.lights()[index as usize].intersect(&walk.ray) {
                sum += self.emission(walk, index, &hit, counters);
            }
        }
        sum
    }

    /// Light that the path carries back from a light that it has met.
    fn emission(&self, walk: &Walk, light: u32, hit: &LightHit, counters: &mut Counters) -> DVec3 {
        if !self.accepts(walk.filter, &[PathEvent::Light]) {
            return DVec3::ZERO;
        }
        let carried = walk.throughput * hit.radiance * through_body(walk.body, hit.distance);
        let Some(origin) = walk.stretch.from.as_ref().filter(|_| carried != DVec3::ZERO) else { return carried };
        if walk.stretch.is_unseen {
            return carried;
        }
        if walk.stretch.links.is_empty() {
            let asked = self.scene.light_sampler().probability(light, &origin.receiver);
            // As seen from the vertex, before all walls.
            let ray = Ray::new(origin.point.position, walk.ray.direction);
            let hit = LightHit { distance: walk.stretch.length + hit.distance, ..*hit };
            let light_density = self.scene.pdf_li(light, &origin.receiver, &ray, &hit) * asked;
            let by_light =
                self.straight_by_light(light, &walk.stretch.walls, (&ray, &hit), origin.cosine, origin.by_light);
            return carried * (origin.pdf / (origin.pdf + light_density + by_light));
        }
        let source = if hit.distance.is_finite() {
            Source::Point(walk.ray.at(hit.distance))
        } else {
            Source::Direction(walk.ray.direction)
        };
        let path = SpecularPath {
            light,
            source,
            triangle: hit.triangle,
            last_direction: walk.ray.direction,
            links: &walk.stretch.links,
        };
        let is_left_to_chance = walk.stretch.is_left_to_chance
            || !walk.asks_methods
            || self.owner(origin.point, origin.gathers_behind, &path, counters).is_none();
        if is_left_to_chance {
            return carried * self.share_of_chance(origin, walk, light, hit);
        }
        DVec3::ZERO
    }

    /// The side of a point on which the method looks for a path.
    fn owner(
        &self,
        point: ShadingPoint,
        gathers_behind: bool,
        path: &SpecularPath<'_>,
        counters: &mut Counters,
    ) -> Option<ShadingPoint> {
        // Methods gather light on the side of a normal: what other BSDFs transmit from behind is left to chance.
        let towards = path.links[0].direction;
        let side = sides(point, gathers_behind).find(|side| towards.dot(side.normal) > 0.0)?;
        self.method?.owns(self.scene, &side, path, counters).then_some(side)
    }

    /// Adds the light that a surface scatters into the path, and scatters the path; false when the path ends.
    #[expect(clippy::too_many_arguments, reason = "where a path is, and all that it meets there")]
    fn surface(
        &self,
        walk: &mut Walk,
        distance: f64,
        (triangle, barycentric, interface): (u32, [f64; 2], Option<Interface>),
        from_light: &LightSubpath<'_>,
        sample: &mut PathSample,
        stream: &mut SampleStream,
        counters: &mut Counters,
    ) -> bool {
        // A mesh that stands in the glass of a pane is black: nothing describes how the two touch.
        if walk.inside.is_some() {
            return false;
        }
        let of_material = self.scene.bsdf(triangle);
        let between = interface.as_ref().and_then(|interface| of_material.between(interface.ratio()));
        let bsdf = between.as_deref().unwrap_or(of_material);
        let at = self.scene.surface_point(triangle, barycentric);
        let incident = walk.ray.direction;
        let leaves = incident.dot(at.normals.geometric) > 0.0;
        let absorbs = if interface.is_none() { absorption_before(bsdf, leaves, walk.body) } else { walk.body };
        if absorbs != DVec3::ZERO {
            walk.throughput *= absorption(absorbs, distance);
        }
        let behind = match &interface {
            Some(interface) => interface.behind().absorption,
            None => absorption_behind(bsdf, leaves, absorbs),
        };
        let ray_origin = SurfaceId::Triangle(triangle);
        let position = walk.ray.at(distance);
        let mut point = None;
        if !bsdf.is_delta() {
            if !self.advance(walk, PathEvent::Diffuse) {
                return false;
            }
            let scale = bsdf.scale(&at);
            if scale == DVec3::ZERO {
                return false;
            }
            let carried = walk.throughput * scale;
            let bounces = walk.stretch.from.map_or(0, |from| from.point.bounces + 1);
            Looks::count(|looks| looks.vertices += 1);
            let here = ShadingPoint { position, normal: at.normals.facing(incident), surface: ray_origin, bounces };
            let side = if bsdf.transmits() { Side::Both(here.normal) } else { Side::Front(here.normal) };
            let receiver = Receiver { position, side };
            let before = walk.around.bodies();
            let around = [before, interface.as_ref().map_or(before, Interface::bodies_behind)];
            let is_open = walk.around.is_air() && interface.is_none();
            let by_light = if is_open { self.by_light(walk, &at, position) } else { FromCamera::default() };
            if self.light_plane.is_alone && walk.stretch.from.is_none() {
                walk.asks_methods = by_light.is_nothing();
            }
            let lobe = Lobe { bsdf, at: &at, incident, receiver, bodies: [absorbs, behind], around, by_light };
            self.add_scattered(walk, &here, &lobe, carried, sample, stream, counters);
            if is_open {
                let found = self.connected_light(walk, &here, &lobe, from_light, counters);
                sample.radiance += carried * found.all;
                sample.caustic += carried * found.caustic;
            }
            point = Some((here, receiver, by_light));
        }
        let next = bsdf.sample_polarised(&at, incident, &mut walk.polarisation, stream);
        let Some(next) = next else { return false };
        walk.throughput *= next.weight;
        let by_light = |by_light: FromCamera| by_light.total(|| bsdf.pdf(&at, -next.direction, -incident));
        let cosine = next.direction.dot(at.normals.geometric).abs();
        let goes_through = next.direction.dot(at.normals.geometric) * incident.dot(at.normals.geometric) > 0.0;
        walk.body = if goes_through { behind } else { absorbs };
        // Methods were not asked for light among bodies.
        let was_asked = walk.around.is_air();
        let is_immersed = interface.is_some();
        walk.around.leave_surface();
        if goes_through && let Some(interface) = interface {
            walk.around = interface.into_behind();
        }
        walk.ray_origin = ray_origin;
        walk.ray = Ray::new(position, next.direction);
        match next.kind {
            SampleKind::Density(pdf) => {
                let gathers_behind = bsdf.gathers_behind();
                walk.stretch = Stretch::new(point.map(|(point, receiver, before)| Origin {
                    point,
                    receiver,
                    pdf,
                    gathers_behind,
                    cosine,
                    by_light: by_light(before),
                }));
                walk.stretch.is_left_to_chance = !was_asked;
                true
            }
            SampleKind::Delta(event) => {
                let link = Link { event, surface: ray_origin, position, direction: incident };
                walk.stretch.choices = 0.0;
                walk.stretch.is_over_glass |= caustic::is_glass(bsdf, event);
                if event == SpecularEvent::Transmission && bsdf.as_straight().is_some() && walk.around.is_air() {
                    walk.stretch.pass(triangle, link, distance);
                } else {
                    walk.stretch.is_left_to_chance |= bsdf.as_delta().is_none() || is_immersed;
                    walk.stretch.push(link);
                }
                self.advance(walk, event.into())
            }
        }
    }

    /// Reflects or refracts the path at a pane; false when the path ends at the pane's black edge.
    fn glass(&self, walk: &mut Walk, index: u32, hit: &Hit, stream: &mut SampleStream) -> bool {
        let Surface::Pane { hit: pane_hit, .. } = &hit.surface else { return false };
        let PaneBoundary::Face(face) = pane_hit.boundary else { return false };
        let pane = &self.scene.accelerator().panes()[index as usize];
        let was_inside = walk.inside.is_some();
        if was_inside {
            walk.throughput *= absorption(pane.absorption, hit.distance);
        }
        let normal = pane.frame.vector_to_world(unit_normal(pane_hit.gradient));
        let direction = walk.ray.direction;
        let (index_in, index_out) =
            if was_inside { (pane.index_of_refraction, 1.0) } else { (1.0, pane.index_of_refraction) };
        let refraction = refract(direction, normal, index_in, index_out);
        let fresnel = refraction.map_or(Fresnel::TOTAL, |refraction| refraction.fresnel);
        let light = walk.polarisation.incident(direction, normal);
        let (transmitted, behind) = light.after(fresnel.transmission());
        let choice = stream.next_1d();
        let position = pane.frame.point_to_world(pane_hit.point);
        walk.ray_origin = SurfaceId::Pane { index, face };
        let crosses = |inside: DVec3| pane.layer(face, inside.dot(normal));
        let (event, next) = match refraction {
            Some(refraction) if choice < transmitted => {
                walk.stretch.choices *= transmitted;
                walk.throughput *= crosses(if was_inside { direction } else { refraction.direction });
                walk.inside = (!was_inside).then_some((index, face));
                walk.polarisation = behind;
                (SpecularEvent::Transmission, refraction.direction)
            }
            _ => {
                walk.stretch.choices *= 1.0 - transmitted;
                if was_inside {
                    walk.throughput *= crosses(direction) * crosses(direction);
                }
                walk.inside = was_inside.then_some((index, face));
                (_, walk.polarisation) = light.after(fresnel.reflection());
                (SpecularEvent::Reflection, reflect(direction, normal))
            }
        };
        walk.stretch.is_over_glass = true;
        walk.stretch.push(Link { event, surface: walk.ray_origin, position, direction });
        walk.ray = Ray::new(position, next);
        self.advance(walk, event.into())
    }

    /// Reads one event into the path filter; false when the path cannot match any more.
    fn advance(&self, walk: &mut Walk, event: PathEvent) -> bool {
        if let (Some(filter), Some(state)) = (self.filter, walk.filter) {
            let next = filter.step(state, event);
            walk.filter = Some(next);
            return !filter.is_dead(next);
        }
        true
    }

    fn accepts(&self, state: Option<FilterState>, events: &[PathEvent]) -> bool {
        match (self.filter, state) {
            (Some(filter), Some(state)) => filter.accepts(state, events),
            _ => true,
        }
    }

    /// Russian roulette on the throughput.
    fn survives(&self, walk: &mut Walk, stream: &mut SampleStream) -> bool {
        if walk.depth < ROULETTE_START {
            return true;
        }
        let survival = walk.throughput.max_element().min(MAX_SURVIVAL);
        if stream.next_1d() >= survival {
            return false;
        }
        walk.throughput /= survival;
        true
    }
}

#[cfg(test)]
mod caustic_tests;
#[cfg(test)]
mod double_glazing_tests;
#[cfg(test)]
mod from_light_tests;
#[cfg(test)]
mod furnace_tests;
#[cfg(test)]
mod media_tests;
#[cfg(test)]
mod opacity_tests;
#[cfg(test)]
mod paint_tests;
#[cfg(test)]
mod shining;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod thin_wall_tests;
#[cfg(test)]
mod weight_tests;
