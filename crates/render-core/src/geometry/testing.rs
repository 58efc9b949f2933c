//! What the tests of this module share: glass of several kinds, and property tests with a fixed seed.

use std::sync::Arc;

use glam::{DVec2, DVec3, dvec2};
use proptest::test_runner::{Config, RngSeed};

use super::{Frame, HeightField, Outline, Pane, PaneParts};

/// A run of `cases` cases that is the same every time.
pub(crate) fn fixed_seed(cases: u32) -> Config {
    Config { cases, rng_seed: RngSeed::Fixed(0x6c61_7373), failure_persistence: None, ..Config::default() }
}

/// A rectangular pane of this size around the origin of its frame, between two faces.
pub(crate) fn rectangular(
    frame: Frame,
    size: DVec2,
    thickness: f64,
    index_of_refraction: f64,
    absorption: DVec3,
    faces: [HeightField; 2],
) -> Pane {
    let (name, outline, faces) = ("test".to_owned(), Outline::centred(size), faces.map(Arc::new));
    let layers = [DVec3::ZERO; 2];
    Pane::new(PaneParts { name, frame, outline, thickness, index_of_refraction, absorption, layers, faces }).unwrap()
}

/// Kinds of old glass, by the shape of a face.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Glass {
    /// Concentric rings around a raised centre.
    Crown,
    /// Bumps without any order.
    Bumpy,
    /// Ridges with slopes up to about 1.
    Steep,
    /// A plane at a height.
    Flat,
}

impl Glass {
    pub(crate) const ALL: [Self; 4] = [Self::Crown, Self::Bumpy, Self::Steep, Self::Flat];

    /// The face with heights of at most `amplitude` metres over `size` metres; `variant` varies it.
    pub(crate) fn face(self, size: DVec2, amplitude: f64, variant: f64) -> HeightField {
        let (columns, rows) = match self {
            Self::Crown => (48, 40),
            Self::Bumpy => (23, 31),
            Self::Steep => (64, 50),
            Self::Flat => (1, 1),
        };
        let values = (0..columns * rows).map(|i| {
            let (column, row) = ((i % columns) as f64 + 0.5, (i / columns) as f64 + 0.5);
            let u = dvec2(column / columns as f64, row / rows as f64) - 0.5;
            let height = match self {
                Self::Crown => {
                    let r = u.length();
                    0.5 * libm::exp(-30.0 * r * r) + 0.5 * libm::cos(40.0 * r + variant) * r
                }
                Self::Bumpy => libm::sin(i as f64 * (1.7 + variant) + (i * i % 97) as f64),
                Self::Steep => libm::sin(column * 1.3 + variant) * libm::cos(row * 0.9 - 2.0 * variant),
                Self::Flat => variant - libm::floor(variant),
            };
            (amplitude * height) as f32
        });
        HeightField::new(values.collect(), columns, rows, size).unwrap()
    }
}
