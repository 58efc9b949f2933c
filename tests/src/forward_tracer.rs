//! Light traced forward, from the lights through single panes onto diffuse surfaces and into the camera: `D TT L`.
//!
//! A photon starts at a point of the face towards the light, drawn uniformly, and at a point or direction of the light.
//! It is refracted at both faces, with Fresnel's transmittance of both together and Beer-Lambert absorption between
//! them. It meets the nearest triangle, and is added to the pixel that sees the place. The only equation to solve is
//! where a line meets a height field. The only density to know is that of the start. This is the simplest unbiased
//! estimator of the picture. It shares no formula with the methods that search paths backwards.
//!
//! All other paths are left out. Photons whose line to the light or onwards meets the prism of another pane are
//! dropped. This is right only where panes do not cover each other.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::polarised_light::TwoFaces;
use crate::random::Random;
use crate::reference::Image;
use crate::spline::Spline;
use crate::traced_pane::TracedPane;
use crate::traced_scene::{TracedLight, TracedScene};

/// How a picture is traced.
#[derive(Clone, Copy, Debug)]
pub struct Tracing {
    /// Photons in all, shared equally between batches and pairs of light and pane; rounded to full strata.
    pub photons: u64,
    /// Independent batches of stratified photons, an even number.
    pub batches: u32,
    /// Seed of every random number.
    pub seed: u64,
    /// What is done wrong.
    pub fault: Fault,
}

/// Mistakes that a bias test has to notice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// No mistake.
    None,
    /// The Fresnel transmittance of the second face is forgotten.
    MissingFresnelFactor,
    /// Each face is taken to meet unpolarised light.
    AveragedPerFace,
    /// Paths that reverse the orientation, the saddle points of the optical length, are lost.
    DroppedSaddles,
    /// All light is too bright by half a percent.
    Scaled,
}

/// Traces the batches of a picture; they are independent and equally distributed.
pub fn trace(scene: &TracedScene, tracing: &Tracing) -> Vec<Image> {
    (0..tracing.batches)
        .into_par_iter()
        .map(|batch| trace_batch(scene, tracing, &mut Random::new(tracing.seed, u64::from(batch))))
        .collect()
}

fn trace_batch(scene: &TracedScene, tracing: &Tracing, random: &mut Random) -> Image {
    let mut image = Image::black(scene.film[0], scene.film[1]);
    let pairs = scene.lights.len() * scene.panes.len();
    let share = tracing.photons as f64 / (f64::from(tracing.batches) * pairs as f64);
    for light in &scene.lights {
        for pane_index in 0..scene.panes.len() {
            trace_pair(scene, light, pane_index, share, tracing.fault, random, &mut image);
        }
    }
    image
}

/// Photons of one light through one pane, jittered over strata of the face and, for lights with an extent, of the
/// light.
fn trace_pair(
    scene: &TracedScene,
    light: &TracedLight,
    pane_index: usize,
    photons: f64,
    fault: Fault,
    random: &mut Random,
    image: &mut Image,
) {
    let light_strata = match light {
        TracedLight::Point { .. } => 1,
        _ => (photons.sqrt().sqrt() as usize).clamp(1, 16),
    };
    let face_strata = ((photons.sqrt() / light_strata as f64).round() as usize).max(1);
    let count = (face_strata * face_strata * light_strata * light_strata) as f64;
    let scale = if fault == Fault::Scaled { 1.005 } else { 1.0 };
    for k in 0..light_strata * light_strata {
        for j in 0..face_strata {
            for i in 0..face_strata {
                let mut jitter = |stratum: usize, strata: usize| (stratum as f64 + random.uniform()) / strata as f64;
                let face = [jitter(i, face_strata), jitter(j, face_strata)];
                let lamp = match light {
                    TracedLight::Point { .. } => [0.0; 2],
                    _ => [jitter(k / light_strata, light_strata), jitter(k % light_strata, light_strata)],
                };
                if let Some(splat) = photon(scene, light, pane_index, face, lamp, fault) {
                    image.pixels[splat.position.y as usize * image.width + splat.position.x as usize] +=
                        splat.radiance * (scale / count);
                }
            }
        }
    }
}

/// What a photon adds to the picture.
#[derive(Clone, Copy, Debug)]
pub struct Splat {
    /// Place in the picture, in pixels from the top left.
    pub position: DVec2,
    /// Radiance times the measure of the face's parameters (one) and of the light's samples (one).
    pub radiance: DVec3,
}

