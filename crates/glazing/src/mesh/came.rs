//! Cames: two flanges and a heart.

use glam::DVec2;

use super::sweep::{add_sweep, rectangle};
use super::triangles::Triangles;
use crate::lead::{CameProfile, Cames};
use crate::plan::WindowPlan;

/// Segments of the arc of a round flange.
const ARC: u32 = 6;

/// Adds all cames of a window.
pub(super) fn add_cames(plan: &WindowPlan, triangles: &mut Triangles) {
    let Some(lead) = &plan.lead else { return };
    let (inner, outer) = (0.5 * lead.heart_height, lead.half_depth());
    // The heart ends within the flanges.
    let heart = 0.5 * (inner + outer);
    for came in &plan.cames {
        let path = subdivided(&came.path, came.is_closed);
        for side in [-1.0, 1.0] {
            add_sweep(triangles, &path, came.is_closed, &flange(lead, came.flange_width, side));
        }
        let heart = rectangle(lead.heart_thickness, [-heart, heart]);
        add_sweep(triangles, &path, came.is_closed, &heart);
    }
}

/// Longest triangle along a came, metres. Boxes around long ones that run aslant hold most of the window, and rays
/// would be tested against all of them.
const LONGEST: f64 = 0.05;

/// The path with further corners, so that none is farther than [`LONGEST`] from the next.
fn subdivided(path: &[DVec2], is_closed: bool) -> Vec<DVec2> {
    let next = path.iter().skip(1).chain(path.first().filter(|_| is_closed));
    let mut corners = Vec::new();
    for (&from, &to) in path.iter().zip(next) {
        let parts = (from.distance(to) / LONGEST).ceil().clamp(1.0, 1e4) as u32;
        corners.extend((0..parts).map(|part| from.lerp(to, f64::from(part) / f64::from(parts))));
    }
    if !is_closed {
        corners.extend(path.last());
    }
    corners
}

/// The section of a flange on one side of the glass, clockwise.
fn flange(lead: &Cames, width: f64, side: f64) -> Vec<DVec2> {
    let (inner, outer) = (0.5 * lead.heart_height, lead.half_depth());
    match lead.profile {
        CameProfile::Flat if side > 0.0 => rectangle(width, [inner, outer]),
        CameProfile::Flat => rectangle(width, [-outer, -inner]),
        CameProfile::Round => (0..=ARC)
            .map(|step| {
                let angle = std::f64::consts::PI * f64::from(step) / f64::from(ARC);
                let (sine, cosine) = libm::sincos(angle);
                DVec2::new(-0.5 * width * cosine * side, side * (inner + lead.flange_thickness * sine))
            })
            .collect(),
    }
}
