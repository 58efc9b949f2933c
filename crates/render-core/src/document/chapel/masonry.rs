//! Dressed stone around the windows, on the inner faces of their walls.

use glam::{DVec2, DVec3};

use super::windows::windows;
use crate::document::triangles::Triangles;

/// How far the dressed stone is before the wall, metres.
const DRESSED: f64 = 0.002;

/// Covers the inner faces of the walls with dressed stone, as far as the windows leave them.
pub(super) fn stone_around(stone: &mut Triangles) {
    for window in windows() {
        let Some(wall) = window.design.plan().ok().and_then(|plan| plan.wall) else { continue };
        let Some((depth, hole)) = wall.hole.first() else { continue };
        let [x, y] = [window.x_axis, window.y_axis].map(DVec3::from);
        let inner = DVec3::from(window.sill) + x.cross(y) * (depth + DRESSED);
        let place = |[across, up]: [f64; 2]| (inner + x * across + y * up).to_array();
        let (low, high) = (wall.outline[0], wall.outline[2]);
        let mut levels: Vec<f64> = hole.iter().map(|corner| corner.y).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup_by(|a, b| *a - *b < LEVEL);
        let [Some(&sill), Some(&head)] = [levels.first(), levels.last()] else { continue };
        let mut add = |left: [f64; 2], right: [f64; 2], below: f64, above: f64| {
            let corners = [[left[0], below], [right[0], below], [right[1], above], [left[1], above]];
            stone.add_quadrilateral(corners.map(place));
        };
        add([low.x; 2], [high.x; 2], low.y, sill);
        add([low.x; 2], [high.x; 2], head, high.y);
        for pair in levels.windows(2) {
            let ends = [pair[0], pair[1]].map(|level| across(hole, level));
            let [left, right] = [0, 1].map(|end| ends.map(|ends| ends[end]));
            add([low.x; 2], left, pair[0], pair[1]);
            add(right, [high.x; 2], pair[0], pair[1]);
        }
    }
}

/// Levels nearer to each other than this are one, metres.
const LEVEL: f64 = 1e-6;

/// The leftmost and the rightmost point of a convex polygon at a level.
fn across(polygon: &[DVec2], level: f64) -> [f64; 2] {
    let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
    for (index, from) in polygon.iter().enumerate() {
        let to = polygon[(index + 1) % polygon.len()];
        let (bottom, top) = (from.y.min(to.y), from.y.max(to.y));
        if level < bottom - LEVEL || level > top + LEVEL {
            continue;
        }
        let part =
            if top - bottom < LEVEL { [0.0, 1.0] } else { [((level - from.y) / (to.y - from.y)).clamp(0.0, 1.0); 2] };
        for x in part.map(|part| from.x + (to.x - from.x) * part) {
            ends = [ends[0].min(x), ends[1].max(x)];
        }
    }
    ends
}
