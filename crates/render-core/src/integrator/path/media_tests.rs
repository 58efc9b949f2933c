//! Bodies that touch, overlap or hold each other, against closed forms, and in a white furnace.

use serde_json::{Value, json};

use super::tests::{EDGE, SAMPLES, mean, mean_of};
use crate::scene::Assets;

const GLASS: f64 = 1.52;
const WATER: f64 = 1.33;

/// A box from `z[0]` to `z[1]`, with its normals outwards; inwards for the inside of a vessel.
pub(super) fn shell(half: f64, z: [f64; 2], inwards: bool, first: usize) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let side = |bit: usize| if bit == 0 { -half } else { half };
    let corners = (0..8).map(|bits: usize| [side(bits & 1), side(bits >> 1 & 1), z[bits >> 2 & 1]]).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let turned = |[a, b, c]: [usize; 3]| if inwards { [a, c, b] } else { [a, b, c] };
    let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    (corners, triangles.map(|corners| turned(corners.map(|corner| first + corner))).collect())
}

pub(super) fn block(name: &str, material: &str, half: f64, z: [f64; 2]) -> Value {
    let (positions, triangles) = shell(half, z, false, 0);
    let inline = json!({"positions": positions, "triangles": triangles});
    json!({"name": name, "material": material, "source": {"inline": inline}})
}

/// A block with a hollow.
pub(super) fn vessel(name: &str, material: &str, [outer, inner]: [(f64, [f64; 2]); 2]) -> Value {
    let (mut positions, mut triangles) = shell(outer.0, outer.1, false, 0);
    let (inside, of_inside) = shell(inner.0, inner.1, true, positions.len());
    positions.extend(inside);
    triangles.extend(of_inside);
    let inline = json!({"positions": positions, "triangles": triangles});
    json!({"name": name, "material": material, "source": {"inline": inline}})
}

/// A ball of triangles that lies on z = `low`.
pub(super) fn ball(name: &str, material: &str, centre: [f64; 2], radius: f64, low: f64, rings: i32) -> Value {
    let around = 2 * rings;
    let turn = |part: f64| libm::sincos(part * std::f64::consts::PI);
    let mut positions = vec![[centre[0], centre[1], low]];
    for ring in 1..rings {
        let (sin, cos) = turn(f64::from(ring) / f64::from(rings));
        positions.extend((0..around).map(|step| {
            let (y, x) = turn(2.0 * f64::from(step) / f64::from(around));
            [centre[0] + radius * sin * x, centre[1] + radius * sin * y, low + radius * (1.0 - cos)]
        }));
    }
    positions.push([centre[0], centre[1], low + 2.0 * radius]);
    let at = |ring: i32, step: i32| match ring {
        0 => 0,
        ring if ring == rings => positions.len() as i32 - 1,
        ring => 1 + (ring - 1) * around + step % around,
    };
    let quads = (0..rings).flat_map(|ring| (0..around).map(move |step| (ring, step)));
    let triangles: Vec<[i32; 3]> = quads
        .flat_map(|(ring, step)| {
            let [a, b, c, d] = [at(ring, step), at(ring, step + 1), at(ring + 1, step + 1), at(ring + 1, step)];
            [[a, b, c], [a, c, d]]
        })
        .filter(|[a, b, c]| a != b && b != c && a != c)
        .collect();
    json!({"name": name, "material": material, "source": {"inline": {"positions": positions, "triangles": triangles}}})
}

fn dielectric(index: f64, absorption: f64, priority: i32) -> Value {
    let mut members = json!({"index_of_refraction": index, "absorption": [absorption, 0, 0]});
    if priority != 0 {
        members["priority"] = priority.into();
    }
    json!({"dielectric": members})
}

pub(super) fn pane(name: &str, z: f64, edge: f64) -> Value {
    json!({
        "name": name, "centre": [0, 0, z], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
        "width": edge, "height": edge, "thickness": 0.003, "index_of_refraction": GLASS
    })
}

/// Parallel rays along +z, or from above, through things to a panel of radiance 1 on their other side.
fn along(materials: &Value, meshes: &[Value], panes: &[Value], upwards: bool) -> Value {
    along_from(if upwards { -1.0 } else { 1.0 }, materials, meshes, panes)
}

