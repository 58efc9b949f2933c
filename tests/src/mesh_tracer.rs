//! Light traced forward from a lamp through one sheet of triangles with interpolated normals, or off it, onto a flat
//! floor: `D T L` and `D R L`.
//!
//! A photon starts at a place of a triangle, drawn uniformly. For a lamp with an extent, its direction is drawn
//! uniformly from those in which the lamp is seen there. It is refracted or reflected by the interpolated normal, and
//! lands on the floor, which the sheet does not shade. As in `forward_tracer`, no path is sought between two given
//! ends, and no density has to be known but that of the start.

use std::f64::consts::PI;

use clerestory_render_core::light::Source;
use clerestory_render_core::specular::SpecularEvent;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::forward_tracer::{Fault, Tracing};
use crate::random::Random;
use crate::reference::Image;

/// A square around the z axis, cut into cells of two triangles each.
#[derive(Clone, Debug)]
pub struct Sheet {
    half: f64,
    cells: usize,
    /// Row by row, `cells + 1` in each.
    positions: Vec<DVec3>,
    /// Not of unit length.
    normals: Vec<DVec3>,
}

/// A sheet, a floor below it, and where a lamp is.
#[derive(Clone, Debug)]
pub struct SheetScene {
    /// The sheet. Its normals point to the light's side.
    pub sheet: Sheet,
    /// Index of refraction behind it.
    pub index: f64,
    /// Where the light is.
    pub lamp: DVec3,
    /// Radiant intensity of each channel, W/sr.
    pub intensity: f64,
    /// Height of the floor.
    pub floor: f64,
    /// Fraction of light that the floor reflects.
    pub reflectance: f64,
    /// Edge of the part of the floor around the z axis that is seen from above, metres.
    pub edge: f64,
    /// Pixels along that edge.
    pub pixels: usize,
}

/// What shines on a sheet. From afar, each is as bright as the point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lamp {
    /// A point where the lamp is.
    Point,
    /// A sphere around there, with a radius in metres.
    Sphere(f64),
    /// A sun that is seen there from the middle of the sheet, with an angular radius in degrees.
    Sun(f64),
}

/// The light of a lamp on the floor that a sheet refracts or reflects.
#[derive(Clone, Copy, Debug)]
pub struct LitSheet<'a> {
    /// The sheet with the floor.
    pub scene: &'a SheetScene,
    /// What shines.
    pub lamp: Lamp,
    /// What the sheet does to the light.
    pub event: SpecularEvent,
}

/// Where a photon lands, and what it carries there.
struct Landing {
    place: DVec2,
    /// Watts for each watt per square metre, across the way to the lamp, that arrives at the triangle.
    weight: f64,
}

impl Sheet {
    /// A sheet of half an edge's length `half` in `cells` by `cells` cells, of a height with its gradient.
    pub fn new(half: f64, cells: usize, height: impl Fn(DVec2) -> (f64, DVec2)) -> Self {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        for row in 0..=cells {
            for column in 0..=cells {
                let place = DVec2::new(column as f64, row as f64) / cells as f64 * (2.0 * half) - half;
                let (height, slope) = height(place);
                positions.push(place.extend(height));
                normals.push(DVec3::new(-slope.x, -slope.y, 1.0));
            }
        }
        Self { half, cells, positions, normals }
    }

    /// The sheet as the source of a mesh in a scene file.
    pub fn source(&self) -> Value {
        let arrays = |vectors: &[DVec3]| -> Vec<[f64; 3]> { vectors.iter().map(|v| v.to_array()).collect() };
        let triangles: Vec<[usize; 3]> = (0..2 * self.cells * self.cells).map(|k| self.triangle(k)).collect();
        json!({"inline": {
            "positions": arrays(&self.positions), "normals": arrays(&self.normals), "triangles": triangles}})
    }

    fn triangle(&self, index: usize) -> [usize; 3] {
        let (cell, half) = (index / 2, index % 2);
        let corner = cell / self.cells * (self.cells + 1) + cell % self.cells;
        let above = corner + self.cells + 1;
        if half == 0 { [corner, corner + 1, above + 1] } else { [corner, above + 1, above] }
    }

