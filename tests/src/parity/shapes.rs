//! Things of which scenes are made, as in a scene file.

use serde_json::{Value, json};

/// A camera inside the room that looks along y.
pub(super) fn camera() -> Value {
    json!({"perspective":
        {"position": [0.05, -0.95, 1.1], "look_at": [0, 1, 0.9], "up": [0, 0, 1], "vertical_field_of_view": 65}})
}

/// A matt grey.
pub(super) fn grey(reflectance: f64) -> Value {
    json!({"diffuse": {"reflectance": {"colour": [reflectance, reflectance, reflectance]}}})
}

/// Six walls around [-1, 1] x [-1, 1] x [0, 2]: floor, ceiling, left, right, back and front.
pub(super) fn room(materials: [&str; 6]) -> Vec<Value> {
    let [floor, ceiling, left, right, back, front] = materials;
    let [x, y, z] = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
    vec![
        quad("floor", floor, [-1.0, -1.0, 0.0], x, y),
        quad("ceiling", ceiling, [-1.0, -1.0, 2.0], y, x),
        quad("left", left, [-1.0, -1.0, 0.0], y, z),
        quad("right", right, [1.0, -1.0, 0.0], z, y),
        quad("back", back, [-1.0, 1.0, 0.0], x, z),
        quad("front", front, [-1.0, -1.0, 0.0], z, x),
    ]
}

/// A parallelogram, counterclockwise along u and v.
pub(super) fn quad(name: &str, material: &str, corner: [f64; 3], u: [f64; 3], v: [f64; 3]) -> Value {
    let at = |i: f64, j: f64| [0, 1, 2].map(|axis| corner[axis] + i * u[axis] + j * v[axis]);
    json!({"name": name, "material": material, "source": {"inline": {
        "positions": [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)],
        "triangles": [[0, 1, 2], [0, 2, 3]]}}})
}

/// A block of half the width and depth, and the height, turned about its vertical axis. Its normals point outwards.
pub(super) fn block(name: &str, material: &str, foot: [f64; 3], [width, depth, height]: [f64; 3], turn: f64) -> Value {
    let corner = |index: usize| {
        let side = |bit: usize| if index >> bit & 1 == 1 { 1.0 } else { -1.0 };
        [side(0) * width, side(1) * depth, if index >> 2 & 1 == 1 { height } else { 0.0 }]
    };
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[usize; 3]> = sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    json!({"name": name, "material": material, "rotate": [0, 0, turn], "translate": foot, "source": {"inline": {
        "positions": (0..8).map(corner).collect::<Vec<_>>(), "triangles": triangles}}})
}

/// The materials of the box.
pub(super) fn paints() -> Value {
    json!({
        "white": {"diffuse": {"reflectance": {"colour": [0.73, 0.7, 0.65]}}},
        "red": {"diffuse": {"reflectance": {"colour": [0.63, 0.06, 0.05]}}},
        "green": {"diffuse": {"reflectance": {"colour": [0.14, 0.45, 0.09]}}}
    })
}

/// A box with coloured walls and two blocks.
pub(super) fn box_meshes() -> Vec<Value> {
    let mut meshes = room(["white", "white", "red", "green", "white", "white"]);
    meshes.push(block("tall", "white", [0.3, 0.3, 0.0], [0.25, 0.25, 1.1], 20.0));
    meshes.push(block("short", "white", [-0.4, -0.1, 0.0], [0.3, 0.25, 0.5], -15.0));
    meshes
}

/// A panel below the ceiling.
pub(super) fn ceiling_light(edge: f64) -> Value {
    json!({"rectangle": {"name": "panel", "centre": [0, 0, 1.98], "edge_u": [0, edge, 0], "edge_v": [edge, 0, 0],
        "radiance": [10, 9, 7]}})
}
