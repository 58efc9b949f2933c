//! How a path goes on among bodies that meet others: what a boundary on its way is, and what happens there.

use glam::DVec3;

use super::media::{Around, Film, Interface, LEAST_COSINE, MOST_STRAIGHT, Meeting};
use super::{PathTracer, Walk};
use crate::bsdf::fresnel::reflect;
use crate::geometry::contact::RIM;
use crate::geometry::{Face, Hit, PaneBoundary, Ray, Surface, SurfaceId, Within};
use crate::math::absorption;
use crate::scene::media::Bodies;
use crate::scene::visibility::{SAME_PLACE, StraightWay};
use crate::specular::side::unit_normal;
use crate::specular::{Link, SpecularEvent};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

/// A boundary that a ray has met.
struct Boundary {
    body: u32,
    enters: bool,
    surface: SurfaceId,
    /// Of the triangle, or of the face.
    normal: DVec3,
    point: DVec3,
    is_edge: bool,
}

impl PathTracer<'_> {
    /// What a ray meets next.
    pub(super) fn closest_hit_among_bodies(&self, walk: &Walk, most: f64, counters: &mut Counters) -> Option<Hit> {
        let Around { bodies, second, left, .. } = &walk.around;
        let origins = [walk.ray_origin, second.unwrap_or(SurfaceId::Nothing)];
        let within = Within { panes: bodies.numbers(), origins, left: *left };
        self.scene.accelerator().closest_hit_within(&walk.ray, most, &within, counters)
    }

    /// The straight way to a light through one medium: nothing is on it.
    pub(super) fn straight_way_among_bodies(
        &self,
        ray: &Ray,
        distance: f64,
        ray_origin: SurfaceId,
        around: &Bodies,
        light: u32,
        counters: &mut Counters,
    ) -> Option<StraightWay> {
        let within = Within { panes: around.numbers(), origins: [ray_origin, SurfaceId::Nothing], left: None };
        let clear = distance * (1.0 - SAME_PLACE);
        let is_blocked = self.scene.blocked_by_light(ray, distance, Some(light))
            || self.scene.accelerator().closest_hit_within(ray, clear, &within, counters).is_some();
        (!is_blocked).then(StraightWay::clear)
    }

    /// What a hit is for the media around the path.
    pub(super) fn meeting(&self, walk: &Walk, hit: &Hit) -> Meeting {
        let media = self.scene.media();
        let before = walk.around.bodies();
        if walk.inside.is_some() || (before.is_empty() && !media.has_immersed()) {
            return Meeting::Plain;
        }
        let Some(boundary) = self.boundary(walk, hit) else { return Meeting::Plain };
        let behind = if boundary.enters { before.with(boundary.body) } else { before.without(boundary.body) };
        if let Some(interface) = self.with_film(walk, &boundary) {
            return Meeting::Face(interface);
        }
        let media_there = [before, &behind].map(|bodies| media.medium(bodies));
        if media.highest(before) == media.highest(&behind) {
            return Meeting::Straight(behind);
        }
        if boundary.is_edge {
            return Meeting::Black;
        }
        if media_there[0] == media_there[1] && self.layer(boundary.surface, 1.0) == DVec3::ONE {
            return Meeting::Straight(behind);
        }
        let interface = Interface { media: media_there, before: before.clone(), behind, film: None };
        match hit.surface {
            Surface::Pane { .. } => Meeting::Face(interface),
            Surface::Triangle { .. } => Meeting::Surface(interface),
        }
    }

    /// The boundary of a body among others; `None` for all other surfaces.
    fn boundary(&self, walk: &Walk, hit: &Hit) -> Option<Boundary> {
        let (media, direction) = (self.scene.media(), walk.ray.direction);
        let is_tracked = |body: u32| media.is_immersed(body) || walk.around.bodies.contains(body);
        match &hit.surface {
            Surface::Pane { index, hit: at } => {
                let frame = &self.scene.panes()[*index as usize].frame;
                let (face, is_edge) = match at.boundary {
                    PaneBoundary::Face(face) => (face, false),
                    PaneBoundary::Edge => (Face::Front, true),
                };
                let surface = if is_edge { SurfaceId::Nothing } else { SurfaceId::Pane { index: *index, face } };
                let normal = frame.vector_to_world(unit_normal(at.gradient));
                let point = frame.point_to_world(at.point);
                let boundary = Boundary { body: *index, enters: !at.inside, surface, normal, point, is_edge };
                is_tracked(*index).then_some(boundary)
            }
            Surface::Triangle { index, .. } => {
                let body = media.body_of_mesh(self.scene.mesh_of(*index));
                let normal = self.scene.triangle_normal(*index);
                let (surface, point) = (SurfaceId::Triangle(*index), walk.ray.at(hit.distance));
                let enters = direction.dot(normal) < 0.0;
                let boundary = Boundary { body, enters, surface, normal, point, is_edge: false };
                is_tracked(body).then_some(boundary)
            }
        }
    }

    /// The interface with a film where a body ends and another one begins.
    fn with_film(&self, walk: &Walk, boundary: &Boundary) -> Option<Interface> {
        let (media, before) = (self.scene.media(), walk.around.bodies());
        let neighbours = media.neighbours(boundary.body);
        if neighbours.is_empty() || boundary.is_edge || !self.is_smooth(boundary.surface) {
            return None;
        }
        neighbours.iter().find_map(|other| {
            let (left, entered) = if boundary.enters { (*other, boundary.body) } else { (boundary.body, *other) };
            if !before.contains(left) || !self.scene.is_body_near(*other, boundary.point, RIM / LEAST_COSINE) {
                return None;
            }
            let rest = before.without(left).without(entered);
            let (from, to) = (rest.with(left), rest.with(entered));
            if media.highest(&from) != Some(left) || media.highest(&to) != Some(entered) {
                return None;
            }
            let second = self.face_near(walk.ray.direction, boundary, *other)?;
            let film = Some(Film { medium: media.medium(&rest), second });
            Some(Interface { media: [media.medium(&from), media.medium(&to)], before: from, behind: to, film })
        })
    }

    /// The face of another body within [`RIM`] of a boundary, which a ray enters where it leaves the boundary's body,
    /// and leaves where it enters that.
    fn face_near(&self, direction: DVec3, boundary: &Boundary, other: u32) -> Option<SurfaceId> {
        let enters = !boundary.enters;
        let Some(mesh) = self.scene.media().mesh_of(other) else {
            let (face, _) = self.scene.panes()[other as usize].face_near(boundary.point, direction, enters, RIM)?;
            return Some(SurfaceId::Pane { index: other, face });
        };
        let reach = RIM / direction.dot(boundary.normal).abs().max(LEAST_COSINE);
        let ray = Ray::new(boundary.point - direction * reach, direction);
        let mut nearest: Option<(f64, u32)> = None;
        self.scene.accelerator().triangles_along(&ray, 2.0 * reach, &mut |triangle, distance| {
            let leads_in = direction.dot(self.scene.triangle_normal(triangle)) < 0.0;
            let found = ((distance - reach).abs(), triangle);
            if self.scene.mesh_of(triangle) == mesh && leads_in == enters && nearest.is_none_or(|known| found < known) {
                nearest = Some(found);
            }
        });
        let surface = SurfaceId::Triangle(nearest?.1);
        self.is_smooth(surface).then_some(surface)
    }

    /// Transmittance of the coloured layer on a face, for light whose direction in the glass has this cosine.
    fn layer(&self, face: SurfaceId, cosine: f64) -> DVec3 {
        match face {
            SurfaceId::Pane { index, face } => self.scene.panes()[index as usize].layer(face, cosine),
            SurfaceId::Triangle(_) | SurfaceId::Nothing => DVec3::ONE,
        }
    }

    fn is_smooth(&self, surface: SurfaceId) -> bool {
        match surface {
            SurfaceId::Triangle(triangle) => self.scene.delta_bsdf(triangle).is_some(),
            SurfaceId::Pane { .. } | SurfaceId::Nothing => true,
        }
    }

    /// Takes a path straight through a boundary; false when it has gone through too many.
    pub(super) fn go_straight(&self, walk: &mut Walk, hit: &Hit, after: Bodies) -> bool {
        walk.throughput *= absorption(walk.body, hit.distance);
        walk.body = self.scene.media().medium(&after).absorption;
        let mut left = None;
        (walk.ray_origin, walk.ray) = match &hit.surface {
            Surface::Pane { index, hit: at } => {
                let point = self.scene.panes()[*index as usize].frame.point_to_world(at.point);
                let surface = match at.boundary {
                    PaneBoundary::Face(face) => SurfaceId::Pane { index: *index, face },
                    PaneBoundary::Edge => {
                        left = at.inside.then_some(*index);
                        SurfaceId::Nothing
                    }
                };
                (surface, Ray::new(point, walk.ray.direction))
            }
            Surface::Triangle { index, .. } => {
                (SurfaceId::Triangle(*index), Ray::new(walk.ray.at(hit.distance), walk.ray.direction))
            }
        };
        let passed = walk.around.passed + 1;
        walk.around = Around { bodies: after, second: None, left, passed };
        walk.stretch.is_unseen = true;
        passed < MOST_STRAIGHT
    }

    /// Reflects or refracts the path at a smooth interface; false when the path ends.
    pub(super) fn smooth_interface(
        &self,
        walk: &mut Walk,
        hit: &Hit,
        interface: Interface,
        stream: &mut SampleStream,
    ) -> bool {
        let Some(Boundary { body, enters, surface, normal: geometric, point, .. }) = self.boundary(walk, hit) else {
            return false;
        };
        walk.throughput *= absorption(walk.body, hit.distance);
        let direction = walk.ray.direction;
        let normal = match &hit.surface {
            Surface::Triangle { index, barycentric } => self.scene.normals(*index, *barycentric).shading,
            Surface::Pane { .. } => geometric,
        };
        let towards = direction.dot(geometric);
        if direction.dot(normal) * towards <= 0.0 {
            return false;
        }
        let (through, back) = interface.scattering(direction, normal);
        let light = walk.polarisation.incident(direction, normal);
        let transmission = through.map(|(onwards, mueller)| (onwards, light.after(mueller)));
        let transmitted = transmission.map_or(0.0, |(_, (part, _))| part);
        let second = interface.film.as_ref().map(|film| film.second);
        let is_film = second.is_some();
        let [left, entered] = if enters { [second, Some(surface)] } else { [Some(surface), second] };
        let out = left.map_or(DVec3::ONE, |face| self.layer(face, direction.dot(normal)));
        let choice = stream.next_1d();
        let (event, next) = match transmission {
            Some((onwards, (_, polarisation))) if choice < transmitted => {
                let [before, behind] = interface.media;
                let ratio = before.index_of_refraction / behind.index_of_refraction;
                let within = entered.map_or(DVec3::ONE, |face| self.layer(face, onwards.dot(normal)));
                walk.throughput *= ratio * ratio * out * within;
                walk.polarisation = polarisation;
                walk.body = behind.absorption;
                walk.around = Around { second, ..interface.into_behind() };
                (SpecularEvent::Transmission, onwards)
            }
            _ => {
                (_, walk.polarisation) = light.after(back);
                walk.throughput *= out * out;
                walk.body = interface.media[0].absorption;
                walk.around = Around { bodies: interface.before, second, ..Around::default() };
                (SpecularEvent::Reflection, reflect(direction, normal))
            }
        };
        let goes_through = next.dot(geometric) * towards > 0.0;
        if goes_through != (event == SpecularEvent::Transmission) {
            return false;
        }
        walk.stretch.is_left_to_chance |= self.scene.media().is_immersed(body);
        walk.stretch.choices = 0.0;
        walk.stretch.is_over_glass = true;
        let link = Link { event, surface, position: point, direction };
        walk.stretch.push(link);
        walk.ray_origin = surface;
        walk.ray = Ray::new(point, next);
        if is_film && event == SpecularEvent::Transmission {
            // Out of one body and into the next one.
            walk.depth += 1;
            walk.stretch.push(link);
            return self.advance(walk, event.into()) && self.advance(walk, event.into());
        }
        self.advance(walk, event.into())
    }
}
