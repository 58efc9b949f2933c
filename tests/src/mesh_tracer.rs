//! Light traced forward from a point through one sheet of triangles with interpolated normals onto a flat floor: `D T L`.
//!
//! A photon starts at a place of a triangle, drawn uniformly, is refracted by the interpolated normal, and lands on the floor,
//! which the sheet does not shade. As in `forward_tracer`, no path is sought between two given ends, and no density has to
//! be known but that of the start.

use std::f64::consts::PI;

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

/// What the light of a point does behind a sheet.
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

/// Where a photon lands, and what it carries there.
struct Landing {
    place: DVec2,
    /// Watts for each steradian of the lamp and square metre of the sheet.
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
    /// The scene file for an integrator.
    pub fn description(&self, integrator: &Value, samples: u32) -> Value {
        let (floor, reach) = (self.floor, 4.0 * self.sheet.half);
        json!({
            "version": 1, "name": "sheet",
            "film": {"width": self.pixels, "height": self.pixels},
            "camera": {"orthographic": {"position": [0, 0, floor + 0.1], "look_at": [0, 0, floor], "up": [0, 1, 0],
                "height": self.edge}},
            "sampling": {"samples_per_pass": samples, "samples_per_block": samples},
            "integrator": integrator,
            "path_filter": "D T L",
            "materials": {
                "water": {"dielectric": {"index_of_refraction": self.index}},
                "floor": {"diffuse": {"reflectance": {"colour": [self.reflectance, self.reflectance, self.reflectance]}}}},
            "meshes": [
                {"name": "floor", "material": "floor", "source": {"inline": {
                    "positions": [[-reach, -reach, floor], [reach, -reach, floor], [reach, reach, floor],
                        [-reach, reach, floor]],
                    "triangles": [[0, 1, 2], [0, 2, 3]]}}},
                {"name": "water", "material": "water", "source": self.sheet.source()}],
            "lights": [{"point": {"name": "lamp", "position": self.lamp.to_array(),
                "intensity": [self.intensity, self.intensity, self.intensity]}}],
        })
    }

    /// Independent batches of the picture.
    pub fn trace(&self, tracing: &Tracing) -> Vec<Image> {
        (0..tracing.batches)
            .into_par_iter()
            .map(|batch| self.trace_batch(tracing, &mut Random::new(tracing.seed, u64::from(batch))))
            .collect()
    }

    fn trace_batch(&self, tracing: &Tracing, random: &mut Random) -> Image {
        let triangles = 2 * self.sheet.cells * self.sheet.cells;
        let share = tracing.photons as f64 / (f64::from(tracing.batches) * triangles as f64);
        let strata = (share.sqrt().round() as usize).max(1);
        let pixel = self.edge / self.pixels as f64;
        let scale = if tracing.fault == Fault::Scaled { 1.005 } else { 1.0 };
        let scale = scale * self.intensity * self.reflectance / (PI * pixel * pixel * (strata * strata) as f64);
        let mut image = Image::black(self.pixels, self.pixels);
        for triangle in 0..triangles {
            for stratum in 0..strata * strata {
                let mut jitter = |k: usize| (k as f64 + random.uniform()) / strata as f64;
                let (u, v) = (jitter(stratum % strata).sqrt(), jitter(stratum / strata));
                let weights = DVec2::new(u * (1.0 - v), u * v);
                let Some(landing) = self.land(triangle, weights, tracing.fault) else { continue };
                if tracing.fault == Fault::DroppedSaddles && self.reverses(triangle, weights, landing.place) {
                    continue;
                }
                if let Some(index) = self.pixel(landing.place) {
                    image.pixels[index] += DVec3::splat(landing.weight * scale);
                }
            }
        }
        image
    }

