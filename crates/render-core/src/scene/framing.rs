//! A camera for a scene that has none: inside the largest room-like space, or in front of what stands alone.

use std::f64::consts::PI;

use glam::DVec3;

use super::build::Scene;
use super::description::CameraDescription;
use crate::geometry::{Hit, Ray, SurfaceId};
use crate::light::LightBounds;
use clerestory_film::counters::Counters;

/// Places that are looked at along each axis.
const PLACES: [u32; 3] = [12, 12, 8];

/// Directions in which each place looks.
const DIRECTIONS: u32 = 64;

/// Share of directions that end at something, in a room.
const ENCLOSED: f64 = 0.75;

/// The most open places that may be in a room.
const ROOMS: usize = 64;

/// Directions in which such a place looks for windows.
const LOOKS_OUT: u32 = 2048;

/// Height of the eyes above the floor, metres, and at the most as a share of the room's height.
const EYES: [f64; 2] = [1.6, 0.5];

/// Directions along the floor in which a place in a room looks.
const AROUND: u32 = 48;

/// Distance from the wall behind, at the least, as a share of the way across the room.
const FROM_THE_WALL: f64 = 0.06;

/// Places between the middle of a room and the wall behind that are tried.
const STEPS: u32 = 12;

/// The least cosine between the view and what is seen at its sides.
const SIDEWAYS: f64 = 0.6;

/// Vertical field of view in a room and in front of a thing, degrees.
const IN_A_ROOM: f64 = 62.0;
const IN_FRONT: f64 = 38.0;

/// A camera, and where it stands.
#[derive(Clone, Debug)]
pub struct View {
    /// The camera.
    pub camera: CameraDescription,
    /// Whether it stands in a room.
    pub is_inside: bool,
}

/// A view of a scene. It stands in the open: nothing is nearer than a share of the way across.
pub fn view_of(scene: &Scene) -> View {
    let [min, max] = scene.bounds().unwrap_or([DVec3::ZERO, DVec3::ONE]);
    let inside = view_in_a_room(scene, min, max);
    let is_inside = inside.is_some();
    View { camera: inside.unwrap_or_else(|| view_from_outside(min, max)), is_inside }
}

fn perspective(position: DVec3, look_at: DVec3, vertical_field_of_view: f64) -> CameraDescription {
    CameraDescription::Perspective {
        position: position.to_array(),
        look_at: look_at.to_array(),
        up: [0.0, 0.0, 1.0],
        vertical_field_of_view,
    }
}

/// From the front, the right and a little above.
fn view_from_outside(min: DVec3, max: DVec3) -> CameraDescription {
    let middle = 0.5 * (min + max);
    let radius = (0.5 * (max - min).length()).max(1e-3);
    let away = DVec3::new(0.5, -0.8, 0.35).normalize();
    let distance = 1.05 * radius / libm::sin((0.5 * IN_FRONT).to_radians());
    perspective(middle + away * distance, middle, IN_FRONT)
}

