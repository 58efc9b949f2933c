//! Walls, floor and ceiling, all 0.8 m thick: a closed shell inside and one outside, joined only by the reveals of the
//! windows.

use crate::document::triangles::Triangles;
use crate::scene::description::MeshDescription;
use crate::settings::Triple;

/// The openings of the clerestory, all alike.
pub(super) const WINDOWS: u32 = 4;

/// Extent of the inside, metres: across, along, up.
const INSIDE: Triple = [8.0, 14.0, 13.0];

/// Of walls, floor and ceiling, metres.
const THICKNESS: f64 = 0.8;

/// The middle of the glass, metres from the inside of the wall outwards.
pub(super) const GLASS_DEPTH: f64 = 0.6;

/// Where the openings hold the glass, metres.
pub(super) const OPENING: Opening = Opening { half_width: 0.5, sill: 8.0, head: 10.4 };

/// The reveals widen from the glass to the outside, and more to the inside, where the sill falls off more steeply than
/// the sun shines: next to no sunlight that comes through glass is lost on them.
const OUTER_OPENING: Opening = Opening { half_width: 0.6, sill: 7.9, head: 10.6 };
const INNER_OPENING: Opening = Opening { half_width: 0.85, sill: 7.35, head: 10.5 };

/// Depth of the stone on either side of the glass that is cut straight, metres.
const REBATE: f64 = 0.02;

/// A rectangular opening in a plane of the wall.
pub(super) struct Opening {
    /// To either side of the window's centre line, metres.
    pub(super) half_width: f64,
    /// Its lower edge, metres above the floor.
    pub(super) sill: f64,
    /// Its upper edge, metres above the floor.
    pub(super) head: f64,
}

impl Opening {
    /// Its corners in the plane `x` of the wall.
    fn corners(&self, window: u32, x: f64) -> [Triple; 4] {
        let Self { half_width, sill, head } = *self;
        let [left, right] = [-half_width, half_width].map(|offset| window_centre(window) + offset);
        [[x, left, sill], [x, right, sill], [x, right, head], [x, left, head]]
    }

    /// The plane `x` of the wall between the given corners, with such an opening for each window.
    fn pierce(&self, triangles: &mut Triangles, x: f64, [y_min, z_min]: [f64; 2], [y_max, z_max]: [f64; 2]) {
        let jambs =
            (0..WINDOWS).flat_map(|window| [-1.0, 1.0].map(|side| window_centre(window) + side * self.half_width));
        let y: Vec<f64> = [y_min].into_iter().chain(jambs).chain([y_max]).collect();
        triangles.add_pierced_plane(x, [&y, &[z_min, self.sill, self.head, z_max]], |column, row| {
            column % 2 == 1 && row == 1
        });
    }
}

/// The meshes of the building.
pub(super) fn meshes() -> Vec<MeshDescription> {
    let [width, length, height] = INSIDE;
    let outside = [[-THICKNESS; 3], INSIDE.map(|extent| extent + THICKNESS)];
    let mut walls = Triangles::default();
    INNER_OPENING.pierce(&mut walls, 0.0, [0.0; 2], [length, height]);
    add_upright_sides(&mut walls, [[0.0; 3], INSIDE]);
    for window in 0..WINDOWS {
        let rings = [
            OUTER_OPENING.corners(window, -THICKNESS),
            OPENING.corners(window, -GLASS_DEPTH - REBATE),
            OPENING.corners(window, -GLASS_DEPTH + REBATE),
            INNER_OPENING.corners(window, 0.0),
        ];
        for pair in rings.windows(2) {
            for side in 0..4 {
                let next = (side + 1) % 4;
                walls.add_quadrilateral([pair[0][side], pair[0][next], pair[1][next], pair[1][side]]);
            }
        }
    }
    let [[_, y_min, z_min], [_, y_max, z_max]] = outside;
    let mut exterior = Triangles::default();
    OUTER_OPENING.pierce(&mut exterior, -THICKNESS, [y_min, z_min], [y_max, z_max]);
    add_upright_sides(&mut exterior, outside);
    add_level(&mut exterior, outside, z_min);
    add_level(&mut exterior, outside, z_max);
    let level = |z: f64| {
        let mut triangles = Triangles::default();
        add_level(&mut triangles, [[0.0; 3], [width, length, height]], z);
        triangles
    };
    vec![
        walls.into_mesh("walls", "ashlar"),
        level(0.0).into_mesh("floor", "flagstones"),
        level(height).into_mesh("ceiling", "oak"),
        exterior.into_mesh("exterior", "ashlar"),
    ]
}

/// The upright sides of a box but for that of the windows.
fn add_upright_sides(triangles: &mut Triangles, [[x0, y0, z0], [x1, y1, z1]]: [Triple; 2]) {
    let mut side = |[xa, ya]: [f64; 2], [xb, yb]: [f64; 2]| {
        triangles.add_quadrilateral([[xa, ya, z0], [xb, yb, z0], [xb, yb, z1], [xa, ya, z1]]);
    };
    side([x0, y0], [x1, y0]);
    side([x1, y0], [x1, y1]);
    side([x1, y1], [x0, y1]);
}

/// The floor or the ceiling of a box.
fn add_level(triangles: &mut Triangles, [[x0, y0, _], [x1, y1, _]]: [Triple; 2], z: f64) {
    triangles.add_quadrilateral([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]]);
}

/// The centre line of an opening along the nave, metres.
pub(super) fn window_centre(window: u32) -> f64 {
    2.5 + 2.0 * f64::from(window)
}
