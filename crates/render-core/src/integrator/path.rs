//! The path tracer: next event estimation, specular methods for light through glass, and everything else by chance.
//!
//! Light that arrives at a diffuse vertex is split by path: straight from a light (next event estimation combined with
//! BSDF sampling by the balance heuristic), through one pane (owned by the specular method, if there is one; see
//! [`crate::specular::coverage`]), and all the rest (found by following the path).

use glam::DVec3;

use super::path_filter::{FilterState, PathEvent, PathFilter};
use crate::{
    counters::Counters,
    film::SampleStream,
    geometry::{Face, Frame, Hit, Leaving, PaneBoundary, Ray, Surface},
    optics::{
        Source,
        dielectric::{absorption, reflect, refract},
        light_sampling::LightHit,
    },
    scene::Scene,
    specular::{PanePath, ShadingPoint, SpecularMethod, coverage, side::PaneSide, side::unit_normal},
};

/// What one camera sample sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathSample {
    /// Radiance, W/(m2 sr).
    pub radiance: DVec3,
    /// Reflectance of the first surface; 1 for glass, 0 for lights and where there is nothing.
    pub albedo: DVec3,
    /// Unit normal of the first surface, towards the camera; zero where there is nothing.
    pub normal: DVec3,
    /// Distance to the first surface, metres; 0 where there is nothing.
    pub depth: f64,
}

/// Vertices after which a path may be ended at random.
const ROULETTE_START: u32 = 4;

/// Longest run of vertices at random survival: a path that goes on forever inside perfect mirrors of glass ends here.
const MAX_SURVIVAL: f64 = 0.95;

/// A path tracer for one scene.
pub struct PathTracer<'a> {
    scene: &'a Scene,
    method: Option<&'a dyn SpecularMethod>,
    max_depth: u32,
}

/// The stretch of a path since its last diffuse vertex.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    /// The diffuse vertex, and the BSDF's density per solid angle with which the stretch's first direction was drawn;
    /// `None` before the first diffuse vertex.
    from: Option<(ShadingPoint, f64)>,
    course: Course,
}

/// What has happened on a stretch.
#[derive(Clone, Copy, Debug)]
enum Course {
    /// Nothing.
    Straight,
    /// One transmission into a pane.
    Inside { entry: PaneCrossing },
    /// Two transmissions, in and out of the same pane.
    Through { entry: PaneCrossing, exit_face: Face, inner_direction: DVec3 },
    /// Anything else.
    Other,
}

#[derive(Clone, Copy, Debug)]
struct PaneCrossing {
    pane: u32,
    face: Face,
    position: DVec3,
    direction: DVec3,
}

/// A path on its way.
struct Walk {
    ray: Ray,
    leaving: Leaving,
    /// The pane in whose glass the ray is.
    inside: Option<(u32, Face)>,
    throughput: DVec3,
    stretch: Stretch,
    filter: Option<FilterState>,
    depth: u32,
}

impl<'a> PathTracer<'a> {
    /// A path tracer that leaves the paths that `method` owns to it.
    pub fn new(scene: &'a Scene, method: Option<&'a dyn SpecularMethod>, max_depth: u32) -> Self {
        Self { scene, method, max_depth }
    }

    /// Traces one path from the camera.
    pub fn sample(&self, ray: Ray, stream: &mut SampleStream, counters: &mut Counters) -> PathSample {
        let mut sample = PathSample::default();
        let mut walk = Walk {
            ray,
            leaving: Leaving::Nothing,
            inside: None,
            throughput: DVec3::ONE,
            stretch: Stretch { from: None, course: Course::Straight },
            filter: self.scene.path_filter().map(PathFilter::start),
            depth: 0,
        };
        loop {
            let hit = match walk.inside {
                Some((pane, face)) => {
                    self.scene.accelerator().closest_hit_inside(pane, &walk.ray, Some(face), counters)
                }
                None => self.scene.accelerator().closest_hit(&walk.ray, f64::INFINITY, walk.leaving, counters),
            };
            let distance = hit.as_ref().map_or(f64::INFINITY, |hit| hit.distance);
            if walk.inside.is_none()
                && let Some((index, light_hit)) = self.closest_light(&walk, distance)
            {
                sample.radiance += self.emission(&walk, index, &light_hit, counters);
                if light_hit.distance.is_finite() {
                    if walk.depth == 0 {
                        sample.depth = light_hit.distance;
                    }
                    return sample;
                }
            }
            let Some(hit) = hit else { return sample };
            if walk.depth == 0 {
                self.describe_first_hit(&walk.ray, &hit, &mut sample);
            }
            if walk.depth >= self.max_depth {
                return sample;
            }
            walk.depth += 1;
            let goes_on = match hit.surface {
                Surface::Triangle { index, barycentric } => {
                    self.diffuse(&mut walk, hit.distance, index, barycentric, &mut sample, stream, counters)
                }
                Surface::Pane { index, .. } => self.glass(&mut walk, index, &hit, stream),
            };
            if !goes_on || !self.survives(&mut walk, stream) {
                return sample;
            }
        }
    }