fn view_in_a_room(scene: &Scene, min: DVec3, max: DVec3) -> Option<CameraDescription> {
    let size = max - min;
    let across = size.length();
    let distance = |from: DVec3, direction: DVec3| free_distance(scene, from, direction);
    let directions: Vec<DVec3> = (0..DIRECTIONS).map(|index| on_a_sphere(index, DIRECTIONS)).collect();
    // How open a place is: the mean free distance, if it is enclosed and nothing is close.
    let openness = |place: DVec3| {
        let distances: Vec<Option<f64>> = directions.iter().map(|direction| distance(place, *direction)).collect();
        let found: Vec<f64> = distances.into_iter().flatten().collect();
        let nearest = found.iter().copied().fold(f64::INFINITY, f64::min);
        let is_room = found.len() as f64 >= ENCLOSED * f64::from(DIRECTIONS) && nearest > 0.01 * across;
        is_room.then(|| found.iter().sum::<f64>() / found.len() as f64)
    };
    let places = (0..PLACES[0] * PLACES[1] * PLACES[2]).map(|index| {
        let [x, y, z] = [index % PLACES[0], index / PLACES[0] % PLACES[1], index / (PLACES[0] * PLACES[1])];
        let share = |number: u32, count: u32| (f64::from(number) + 0.5) / f64::from(count);
        min + size * DVec3::new(share(x, PLACES[0]), share(y, PLACES[1]), share(z, PLACES[2]))
    });
    let mut open: Vec<(f64, DVec3)> = places.filter_map(|place| Some((openness(place)?, place))).collect();
    // Of places that are alike the first.
    open.sort_by(|one, other| other.0.total_cmp(&one.0));
    let (_, place) = open.into_iter().take(ROOMS).find(|(_, place)| is_lit(scene, *place))?;
    let (below, above) = (distance(place, DVec3::NEG_Z)?, distance(place, DVec3::Z).unwrap_or(across));
    let eyes = EYES[0].min(EYES[1] * (below + above));
    let place = place + DVec3::Z * (eyes - below);
    let around = (0..AROUND).filter_map(|index| {
        let (sin, cos) = libm::sincos(2.0 * PI * f64::from(index) / f64::from(AROUND));
        let direction = DVec3::new(cos, sin, 0.0);
        Some((distance(place, direction)? + distance(place, -direction)?, direction))
    });
    let (length, direction) = around.reduce(|best, next| if next.0 > best.0 { next } else { best })?;
    let behind = (distance(place, -direction)? - FROM_THE_WALL * length).max(0.0);
    // How far one sees on average, ahead and to the sides.
    let sight = |position: &DVec3| {
        let ahead = directions.iter().filter(|way| way.dot(direction) > SIDEWAYS);
        let distances: Vec<f64> = ahead.filter_map(|way| distance(*position, *way)).collect();
        distances.iter().sum::<f64>() / distances.len().max(1) as f64
    };
    let stands = (0..=STEPS).map(|step| place - direction * (behind * f64::from(step) / f64::from(STEPS)));
    let seen = stands.map(|position| (sight(&position), position));
    let (_, position) = seen.reduce(|best, next| if next.0 > best.0 { next } else { best })?;
    let look_at = position + direction * (0.5 * length) + DVec3::Z * (0.03 * length);
    Some(perspective(position, look_at, IN_A_ROOM))
}

/// Whether light comes to a place: out of windows, from what shines there, or off a surface that a lamp lights. The
/// inside of a solid thing is dark.
fn is_lit(scene: &Scene, place: DVec3) -> bool {
    let lamps = scene.lights().iter().filter_map(|light| match light.bounds() {
        LightBounds::Ball { centre, .. } if light.triangles().is_none() => Some(centre),
        _ => None,
    });
    let lamps: Vec<DVec3> = lamps.take(LAMPS).collect();
    let sees = |from: DVec3, lamp: DVec3| {
        let distance = from.distance(lamp);
        free_distance(scene, from, (lamp - from) / distance).is_none_or(|free| free > (1.0 - NEARLY) * distance)
    };
    (0..LOOKS_OUT).any(|index| {
        let ray = Ray::new(place, on_a_sphere(index, LOOKS_OUT));
        let Some(hit) = closest_hit(scene, &ray) else { return true };
        let shines = scene.light_on(&hit).is_some_and(|(_, light)| light.radiance.max_element() > 0.0);
        shines || lamps.iter().any(|lamp| sees(ray.at((1.0 - NEARLY) * hit.distance), *lamp))
    })
}

/// The most lamps that are looked for.
const LAMPS: usize = 8;

/// What is nearer to a thing by this share of the way to it is before its surface.
const NEARLY: f64 = 1e-3;

fn closest_hit(scene: &Scene, ray: &Ray) -> Option<Hit> {
    scene.accelerator().closest_hit(ray, f64::INFINITY, SurfaceId::Nothing, &mut Counters::default())
}