    /// The triangle over a place, and the weights of its second and third corner.
    fn locate(&self, place: DVec2) -> (usize, DVec2) {
        let cells = (place / self.half + 1.0) * (0.5 * self.cells as f64);
        let cell = cells.floor().clamp(DVec2::ZERO, DVec2::splat(self.cells as f64 - 1.0));
        let DVec2 { x, y } = cells - cell;
        let index = 2 * (cell.y as usize * self.cells + cell.x as usize);
        if x >= y { (index, DVec2::new(x - y, y)) } else { (index + 1, DVec2::new(x, y - x)) }
    }
}

impl SheetScene {
    /// The light of a point through the sheet.
    fn through(&self) -> LitSheet<'_> {
        LitSheet { scene: self, lamp: Lamp::Point, event: SpecularEvent::Transmission }
    }

    /// The scene file of the light of a point through the sheet, for an integrator.
    pub fn description(&self, integrator: &Value, samples: u32) -> Value {
        self.through().description(integrator, samples)
    }

    /// Whether light of a point beside the place of the sheet over a point of the plane lands the other way round.
    pub fn reverses_at(&self, place: DVec2) -> bool {
        let (triangle, weights) = self.sheet.locate(place);
        self.through()
            .land(triangle, weights, Source::Point(self.lamp), Fault::None)
            .is_some_and(|landing| self.through().reverses(triangle, weights, Source::Point(self.lamp), landing.place))
    }

    /// The pixel that sees a place of the floor, row by row from the top left.
    fn pixel(&self, place: DVec2) -> Option<usize> {
        let at = (place * DVec2::new(1.0, -1.0) / self.edge + 0.5) * self.pixels as f64;
        let within = at.min_element() >= 0.0 && at.max_element() < self.pixels as f64;
        within.then(|| at.y as usize * self.pixels + at.x as usize)
    }
}

