//! What the tests of this module share: panes, and random numbers with a fixed seed.

use glam::{DVec2, DVec3, dvec2};

use crate::geometry::testing::{Glass, rectangular};
use crate::geometry::{Frame, Pane};
use clerestory_film::{SampleStream, SamplerSettings, TrialStream};

/// A pane of 0.3 m x 0.24 m x 3 mm whose faces have reliefs of `amplitude` metres.
pub(crate) fn pane(glass: Glass, amplitude: f64) -> Pane {
    let size = dvec2(0.3, 0.24);
    let frame = Frame::new(DVec3::ZERO, DVec3::X, DVec3::Y);
    let faces = [glass.face(size, amplitude, 0.3), glass.face(size, amplitude * 0.7, 1.9)];
    rectangular(frame, size, 0.003, 1.5, DVec3::new(20.0, 40.0, 90.0), faces)
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