/// How far one sees; `None` where there is nothing.
fn free_distance(scene: &Scene, from: DVec3, direction: DVec3) -> Option<f64> {
    closest_hit(scene, &Ray::new(from, direction)).map(|hit| hit.distance)
}

/// One of `count` directions that are spread evenly.
fn on_a_sphere(index: u32, count: u32) -> DVec3 {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    let z = 1.0 - (2.0 * f64::from(index) + 1.0) / f64::from(count);
    let (sin, cos) = libm::sincos(GOLDEN_ANGLE * f64::from(index));
    let radius = (1.0 - z * z).sqrt();
    DVec3::new(radius * cos, radius * sin, z)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde_json::{Value, json};

    use super::*;
    use crate::document::{SceneBundle, SceneDescription};

    /// The position of the camera for a box of 4 x 6 x 3 m with a light, with an opening in one wall or without.
    fn position(has_window: bool, light: &Value) -> DVec3 {
        let [x, y, z] = [4.0, 6.0, 3.0];
        let quad = |corners: [[f64; 3]; 4]| corners;
        let mut quads = vec![
            quad([[0.0, 0.0, 0.0], [x, 0.0, 0.0], [x, y, 0.0], [0.0, y, 0.0]]),
            quad([[0.0, 0.0, z], [x, 0.0, z], [x, y, z], [0.0, y, z]]),
            quad([[0.0, 0.0, 0.0], [x, 0.0, 0.0], [x, 0.0, z], [0.0, 0.0, z]]),
            quad([[0.0, y, 0.0], [x, y, 0.0], [x, y, z], [0.0, y, z]]),
            quad([[0.0, 0.0, 0.0], [0.0, y, 0.0], [0.0, y, z], [0.0, 0.0, z]]),
        ];
        // The wall at x = 4 m, around a window of 1 x 1 m.
        let window = [2.5, 3.5, 1.0, 2.0];
        let strips = [[0.0, 2.5, 0.0, z], [3.5, y, 0.0, z], [2.5, 3.5, 0.0, 1.0], [2.5, 3.5, 2.0, z]];
        for [start, end, low, high] in strips.into_iter().chain((!has_window).then_some(window)) {
            quads.push(quad([[x, start, low], [x, end, low], [x, end, high], [x, start, high]]));
        }
        let triangles: Vec<[usize; 3]> = (0..quads.len())
            .flat_map(|quad| [[0, 1, 2], [0, 2, 3]].map(|corners| corners.map(|c| 4 * quad + c)))
            .collect();
        let scene: Value = json!({
            "version": 2, "name": "box", "film": {"width": 8, "height": 8},
            "camera": {"perspective": {
                "position": [9, 9, 9], "look_at": [0, 0, 0], "up": [0, 0, 1], "vertical_field_of_view": 30
            }},
            "materials": {"white": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}}},
            "meshes": [{"name": "box", "material": "white", "source": {"inline": {
                "positions": quads.concat(), "triangles": triangles
            }}}],
            "lights": [light]
        });
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        let scene = SceneBundle::from_parts(description, BTreeMap::new()).unwrap().build_scene().unwrap();
        let CameraDescription::Perspective { position, .. } = view_of(&scene).camera else { panic!("a perspective") };
        DVec3::from(position)
    }

    #[test]
    fn a_room_that_is_lit_is_seen_from_inside_and_a_dark_one_from_outside() {
        let inside = |at: DVec3| at.cmpgt(DVec3::splat(0.1)).all() && at.cmplt(DVec3::new(3.9, 5.9, 2.9)).all();
        let sky = json!({"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}});
        let lamp = |x: f64| json!({"point": {"name": "lamp", "position": [x, 3, 2.5], "intensity": [1, 1, 1]}});
        for room in [position(true, &sky), position(false, &lamp(1.0))] {
            assert!(inside(room) && (room.z - 1.5).abs() < 0.2, "{room}");
        }
        for solid in [position(false, &sky), position(false, &lamp(6.0))] {
            assert!(!inside(solid) && solid.z > 3.0, "{solid}");
        }
    }
}