/// Follows the photon that starts at the parameters `face` of the pane's face and `lamp` of the light, all in `[0, 1)`.
pub fn photon(
    scene: &TracedScene,
    light: &TracedLight,
    pane_index: usize,
    face: [f64; 2],
    lamp: [f64; 2],
    fault: Fault,
) -> Option<Splat> {
    let pane = &scene.panes[pane_index];
    let side = Side::towards(pane, light);
    let start = side.start(pane, face);
    if !pane.contains(start.local.truncate()) {
        return None;
    }
    let emission = emit(light, start.world, lamp)?;
    let exit = side.refract(pane, &start, emission.to_light)?;
    let obstructed = |origin: DVec3, direction: DVec3, reach: f64, skipped: usize| {
        let mut panes = scene.panes.iter().enumerate().filter(|(i, _)| *i != pane_index);
        let nearest = scene.nearest_triangle(origin, direction, reach, skipped);
        nearest.is_some() || panes.any(|(_, other)| other.prism_meets(origin, direction, reach))
    };
    if obstructed(start.world, emission.to_light, emission.distance, usize::MAX) {
        return None;
    }
    let (distance, index) = scene.nearest_triangle(exit.origin, exit.direction, f64::INFINITY, usize::MAX)?;
    let triangle = &scene.triangles[index];
    let others =
        |i: usize, other: &TracedPane| i != pane_index && other.prism_meets(exit.origin, exit.direction, distance);
    if scene.panes.iter().enumerate().any(|(i, other)| others(i, other)) {
        return None;
    }
    let point = exit.origin + exit.direction * distance;
    let reflectance = scene.reflectance(index, point);
    if reflectance == DVec3::ZERO {
        return None;
    }
    let sighting = scene.camera.sight(point)?;
    let cosine = triangle.normal.dot(sighting.direction);
    let same_side = cosine * triangle.normal.dot(exit.direction) < 0.0;
    if !same_side
        || obstructed(point, sighting.direction, sighting.distance, index)
        || pane.prism_meets(point, sighting.direction, sighting.distance)
    {
        return None;
    }
    if fault == Fault::DroppedSaddles {
        let normal = triangle.normal;
        if side.reverses(pane, face, &emission.sample, &exit, |ray| {
            ray.origin + ray.direction * ((point - ray.origin).dot(normal) / ray.direction.dot(normal))
        }) {
            return None;
        }
    }
    let TwoFaces { each: [first, second], both } = exit.faces;
    let fresnel = match fault {
        Fault::MissingFresnelFactor => first,
        Fault::AveragedPerFace => first * second,
        _ => both,
    };
    let absorption = (-pane.absorption * exit.glass_length - exit.layers).to_array().map(libm::exp);
    let flux = emission.power * DVec3::from(absorption) * (fresnel * exit.projected_area);
    Some(Splat { position: sighting.position, radiance: reflectance * flux * (sighting.density * cosine.abs() / PI) })
}

/// A sample of a light, kept when neighbouring photons are followed.
#[derive(Clone, Copy, Debug)]
pub enum LightSample {
    /// A point.
    Point(DVec3),
    /// A unit vector towards the light.
    Direction(DVec3),
}

impl LightSample {
    /// Unit vector from `x` to the sample.
    pub fn direction_from(&self, x: DVec3) -> DVec3 {
        match self {
            Self::Point(point) => (*point - x).normalize(),
            Self::Direction(direction) => *direction,
        }
    }
}

struct Emission {
    to_light: DVec3,
    distance: f64,
    /// Irradiance on a surface that faces the light, over the probability density of the sample.
    power: DVec3,
    sample: LightSample,
}

