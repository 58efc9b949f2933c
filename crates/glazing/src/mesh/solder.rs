//! Solder: a flat drop on both sides of each joint.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::sweep::at;
use super::triangles::Triangles;
use crate::plan::WindowPlan;

/// Corners around a drop.
const CORNERS: u32 = 6;

/// Height of a drop above the flange, as a part of the flange's thickness.
const HEIGHT: f64 = 0.9;

/// Adds the solder of all joints.
pub(super) fn add_solder(plan: &WindowPlan, triangles: &mut Triangles) {
    let Some(lead) = &plan.lead else { return };
    let directions: Vec<DVec2> = (0..CORNERS)
        .map(|corner| {
            let (sine, cosine) = libm::sincos(TAU * f64::from(corner) / f64::from(CORNERS));
            DVec2::new(cosine, sine)
        })
        .collect();
    let base = lead.half_depth() - 0.5 * lead.flange_thickness;
    let top = lead.half_depth() + HEIGHT * lead.flange_thickness;
    for joint in &plan.joints {
        for side in [1.0, -1.0] {
            let around = directions.iter().map(|direction| at(joint.at + *direction * joint.radius, side * base));
            let first = triangles.add_vertices(around.collect::<Vec<DVec3>>());
            let apex = triangles.add_vertices([at(joint.at, side * top)]);
            let mut add = |[a, b, c]: [u32; 3]| triangles.add(if side > 0.0 { [a, b, c] } else { [a, c, b] });
            for corner in 0..CORNERS {
                add([first + corner, first + (corner + 1) % CORNERS, apex]);
            }
            for corner in 1..CORNERS - 1 {
                add([first, first + corner + 1, first + corner]);
            }
        }
    }
}