impl LitSheet<'_> {
    /// The scene file for an integrator.
    pub fn description(&self, integrator: &Value, samples: u32) -> Value {
        let SheetScene { sheet, index, floor, reflectance, edge, pixels, .. } = self.scene;
        let reach = 4.0 * sheet.half;
        let chain = if self.event == SpecularEvent::Transmission { "T" } else { "R" };
        json!({
            "version": 1, "name": "sheet",
            "film": {"width": pixels, "height": pixels},
            "camera": {"orthographic": {"position": [0, 0, floor + 0.1], "look_at": [0, 0, floor], "up": [0, 1, 0],
                "height": edge}},
            "sampling": {"samples_per_pass": samples, "samples_per_block": samples},
            "integrator": integrator,
            "path_filter": format!("D {chain} L"),
            "materials": {
                "water": {"dielectric": {"index_of_refraction": index}},
                "floor": {"diffuse": {"reflectance": {"colour": [reflectance, reflectance, reflectance]}}}},
            "meshes": [
                {"name": "floor", "material": "floor", "source": {"inline": {
                    "positions": [[-reach, -reach, floor], [reach, -reach, floor], [reach, reach, floor],
                        [-reach, reach, floor]],
                    "triangles": [[0, 1, 2], [0, 2, 3]]}}},
                {"name": "water", "material": "water", "source": sheet.source()}],
            "lights": [self.light()],
        })
    }

    /// The lamp as in a scene file.
    fn light(&self) -> Value {
        let SheetScene { lamp, intensity, .. } = *self.scene;
        let place = lamp.to_array();
        match self.lamp {
            Lamp::Point => {
                json!({"point": {"name": "lamp", "position": place, "intensity": [intensity, intensity, intensity]}})
            }
            Lamp::Sphere(radius) => {
                let radiance = intensity / (PI * radius * radius);
                json!({"sphere": {"name": "lamp", "centre": place, "radius": radius,
                    "radiance": [radiance, radiance, radiance]}})
            }
            Lamp::Sun(angular_radius) => {
                let solid_angle = 2.0 * PI * one_less_cosine(libm::sin(angular_radius.to_radians()));
                let radiance = intensity / lamp.length_squared() / solid_angle;
                json!({"sun": {"name": "lamp", "direction": place, "angular_radius": angular_radius,
                    "radiance": [radiance, radiance, radiance]}})
            }
        }
    }

    /// A point of the lamp, chosen by two numbers in [0, 1). With it come the watts per square metre that arrive at a
    /// place, across the direction there.
    fn emission(&self, place: DVec3, numbers: DVec2) -> (Source, f64) {
        let SheetScene { lamp, intensity, .. } = *self.scene;
        let offset = lamp - place;
        match self.lamp {
            Lamp::Point => (Source::Point(lamp), intensity / offset.length_squared()),
            Lamp::Sphere(radius) => {
                let distance = offset.length();
                let sine = radius / distance;
                let direction = within_cone(offset / distance, sine, numbers);
                let nearest = direction.dot(offset);
                let half_chord = (radius * radius - offset.length_squared() + nearest * nearest).max(0.0).sqrt();
                // All directions in which the lamp is seen, times its radiance.
                let irradiance = 2.0 * one_less_cosine(sine) * intensity / (radius * radius);
                (Source::Point(place + direction * (nearest - half_chord)), irradiance)
            }
            Lamp::Sun(angular_radius) => {
                let sine = libm::sin(angular_radius.to_radians());
                let direction = within_cone(lamp.normalize(), sine, numbers);
                (Source::Direction(direction), intensity / lamp.length_squared())
            }
        }
    }

    /// Independent batches of the picture.
    pub fn trace(&self, tracing: &Tracing) -> Vec<Image> {
        (0..tracing.batches)
            .into_par_iter()
            .map(|batch| self.trace_batch(tracing, &mut Random::new(tracing.seed, u64::from(batch))))
            .collect()
    }

    fn trace_batch(&self, tracing: &Tracing, random: &mut Random) -> Image {
        let SheetScene { sheet, reflectance, edge, pixels, .. } = self.scene;
        let triangles = 2 * sheet.cells * sheet.cells;
        let share = tracing.photons as f64 / (f64::from(tracing.batches) * triangles as f64);
        let strata = (share.sqrt().round() as usize).max(1);
        let pixel = edge / *pixels as f64;
        let scale = if tracing.fault == Fault::Scaled { 1.005 } else { 1.0 };
        let scale = scale * reflectance / (PI * pixel * pixel * (strata * strata) as f64);
        let mut image = Image::black(*pixels, *pixels);
        for triangle in 0..triangles {
            for stratum in 0..strata * strata {
                let mut jitter = |k: usize| (k as f64 + random.uniform()) / strata as f64;
                let (u, v) = (jitter(stratum % strata).sqrt(), jitter(stratum / strata));
                let weights = DVec2::new(u * (1.0 - v), u * v);
                let numbers = match self.lamp {
                    Lamp::Point => DVec2::ZERO,
                    Lamp::Sphere(_) | Lamp::Sun(_) => DVec2::new(random.uniform(), random.uniform()),
                };
                let (source, irradiance) = self.emission(self.place(triangle, weights), numbers);
                let Some(landing) = self.land(triangle, weights, source, tracing.fault) else { continue };
                if tracing.fault == Fault::DroppedSaddles && self.reverses(triangle, weights, source, landing.place) {
                    continue;
                }
                if let Some(index) = self.scene.pixel(landing.place) {
                    image.pixels[index] += DVec3::splat(landing.weight * irradiance * scale);
                }
            }
        }
        image
    }

    fn place(&self, triangle: usize, weights: DVec2) -> DVec3 {
        blend(self.scene.sheet.triangle(triangle).map(|corner| self.scene.sheet.positions[corner]), weights)
    }

    /// The light from a point of the lamp by way of a place of a triangle.
    fn land(&self, triangle: usize, weights: DVec2, source: Source, fault: Fault) -> Option<Landing> {
        let SheetScene { sheet, index, floor, .. } = self.scene;
        let corners = sheet.triangle(triangle);
        let positions = corners.map(|corner| sheet.positions[corner]);
        let place = blend(positions, weights);
        let normal = blend(corners.map(|corner| sheet.normals[corner]), weights).normalize();
        let [a, b, c] = positions;
        let area = 0.5 * (b - a).cross(c - a);
        let to_lamp = match source {
            Source::Point(position) => (position - place).normalize(),
            Source::Direction(direction) => direction,
        };
        let (cosine, facing) = (to_lamp.dot(normal), to_lamp.dot(area));
        if cosine * facing <= 0.0 {
            return None;
        }
        let (direction, fraction) = match self.event {
            SpecularEvent::Transmission => {
                let (behind, reflected) = fresnel(cosine, *index).filter(|_| cosine > 0.0)?;
                (normal * (cosine / index - behind) - to_lamp / *index, 1.0 - reflected)
            }
            SpecularEvent::Reflection => {
                let ratio = if cosine > 0.0 { *index } else { 1.0 / index };
                let reflected = fresnel(cosine.abs(), ratio).map_or(1.0, |(_, reflected)| reflected);
                (normal * (2.0 * cosine) - to_lamp, reflected)
            }
        };
        if direction.z >= 0.0 {
            return None;
        }
        let landing = place + direction * ((floor - place.z) / direction.z);
        let fraction = if fault == Fault::MissingFresnelFactor { 1.0 } else { fraction };
        Some(Landing { place: landing.truncate(), weight: facing.abs() * fraction })
    }

    /// Whether light beside a place, from the same point of the lamp, lands the other way round.
    fn reverses(&self, triangle: usize, weights: DVec2, source: Source, place: DVec2) -> bool {
        const STEP: f64 = 1e-6;
        let beside =
            |step: DVec2| self.land(triangle, weights + step, source, Fault::None).map(|landing| landing.place - place);
        match [DVec2::X, DVec2::Y].map(|axis| beside(axis * STEP)) {
            [Some(x), Some(y)] => x.perp_dot(y) < 0.0,
            _ => false,
        }
    }

    /// For each pixel, whether the caustic of a point of light folds in it or in one beside it. There the map from the
    /// sheet to the floor changes its orientation. None where the lamp has an extent, over which folds are blurred.
    pub fn folds(&self) -> Vec<bool> {
        /// Places of the sheet along an edge.
        const PLACES: usize = 2048;
        let SheetScene { sheet, pixels, edge, lamp, .. } = self.scene;
        let mut marked = vec![false; pixels * pixels];
        if self.lamp != Lamp::Point {
            return marked;
        }
        let source = Source::Point(*lamp);
        let place = |k: usize| (2.0 * (k as f64 + 0.5) / PLACES as f64 - 1.0) * sheet.half;
        let seen: Vec<Vec<Option<(DVec2, bool)>>> = (0..PLACES)
            .into_par_iter()
            .map(|row| {
                let at = |column| {
                    let (triangle, weights) = sheet.locate(DVec2::new(place(column), place(row)));
                    let landing = self.land(triangle, weights, source, Fault::None)?;
                    Some((landing.place, self.reverses(triangle, weights, source, landing.place)))
                };
                (0..PLACES).map(at).collect()
            })
            .collect();
        let pixel = edge / *pixels as f64;
        for row in 1..PLACES {
            for column in 1..PLACES {
                let Some((here, reversed)) = seen[row][column] else { continue };
                for other in [seen[row - 1][column], seen[row][column - 1]] {
                    if other.is_some_and(|(_, other)| other != reversed) {
                        for (x, y) in [-1.0, 0.0, 1.0].into_iter().flat_map(|x| [-1.0, 0.0, 1.0].map(|y| (x, y))) {
                            if let Some(index) = self.scene.pixel(here + DVec2::new(x, y) * pixel) {
                                marked[index] = true;
                            }
                        }
                    }
                }
            }
        }
        marked
    }
}