fn along_from(start: f64, materials: &Value, meshes: &[Value], panes: &[Value]) -> Value {
    let way = -start.signum();
    // A rectangle shines along edge_u x edge_v.
    let edges = if way > 0.0 { [[0, 2, 0], [2, 0, 0]] } else { [[2, 0, 0], [0, 2, 0]] };
    json!({
        "version": 1, "name": "slabs", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [0.003, 0.007, start], "look_at": [0.003, 0.007, start + way], "up": [0, 1, 0],
            "height": 0.02}},
        "integrator": {"path": {"max_depth": 1000}},
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": materials, "meshes": meshes, "panes": panes,
        "lights": [{"rectangle": {
            "name": "panel", "centre": [0, 0, 2.0 * way], "edge_u": edges[0], "edge_v": edges[1],
            "radiance": [1, 1, 1]}}]
    })
}

/// What slabs of these indices transmit along their normal, with all reflections between them.
fn slabs(indices: &[f64]) -> f64 {
    let lost = indices.windows(2).map(|pair| {
        let reflected = ((pair[0] - pair[1]) / (pair[0] + pair[1])).powi(2);
        reflected / (1.0 - reflected)
    });
    1.0 / (1.0 + lost.sum::<f64>())
}

#[track_caller]
fn check(what: &str, scene: &Value, expected: f64, precision: f64) {
    let (mean, error) = mean(scene);
    assert!(error < precision, "{what}: no power, +- {error}");
    assert!((mean - expected).abs() < 4.0 * error + 1e-6, "{what}: {mean} +- {error}, not {expected}");
}

pub(super) fn clear() -> Value {
    json!({
        "glass": dielectric(GLASS, 0.0, 0), "water": dielectric(WATER, 0.0, 0), "air": dielectric(1.0, 0.0, 1),
        "syrup": dielectric(WATER, 0.0, 1)
    })
}

#[test]
fn panes_that_touch_have_a_film_of_air_between_them_wherever_rounding_puts_their_faces() {
    let expected = slabs(&[1.0, GLASS, 1.0, GLASS, 1.0]);
    for at in [0.0, 0.3, 1.0, 777.0] {
        for gap in [0.0, 1e-9, -1e-9, -1e-6, 1e-6] {
            let panes = [pane("near", at, 0.3), pane("far", at + 0.003 + gap, 0.3)];
            for start in [at - 1.0, at + 1.0] {
                let mut scene = along_from(if start < at { -1.0 } else { 1.0 }, &json!({}), &[], &panes);
                let way = if start < at { 1.0 } else { -1.0 };
                scene["camera"]["orthographic"]["position"][2] = start.into();
                scene["camera"]["orthographic"]["look_at"][2] = (start + way).into();
                scene["lights"][0]["rectangle"]["centre"][2] = json!(at + 2.0 * way);
                check(&format!("{gap} m apart at {at} from {start}"), &scene, expected, 0.002);
            }
        }
    }
}

/// Red light is `exp(-0.2)` of the green for each layer that light crosses, which no reflection alters by much.
#[test]
fn layers_colour_light_on_faces_that_touch_others_too() {
    let flashed = |name: &str, z: f64, layers: Value| {
        let mut pane = pane(name, z, 0.3);
        pane["layers"] = layers;
        pane
    };
    let front = json!({"front": [0.2, 0, 0]});
    let both = json!({"front": [0.2, 0, 0], "back": [0.2, 0, 0]});
    let water = vec![block("water", "water", 0.4, [-0.1, 0.1])];
    let table = [
        ("in water", water, vec![flashed("pane", 0.0, both.clone())], 2),
        ("face to face", vec![], vec![flashed("near", 0.0, both), flashed("far", 0.003, front.clone())], 3),
        ("overlapping", vec![], vec![flashed("near", 0.0, front.clone()), flashed("far", 0.002, front)], 2),
    ];
    for (what, meshes, panes, layers) in table {
        for upwards in [true, false] {
            let scene = along(&clear(), &meshes, &panes, upwards);
            let [red, green] = [0, 1].map(|channel| mean_of(&scene, &Assets::new(), channel).0);
            let expected = libm::exp(-0.2 * f64::from(layers));
            // Light that is reflected to and fro crosses layers more often.
            assert!(
                (red / green - expected).abs() < 0.02,
                "{what}: {} of the green light, not {expected}",
                red / green
            );
        }
    }
}

