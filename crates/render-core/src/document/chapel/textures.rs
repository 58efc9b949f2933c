//! Pictures of the chapel's stone and wood, computed: they repeat without a seam.
//!
//! Stone and wood are cut into pieces in rows, each of a tone of its own, with joints between. Noise on grids that
//! repeat makes blotches and grain.

use std::f64::consts::PI;
use std::io::Cursor;

use image::{ImageError, ImageFormat, Rgb, RgbImage};

use crate::math::hash::mix;
use crate::settings::Triple;

/// Texels along each edge of a picture.
const SIZE: u32 = 512;

/// Length of each edge of a picture on a wall, a floor or a bench, metres.
pub(super) const EXTENT: f64 = 2.4;

/// A picture of a material, by the name of its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Texture {
    /// Courses of squared stone in lime mortar.
    Ashlar,
    /// Slabs of worn stone.
    Flagstones,
    /// Planks, with the grain along u.
    Oak,
}

/// How a material is cut into pieces and coloured.
struct Pattern {
    /// Rows of pieces, and pieces in each row.
    rows: u32,
    pieces: u32,
    /// By how much the length of a piece varies, as a part of the mean.
    uneven: f64,
    /// Half the width of a joint, metres.
    joint: f64,
    /// Linear reflectance of the pieces and of the joints.
    colour: Triple,
    joint_colour: Triple,
    /// By how much the tone of a piece, its blotches and its grain vary.
    tones: f64,
    blotches: f64,
    grain: f64,
    /// Cells of the grain along u and v.
    grain_cells: [u32; 2],
    seed: u64,
}

const ASHLAR: Pattern = Pattern {
    rows: 8,
    pieces: 4,
    uneven: 0.45,
    joint: 0.005,
    colour: [0.55, 0.49, 0.4],
    joint_colour: [0.66, 0.62, 0.55],
    tones: 0.18,
    blotches: 0.22,
    grain: 0.12,
    grain_cells: [96, 96],
    seed: 1,
};

const FLAGSTONES: Pattern = Pattern {
    rows: 4,
    pieces: 3,
    uneven: 0.5,
    joint: 0.006,
    colour: [0.36, 0.33, 0.29],
    joint_colour: [0.16, 0.14, 0.12],
    tones: 0.3,
    blotches: 0.35,
    grain: 0.1,
    grain_cells: [128, 128],
    seed: 2,
};

const OAK: Pattern = Pattern {
    rows: 12,
    pieces: 1,
    uneven: 0.0,
    joint: 0.0025,
    colour: [0.2, 0.12, 0.065],
    joint_colour: [0.04, 0.025, 0.015],
    tones: 0.35,
    blotches: 0.2,
    grain: 0.45,
    grain_cells: [12, 240],
    seed: 3,
};

impl Texture {
    pub(super) const ALL: [Self; 3] = [Self::Ashlar, Self::Flagstones, Self::Oak];

    /// The file beside the scene.
    pub(super) fn file(self) -> &'static str {
        match self {
            Self::Ashlar => "chapel-ashlar.png",
            Self::Flagstones => "chapel-flagstones.png",
            Self::Oak => "chapel-oak.png",
        }
    }

    /// The picture as a PNG file.
    pub(super) fn png(self) -> Result<Vec<u8>, ImageError> {
        let coordinate = |texel: u32| (f64::from(texel) + 0.5) / f64::from(SIZE);
        let picture = RgbImage::from_fn(SIZE, SIZE, |column, row| {
            let colour = self.colour([coordinate(column), 1.0 - coordinate(row)]);
            Rgb(colour.map(|value| (encoded(value) * 255.0).round() as u8))
        });
        let mut file = Cursor::new(Vec::new());
        picture.write_to(&mut file, ImageFormat::Png)?;
        Ok(file.into_inner())
    }

    /// Linear reflectance at texture coordinates.
    fn colour(self, place: [f64; 2]) -> Triple {
        match self {
            Self::Ashlar => ASHLAR.colour(place),
            Self::Flagstones => FLAGSTONES.colour(place),
            Self::Oak => OAK.colour(place),
        }
    }
}

impl Pattern {
    fn colour(&self, place: [f64; 2]) -> Triple {
        let [u, v] = place;
        let height = v * f64::from(self.rows);
        let row = height.floor() as u32 % self.rows;
        let across = (height - height.floor()).min(1.0 - (height - height.floor())) / f64::from(self.rows);
        let (piece, along) = self.piece(u, row);
        // Edges are worn: they are not quite straight.
        let worn = 0.6 * self.joint * (self.noise(place, [64, 64], 7) - 0.5);
        let edge = across.min(along) * EXTENT - self.joint + worn;
        let within = smooth((edge / self.joint).clamp(0.0, 1.0));
        let tone = 1.0 + self.tones * (unit([self.seed, u64::from(row), u64::from(piece), 11]) - 0.5);
        let warmth = 0.06 * self.tones * (unit([self.seed, u64::from(row), u64::from(piece), 12]) - 0.5);
        let blotch = 1.0 + self.blotches * (self.blotch_at(place) - 0.5);
        let grain = 1.0 + self.grain * (self.grain_at(place, row) - 0.5);
        let rim = 0.9 + 0.1 * smooth((edge / (8.0 * self.joint)).clamp(0.0, 1.0));
        [0, 1, 2].map(|channel| {
            let shade = 1.0 + warmth * (1.0 - channel as f64) * 4.0;
            let stone = self.colour[channel] * tone * shade * blotch * grain * rim;
            let joint = self.joint_colour[channel] * (0.5 + 0.5 * blotch);
            (joint + (stone - joint) * within).clamp(0.0, 1.0)
        })
    }