fn blend([a, b, c]: [DVec3; 3], weights: DVec2) -> DVec3 {
    a * (1.0 - weights.x - weights.y) + b * weights.x + c * weights.y
}

/// The cosine behind an interface at which the index of refraction grows by `ratio`, and the reflected fraction of
/// unpolarised light (Snell and Fresnel). `None` at total reflection.
fn fresnel(cosine: f64, ratio: f64) -> Option<(f64, f64)> {
    let squared = 1.0 - (1.0 - cosine * cosine) / (ratio * ratio);
    if squared <= 0.0 {
        return None;
    }
    let behind = squared.sqrt();
    let across = (cosine - ratio * behind) / (cosine + ratio * behind);
    let along = (ratio * cosine - behind) / (ratio * cosine + behind);
    Some((behind, 0.5 * (across * across + along * along)))
}

/// One less the cosine of an angle below a right one, by its sine.
fn one_less_cosine(sine: f64) -> f64 {
    sine * sine / (1.0 + (1.0 - sine * sine).sqrt())
}

/// A direction in a cone around `axis` whose half opening angle has this sine, uniform by solid angle.
fn within_cone(axis: DVec3, sine: f64, numbers: DVec2) -> DVec3 {
    let less = numbers.x * one_less_cosine(sine);
    let (first, second) = axis.any_orthonormal_pair();
    let (y, x) = libm::sincos(2.0 * PI * numbers.y);
    axis * (1.0 - less) + (first * x + second * y) * (less * (2.0 - less)).sqrt()
}
