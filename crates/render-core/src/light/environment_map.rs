//! Pictures and skies around a scene, and how directions are drawn by their radiance.
//!
//! The top row of a picture is +z. Seen from inside, its middle column lies towards +x and the columns left of that
//! towards +y. Radiance between texels is bilinear. The density is constant in each cell of a grid, and proportional to
//! the root of the mean square of that same radiance there. No other such density has less variance.
//!
//! Where sampling is combined with that of a BSDF, the mean radiance is taken off the density first. The BSDF's samples
//! find what is even (Karlik et al. 2019, "MIS Compensation: Optimizing Sampling Techniques in Multiple Importance
//! Sampling").

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::environment_sky::Sky;
use super::sphere_density::{SphereDensity, direction_of, place_of, row_edges};
use crate::settings::AssetProblem;
use crate::texture::RadiancePicture;

/// Columns and rows of the density at the most.
const MAX_CELLS: [usize; 2] = [1024, 512];

/// Points along an edge of a cell at which its radiance is read, for each texel and at the least.
const POINTS_OF_TEXEL: usize = 2;
const LEAST_POINTS: usize = 4;

/// The density nowhere falls below this part of its mean: a cell is dark where it was read, and need not be elsewhere.
const FLOOR: f64 = 1e-4;

/// Where less than this part of the light is above the mean, the picture is taken for uniform.
const UNEVEN: f64 = 0.01;

/// Bytes of a texel.
const TEXEL_BYTES: u64 = 12;

/// Bytes of a cell in two densities, and in what these are computed from.
const CELL_BYTES: u64 = 6 * 8;

/// Decoded pictures by the names of their files.
pub type EnvironmentMaps = BTreeMap<String, Arc<EnvironmentMap>>;

/// A picture or a sky around the scene.
#[derive(Debug)]
pub struct EnvironmentMap {
    surroundings: Surroundings,
    /// Mean and largest radiance of each channel.
    mean: DVec3,
    brightest: DVec3,
    plain: SphereDensity,
    /// For sampling that is combined with that of a BSDF; `None` where it is the plain one.
    compensated: Option<SphereDensity>,
}

/// What is around the scene.
#[derive(Debug)]
enum Surroundings {
    Picture(RadiancePicture),
    Sky(Sky),
}

impl Surroundings {
    /// Columns and rows.
    fn size(&self) -> [usize; 2] {
        match self {
            Self::Picture(picture) => picture.size(),
            Self::Sky(_) => Sky::SIZE,
        }
    }

    /// Radiance at a place, in columns from the left and in rows from the top.
    fn at(&self, x: f64, y: f64) -> DVec3 {
        match self {
            Self::Picture(picture) => picture.between(x, y),
            Self::Sky(sky) => {
                let [width, height] = Sky::SIZE.map(|edge| edge as f64);
                sky.radiance(direction_of(DVec2::new(x / width, y / height)))
            }
        }
    }

    /// The same at the middles of all columns, row by row.
    fn texels(&self) -> Vec<DVec3> {
        let [width, height] = self.size();
        let middle = |place: usize| self.at((place % width) as f64 + 0.5, (place / width) as f64 + 0.5);
        (0..width * height).into_par_iter().map(middle).collect()
    }

    /// Radiance from a direction.
    fn radiance(&self, direction: DVec3) -> DVec3 {
        match self {
            Self::Picture(picture) => {
                let place = place_of(direction);
                let [width, height] = picture.size().map(|edge| edge as f64);
                picture.between(place.x * width, place.y * height)
            }
            Self::Sky(sky) => sky.radiance(direction),
        }
    }

    /// The largest radiance of each channel.
    fn brightest(&self, texels: &[DVec3]) -> DVec3 {
        let at_the_sun = match self {
            Self::Picture(_) => DVec3::ZERO,
            Self::Sky(sky) => sky.at_the_sun(),
        };
        texels.iter().fold(at_the_sun, |most, texel| most.max(*texel))
    }
}

impl EnvironmentMap {
    /// The map of a sky.
    pub(super) fn of_sky(sky: Sky) -> Self {
        Self::new(Surroundings::Sky(sky))
    }

    /// Decodes an OpenEXR or Radiance file.
    pub(crate) fn decode(bytes: &[u8]) -> Result<Self, AssetProblem> {
        RadiancePicture::decode(bytes).map(|picture| Self::new(Surroundings::Picture(picture)))
    }

