//! What is not window: floor, walls, vault, ribs on their shafts, altar, benches and candles.

use super::dimensions::{BAYS, GABLE, LENGTH, SPRINGING, WIDTH};
use super::masonry::stone_around;
use super::textures::EXTENT;
use crate::document::triangles::{Triangles, rounded};
use crate::scene::description::MeshDescription;
use crate::settings::Triple;

/// Where candles stand on the altar, metres.
pub(super) const CANDLES: [[f64; 2]; 2] = [[2.4, 9.1], [3.6, 9.1]];

/// Half the width of a candle, metres.
const CANDLE: f64 = 0.02;

/// Top of the altar, of the candles, and the middle of a flame, metres.
const ALTAR: f64 = 1.0;
const CANDLE_TOP: f64 = 1.35;
pub(super) const FLAME: f64 = 1.39;

/// Radius of the arcs of the vault, metres: less than the span, which makes a drop arch.
const RADIUS: f64 = 4.2;

/// Segments of each arc.
const SEGMENTS: u32 = 24;

/// Width and depth of a rib, metres.
const RIB: [f64; 2] = [0.22, 0.18];

/// By how much capitals and bases stand out, metres.
const CAPITAL: f64 = 0.05;

pub(super) fn meshes() -> Vec<MeshDescription> {
    let mut floor = Triangles::default();
    floor.add_quadrilateral([[0.0, 0.0, 0.0], [WIDTH, 0.0, 0.0], [WIDTH, LENGTH, 0.0], [0.0, LENGTH, 0.0]]);
    let mut walls = Triangles::default();
    walls.add_quadrilateral([[0.0, 0.0, 0.0], [0.0, LENGTH, 0.0], [0.0, LENGTH, SPRINGING], [0.0, 0.0, SPRINGING]]);
    walls.add_quadrilateral([[0.0, 0.0, 0.0], [0.0, 0.0, GABLE], [WIDTH, 0.0, GABLE], [WIDTH, 0.0, 0.0]]);
    stone_around(&mut walls);
    let mut vault = Triangles::default();
    let arch = arch(0.0);
    for pair in arch.windows(2) {
        let [[x0, z0], [x1, z1]] = [pair[0], pair[1]];
        vault.add_quadrilateral([[x0, 0.0, z0], [x0, LENGTH, z0], [x1, LENGTH, z1], [x1, 0.0, z1]]);
    }
    let mut altar = Triangles::default();
    altar.add_box([2.0, 8.7, 0.0], [4.0, 9.4, ALTAR - 0.12]);
    altar.add_box([1.9, 8.6, ALTAR - 0.12], [4.1, 9.5, ALTAR]);
    let mut candles = Triangles::default();
    for [x, y] in CANDLES {
        candles.add_box([x - CANDLE, y - CANDLE, ALTAR], [x + CANDLE, y + CANDLE, CANDLE_TOP]);
    }
    vec![
        floor.projected(EXTENT).into_mesh("floor", "flagstones"),
        walls.projected(EXTENT).into_mesh("walls", "ashlar"),
        vault.into_mesh("vault", "limewashed wall"),
        ribs().into_mesh("ribs", "rib stone"),
        altar.into_mesh("altar", "altar stone"),
        benches().projected(EXTENT).into_mesh("benches", "oak"),
        candles.into_mesh("candles", "wax"),
    ]
}

/// The line of the vault from south to north, or one at a distance below it: x and z, metres.
fn arch(below: f64) -> Vec<[f64; 2]> {
    let radius = RADIUS - below;
    // Both arcs meet over the middle.
    let reach = libm::acos((RADIUS - 0.5 * WIDTH) / radius);
    let at = |step: u32| {
        let (sine, cosine) = libm::sincos(reach * f64::from(step) / f64::from(SEGMENTS));
        [RADIUS - radius * cosine, SPRINGING + radius * sine]
    };
    let north = (0..=SEGMENTS).map(at);
    let south = (0..SEGMENTS).rev().map(|step| [WIDTH - at(step)[0], at(step)[1]]);
    north.chain(south).map(|place| place.map(rounded)).collect()
}

/// Arches under the vault, from wall to wall, with the shafts on which they stand.
fn ribs() -> Triangles {
    let mut ribs = Triangles::default();
    let [width, depth] = RIB;
    let (outer, inner) = (arch(0.0), arch(depth));
    for rib in 0..=BAYS {
        let middle = (LENGTH * f64::from(rib) / f64::from(BAYS)).clamp(0.5 * width, LENGTH - 0.5 * width);
        let [y0, y1] = [middle - 0.5 * width, middle + 0.5 * width].map(rounded);
        for [x0, x1] in [[0.0, depth], [WIDTH - depth, WIDTH]] {
            ribs.add_box([x0, y0, 0.0], [x1, y1, SPRINGING]);
            let capital = [x0 - CAPITAL, x1 + CAPITAL].map(|x| x.clamp(0.0, WIDTH));
            let [low, high] = [y0 - CAPITAL, y1 + CAPITAL].map(|y| rounded(y.clamp(0.0, LENGTH)));
            ribs.add_box([capital[0], low, SPRINGING - 0.2], [capital[1], high, SPRINGING]);
            ribs.add_box([capital[0], low, 0.0], [capital[1], high, 0.3]);
        }
        for (over, under) in outer.windows(2).zip(inner.windows(2)) {
            let at = |[x, z]: [f64; 2], y: f64| -> Triple { [x, y, z] };
            ribs.add_quadrilateral([at(under[0], y0), at(under[1], y0), at(under[1], y1), at(under[0], y1)]);
            for y in [y0, y1] {
                ribs.add_quadrilateral([at(over[0], y), at(over[1], y), at(under[1], y), at(under[0], y)]);
            }
        }
    }
    ribs
}

/// Three rows of benches on both sides of the aisle.
fn benches() -> Triangles {
    let mut benches = Triangles::default();
    for row in 0..3 {
        let y = 2.2 + 1.1 * f64::from(row);
        for [x0, x1] in [[0.5, 2.4], [3.6, 5.5]] {
            benches.add_box([x0, y, 0.4], [x1, y + 0.38, 0.45]);
            benches.add_box([x0, y, 0.45], [x1, y + 0.04, 0.95].map(rounded));
            for x in [x0, x1 - 0.06] {
                benches.add_box([x, y, 0.0], [x + 0.06, y + 0.38, 0.4]);
            }
        }
    }
    benches
}
