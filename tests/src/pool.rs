//! The water in `scenes/pool.json`: plane waves of 30 to 70 cm in all directions, as a mesh with normals. It also tells
//! where they refract the light of a point.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::random::Random;

/// Edge of the surface, metres.
pub const EDGE: f64 = 2.0;

/// Depth of the water, metres: the mean height of the surface above the floor.
pub const DEPTH: f64 = 2.0;

/// Triangles of the mesh have two edges as long as this part of the surface's edge.
pub const CELLS: u16 = 80;

/// Shortest and longest wave, metres.
pub const WAVELENGTHS: [f64; 2] = [0.3, 0.7];

/// Root of the mean square of the height above its mean, metres.
pub const HEIGHT: f64 = 0.015;

/// Index of refraction.
pub const INDEX: f64 = 1.33;

/// Number of waves.
const WAVES: usize = 16;

/// The surface of the water.
#[derive(Clone, Debug)]
pub struct Water {
    /// Wave vectors, 1/m, and phases.
    waves: Vec<(DVec2, f64)>,
}

/// A ray of light that has come through the surface.
#[derive(Clone, Copy, Debug)]
pub struct Landing {
    /// Where it meets the floor, metres.
    pub place: DVec2,
    /// The refracted part of its light, times the cosine of its angle with the normal, times an area ratio. That is the
    /// area of a small piece of the surface over its area from above.
    pub weight: f64,
}

impl Water {
    /// A surface with waves of random directions, lengths and phases, all of the same amplitude.
    pub fn new(seed: u64) -> Self {
        let mut random = Random::new(seed, 0);
        let [shortest, longest] = WAVELENGTHS;
        let waves = (0..WAVES).map(|_| {
            let (sin, cos) = libm::sincos(TAU * random.uniform());
            let length = shortest + (longest - shortest) * random.uniform();
            (DVec2::new(cos, sin) * (TAU / length), TAU * random.uniform())
        });
        Self { waves: waves.collect() }
    }

    /// Height above the floor, metres, and slope.
    pub fn surface(&self, place: DVec2) -> (f64, DVec2) {
        let amplitude = HEIGHT * (2.0 / WAVES as f64).sqrt();
        let flat = (DEPTH, DVec2::ZERO);
        self.waves.iter().fold(flat, |(height, slope), (k, phase)| {
            let (sin, cos) = libm::sincos(k.dot(place) + phase);
            (height + amplitude * cos, slope - *k * (amplitude * sin))
        })
    }

    /// The mesh: a PLY file with positions and unit normals, whose triangles are seen counterclockwise from above.
    pub fn ply(&self) -> Vec<u8> {
        let along = u32::from(CELLS) + 1;
        let properties: String =
            ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property float {name}\n")).concat();
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}element face {}\n\
             property list uchar ushort vertex_indices\nend_header\n",
            along * along,
            2 * u32::from(CELLS) * u32::from(CELLS)
        );
        let mut bytes = header.into_bytes();
        for place in corners(usize::from(CELLS)) {
            let (height, slope) = self.surface(place);
            for vector in [place.extend(height), (-slope).extend(1.0).normalize()] {
                bytes.extend(vector.to_array().into_iter().flat_map(|number| (number as f32).to_le_bytes()));
            }
        }
        for [a, b, c, d] in cells(CELLS) {
            for triangle in [[a, b, c], [a, c, d]] {
                bytes.push(3);
                bytes.extend(triangle.into_iter().flat_map(u16::to_le_bytes));
            }
        }
        bytes
    }

    /// The light that a point of light sends onto a place of the surface.
    pub fn landing(&self, place: DVec2, lamp: DVec3) -> Landing {
        let (height, slope) = self.surface(place);
        let upwards = (-slope).extend(1.0);
        let normal = upwards.normalize();
        let position = place.extend(height);
        let incident = (position - lamp).normalize();
        let cos_above = -incident.dot(normal);
        let cos_below = (1.0 - (1.0 - cos_above * cos_above) / (INDEX * INDEX)).sqrt();
        let refracted = incident / INDEX + normal * (cos_above / INDEX - cos_below);
        let fresnel = {
            let across = (cos_above - INDEX * cos_below) / (cos_above + INDEX * cos_below);
            let along = (INDEX * cos_above - cos_below) / (INDEX * cos_above + cos_below);
            1.0 - 0.5 * (across * across + along * along)
        };
        let on_floor = position - refracted * (position.z / refracted.z);
        Landing { place: on_floor.truncate(), weight: fresnel * -incident.dot(upwards) }
    }
}

/// The surface, cut into small triangles, as its refraction throws it onto the floor.
#[derive(Clone, Debug)]
pub struct Caustic {
    triangles: Vec<[DVec2; 3]>,
}

impl Caustic {
    /// The caustic of a point of light, from twice as many triangles as there are square cells.
    pub fn new(water: &Water, lamp: DVec3, cells_along: u16) -> Self {
        let landings: Vec<DVec2> =
            corners(usize::from(cells_along)).map(|place| water.landing(place, lamp).place).collect();
        let triangles = cells(cells_along).flat_map(|cell| {
            let [a, b, c, d] = cell.map(|corner| landings[usize::from(corner)]);
            [[a, b, c], [a, c, d]]
        });
        Self { triangles: triangles.collect() }
    }

    /// How many rays from the point of light meet a place of the floor.
    pub fn rays(&self, place: DVec2) -> usize {
        let contains = |&&[a, b, c]: &&[DVec2; 3]| {
            let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(place - from) > 0.0);
            sides[0] == sides[1] && sides[1] == sides[2]
        };
        self.triangles.iter().filter(contains).count()
    }
}

/// Corners of the cells of a grid over the surface, row by row, metres from the middle.
fn corners(cells_along: usize) -> impl Iterator<Item = DVec2> {
    let along = move |index: usize| (index as f64 / cells_along as f64 - 0.5) * EDGE;
    let count = cells_along + 1;
    (0..count * count).map(move |k| DVec2::new(along(k % count), along(k / count)))
}

/// The corners of each cell, by number, counterclockwise.
fn cells(cells_along: u16) -> impl Iterator<Item = [u16; 4]> {
    let corner = move |row: u16, column: u16| row * (cells_along + 1) + column;
    let of_row = move |row: u16| {
        (0..cells_along).map(move |column| {
            [corner(row, column), corner(row, column + 1), corner(row + 1, column + 1), corner(row + 1, column)]
        })
    };
    (0..cells_along).flat_map(of_row)
}