    /// Bytes that a map of so many pixels takes, while it is made too.
    pub(crate) fn bytes(pixels: u64) -> u64 {
        TEXEL_BYTES * pixels + CELL_BYTES * pixels.min((MAX_CELLS[0] * MAX_CELLS[1]) as u64)
    }

    fn new(surroundings: Surroundings) -> Self {
        let [width, height] = surroundings.size();
        let cells = [width.min(MAX_CELLS[0]), height.min(MAX_CELLS[1])];
        let texels = surroundings.texels();
        let (brightest, mean) = (surroundings.brightest(&texels), mean([width, height], &texels));
        let plain = root_mean_squares(&surroundings, cells);
        let level = mean.element_sum() / 3.0;
        let compensated: Vec<f64> = plain.iter().map(|weight| (weight - level).max(0.0)).collect();
        let edges = row_edges(cells[1]);
        let total = |weights: &[f64]| -> f64 {
            let rows = weights.chunks_exact(cells[0]).zip(edges.windows(2));
            rows.map(|(row, edge)| row.iter().sum::<f64>() * (edge[0] - edge[1])).sum()
        };
        let is_uneven = total(&compensated) > UNEVEN * total(&plain);
        let density = |weights: &[f64]| {
            let floored: Vec<f64> = weights.iter().map(|weight| weight.max(FLOOR * level)).collect();
            SphereDensity::new(cells, &floored)
        };
        let compensated = is_uneven.then(|| density(&compensated));
        Self { mean, brightest, plain: density(&plain), compensated, surroundings }
    }

    /// Mean radiance over all directions.
    pub(super) fn mean(&self) -> DVec3 {
        self.mean
    }

    /// The largest radiance of each channel.
    pub(super) fn brightest(&self) -> DVec3 {
        self.brightest
    }

    /// Radiance from a direction.
    pub(super) fn radiance(&self, direction: DVec3) -> DVec3 {
        self.surroundings.radiance(direction)
    }

    /// Draws a direction.
    pub(super) fn sample(&self, partner: Partner, random: DVec2) -> DVec3 {
        self.density(partner).sample(random)
    }

    /// The density, per solid angle, with which [`Self::sample`] draws a direction.
    pub(super) fn pdf(&self, partner: Partner, direction: DVec3) -> f64 {
        self.density(partner).at(place_of(direction))
    }

    fn density(&self, partner: Partner) -> &SphereDensity {
        match (partner, &self.compensated) {
            (Partner::Bsdf, Some(compensated)) => compensated,
            _ => &self.plain,
        }
    }
}

/// What a way of sampling is combined with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Partner {
    /// Directions that a BSDF draws, by the balance heuristic.
    Bsdf,
    /// Nothing: every direction from which light comes has to be drawn.
    None,
}

/// The mean radiance over all directions. A row stands for the latitudes that it covers.
fn mean([width, height]: [usize; 2], texels: &[DVec3]) -> DVec3 {
    let edges = row_edges(height);
    let sum = texels.chunks_exact(width).enumerate().fold(DVec3::ZERO, |sum, (row, texels)| {
        let of_row = texels.iter().fold(DVec3::ZERO, |sum, texel| sum + *texel);
        sum + of_row * (edges[row] - edges[row + 1])
    });
    sum / (2.0 * width as f64)
}

/// The root of the mean square of the radiance in each cell, where radiance is the mean of its channels.
fn root_mean_squares(surroundings: &Surroundings, [columns, rows]: [usize; 2]) -> Vec<f64> {
    let [width, height] = surroundings.size();
    let texels = [width as f64 / columns as f64, height as f64 / rows as f64];
    let points = texels.map(|texels| (POINTS_OF_TEXEL * texels.ceil() as usize).max(LEAST_POINTS));
    let steps = [0, 1].map(|axis| texels[axis] / points[axis] as f64);
    let of_cell = |cell: usize| {
        let corner = [(cell % columns) as f64 * texels[0], (cell / columns) as f64 * texels[1]];
        let mut sum = 0.0;
        for point in 0..points[0] * points[1] {
            let place = [(point % points[0]) as f64 + 0.5, (point / points[0]) as f64 + 0.5];
            let radiance = surroundings.at(corner[0] + place[0] * steps[0], corner[1] + place[1] * steps[1]);
            let grey = radiance.element_sum() / 3.0;
            sum += grey * grey;
        }
        (sum / (points[0] * points[1]) as f64).sqrt()
    };
    (0..columns * rows).into_par_iter().map(of_cell).collect()
}

/// Solid angle of all directions.
pub(super) const SPHERE: f64 = 4.0 * PI;