    /// The piece of a row at `u`, and how far its nearer end is.
    fn piece(&self, u: f64, row: u32) -> (u32, f64) {
        if self.pieces == 1 && self.uneven == 0.0 {
            // A plank goes on without an end.
            return (0, f64::INFINITY);
        }
        let count = f64::from(self.pieces);
        let end = |piece: u32| {
            let random = unit([self.seed, u64::from(row), u64::from(piece % self.pieces), 5]) - 0.5;
            f64::from(piece) + random * self.uneven
        };
        // Ends of one row are over the middles of the next.
        let place = (u * count + 0.5 * f64::from(row % 2)).rem_euclid(count);
        // The first piece begins around 0, before or behind it.
        let place = if place < end(0) { place + count } else { place };
        let piece = (0..self.pieces).rev().find(|piece| place >= end(*piece)).unwrap_or(0);
        let nearer = (place - end(piece)).min(end_after(piece, self.pieces, count, &end) - place);
        (piece, nearer / count)
    }

    /// Large soft spots.
    fn blotch_at(&self, place: [f64; 2]) -> f64 {
        let octaves = [(5, 0.5), (11, 0.3), (29, 0.2)];
        octaves.into_iter().map(|(cells, weight)| weight * self.noise(place, [cells; 2], u64::from(cells))).sum()
    }

    fn grain_at(&self, place: [f64; 2], row: u32) -> f64 {
        let [along, across] = self.grain_cells;
        // Fibres of each plank wander, and are not those of its neighbour.
        let bend = if along == across { 0.0 } else { 0.012 * libm::sin(2.0 * PI * place[0]) };
        let moved = [place[0] + unit([self.seed, u64::from(row), 3]), place[1] + bend];
        0.6 * self.noise(moved, [along, across], 21) + 0.4 * self.noise(moved, [2 * along, across / 3], 22)
    }

    /// Noise between 0 and 1 over a grid of cells that repeats.
    fn noise(&self, place: [f64; 2], cells: [u32; 2], number: u64) -> f64 {
        let axis = |axis: usize| {
            let at = (place[axis] * f64::from(cells[axis])).rem_euclid(f64::from(cells[axis]));
            let cell = at.floor();
            let next = (cell as u32 + 1) % cells[axis];
            ([cell as u32 % cells[axis], next], smooth(at - cell))
        };
        let ([x0, x1], x) = axis(0);
        let ([y0, y1], y) = axis(1);
        let corner = |x: u32, y: u32| unit([self.seed, number, u64::from(x), u64::from(y)]);
        let between = |a: f64, b: f64, part: f64| a + (b - a) * part;
        between(between(corner(x0, y0), corner(x1, y0), x), between(corner(x0, y1), corner(x1, y1), x), y)
    }
}

/// Where the piece after one begins.
fn end_after(piece: u32, pieces: u32, count: f64, end: &impl Fn(u32) -> f64) -> f64 {
    if piece + 1 == pieces { count + end(0) } else { end(piece + 1) }
}

/// A step without a corner.
fn smooth(x: f64) -> f64 {
    x * x * (3.0 - 2.0 * x)
}

/// A number in [0, 1) from a key.
fn unit<const N: usize>(key: [u64; N]) -> f64 {
    let bits = key.into_iter().fold(0, |bits, part| mix(bits ^ part));
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// The value of sRGB for a linear one.
fn encoded(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colours(texture: Texture, size: u32) -> Vec<Triple> {
        let at = |index: u32| (f64::from(index) + 0.5) / f64::from(size);
        (0..size).flat_map(|row| (0..size).map(move |column| texture.colour([at(column), at(row)]))).collect()
    }

    #[test]
    fn pictures_are_the_same_each_time_and_differ_from_each_other() {
        let files: Vec<_> = Texture::ALL.map(|texture| texture.png().unwrap()).into();
        assert_eq!(files, Texture::ALL.map(|texture| texture.png().unwrap()));
        assert!(files[0] != files[1] && files[1] != files[2]);
        assert!(files.iter().all(|file| file.len() < 1 << 20));
    }

    #[test]
    fn pictures_repeat_without_a_seam() {
        for texture in Texture::ALL {
            for step in 0..1000 {
                let along = f64::from(step) / 1000.0;
                for [before, after] in [[[-1e-9, along], [1.0 - 1e-9, along]], [[along, 1e-9], [along, 1.0 + 1e-9]]] {
                    let [before, after] = [before, after].map(|place| texture.colour(place));
                    for channel in 0..3 {
                        let difference = (before[channel] - after[channel]).abs();
                        assert!(difference < 1e-4, "{texture:?} {step}: {before:?} {after:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn pictures_reflect_as_their_materials_do() {
        let means = Texture::ALL.map(|texture| {
            let colours = colours(texture, 128);
            let mean = colours.iter().map(|colour| colour[1]).sum::<f64>() / colours.len() as f64;
            let square = colours.iter().map(|colour| (colour[1] - mean).powi(2)).sum::<f64>() / colours.len() as f64;
            assert!(square.sqrt() > 0.05 * mean, "{texture:?} is plain");
            mean
        });
        for (mean, [least, most]) in means.into_iter().zip([[0.4, 0.6], [0.2, 0.4], [0.05, 0.2]]) {
            assert!(least < mean && mean < most, "{means:?}");
        }
    }
}
