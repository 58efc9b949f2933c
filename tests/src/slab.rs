//! The faces of the slab in `scenes/slab.json`: plane waves of 5 to 12 cm in all directions, and what they do to light.
//!
//! Slab, light and receiver are those for which the speed of the renderer of specular manifold sampling's authors is
//! known; the waves are ours.

use std::f64::consts::TAU;
use std::path::Path;

use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage};
use glam::{DMat2, DVec2};

use crate::random::Random;

/// Edge of the slab, metres.
pub const EDGE: f64 = 0.2;

/// Coefficients along an edge: 16 for the shortest wave.
pub const COEFFICIENTS: usize = 64;

/// Shortest and longest wave, metres.
pub const WAVELENGTHS: [f64; 2] = [0.05, 0.12];

/// Height of the highest or depth of the lowest coefficient, metres.
pub const AMPLITUDE: f64 = 3e-4;

/// Waves of a face.
const WAVES: usize = 24;

/// One face of the slab.
#[derive(Clone, Debug)]
pub struct SlabFace {
    waves: Vec<(DVec2, f64)>,
    amplitude: f64,
}

impl SlabFace {
    /// A face with waves of random directions, lengths and phases.
    pub fn new(seed: u64) -> Self {
        let mut random = Random::new(seed, 0);
        let [shortest, longest] = WAVELENGTHS;
        let waves = (0..WAVES).map(|_| {
            let (sin, cos) = libm::sincos(TAU * random.uniform());
            let length = shortest + (longest - shortest) * random.uniform();
            (DVec2::new(cos, sin) * (TAU / length), TAU * random.uniform())
        });
        let mut face = Self { waves: waves.collect(), amplitude: 1.0 };
        let highest = places().map(|place| face.height(place).abs()).fold(0.0, f64::max);
        face.amplitude = AMPLITUDE / highest;
        face
    }

    /// The coefficients of the spline, row by row.
    pub fn coefficients(&self) -> Vec<f32> {
        places().map(|place| self.height(place) as f32).collect()
    }

    /// Second derivatives of the height, 1/m.
    pub fn curvature(&self, place: DVec2) -> DMat2 {
        let sum = |sum: DMat2, (k, phase): &(DVec2, f64)| {
            let curvature = -self.amplitude * libm::cos(k.dot(place) + phase);
            sum + DMat2::from_cols(*k * k.x, *k * k.y) * curvature
        };
        self.waves.iter().fold(DMat2::ZERO, sum)
    }

    /// Writes the coefficients as a height map.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn write(&self, file: &Path) -> exr::error::UnitResult {
        let channels =
            AnyChannels::sort([AnyChannel::new("Y", FlatSamples::F32(self.coefficients()))].into_iter().collect());
        let size = (COEFFICIENTS, COEFFICIENTS);
        let layer = Layer::new(size, LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
        Image::from_layer(layer).write().to_file(file)
    }

    fn height(&self, place: DVec2) -> f64 {
        self.amplitude * self.waves.iter().map(|(k, phase)| libm::cos(k.dot(place) + phase)).sum::<f64>()
    }
}

/// Where the coefficients stand, row by row, metres from the middle.
pub fn places() -> impl Iterator<Item = DVec2> {
    let along = |index: usize| ((index as f64 + 0.5) / COEFFICIENTS as f64 - 0.5) * EDGE;
    (0..COEFFICIENTS * COEFFICIENTS).map(move |k| DVec2::new(along(k % COEFFICIENTS), along(k / COEFFICIENTS)))
}

/// The least spread of the light of a point 3 m above the slab, in any direction on a receiver 1 m below. It is the
/// smallest eigenvalue of the derivative of the place on the receiver, by the thin lens. A negative one is a fold.
pub fn smallest_spread(front: &SlabFace, back: &SlabFace, index_of_refraction: f64) -> f64 {
    let spread = |place: DVec2| {
        let thickness = back.curvature(place) - front.curvature(place);
        let landing = DMat2::from_diagonal(DVec2::splat(4.0 / 3.0)) + thickness * (index_of_refraction - 1.0);
        let half_trace = 0.5 * (landing.x_axis.x + landing.y_axis.y);
        half_trace - (half_trace * half_trace - landing.determinant()).max(0.0).sqrt()
    };
    places().map(spread).fold(f64::INFINITY, f64::min)
}
