//! The lead cames: H-shaped strips that hold the panes, with flanges before and behind the glass and a heart between
//! neighbours.

use super::stonework::{GLASS_DEPTH, OPENING, WINDOWS, window_centre};
use crate::document::triangles::Triangles;
use crate::scene::description::MeshDescription;

/// Distance between neighbouring panes, metres: the heart of the came, and a little air.
pub(super) const GAP: f64 = 0.002;

/// The flanges cover so much on either side of the middle of the came, metres.
const FLANGE: f64 = 0.004;

/// Where the flanges are, metres from the middle of the glass: clear of all its relief.
const FLANGE_DEPTHS: [f64; 2] = [0.003, 0.005];

/// Half the thickness of the heart, metres.
const HALF_HEART: f64 = 0.0008;

/// Along which way a came runs.
#[derive(Clone, Copy)]
enum Run {
    /// Upright, at a distance from the window's centre line.
    Up(f64),
    /// Level, at a height.
    Level(f64),
}

/// The cames of all windows, of which each is cut into `cuts` rows and columns of panes.
pub(super) fn cames(cuts: u32) -> MeshDescription {
    let mut triangles = Triangles::default();
    for window in 0..WINDOWS {
        for line in 0..=cuts {
            let part = f64::from(line) / f64::from(cuts);
            let is_inside = 0 < line && line < cuts;
            for run in [
                Run::Up((2.0 * part - 1.0) * OPENING.half_width),
                Run::Level(OPENING.sill + part * (OPENING.head - OPENING.sill)),
            ] {
                let [front, back] = FLANGE_DEPTHS;
                add_strip(&mut triangles, window, run, FLANGE, [front, back]);
                add_strip(&mut triangles, window, run, FLANGE, [-back, -front]);
                // At the border the stone takes the place of the heart.
                if is_inside {
                    add_strip(&mut triangles, window, run, HALF_HEART, [-back, back]);
                }
            }
        }
    }
    triangles.into_mesh("cames", "lead")
}

/// A strip from border to border of a window, between two depths from the middle of the glass. Strips at the border are
/// half in the stone.
fn add_strip(triangles: &mut Triangles, window: u32, run: Run, half_width: f64, depths: [f64; 2]) {
    let (centre, [near, far]) = (window_centre(window), depths.map(|depth| depth - GLASS_DEPTH));
    let ([y0, y1], [z0, z1]) = match run {
        Run::Up(offset) => ([centre + offset - half_width, centre + offset + half_width], [OPENING.sill, OPENING.head]),
        Run::Level(height) => {
            ([centre - OPENING.half_width, centre + OPENING.half_width], [height - half_width, height + half_width])
        }
    };
    triangles.add_box([near, y0, z0], [far, y1, z1]);
}
