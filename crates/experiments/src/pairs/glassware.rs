//! Things of glass on a table: closed meshes, turned about the z axis.

use std::f64::consts::PI;

use serde_json::{Value, json};

/// Corners around the axis.
const AROUND: usize = 48;

/// Corners along an arc of half a turn.
const ALONG: usize = 24;

/// From the table to the lowest point, metres: glass must not touch it.
const GAP: f64 = 0.001;

/// A point of a profile, by its distance from the axis and its height, and its normal in the same plane.
struct Corner {
    place: [f64; 2],
    normal: [f64; 2],
}

/// A solid ball of 6 cm radius.
pub(super) fn ball() -> Value {
    const RADIUS: f64 = 0.06;
    mesh("ball", &arc([0.0, GAP + RADIUS], RADIUS, [-0.5 * PI, 0.5 * PI]))
}

/// A bowl of 8 cm radius with a wall of 6 mm and a round rim.
pub(super) fn bowl() -> Value {
    const RADIUS: f64 = 0.08;
    const WALL: f64 = 0.006;
    // The rim is a little above the middle of the ball.
    let top = 0.1 * PI;
    let middle = [0.0, GAP + RADIUS];
    let mean = RADIUS - 0.5 * WALL;
    let rim = [mean * libm::cos(top), middle[1] + mean * libm::sin(top)];
    let mut profile = arc(middle, RADIUS, [-0.5 * PI, top]);
    profile.pop();
    profile.extend(arc(rim, 0.5 * WALL, [top, top + PI]));
    profile.pop();
    // The inside looks towards the middle.
    let inside = arc(middle, RADIUS - WALL, [top, -0.5 * PI]);
    profile.extend(inside.into_iter().map(|Corner { place, normal }| Corner { place, normal: normal.map(|n| -n) }));
    mesh("bowl", &profile)
}

/// Part of a circle about a point, between two angles to the horizontal.
fn arc([middle, height]: [f64; 2], radius: f64, [from, to]: [f64; 2]) -> Vec<Corner> {
    let steps = ((to - from).abs() / PI * ALONG as f64).ceil() as usize;
    let corner = |step: usize| {
        let angle = from + (to - from) * step as f64 / steps as f64;
        let normal = [libm::cos(angle), libm::sin(angle)];
        Corner { place: [middle + radius * normal[0], height + radius * normal[1]], normal }
    };
    (0..=steps).map(corner).collect()
}

/// The closed mesh of a profile that begins and ends on the axis.
fn mesh(name: &str, profile: &[Corner]) -> Value {
    let (mut positions, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    let last = profile.len() - 1;
    let mut first_of_ring = Vec::new();
    for (index, Corner { place: [radius, height], normal: [outwards, upwards] }) in profile.iter().enumerate() {
        first_of_ring.push(positions.len());
        if index == 0 || index == last {
            positions.push([0.0, 0.0, *height]);
            normals.push([0.0, 0.0, upwards.signum()]);
            continue;
        }
        for corner in 0..AROUND {
            let angle = 2.0 * PI * corner as f64 / AROUND as f64;
            let (cosine, sine) = (libm::cos(angle), libm::sin(angle));
            positions.push([radius * cosine, radius * sine, *height]);
            normals.push([outwards * cosine, outwards * sine, *upwards]);
        }
    }
    for ring in 0..last {
        let (below, above) = (first_of_ring[ring], first_of_ring[ring + 1]);
        for corner in 0..AROUND {
            let next = (corner + 1) % AROUND;
            if ring > 0 {
                let opposite = if ring + 1 == last { above } else { above + next };
                triangles.push([below + corner, below + next, opposite]);
            }
            if ring + 1 < last {
                let start = if ring == 0 { below } else { below + corner };
                triangles.push([start, above + next, above + corner]);
            }
        }
    }
    let source = json!({"inline": {"positions": positions, "normals": normals, "triangles": triangles}});
    json!({"name": name, "material": "glass", "source": source})
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::DVec3;

    use super::*;

    /// The volume in a closed mesh whose triangles look outwards.
    #[track_caller]
    fn volume(thing: &Value) -> f64 {
        let source = &thing["source"]["inline"];
        let positions: Vec<[f64; 3]> = serde_json::from_value(source["positions"].clone()).unwrap();
        let normals: Vec<[f64; 3]> = serde_json::from_value(source["normals"].clone()).unwrap();
        let triangles: Vec<[usize; 3]> = serde_json::from_value(source["triangles"].clone()).unwrap();
        let mut edges = BTreeMap::new();
        let mut volume = 0.0;
        for triangle in triangles {
            for side in 0..3 {
                let [from, to] = [triangle[side], triangle[(side + 1) % 3]];
                *edges.entry([from.min(to), from.max(to)]).or_insert(0) += if from < to { 1 } else { -1 };
            }
            let [a, b, c] = triangle.map(|corner| DVec3::from(positions[corner]));
            let across = (b - a).cross(c - a);
            for corner in triangle {
                assert!(across.dot(DVec3::from(normals[corner])) > 0.0, "normals and triangles look outwards");
            }
            volume += a.dot(b.cross(c)) / 6.0;
        }
        assert!(edges.values().all(|sides| *sides == 0), "each edge has a triangle on both sides");
        volume
    }

    #[test]
    fn glassware_is_closed_and_looks_outwards() {
        let of_ball = 4.0 / 3.0 * PI * 0.06_f64.powi(3);
        assert!((volume(&ball()) / of_ball - 1.0).abs() < 0.01);
        // A shell of 6 mm below a plane that is a little above the middle of the ball.
        let height = 0.08 * (1.0 + libm::sin(0.1 * PI));
        let of_bowl = 2.0 * PI * 0.077 * height * 0.006;
        assert!((volume(&bowl()) / of_bowl - 1.0).abs() < 0.05, "{}", volume(&bowl()) / of_bowl);
    }
}
