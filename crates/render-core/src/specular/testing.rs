//! What the tests of this module share: panes, and random numbers with a fixed seed.

use glam::{DVec2, DVec3, dvec2};

use crate::geometry::testing::{Glass, rectangular};
use crate::geometry::{Frame, HeightField, Pane};
use clerestory_film::{SampleStream, SamplerSettings, TrialStream};

/// A pane of 0.3 m x 0.24 m x 3 mm whose faces have reliefs of `amplitude` metres.
pub(crate) fn pane(glass: Glass, amplitude: f64) -> Pane {
    let size = dvec2(0.3, 0.24);
    let frame = Frame::new(DVec3::ZERO, DVec3::X, DVec3::Y);
    let faces = [glass.face(size, amplitude, 0.3), glass.face(size, amplitude * 0.7, 1.9)];
    rectangular(frame, size, 0.003, 1.5, DVec3::new(20.0, 40.0, 90.0), faces)
}

/// A clear pane of 1 m x 1 m whose faces are planes with these slopes, but for the cells at its border. Slopes are
/// multiples of 1/64, so that no coefficient is rounded.
pub(crate) fn wedge(index_of_refraction: f64, slopes: [DVec2; 2]) -> Pane {
    const CELLS: usize = 32;
    let along = |cell: usize| (cell as f64 + 0.5) / CELLS as f64 - 0.5;
    let faces = slopes.map(|slope| {
        let heights = (0..CELLS * CELLS).map(|cell| slope.dot(dvec2(along(cell % CELLS), along(cell / CELLS))) as f32);
        HeightField::new(heights.collect(), CELLS, CELLS, DVec2::ONE).unwrap()
    });
    let frame = Frame::new(DVec3::ZERO, DVec3::X, DVec3::Y);
    rectangular(frame, DVec2::ONE, 0.625, index_of_refraction, DVec3::ZERO, faces)
}

/// Random numbers.
pub(crate) fn random(stream: u32) -> TrialStream {
    SampleStream::new(&SamplerSettings { seed: 5, samples_per_block: 1 }, 0, [0, 0], stream).trials()
}

/// Uniform in [0, 1)^2.
pub(crate) fn pair(random: &mut TrialStream) -> DVec2 {
    let x = random.next_f64();
    dvec2(x, random.next_f64())
}

/// Uniform between `min` and `max`.
pub(crate) fn between(random: &mut TrialStream, min: f64, max: f64) -> f64 {
    min + (max - min) * random.next_f64()
}
