//! Light of every kind through thin walls, against closed forms: shadow rays go straight through.

use std::f64::consts::PI;

use serde_json::{Value, json};

use super::tests::{EDGE, SAMPLES, mean, square};

/// Index of refraction and tint of walls, from the floor up.
const WALLS: [(f64, f64); 2] = [(1.5, 0.7), (1.8, 0.4)];

/// Reflectance of the floor.
pub(super) const REFLECTANCE: f64 = 0.5;

/// Where lamps are, above the place that the camera sees.
const LAMP: [f64; 3] = [0.6, 0.0, 2.0];

/// Half an edge of the rectangle, metres.
const HALF: f64 = 0.8;

/// What parallel walls let through at a cosine to their normal, by Fresnel's equations for both faces of each: the mean
/// of that for both polarisations.
fn transmittance(walls: &[(f64, f64)], cosine: f64) -> f64 {
    let through = |face: f64| (1.0 - face) / (1.0 + face);
    let of_wall = |(index, tint): (f64, f64)| {
        let behind = (1.0 - (1.0 - cosine * cosine) / (index * index)).sqrt();
        let s = ((cosine - index * behind) / (cosine + index * behind)).powi(2);
        let p = ((index * cosine - behind) / (index * cosine + behind)).powi(2);
        [tint * through(s), tint * through(p)]
    };
    let both = walls.iter().map(|wall| of_wall(*wall)).fold([1.0; 2], |[s, p], [t, u]| [s * t, p * u]);
    0.5 * (both[0] + both[1])
}

/// Half an edge of floor and walls, metres. Farther away, the environment shines in between them.
const EDGE_OF_THE_WORLD: f64 = 1e4;

/// Radiance of what shines in from there, W/(m2 sr), is less.
const DARK: f64 = 1e-6;

/// The sum over a square of cells of a function of its middle and its area.
fn sum_over(cells: u32, half: f64, of: impl Fn([f64; 2], f64) -> f64) -> f64 {
    let step = 2.0 * half / f64::from(cells);
    let middle = |cell: u32| (f64::from(cell) + 0.5) * step - half;
    let all = (0..cells).flat_map(|x| (0..cells).map(move |y| [middle(x), middle(y)]));
    all.map(|place| of(place, step * step)).sum()
}

/// A light, and the irradiance of a floor that sees it through something of this transmittance at each cosine.
pub(super) struct Lit {
    pub(super) light: Value,
    pub(super) irradiance: fn(&dyn Fn(f64) -> f64) -> f64,
}

pub(super) fn lights() -> [Lit; 4] {
    const ANGLE: f64 = 0.5;
    let sun = json!({"sun": {
        "name": "sun", "direction": [-0.6, 0, 0.8], "angular_radius": ANGLE, "radiance": [1e4, 1, 1]}});
    let point = json!({"point": {"name": "point", "position": LAMP, "intensity": [3, 1, 1]}});
    let rectangle = json!({"rectangle": {
        "name": "panel", "centre": LAMP, "edge_u": [0, 2.0 * HALF, 0], "edge_v": [2.0 * HALF, 0, 0],
        "radiance": [1, 1, 1]}});
    let sky = json!({"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}});
    let lit = |light, irradiance| Lit { light, irradiance };
    [
        lit(sun, |passes| 1e4 * PI * libm::sin(ANGLE.to_radians()).powi(2) * 0.8 * passes(0.8)),
        lit(point, |passes| {
            let squared: f64 = LAMP.iter().map(|at| at * at).sum();
            let cosine = LAMP[2] / squared.sqrt();
            3.0 * cosine / squared * passes(cosine)
        }),
        lit(rectangle, |passes| {
            sum_over(200, HALF, |[x, y], area| {
                let squared = (LAMP[0] + x).powi(2) + y * y + LAMP[2] * LAMP[2];
                let cosine = LAMP[2] / squared.sqrt();
                cosine * cosine / squared * area * passes(cosine)
            })
        }),
        lit(sky, |passes| {
            let cells = 10_000;
            let cosine = |cell: u32| (f64::from(cell) + 0.5) / f64::from(cells);
            (0..cells).map(|cell| 2.0 * PI * cosine(cell) * passes(cosine(cell)) / f64::from(cells)).sum()
        }),
    ]
}

/// A place on a floor under walls, far from their edges, seen from below them.
fn floor_below(walls: &[(f64, f64)], lights: &[Value], max_depth: usize) -> Value {
    let name = |index: usize| format!("wall {index}");
    let grey = [REFLECTANCE; 3];
    let mut materials = json!({"floor": {"diffuse": {"reflectance": {"colour": grey}}}});
    let mut meshes = vec![json!({"name": "floor", "material": "floor", "source": square(EDGE_OF_THE_WORLD, 0.0)})];
    for (index, (refraction, tint)) in walls.iter().enumerate() {
        materials[name(index)] =
            json!({"thin_wall": {"index_of_refraction": refraction, "tint": {"colour": [tint, 1, 1]}}});
        let source = square(EDGE_OF_THE_WORLD, 1.0 + 0.3 * index as f64);
        meshes.push(json!({"name": name(index), "material": name(index), "source": source}));
    }
    json!({
        "version": 2, "name": "floor", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [-0.5, 0.1, 0.4], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1e-4}},
        "integrator": {"path": {"max_depth": max_depth}},
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": materials, "meshes": meshes, "lights": lights
    })
}