fn emit(light: &TracedLight, x: DVec3, lamp: [f64; 2]) -> Option<Emission> {
    match *light {
        TracedLight::Point { position, intensity } => {
            let v = position - x;
            let distance = v.length();
            Some(Emission {
                to_light: v / distance,
                distance,
                power: intensity / (distance * distance),
                sample: LightSample::Point(position),
            })
        }
        TracedLight::Sphere { centre, radius, radiance } => {
            let v = centre - x;
            let distance = v.length();
            let sin2 = radius * radius / (distance * distance);
            if sin2 >= 1.0 {
                return None;
            }
            let one_minus_cos = sin2 / (1.0 + (1.0 - sin2).sqrt());
            let to_light = direction_in_cone(v / distance, one_minus_cos, lamp);
            let along = to_light.dot(v);
            let reach = along - (radius * radius - (distance * distance - along * along)).max(0.0).sqrt();
            Some(Emission {
                to_light,
                distance: reach,
                power: radiance * (2.0 * PI * one_minus_cos),
                sample: LightSample::Point(x + to_light * reach),
            })
        }
        TracedLight::Rectangle { centre, edges, radiance } => {
            let point = centre + edges[0] * (lamp[0] - 0.5) + edges[1] * (lamp[1] - 0.5);
            let v = point - x;
            let distance = v.length();
            let to_light = v / distance;
            let projected_area = -edges[0].cross(edges[1]).dot(to_light);
            (projected_area > 0.0).then(|| Emission {
                to_light,
                distance,
                power: radiance * (projected_area / (distance * distance)),
                sample: LightSample::Point(point),
            })
        }
        TracedLight::Disk { centre, normal, radius, radiance } => {
            let (across, up) = normal.any_orthonormal_pair();
            let (sin, cos) = libm::sincos(2.0 * PI * lamp[1]);
            let point = centre + (across * cos + up * sin) * (radius * lamp[0].sqrt());
            let v = point - x;
            let distance = v.length();
            let to_light = v / distance;
            let projected_area = -PI * radius * radius * normal.dot(to_light);
            (projected_area > 0.0).then(|| Emission {
                to_light,
                distance,
                power: radiance * (projected_area / (distance * distance)),
                sample: LightSample::Point(point),
            })
        }
        TracedLight::Sun { direction, one_minus_cos, radiance } => {
            let to_light = direction_in_cone(direction, one_minus_cos, lamp);
            Some(Emission {
                to_light,
                distance: f64::INFINITY,
                power: radiance * (2.0 * PI * one_minus_cos),
                sample: LightSample::Direction(to_light),
            })
        }
    }
}

/// A direction from the uniform density over a cone about the unit vector `axis`.
fn direction_in_cone(axis: DVec3, one_minus_cos: f64, lamp: [f64; 2]) -> DVec3 {
    let q = lamp[0] * one_minus_cos;
    let sine = (q * (2.0 - q)).sqrt();
    let (sin_phi, cos_phi) = libm::sincos(2.0 * PI * lamp[1]);
    let sign = 1f64.copysign(axis.z);
    let a = -1.0 / (sign + axis.z);
    let b = axis.x * axis.y * a;
    let tangent = DVec3::new(1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x);
    let bitangent = DVec3::new(b, sign + axis.y * axis.y * a, -axis.y);
    axis * (1.0 - q) + (tangent * cos_phi + bitangent * sin_phi) * sine
}

/// From which side the light enters a pane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Through the back face, towards smaller z.
    Back,
    /// Through the front face, towards larger z.
    Front,
}

/// A point of the face through which light enters.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// In the pane's frame.
    local: DVec3,
    /// In the world.
    pub world: DVec3,
    /// Normal towards the light in the pane's frame, its component along z being one.
    normal: DVec3,
}

/// A ray that leaves a pane.
#[derive(Clone, Copy, Debug)]
pub struct Exit {
    /// Where it leaves.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
    /// Parameters of the face through which it leaves.
    pub parameters: [f64; 2],
    /// What both faces transmit.
    pub faces: TwoFaces,
    /// Length of the way through the glass, metres.
    pub glass_length: f64,
    /// Absorbance of the coloured layers on both faces along the way.
    pub layers: DVec3,
    /// Area of the first face for a unit of its parameters, seen from the light, square metres.
    pub projected_area: f64,
}

impl Side {
    /// The side on which the light's middle lies.
    pub fn towards(pane: &TracedPane, light: &TracedLight) -> Self {
        let v = match *light {
            TracedLight::Point { position, .. } => position - pane.origin,
            TracedLight::Sphere { centre, .. }
            | TracedLight::Rectangle { centre, .. }
            | TracedLight::Disk { centre, .. } => centre - pane.origin,
            TracedLight::Sun { direction, .. } => direction,
        };
        if pane.axes[2].dot(v) > 0.0 { Self::Back } else { Self::Front }
    }

    fn sign(self) -> f64 {
        match self {
            Self::Back => 1.0,
            Self::Front => -1.0,
        }
    }

    /// The faces where light enters and leaves, with their undisplaced heights.
    fn faces(self, pane: &TracedPane) -> [(&Spline, f64); 2] {
        let (front, back) = ((&pane.front, 0.0), (&pane.back, pane.thickness));
        match self {
            Self::Back => [back, front],
            Self::Front => [front, back],
        }
    }