    fn describe_first_hit(&self, ray: &Ray, hit: &Hit, sample: &mut PathSample) {
        sample.depth = hit.distance;
        let (normal, albedo) = match &hit.surface {
            Surface::Triangle { index, barycentric } => {
                (self.scene.triangle_normal(*index), self.scene.reflectance(*index, *barycentric))
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

    /// The nearest light on the ray before `distance`; the sun when nothing is hit at all.
    fn closest_light(&self, walk: &Walk, distance: f64) -> Option<(u32, LightHit)> {
        let mut closest: Option<(u32, LightHit)> = None;
        for (index, light) in (0u32..).zip(self.scene.lights()) {
            if walk.leaving == Leaving::Light(index) {
                continue;
            }
            let Some(hit) = light.intersect(&walk.ray) else { continue };
            let nearest = closest.as_ref().map_or(distance, |(_, hit)| hit.distance);
            if hit.distance < nearest || (hit.distance == f64::INFINITY && nearest == f64::INFINITY) {
                closest = Some((index, hit));
            }
        }
        closest
    }

    /// Light that the path carries back from a light that it has met.
    fn emission(&self, walk: &Walk, light: u32, hit: &LightHit, counters: &mut Counters) -> DVec3 {
        if !self.accepts(walk.filter, &[PathEvent::Light]) {
            return DVec3::ZERO;
        }
        let carried = walk.throughput * hit.radiance;
        let Some((point, density)) = walk.stretch.from else { return carried };
        match walk.stretch.course {
            Course::Straight => {
                let light_density = self.scene.lights()[light as usize].direct_density(&walk.ray, hit);
                carried * (density / (density + light_density))
            }
            Course::Through { entry, exit_face, inner_direction } => {
                let source = if hit.distance.is_finite() {
                    Source::Point(walk.ray.at(hit.distance))
                } else {
                    Source::Direction(walk.ray.direction)
                };
                let path = PanePath { light, source, pane: entry.pane, entry: entry.position };
                if self.owned(&point, &entry, exit_face, inner_direction, walk.ray.direction, &path, counters) {
                    DVec3::ZERO
                } else {
                    carried
                }
            }
            Course::Inside { .. } | Course::Other => carried,
        }
    }

    /// Whether the specular method owns this path through a pane.
    #[expect(clippy::too_many_arguments, reason = "the path's vertices and directions")]
    fn owned(
        &self,
        point: &ShadingPoint,
        entry: &PaneCrossing,
        exit_face: Face,
        inner_direction: DVec3,
        last_direction: DVec3,
        path: &PanePath,
        counters: &mut Counters,
    ) -> bool {
        let Some(method) = self.method else { return false };
        let pane = &self.scene.accelerator().panes()[entry.pane as usize];
        let Some(side) = PaneSide::facing(pane, pane.frame.point_to_local(point.position)) else { return false };
        let directions =
            [entry.direction, inner_direction, last_direction].map(|world| pane.frame.vector_to_local(world));
        side.near == entry.face
            && side.far == exit_face
            && coverage::owns(&side, directions)
            && method.selects(self.scene, point, path, counters)
    }

    /// Gathers light at a diffuse surface and scatters the path; false when the path ends.
    #[expect(clippy::too_many_arguments, reason = "a vertex and the three places to which it reports")]
    fn diffuse(
        &self,
        walk: &mut Walk,
        distance: f64,
        triangle: u32,
        barycentric: [f64; 2],
        sample: &mut PathSample,
        stream: &mut SampleStream,
        counters: &mut Counters,
    ) -> bool {
        // An opaque thing that stands in the glass is black: nothing describes how glass and it touch.
        if walk.inside.is_some() || !self.advance(walk, PathEvent::Diffuse) {
            return false;
        }
        let geometric = self.scene.triangle_normal(triangle);
        let normal = if geometric.dot(walk.ray.direction) > 0.0 { -geometric } else { geometric };
        let leaving = Leaving::Triangle(triangle);
        let bounces = walk.stretch.from.map_or(0, |(before, _)| before.bounces + 1);
        let point = ShadingPoint { position: walk.ray.at(distance), normal, leaving, bounces };
        let bsdf = self.scene.reflectance(triangle, barycentric) * std::f64::consts::FRAC_1_PI;
        if bsdf == DVec3::ZERO {
            return false;
        }
        let carried = walk.throughput * bsdf;
        if walk.depth <= self.max_depth {
            if self.accepts(walk.filter, &[PathEvent::Light]) {
                sample.radiance += carried * self.direct_light(&point, stream, counters);
            }
            let through_glass = [PathEvent::Transmission, PathEvent::Transmission, PathEvent::Light];
            if walk.depth + 2 <= self.max_depth && self.accepts(walk.filter, &through_glass) {
                sample.radiance += carried * self.light_through_glass(&point, stream, counters);
            }
        }
        let random = stream.next_2d();
        let cosine = (1.0 - random.x).sqrt();
        let (sin, cos) = libm::sincos(2.0 * std::f64::consts::PI * random.y);
        let sine = random.x.sqrt();
        let direction = Frame::around(normal).vector_to_world(DVec3::new(sine * cos, sine * sin, cosine));
        walk.throughput *= self.scene.reflectance(triangle, barycentric);
        walk.ray = Ray::new(point.position, direction);
        walk.leaving = leaving;
        walk.stretch = Stretch { from: Some((point, cosine * std::f64::consts::FRAC_1_PI)), course: Course::Straight };
        cosine > 0.0
    }

    /// Irradiance straight from the lights.
    fn direct_light(&self, point: &ShadingPoint, stream: &mut SampleStream, counters: &mut Counters) -> DVec3 {
        let mut irradiance = DVec3::ZERO;
        for (index, light) in (0u32..).zip(self.scene.lights()) {
            let Some(sample) = light.sample_direct(point.position, stream.next_2d()) else { continue };
            let cosine = sample.direction.dot(point.normal);
            if cosine <= 0.0 {
                continue;
            }
            let ray = Ray::new(point.position, sample.direction);
            if self.scene.blocked(&ray, sample.distance, point.leaving, None, Some(index), counters) {
                continue;
            }
            let bsdf_density = cosine * std::f64::consts::FRAC_1_PI;
            let balance = sample.density.map_or(1.0, |density| density / (density + bsdf_density));
            irradiance += sample.weight * (cosine * balance);
        }
        irradiance
    }

    /// Irradiance by the paths through panes that the specular method owns.
    fn light_through_glass(&self, point: &ShadingPoint, stream: &mut SampleStream, counters: &mut Counters) -> DVec3 {
        let mut irradiance = DVec3::ZERO;
        let Some(method) = self.method else { return irradiance };
        for light in (0u32..).take(self.scene.lights().len()) {
            method.gather(self.scene, point, light, stream, counters, &mut |arrival| {
                irradiance += arrival.weight * arrival.direction.dot(point.normal).max(0.0);
            });
        }
        irradiance
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
        let choice = stream.next_1d();
        let position = pane.frame.point_to_world(pane_hit.point);
        walk.leaving = Leaving::Pane { index, face };
        let (event, next) = match refraction {
            Some(refraction) if choice < refraction.transmittance => {
                walk.inside = (!was_inside).then_some((index, face));
                (PathEvent::Transmission, refraction.direction)
            }
            _ => {
                walk.inside = was_inside.then_some((index, face));
                (PathEvent::Reflection, reflect(direction, normal))
            }
        };
        walk.stretch.course = match (walk.stretch.course, event) {
            (Course::Straight, PathEvent::Transmission) => {
                Course::Inside { entry: PaneCrossing { pane: index, face, position, direction } }
            }
            (Course::Inside { entry }, PathEvent::Transmission) => {
                Course::Through { entry, exit_face: face, inner_direction: direction }
            }
            _ => Course::Other,
        };
        walk.ray = Ray::new(position, next);
        self.advance(walk, event)
    }

    /// Reads one event into the path filter; false when the path cannot match any more.
    fn advance(&self, walk: &mut Walk, event: PathEvent) -> bool {
        if let (Some(filter), Some(state)) = (self.scene.path_filter(), walk.filter) {
            let next = filter.step(state, event);
            walk.filter = Some(next);
            return !filter.is_dead(next);
        }
        true
    }

    fn accepts(&self, state: Option<FilterState>, events: &[PathEvent]) -> bool {
        match (self.scene.path_filter(), state) {
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