/// Holds the radiance of the floor to that of an irradiance, sharply enough to notice half a percent and `faults`.
#[track_caller]
fn check(scene: &Value, irradiance: f64, faults: &[f64]) {
    let expected = irradiance * REFLECTANCE / PI;
    let (found, error) = mean(scene);
    let what = format!("{found} +- {error}, not {expected}: {}", scene["lights"]);
    assert!((found - expected).abs() < 4.0 * error + 1e-4 * expected, "{what}");
    for fault in faults.iter().chain(&[1.005, 0.995]) {
        assert!((found - fault * expected).abs() > 4.0 * error, "{what}; a fault by the factor {fault} is not noticed");
    }
}

#[test]
fn light_through_thin_walls_is_what_fresnel_and_their_tints_say() {
    for Lit { light, irradiance } in lights() {
        for count in 0..=WALLS.len() {
            let walls = &WALLS[..count];
            let through = |cosine: f64| transmittance(walls, cosine);
            // Light that walls mirror takes longer paths.
            let scene = floor_below(walls, std::slice::from_ref(&light), 1 + count);
            let without_a_wall = walls.iter().flat_map(|wall| [wall.1, transmittance(&[*wall], 0.8) / wall.1]);
            let faults: Vec<f64> = without_a_wall.map(|factor| 1.0 / factor).collect();
            check(&scene, irradiance(&through), &faults);
        }
    }
}

#[test]
fn of_many_lights_behind_thin_walls_each_counts_once() {
    let [sun, point, panel, _] = lights();
    let all: Vec<Value> = [&sun, &panel, &point, &point, &point]
        .into_iter()
        .zip(["a", "b", "c", "d", "e"])
        .map(|(lit, name)| {
            let mut light = lit.light.clone();
            for settings in light.as_object_mut().unwrap().values_mut() {
                settings["name"] = name.into();
                if settings.get("position").is_some() {
                    settings["position"] = json!([LAMP[0], LAMP[1], 1.9]);
                }
            }
            light
        })
        .collect();
    let through = |cosine: f64| transmittance(&WALLS[..1], cosine);
    // The points are nearer than the rectangle, so that nothing covers them.
    let nearer = |passes: &dyn Fn(f64) -> f64| {
        let squared = LAMP[0] * LAMP[0] + 1.9 * 1.9;
        let cosine = 1.9 / squared.sqrt();
        3.0 * cosine / squared * passes(cosine)
    };
    let expected = (sun.irradiance)(&through) + (panel.irradiance)(&through) + 3.0 * nearer(&through);
    check(&floor_below(&WALLS[..1], &all, 2), expected, &[]);
}

#[test]
fn walls_count_as_vertices_and_as_transmissions() {
    for Lit { light, irradiance } in lights() {
        let lights = [light];
        let (found, _) = mean(&floor_below(&WALLS, &lights, WALLS.len()));
        assert!(found < DARK, "{found} of {lights:?} with too few vertices");
        let mut filtered = floor_below(&WALLS, &lights, 16);
        filtered["path_filter"] = "DTTL".into();
        let through = |cosine: f64| transmittance(&WALLS, cosine);
        check(&filtered, irradiance(&through), &[]);
        for other in ["DL", "DTL"] {
            filtered["path_filter"] = other.into();
            let (found, _) = mean(&filtered);
            assert!(found < DARK, "{found} of {lights:?} along {other}");
        }
    }
}

#[test]
fn the_sky_in_a_small_window_lights_the_floor_of_a_room_without_noise() {
    const WINDOW: f64 = 0.05;
    let wall = WALLS[0];
    let [_, _, _, sky] = lights();
    let mut scene = floor_below(&[wall], &[sky.light], 2);
    let at = |[x, y]: [f64; 2]| [LAMP[0] + x, LAMP[1] + y, LAMP[2]];
    let corners = |half: f64| [[-half, -half], [half, -half], [half, half], [-half, half]].map(at);
    // A ceiling without an end, but for the window.
    let around = [corners(1e5), corners(WINDOW)].concat();
    let ceiling = json!({
        "positions": around,
        "triangles": [[0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]]
    });
    let window = json!({"positions": corners(WINDOW), "triangles": [[0, 1, 2], [0, 2, 3]]});
    scene["materials"]["black"] = json!({"diffuse": {"reflectance": {"colour": [0, 0, 0]}}});
    scene["meshes"][1]["source"] = json!({"inline": window});
    let ceiling = json!({"name": "ceiling", "material": "black", "source": {"inline": ceiling}});
    scene["meshes"].as_array_mut().unwrap().push(ceiling);
    let irradiance = sum_over(50, WINDOW, |[x, y], area| {
        let squared = (LAMP[0] + x).powi(2) + y * y + LAMP[2] * LAMP[2];
        let cosine = LAMP[2] / squared.sqrt();
        cosine * cosine / squared * area * transmittance(&[wall], cosine)
    });
    // Chance alone meets the window ten times.
    check(&scene, irradiance, &[1.0 / wall.1]);
}