    /// The light through a place of a triangle.
    fn land(&self, triangle: usize, weights: DVec2, fault: Fault) -> Option<Landing> {
        let corners = self.sheet.triangle(triangle);
        let blend = |values: &[DVec3]| {
            let [a, b, c] = corners.map(|corner| values[corner]);
            a * (1.0 - weights.x - weights.y) + b * weights.x + c * weights.y
        };
        let (place, normal) = (blend(&self.sheet.positions), blend(&self.sheet.normals).normalize());
        let [a, b, c] = corners.map(|corner| self.sheet.positions[corner]);
        let area = 0.5 * (b - a).cross(c - a);
        let offset = self.lamp - place;
        let distance = offset.length();
        let to_lamp = offset / distance;
        let cosine = to_lamp.dot(normal);
        let facing = to_lamp.dot(area);
        if cosine <= 0.0 || facing <= 0.0 {
            return None;
        }
        // Snell and Fresnel, for light from the thinner side.
        let inside = (1.0 - (1.0 - cosine * cosine) / (self.index * self.index)).sqrt();
        let across = (cosine - self.index * inside) / (cosine + self.index * inside);
        let along = (self.index * cosine - inside) / (self.index * cosine + inside);
        let transmitted = 1.0 - 0.5 * (across * across + along * along);
        let direction = normal * (cosine / self.index - inside) - to_lamp / self.index;
        if direction.z >= 0.0 {
            return None;
        }
        let landing = place + direction * ((self.floor - place.z) / direction.z);
        let fresnel = if fault == Fault::MissingFresnelFactor { 1.0 } else { transmitted };
        Some(Landing { place: landing.truncate(), weight: facing * fresnel / (distance * distance) })
    }

    /// Whether light beside a place lands the other way round.
    fn reverses(&self, triangle: usize, weights: DVec2, place: DVec2) -> bool {
        const STEP: f64 = 1e-6;
        let beside =
            |step: DVec2| self.land(triangle, weights + step, Fault::None).map(|landing| landing.place - place);
        match [DVec2::X, DVec2::Y].map(|axis| beside(axis * STEP)) {
            [Some(x), Some(y)] => x.perp_dot(y) < 0.0,
            _ => false,
        }
    }

    /// Whether light beside the place of the sheet over a point of the plane lands the other way round.
    pub fn reverses_at(&self, place: DVec2) -> bool {
        let (triangle, weights) = self.sheet.locate(place);
        self.land(triangle, weights, Fault::None).is_some_and(|landing| self.reverses(triangle, weights, landing.place))
    }

    /// The pixel that sees a place of the floor, row by row from the top left.
    fn pixel(&self, place: DVec2) -> Option<usize> {
        let at = (place * DVec2::new(1.0, -1.0) / self.edge + 0.5) * self.pixels as f64;
        let within = at.min_element() >= 0.0 && at.max_element() < self.pixels as f64;
        within.then(|| at.y as usize * self.pixels + at.x as usize)
    }

    /// For each pixel, whether the caustic folds in it or in one beside it: where light on one side of a place of the sheet
    /// lands the other way round than light on the other side.
    pub fn folds(&self) -> Vec<bool> {
        /// Places of the sheet along an edge.
        const PLACES: usize = 2048;
        let place = |k: usize| (2.0 * (k as f64 + 0.5) / PLACES as f64 - 1.0) * self.sheet.half;
        let seen: Vec<Vec<Option<(DVec2, bool)>>> = (0..PLACES)
            .into_par_iter()
            .map(|row| {
                let at = |column| {
                    let (triangle, weights) = self.sheet.locate(DVec2::new(place(column), place(row)));
                    let landing = self.land(triangle, weights, Fault::None)?;
                    Some((landing.place, self.reverses(triangle, weights, landing.place)))
                };
                (0..PLACES).map(at).collect()
            })
            .collect();
        let mut marked = vec![false; self.pixels * self.pixels];
        let pixel = self.edge / self.pixels as f64;
        for row in 1..PLACES {
            for column in 1..PLACES {
                let Some((here, reversed)) = seen[row][column] else { continue };
                for other in [seen[row - 1][column], seen[row][column - 1]] {
                    if other.is_some_and(|(_, other)| other != reversed) {
                        for (x, y) in [-1.0, 0.0, 1.0].into_iter().flat_map(|x| [-1.0, 0.0, 1.0].map(|y| (x, y))) {
                            if let Some(index) = self.pixel(here + DVec2::new(x, y) * pixel) {
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
