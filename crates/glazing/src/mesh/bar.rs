//! Iron bars.

use std::f64::consts::TAU;

use glam::DVec2;

use super::sweep::{add_prism, rectangle};
use super::triangles::Triangles;
use crate::bars::{Bar, BarSection};
use crate::plan::WindowPlan;

/// Corners of a round section.
const CORNERS: u32 = 12;

/// Adds all bars of a window.
pub(super) fn add_bars(plan: &WindowPlan, triangles: &mut Triangles) {
    for bar in &plan.bars {
        add_prism(triangles, bar.ends, bar.offset + 0.5 * bar.depth, &section(bar));
    }
}

/// The section of a bar about its middle line, clockwise.
fn section(bar: &Bar) -> Vec<DVec2> {
    match bar.section {
        BarSection::Square => rectangle(bar.width, [-0.5 * bar.depth, 0.5 * bar.depth]),
        BarSection::Round => (0..CORNERS)
            .map(|corner| {
                let (sine, cosine) = libm::sincos(-TAU * f64::from(corner) / f64::from(CORNERS));
                0.5 * DVec2::new(bar.width * cosine, bar.depth * sine)
            })
            .collect(),
    }
}