/// A name, meshes, panes, and the indices that light meets.
type Slabs = (&'static str, Vec<Value>, Vec<Value>, Vec<f64>);

#[test]
fn bodies_that_overlap_are_slabs_of_the_higher_one() {
    let one = [1.0, GLASS, 1.0];
    let panes = |gap: f64| [pane("near", 0.0, 0.3), pane("far", 0.003 + gap, 0.3)];
    let water = block("water", "water", 0.2, [-0.1, 0.1]);
    let glass = |low: f64, high: f64| block("glass", "glass", 0.1, [low, high]);
    let vessel = vessel("bottle", "glass", [(0.12, [-0.06, 0.06]), (0.1, [-0.05, 0.05])]);
    let liquid = block("liquid", "water", 0.105, [-0.055, 0.055]);
    let bubble = block("bubble", "air", 0.02, [-0.02, 0.01]);
    let nested = [1.0, WATER, GLASS, WATER, 1.0];
    let syrup = block("syrup", "syrup", 0.2, [-0.1, 0.1]);
    let table: [Slabs; 11] = [
        ("pane in what goes before it", vec![syrup], vec![pane("pane", 0.0, 0.1)], vec![1.0, WATER, 1.0]),
        ("two panes", vec![], panes(-0.001).to_vec(), one.to_vec()),
        ("three panes", vec![], [&panes(-0.001)[..], &[pane("last", 0.0045, 0.3)]].concat(), one.to_vec()),
        ("pane in a pane", vec![], vec![pane("wide", 0.0, 0.3), pane("small", 0.0, 0.2)], one.to_vec()),
        ("pane in water", vec![water.clone()], vec![pane("pane", 0.0, 0.1)], nested.to_vec()),
        (
            "pane that reaches out of water",
            vec![water.clone()],
            vec![pane("pane", 0.098, 0.1)],
            vec![1.0, WATER, GLASS, 1.0],
        ),
        ("glass in water", vec![water.clone(), glass(-0.05, 0.03)], vec![], nested.to_vec()),
        (
            "glass that reaches out of water",
            vec![water.clone(), glass(-0.05, 0.2)],
            vec![],
            vec![1.0, WATER, GLASS, 1.0],
        ),
        ("a bottle of water", vec![vessel, liquid], vec![], vec![1.0, GLASS, WATER, GLASS, 1.0]),
        (
            "a bubble in glass in water",
            vec![bubble.clone(), water.clone(), glass(-0.05, 0.03)],
            vec![],
            vec![1.0, WATER, GLASS, 1.0, GLASS, WATER, 1.0],
        ),
        (
            "a bubble in a pane",
            vec![block("bubble", "air", 0.05, [0.001, 0.002])],
            vec![pane("pane", 0.0, 0.3)],
            vec![1.0, GLASS, 1.0, GLASS, 1.0],
        ),
    ];
    for (what, meshes, panes, indices) in table {
        for upwards in [true, false] {
            check(what, &along(&clear(), &meshes, &panes, upwards), slabs(&indices), 0.002);
        }
    }
}

#[test]
fn a_priority_goes_before_the_smaller_box() {
    let meshes = [block("outer", "outer", 0.2, [-0.1, 0.1]), block("inner", "inner", 0.1, [-0.02, 0.03])];
    for (outer, inner, way) in [(7.0, 0.0, 0.15), (0.0, 7.0, 0.05)] {
        for (priority, way) in [(0, way), (1, if outer > 0.0 { 0.2 } else { 0.0 }), (-1, way)] {
            let materials = json!({"outer": dielectric(1.0, outer, priority), "inner": dielectric(1.0, inner, 0)});
            let expected = libm::exp(-7.0 * way);
            check(&format!("{outer} {inner} {priority}"), &along(&materials, &meshes, &[], true), expected, 1e-3);
            check(&format!("{outer} {inner} {priority}"), &along(&materials, &meshes, &[], false), expected, 1e-3);
        }
    }
    // Of equal bodies, the later one.
    let same = |absorption: [f64; 2]| {
        let materials = json!({"a": dielectric(1.0, absorption[0], 0), "b": dielectric(1.0, absorption[1], 0)});
        let mut later = block("b", "b", 0.125, [-0.125, 0.125]);
        later["translate"] = json!([0.0625, 0.0625, 0.0625]);
        along(&materials, &[block("a", "a", 0.125, [-0.125, 0.125]), later], &[], true)
    };
    check("later", &same([0.0, 7.0]), libm::exp(-7.0 * 0.25), 1e-3);
    check("earlier", &same([7.0, 0.0]), libm::exp(-7.0 * 0.0625), 1e-3);
}

#[test]
fn light_is_the_same_both_ways_through_slabs_that_absorb() {
    let materials = json!({"water": dielectric(WATER, 3.0, 0), "glass": dielectric(GLASS, 20.0, 0)});
    let meshes = [block("water", "water", 0.2, [-0.1, 0.1]), block("glass", "glass", 0.1, [0.06, 0.09])];
    let panes = [pane("in", -0.05, 0.2), pane("out", 0.0995, 0.2)];
    let [(up, up_error), (down, down_error)] =
        [true, false].map(|upwards| mean(&along(&materials, &meshes, &panes, upwards)));
    let error = libm::hypot(up_error, down_error);
    assert!(error < 0.002 && (up - down).abs() < 4.0 * error, "{up} up, {down} down, +- {error}");
    assert!((up - 0.3).abs() < 0.1, "{up}");
}

#[test]
fn a_camera_in_glass_or_water_sees_what_comes_in() {
    let lit = (1.0 - ((GLASS - 1.0) / (GLASS + 1.0_f64)).powi(2)) * GLASS * GLASS;
    // Nothing shines from below: light that is reflected there is lost.
    let at = |z: f64, meshes: &[Value], panes: &[Value]| {
        let mut scene = along(&clear(), meshes, panes, true);
        scene["camera"]["orthographic"]["position"][2] = z.into();
        scene["camera"]["orthographic"]["look_at"][2] = json!(z + 1.0);
        scene
    };
    let reflections = 1.0 / (1.0 - ((GLASS - 1.0) / (GLASS + 1.0_f64)).powi(4));
    check("in a pane", &at(0.001, &[], &[pane("pane", 0.0, 0.3)]), lit * reflections, 0.004);
    let mut pinhole = at(0.001, &[], &[pane("pane", 0.0, 0.3)]);
    pinhole["camera"] = json!({"perspective": {
        "position": [0, 0, 0.001], "look_at": [0, 0, 1], "up": [0, 1, 0], "vertical_field_of_view": 1}});
    check("pinhole in a pane", &pinhole, lit * reflections, 0.004);
    let water = block("water", "water", 0.2, [-0.1, 0.1]);
    let floor = |z: f64| json!({"name": "floor", "material": "black", "source": super::tests::square(0.15, z)});
    let mut under = at(0.0, &[water.clone(), floor(-0.01)], &[pane("pane", 0.099, 0.1)]);
    under["materials"]["black"] = json!({"diffuse": {"reflectance": {"colour": [0, 0, 0]}}});
    check("in water below a pane", &under, WATER * WATER * slabs(&[WATER, GLASS, 1.0]), 0.004);
    // Beyond the critical angle, a pane on the water does not help.
    for (degrees, is_seen) in [(40.0_f64, true), (60.0, false)] {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        let mut slanted = under.clone();
        slanted["camera"]["orthographic"]["look_at"] = json!([0.003 + sin, 0.007, cos]);
        slanted["lights"] = json!([{"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}}]);
        slanted["meshes"][0] = block("water", "water", 20.0, [-0.1, 0.1]);
        slanted["meshes"][1]["source"] = super::tests::square(19.0, -0.01);
        slanted["panes"][0] = pane("pane", 0.099, 30.0);
        check(&format!("at {degrees}"), &slanted, if is_seen { slanted_through(degrees) } else { 0.0 }, 0.006);
    }
}

/// What a camera in water sees of a white sky, through a pane on the water, at an angle to the vertical.
fn slanted_through(degrees: f64) -> f64 {
    let sine = libm::sin(degrees.to_radians());
    WATER * WATER * faces(&[[WATER, GLASS], [GLASS, 1.0]].map(|media| (media, sine * WATER / media[0])))
}

/// What faces transmit together of unpolarised light, each between two media, by the sine of the angle before it.
fn faces(faces: &[([f64; 2], f64)]) -> f64 {
    let transmitted = |is_s: bool| {
        let lost = faces.iter().map(|([before, behind], sine)| {
            let [a, b] = [1.0, before / behind].map(|ratio| (1.0 - (sine * ratio).powi(2)).sqrt());
            let [one, other] = if is_s { [before * a, behind * b] } else { [behind * a, before * b] };
            let reflected = ((one - other) / (one + other)).powi(2);
            reflected / (1.0 - reflected)
        });
        1.0 / (1.0 + lost.sum::<f64>())
    };
    0.5 * (transmitted(true) + transmitted(false))
}

/// What is reflected returns to the lamp, which is black. So what is left reaches a wall, less what lies beside it.
#[test]
fn the_flux_of_a_lamp_in_a_ball_of_glass_in_water_is_conserved() {
    let (lamp, glass, water, distance) = (0.2, 0.4, 0.5, 1.2);
    let mut materials = clear();
    materials["plaster"] = json!({"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}});
    let meshes = [
        ball("glass", "glass", [0.0, 0.0], glass, -glass, 40),
        ball("water", "water", [0.0, 0.0], water, -water, 40),
        json!({"name": "wall", "material": "plaster", "source": super::tests::square(0.5, distance)}),
    ];
    let mut scene = along(&materials, &meshes, &[], true);
    scene["camera"]["orthographic"]["position"][2] = json!(1.0);
    scene["camera"]["orthographic"]["look_at"][2] = json!(2.0);
    scene["lights"] = json!([{"sphere": {
        "name": "lamp", "centre": [0, 0, 0], "radius": lamp, "radiance": [1, 1, 1]}}]);
    // The wall and two faces: what the wall sends back is left out.
    scene["integrator"] = json!({"path": {"max_depth": 3}});
    let steps = 200;
    let through: f64 = (0..steps)
        .map(|step| {
            let angle = (f64::from(step) + 0.5) / f64::from(steps) * std::f64::consts::FRAC_PI_2;
            // A ray keeps its index times its distance from the middle.
            let height = lamp * libm::sin(angle);
            let of_faces = [([GLASS, WATER], height / glass), ([WATER, 1.0], height / water * GLASS / WATER)];
            libm::sin(2.0 * angle) * faces(&of_faces)
        })
        .sum();
    let through = through * std::f64::consts::FRAC_PI_2 / f64::from(steps);
    let expected = 0.5 * through * lamp * lamp / (distance * distance);
    let (mean, error) = mean(&scene);
    assert!(error < 0.03 * expected, "no power: {error} of {expected}");
    assert!((mean - expected).abs() < 4.0 * error + 3e-3 * expected, "{mean} +- {error}, not {expected}");
}

#[test]
fn a_lamp_in_glass_is_seen_from_outside() {
    let mut scene = along(&clear(), &[], &[pane("pane", 0.0, 0.3)], true);
    scene["lights"] = json!([{"rectangle": {
        "name": "lamp", "centre": [0, 0, 0.002], "edge_u": [0, 0.1, 0], "edge_v": [0.1, 0, 0],
        "radiance": [1, 1, 1]}}]);
    let through = (1.0 - ((GLASS - 1.0) / (GLASS + 1.0_f64)).powi(2)) / (GLASS * GLASS);
    check("in a pane", &scene, through, 0.002);
    // A wall in the glass is lit by a lamp in the same glass.
    scene["panes"][0]["thickness"] = json!(0.4);
    scene["materials"]["plaster"] = json!({"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}});
    scene["meshes"] = json!([{"name": "wall", "material": "plaster", "source": super::tests::square(0.1, 0.3)}]);
    scene["lights"] = json!([{"sphere": {
        "name": "lamp", "centre": [0.12, 0, 0.2], "radius": 0.02, "radiance": [1, 1, 1]}}]);
    let cells = 40;
    let middle = |cell: i32| (f64::from(cell) + 0.5) * 0.02 / f64::from(cells) - 0.01;
    let places = (0..cells).flat_map(|x| (0..cells).map(move |y| (0.003 + middle(x), 0.007 + middle(y))));
    let lit = places.map(|(x, y)| {
        let squared = (x - 0.12) * (x - 0.12) + y * y + 0.01;
        0.5 * 0.0004 / squared * 0.1 / squared.sqrt()
    });
    let expected = through * lit.sum::<f64>() / f64::from(cells * cells);
    for method in ["path", "auto"] {
        scene["integrator"] = json!({method: {"max_depth": 2}});
        let (mean, error) = mean(&scene);
        assert!(error < 0.01 * expected, "{method}: no power, {error} of {expected}");
        assert!((mean - expected).abs() < 4.0 * error + 1e-3 * expected, "{method}: {mean} +- {error}, not {expected}");
    }
}