    /// Absorbance of the layers where light enters and leaves, at these cosines to the normals in the glass.
    fn layers(self, pane: &TracedPane, entering: f64, leaving: f64) -> DVec3 {
        let [front, back] = pane.layers;
        let [near, far] = if self == Self::Back { [back, front] } else { [front, back] };
        near / entering.abs() + far / leaving.abs()
    }

    /// The point with parameters `face` on the face where light enters.
    pub fn start(self, pane: &TracedPane, face: [f64; 2]) -> Start {
        let (spline, base) = self.faces(pane)[0];
        let place = (DVec2::from(face) - 0.5) * pane.size;
        let (height, slope) = pane.surface(spline, place);
        let local = place.extend(base + height);
        let normal = (-slope).extend(1.0) * self.sign();
        Start { local, world: pane.origin + pane.vector_to_world(local), normal }
    }

    /// Through both faces; `None` when the light comes from behind, is reflected totally, or meets the pane's edge.
    pub fn refract(self, pane: &TracedPane, start: &Start, to_light: DVec3) -> Option<Exit> {
        let index = pane.index_of_refraction;
        let light = pane.vector_to_local(to_light);
        let projected = light.dot(start.normal);
        if projected <= 0.0 {
            return None;
        }
        let first = start.normal.normalize();
        let inside = refract(-light, first, 1.0, index)?;
        let (spline, base) = self.faces(pane)[1];
        let (distance, parameters, gradient) = leave(pane, spline, base, start.local, inside)?;
        let second = DVec3::new(-gradient[0], -gradient[1], 1.0).normalize() * self.sign();
        let outside = refract(inside, second, index, 1.0)?;
        Some(Exit {
            origin: pane.origin + pane.vector_to_world(start.local + inside * distance),
            direction: pane.vector_to_world(outside),
            parameters,
            faces: TwoFaces::new([-light, inside, outside], [first, second], index),
            glass_length: distance,
            layers: self.layers(pane, inside.dot(first), inside.dot(second)),
            projected_area: projected * pane.size.x * pane.size.y,
        })
    }

    /// Whether the map from the face to the receiver turns over near `face`, for a fixed sample of the light. Then the
    /// path is a saddle point of the optical length. By differences of two neighbours.
    pub fn reverses(
        self,
        pane: &TracedPane,
        face: [f64; 2],
        sample: &LightSample,
        exit: &Exit,
        land: impl Fn(&Exit) -> DVec3,
    ) -> bool {
        const STEP: f64 = 1e-6;
        let neighbour = |face| {
            let start = self.start(pane, face);
            self.refract(pane, &start, sample.direction_from(start.world)).map(|exit| land(&exit))
        };
        let here = land(exit);
        let (Some(x), Some(y)) = (neighbour([face[0] + STEP, face[1]]), neighbour([face[0], face[1] + STEP])) else {
            return false;
        };
        (x - here).cross(y - here).dot(exit.direction) * pane.axes[2].dot(exit.direction) < 0.0
    }
}

/// Refraction of the unit vector `direction` at a face with the unit normal `normal` against it (Snell).
fn refract(direction: DVec3, normal: DVec3, from: f64, to: f64) -> Option<DVec3> {
    let eta = from / to;
    let ci = -direction.dot(normal);
    let sin2 = eta * eta * (1.0 - ci * ci);
    if ci <= 0.0 || sin2 >= 1.0 {
        return None;
    }
    let ct = (1.0 - sin2).sqrt();
    Some(direction * eta + normal * (eta * ci - ct))
}

/// Where a ray in the glass meets the second face (Newton), inside the outline: distance, parameters, gradient.
fn leave(
    pane: &TracedPane,
    spline: &Spline,
    base: f64,
    origin: DVec3,
    direction: DVec3,
) -> Option<(f64, [f64; 2], [f64; 2])> {
    const ITERATIONS: usize = 12;
    const TOLERANCE: f64 = 1e-13;
    let mut distance = (base - origin.z) / direction.z;
    for _ in 0..ITERATIONS {
        let point = origin + direction * distance;
        let place = point.truncate();
        let (height, slope) = pane.surface(spline, place);
        let gradient = slope.to_array();
        let residual = point.z - base - height;
        if residual.abs() < TOLERANCE {
            let parameters = (place / pane.size + 0.5).to_array();
            return (distance > 0.0 && pane.contains(place)).then_some((distance, parameters, gradient));
        }
        distance -= residual / (direction.z - gradient[0] * direction.x - gradient[1] * direction.y);
    }
    None
}
