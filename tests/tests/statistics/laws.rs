//! Closed forms that every method has to meet: flat panes (T1), wedges (T4), lenses (T5), and reciprocity (T11).
//!
//! The numbers are those of `docs/validation.md`. Nothing here shares code with the renderer: refraction and
//! transmittance are written out anew. `polarisation` has larger angles of incidence.

use std::f64::consts::{PI, TAU};

use clerestory_film::counters::Counters;
use clerestory_render_core::geometry::{Pane, SurfaceId};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::Source;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::fermat::Connection;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::fnee::PathSearch;
use clerestory_render_core::specular::newton::Root;
use clerestory_render_core::specular::side::PaneSide;
use clerestory_tests::estimate::{Estimate, check_agreement};
use clerestory_tests::methods::{biased_sms, unbiased_integrators};
use clerestory_tests::pane_scene::{INDEX, PaneScene, gather, height_map, pane};
use clerestory_tests::polarised_light::TwoFaces;
use clerestory_tests::random::Random;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// Fresnel transmittance of a face of glass along its normal.
const STRAIGHT: f64 = 4.0 * INDEX / ((INDEX + 1.0) * (INDEX + 1.0));

/// Cosine in the glass, by the sine in air.
fn glass_cosine(sine: f64) -> f64 {
    (1.0 - (sine / INDEX).powi(2)).sqrt()
}

/// A unit vector refracted at a plane with the unit normal `normal`, which lies on the side to which light goes.
pub(super) fn refracted(direction: DVec3, normal: DVec3, ratio: f64) -> DVec3 {
    let cosine = direction.dot(normal);
    direction * ratio + normal * ((1.0 - ratio * ratio * (1.0 - cosine * cosine)).sqrt() - ratio * cosine)
}

pub(super) const THICKNESS: f64 = 0.004;
const ABSORPTION: f64 = 20.0;

pub(super) fn flat_pane(size: f64) -> Value {
    let mut pane = pane("pane", [0.0; 3], [size, size], THICKNESS, [json!("flat"), json!("flat")]);
    pane["absorption"] = json!([ABSORPTION, ABSORPTION, ABSORPTION]);
    pane
}

/// Transmittance of both faces of a flat pane and of the glass between them.
fn flat_transmittance(sine: f64) -> f64 {
    let (air, glass) = ((1.0 - sine * sine).sqrt(), glass_cosine(sine));
    let [outside, inside] = [DVec3::new(sine, 0.0, air), DVec3::new(sine / INDEX, 0.0, glass)];
    let faces = TwoFaces::new([outside, inside, outside], [DVec3::Z; 2], INDEX);
    faces.both * (-ABSORPTION * THICKNESS / glass).exp()
}

/// Irradiance by a point light of unit intensity behind a flat pane, `air` metres of air and `lateral` metres away. It
/// is the flux in a ring of directions over the area of the lit ring.
pub(super) fn flat_irradiance(air: f64, lateral: f64) -> f64 {
    let tangent = |sine: f64| sine / (1.0 - sine * sine).sqrt();
    let reach = |sine: f64| air * tangent(sine) + THICKNESS * tangent(sine / INDEX);
    let (mut low, mut high) = (0.0, 1.0 - 1e-12);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if reach(middle) < lateral { low = middle } else { high = middle }
    }
    let sine: f64 = low;
    let (cos, inner) = ((1.0 - sine * sine).sqrt(), glass_cosine(sine));
    let by_angle = air / (cos * cos) + THICKNESS * cos / (INDEX * inner.powi(3));
    let around = air / cos + THICKNESS / (INDEX * inner);
    flat_transmittance(sine) / (around * by_angle)
}

/// The settings with which methods find all light from one point of a light, without chance where there is one path.
pub(super) fn sure_methods() -> Vec<Value> {
    let mnee = ["dropped", "left_to_chance"].map(|missed| json!({"mnee": {"missed": missed}}));
    [vec![biased_sms("angle_difference", 12), biased_sms("half_vector", 12)], mnee.to_vec()].concat()
}

/// The methods that send rays to lights with an extent, or draw seeds once.
fn chancy_methods() -> Vec<Value> {
    vec![json!({"cone": {}}), json!({"fnee": {}}), json!({"fnee": {"solver": "published", "max_trials": 100_000}})]
}

pub(super) fn irradiance(arrivals: &[(DVec3, f64)], point: &ShadingPoint) -> f64 {
    arrivals.iter().map(|(direction, weight)| weight * direction.dot(point.normal)).sum()
}

pub(super) fn point_light(position: [f64; 3]) -> Value {
    json!({"point": {"name": "lamp", "position": position, "intensity": [1, 1, 1]}})
}

#[test]
fn one_path_leads_through_a_flat_pane_with_the_light_of_the_closed_form() {
    let lamp = [0.1, 0.2, 0.8];
    let bench = PaneScene::new(vec![flat_pane(0.8)], point_light(lamp));
    for [x, y] in [[0.1, 0.2], [0.0, 0.0], [-0.6, 0.3], [0.3, -0.9]] {
        let point = bench.point([x, y]);
        let expected = flat_irradiance(bench.distance + lamp[2] - THICKNESS, (lamp[0] - x).hypot(lamp[1] - y));
        for integrator in [vec![json!({"fnee": {}})], sure_methods()].concat() {
            let arrivals = gather(&bench.build(&integrator, 1), &point, 0, &mut Counters::default());
            let found = irradiance(&arrivals, &point);
            assert_eq!(arrivals.len(), 1, "{integrator} at {x}, {y}: {arrivals:?}");
            assert!((found / expected - 1.0).abs() < 1e-9, "{integrator} at {x}, {y}: {found}, expected {expected}");
        }
        for (name, integrator) in unbiased_integrators().iter().filter(|(name, _)| !["path", "cone"].contains(name)) {
            let found = bench.clone().at([x, y]).mean_irradiance(integrator, 8, 32);
            check_agreement(
                &format!("a lamp behind a flat pane, {name}"),
                &[found],
                &[Estimate::exact(expected)],
                0.05,
            );
        }
    }
}

/// Irradiance by a sky of unit radiance through a flat square pane of half the edge `half` at a distance, by the
/// midpoint rule. Directions are within `radius` (radians) of one at the angle `tilt` to the normal.
pub(super) fn sky_irradiance(tilt: f64, radius: f64, distance: f64, half: f64) -> f64 {
    const STEPS: usize = 1500;
    let mut sum = 0.0;
    for ring in 0..STEPS {
        let height = (ring as f64 + 0.5) / STEPS as f64 * (1.0 - radius.cos());
        let (cos, sin) = (1.0 - height, (height * (2.0 - height)).sqrt());
        for turn in 0..STEPS / 4 {
            let azimuth = (turn as f64 + 0.5) / (STEPS / 4) as f64 * TAU;
            let (across, y) = (sin * azimuth.cos(), sin * azimuth.sin());
            let (x, z) = (across * tilt.cos() + cos * tilt.sin(), cos * tilt.cos() - across * tilt.sin());
            let sine = (x * x + y * y).sqrt();
            let reach = distance / z + THICKNESS / (INDEX * glass_cosine(sine));
            if z > 0.0 && x.abs().max(y.abs()) * reach < half {
                sum += flat_transmittance(sine) * z;
            }
        }
    }
    sum * (1.0 - radius.cos()) * TAU / (STEPS * (STEPS / 4)) as f64
}

pub(super) fn sun(direction: DVec3, degrees: f64, radiance: f64) -> Value {
    json!({"sun": {"name": "sun", "direction": direction.to_array(), "angular_radius": degrees,
        "radiance": [radiance, radiance, radiance]}})
}

#[test]
fn the_sun_behind_a_flat_pane_loses_what_the_glass_takes() {
    let (tilt, degrees) = (0.5f64, 0.27f64);
    let direction = DVec3::new(tilt.sin(), 0.0, tilt.cos());
    // The middle of the pane lies on the line to the sun.
    let bench = PaneScene::new(vec![flat_pane(0.2)], sun(direction, degrees, 1e4)).at([-tilt.tan(), 0.0]);
    let expected = 1e4 * sky_irradiance(tilt, degrees.to_radians(), 1.0, f64::INFINITY);
    let whole = PI * 1e4 * degrees.to_radians().sin().powi(2) * tilt.cos();
    assert!((expected / (whole * flat_transmittance(tilt.sin())) - 1.0).abs() < 1e-5);
    // Chance alone does not find so small a sun.
    for (name, integrator) in unbiased_integrators().iter().filter(|(name, _)| *name != "path") {
        let found = bench.mean_irradiance(integrator, 64, 16);
        let fault = if name.contains("published") { 0.05 } else { 0.01 };
        check_agreement(&format!("the sun behind a flat pane, {name}"), &[found], &[Estimate::exact(expected)], fault);
    }
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn a_uniform_sky_behind_a_flat_pane_is_dimmed_by_the_mean_transmittance() {
    let (distance, size) = (0.04, 0.3);
    let bench = PaneScene { distance, ..PaneScene::new(vec![flat_pane(size)], sun(DVec3::Z, 90.0, 1.0)) };
    let bench = bench.at([0.0; 2]);
    let expected = sky_irradiance(0.0, 0.5 * PI, distance, 0.5 * size);
    println!("mean transmittance {:.5}", expected / PI);
    for (name, integrator) in unbiased_integrators() {
        let found = bench.mean_irradiance(&integrator, if name == "path" { 512 } else { 128 }, 32);
        let fault = if name.contains("published") { 0.1 } else { 0.02 };
        check_agreement(&format!("a sky behind a flat pane, {name}"), &[found], &[Estimate::exact(expected)], fault);
    }
}

#[test]
fn suns_in_the_same_direction_shine_through_one_another() {
    let (distance, size) = (0.04, 0.3);
    let irradiance = |degrees: f64| sky_irradiance(0.0, degrees.to_radians(), distance, 0.5 * size);
    let expected = Estimate::exact(irradiance(90.0) + 2.0 * irradiance(45.0));
    let [wide, mut narrow] = [sun(DVec3::Z, 90.0, 1.0), sun(DVec3::Z, 45.0, 2.0)];
    narrow["sun"]["name"] = json!("another sun");
    for lights in [vec![wide.clone(), narrow.clone()], vec![narrow, wide]] {
        let bench = PaneScene::new(vec![flat_pane(size)], Value::Null).at([0.0; 2]);
        let bench = PaneScene { distance, lights, ..bench };
        for (name, samples) in [("path", 512), ("cone", 128)] {
            let found = bench.mean_irradiance(&json!({name: {}}), samples, 32);
            check_agreement(&format!("two suns, {name}"), &[found], &[expected], 0.02);
        }
    }
}

/// Edge of wedges and lenses, metres: a power of two, as everything about them, so that their coefficients are exact.
const EDGE: f64 = 0.125;
const CELLS: usize = 16;
const CELL: f64 = EDGE / CELLS as f64;

/// A pane whose front and back have these heights; they are as given but for two cells at the border.
pub(super) fn shaped(
    thickness: f64,
    front: impl Fn(DVec2) -> f64,
    back: impl Fn(DVec2) -> f64,
    light: Value,
) -> PaneScene {
    let faces = ["front.exr", "back.exr"];
    let maps = [height_map([EDGE; 2], [CELLS; 2], front), height_map([EDGE; 2], [CELLS; 2], back)];
    let profiles = faces.map(|file| json!({"height_map": {"file": file}}));
    let bench = PaneScene::new(vec![pane("pane", [0.0; 3], [EDGE; 2], thickness, profiles)], light);
    PaneScene { assets: faces.into_iter().map(str::to_owned).zip(maps).collect(), ..bench }
}

/// Follows a direction at the receiver through a wedge with these slopes. Returns the direction behind it, the
/// transmittance, and the ratio of the solid angles at the receiver and behind the wedge.
pub(super) fn through_wedge(direction: DVec3, front: DVec2, back: DVec2) -> (DVec3, f64, f64) {
    let normal = |slope: DVec2| DVec3::new(-slope.x, -slope.y, 1.0).normalize();
    let inner = refracted(direction, normal(front), 1.0 / INDEX);
    let outer = refracted(inner, normal(back), INDEX);
    let air = [direction.dot(normal(front)), outer.dot(normal(back))];
    let glass = [inner.dot(normal(front)), inner.dot(normal(back))];
    let through = TwoFaces::new([direction, inner, outer], [normal(front), normal(back)], INDEX);
    // Each refraction keeps n^2 cos(theta) times the solid angle.
    (outer, through.both, glass[0] / air[0] * air[1] / glass[1])
}

#[test]
fn a_wedge_turns_and_spreads_light_as_a_prism() {
    const LARGER: f64 = 0.2;
    let degrees = 0.001f64;
    let thin = 2f64.powi(-11);
    let (outer, _, factor) = through_wedge(DVec3::Z, DVec2::ZERO, DVec2::new(thin, 0.0));
    assert!((outer.x / -outer.z / (-(INDEX - 1.0) * thin) - 1.0).abs() < 1e-6 && (factor - 1.0).abs() < 1e-6);
    for (front, back) in [
        (DVec2::ZERO, DVec2::new(thin, 0.0)),
        (DVec2::ZERO, DVec2::new(0.0, -0.0625)),
        (DVec2::new(0.03125, 0.0), DVec2::new(-0.0625, 0.015625)),
    ] {
        for direction in [DVec3::Z, DVec3::new(0.3, -0.2, 1.0).normalize()] {
            let (outer, through, factor) = through_wedge(direction, front, back);
            let bench = shaped(0.02, |place| front.dot(place), |place| back.dot(place), sun(outer, degrees, 1e6));
            // So near that the straight line to the sun meets the wedge as well.
            let bench = PaneScene { distance: 0.25, ..bench };
            let [x, y] = (direction * (-bench.distance / direction.z)).truncate().to_array();
            let point = bench.point([x, y]);
            let expected = PI * 1e6 * degrees.to_radians().sin().powi(2) * through * factor * direction.z;
            for integrator in sure_methods() {
                let arrivals = gather(&bench.build(&integrator, 1), &point, 0, &mut Counters::default());
                let straight = arrivals.iter().all(|(found, _)| (*found - direction).length() < 1e-4);
                let found = irradiance(&arrivals, &point);
                assert!(
                    straight && (found / expected - 1.0).abs() < 1e-5,
                    "{integrator}, slopes {front} and {back}: {found} along {arrivals:?}, expected {expected} \
                     along {direction}"
                );
            }
            for integrator in chancy_methods() {
                // Rays that are sent to the sun do not find one as small as that.
                let larger = PaneScene { lights: vec![sun(outer, LARGER, 1e2)], ..bench.clone() };
                let found = larger.at([x, y]).mean_irradiance(&integrator, 32, 16);
                let brighter = 1e-4 * (LARGER.to_radians().sin() / degrees.to_radians().sin()).powi(2);
                let name = format!("wedge, {integrator}");
                check_agreement(&name, &[found], &[Estimate::exact(expected * brighter)], 0.02);
            }
        }
    }
}

/// Curvature of the lenses' backs, 1/m, and the thickness between the undisplaced faces.
const CURVATURE: f64 = -2.0;
const LENS_THICKNESS: f64 = 0.0078125;

/// A lens with a flat front; `shape` is the square of the distance from its axis.
fn lens(shape: impl Fn(DVec2) -> f64) -> PaneScene {
    shaped(LENS_THICKNESS, |_| 0.0, |place| 0.5 * CURVATURE * shape(place), sun(DVec3::Z, 0.001, 1e6))
}

/// The distance of the focus of a lens with this height on its axis from its front, exact for rays close to the axis.
fn focus(height: f64) -> f64 {
    1.0 / (-CURVATURE * (INDEX - 1.0)) - (LENS_THICKNESS + height) / INDEX
}

/// A cubic B-spline with the squares of the places as coefficients is the square plus a third of a squared cell.
const SPLINE_OFFSET: f64 = 0.5 * CURVATURE * CELL * CELL / 3.0;

/// The determinants of the Hessian along x and along y for the path on the axis, from `distance` in front of a lens.
fn determinants(glass: &Pane, distance: f64) -> [f64; 2] {
    let origin = DVec3::new(0.0, 0.0, -distance);
    let side = PaneSide::facing(glass, origin).expect("the origin is in front of the lens");
    let connection = Connection::new(&side, origin, Source::Direction(DVec3::Z));
    let hessian = connection.path(&[DVec2::ZERO; 2], &mut Counters::default()).hessian();
    let (near, mixed, far) = (hessian.near, hessian.mixed, hessian.far);
    assert!(near.x_axis.y == 0.0 && mixed.x_axis.y == 0.0 && far.x_axis.y == 0.0);
    [
        near.x_axis.x * far.x_axis.x - mixed.x_axis.x * mixed.x_axis.x,
        near.y_axis.y * far.y_axis.y - mixed.y_axis.y * mixed.y_axis.y,
    ]
}

#[test]
fn light_of_a_lens_is_singular_at_its_focal_length() {
    let thin_lens = 1.0 / (-CURVATURE * (INDEX - 1.0));
    for (name, bench) in
        [("cylinder", lens(|place| place.x * place.x)), ("sphere", lens(|place| place.length_squared()))]
    {
        let scene = bench.build(&json!({"fnee": {}}), 1);
        let glass = &scene.scene().panes()[0];
        for axis in 0..if name == "sphere" { 2 } else { 1 } {
            let (mut low, mut high) = (0.5 * thin_lens, 2.0 * thin_lens);
            assert!(determinants(glass, low)[axis] > 0.0 && determinants(glass, high)[axis] < 0.0, "{name}");
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if determinants(glass, middle)[axis] > 0.0 { low = middle } else { high = middle }
            }
            let height = SPLINE_OFFSET * if name == "sphere" { 2.0 } else { 1.0 };
            let expected = focus(height);
            println!("{name}: focus at {low}, by the closed form {expected}, of a thin lens {thin_lens}");
            assert!((low / expected - 1.0).abs() < 1e-12, "{name}: {low} {expected}");
            assert!((low / thin_lens - 1.0).abs() < 0.01, "{name}: {low} {thin_lens}");
            // A ray close to the axis, traced through both faces.
            let offset = 1e-5;
            let slope = CURVATURE * offset;
            let inner = refracted(-DVec3::Z, DVec3::new(slope, 0.0, -1.0).normalize(), 1.0 / INDEX);
            let outer = refracted(inner, -DVec3::Z, INDEX);
            let exit = offset + inner.x / -inner.z * (LENS_THICKNESS + height + 0.5 * CURVATURE * offset * offset);
            let traced = exit / (outer.x / outer.z);
            assert!((traced / expected - 1.0).abs() < 1e-6, "{name}: {traced} {expected}");
        }
    }
}

/// Kinds of a stationary path: the number of directions in which the optical length has a maximum.
fn maxima(root: &Root) -> usize {
    let hessian = root.path.hessian();
    let schur = hessian.near - hessian.mixed * hessian.far.inverse() * hessian.mixed.transpose();
    if root.determinant < 0.0 {
        1
    } else if schur.x_axis.x < 0.0 {
        2
    } else {
        0
    }
}

#[test]
fn paths_through_a_lens_turn_from_minima_to_saddles_or_maxima_at_the_focus() {
    // How far from the axis the lens is what it should be.
    let inside = |root: &&Root| root.theta.iter().all(|vertex| vertex.abs().max_element() < 0.5 * EDGE - 2.5 * CELL);
    for (name, bench) in
        [("cylinder", lens(|place| place.x * place.x)), ("sphere", lens(|place| place.length_squared()))]
    {
        let scene = bench.build(&json!({"fnee": {}}), 1);
        let glass = &scene.scene().panes()[0];
        let height = SPLINE_OFFSET * if name == "sphere" { 2.0 } else { 1.0 };
        for part in [0.5, 0.9, 1.1, 2.0] {
            let origin = DVec3::new(0.001, 0.0007, -part * focus(height));
            let side = PaneSide::facing(glass, origin).unwrap();
            let search = PathSearch::new(side, origin, Source::Direction(DVec3::Z), FneeSolver::Complete).unwrap();
            let roots = search.enumerate(&mut Counters::default()).roots;
            let kinds: Vec<usize> = roots.iter().filter(inside).map(maxima).collect();
            let expected = match (name, part > 1.0) {
                (_, false) => 0,
                ("cylinder", true) => 1,
                _ => 2,
            };
            assert_eq!(kinds, [expected], "{name} at {part} of the focal length");
            // On the axis: every method finds the irradiance of the closed form.
            let bench = PaneScene { distance: part * focus(height), ..bench.clone() };
            let point = bench.point([0.0; 2]);
            let whole = PI * 1e6 * 0.001f64.to_radians().sin().powi(2) * STRAIGHT * STRAIGHT;
            let power = -CURVATURE * (INDEX - 1.0);
            let spread = 1.0 - power * (bench.distance + (LENS_THICKNESS + height) / INDEX);
            let expected = whole / if name == "sphere" { spread * spread } else { spread.abs() };
            for integrator in sure_methods() {
                let arrivals = gather(&bench.build(&integrator, 1), &point, 0, &mut Counters::default());
                let arrivals: Vec<_> = arrivals.into_iter().filter(|(direction, _)| direction.z > 0.9999).collect();
                let found = irradiance(&arrivals, &point);
                assert!(
                    (found / expected - 1.0).abs() < 1e-3,
                    "{name} at {part} of the focal length, {integrator}: {found}, expected {expected}"
                );
            }
        }
    }
}

/// The light that arrives at `to` from a point light of unit intensity at `from`, without a cosine.
fn received(scene: &PaneScene, integrator: &Value, from: DVec3, to: DVec3) -> f64 {
    let scene = PaneScene { lights: vec![point_light(from.to_array())], ..scene.clone() };
    let built: PreparedScene = scene.build(integrator, 1);
    let normal = DVec3::Z * -to.z.signum();
    let point = ShadingPoint { position: to, normal, surface: SurfaceId::Nothing, bounces: 0 };
    gather(&built, &point, 0, &mut Counters::default()).iter().map(|(_, weight)| weight).sum()
}

/// Checks that the ends of random paths can change places; from the one behind, light is `factor` times as strong.
#[track_caller]
fn check_reciprocity(name: &str, scene: &PaneScene, integrators: &[Value], factor: f64) {
    let scene = PaneScene { distance: 5.0, ..scene.clone() };
    let mut random = Random::new(23, 0);
    for _ in 0..4 {
        let mut offset = || 0.15 * (random.uniform() - 0.5);
        let (front, back) =
            (DVec3::new(offset(), offset(), -0.4 + offset()), DVec3::new(offset(), offset(), 0.6 + offset()));
        for integrator in integrators {
            let there = received(&scene, integrator, back, front);
            let again = received(&scene, integrator, front, back) * factor;
            assert!(there > 0.0, "{name}, {integrator}: no light from {back} to {front}");
            assert!((there / again - 1.0).abs() < 1e-7, "{name}, {integrator}: {there} and {again}");
        }
    }
}

#[test]
fn ends_of_a_path_can_change_places() {
    let light = point_light([0.0, 0.0, 1.0]);
    let crown = |centre: [f64; 2], amplitude: f64| {
        let crown = json!({"centre": centre, "wavelength": 0.03, "amplitude": amplitude});
        json!({"crown": crown})
    };
    let glass = |name: &str, z: f64, amplitude: f64| {
        let faces = [crown([0.2, 0.1], amplitude), crown([-0.1, 0.25], amplitude)];
        pane(name, [0.0, 0.0, z], [0.3, 0.3], 0.003, faces)
    };
    let methods = |trials, chain: &str| {
        let sms = |constraint| {
            let mut sms = biased_sms(constraint, trials);
            sms["sms"]["chains"] = json!([chain]);
            sms
        };
        vec![sms("angle_difference"), sms("half_vector"), json!({"mnee": {"missed": "dropped", "chains": [chain]}})]
    };
    let gentle = PaneScene::new(vec![glass("pane", 0.0, 4e-6)], light.clone());
    let all = [methods(20, "TT"), vec![json!({"fnee": {}})]].concat();
    check_reciprocity("one pane", &gentle, &all, 1.0);
    // Several paths; one walk need not find the same one both ways.
    let strong = PaneScene::new(vec![glass("pane", 0.0, 4e-5)], light.clone());
    check_reciprocity("one strong pane", &strong, &[json!({"fnee": {}}), biased_sms("angle_difference", 3000)], 1.0);
    let two = PaneScene::new(vec![glass("near", 0.0, 4e-6), glass("far", 0.1, 4e-6)], light);
    check_reciprocity("two panes", &two, &methods(20, "TTTT"), 1.0);
}

#[test]
fn ends_of_a_reflected_path_can_change_places() {
    let crown = |centre: [f64; 2]| json!({"crown": {"centre": centre, "wavelength": 0.03, "amplitude": 4e-6}});
    let faces = [crown([0.2, 0.1]), crown([-0.1, 0.25])];
    let glass = pane("pane", [0.0; 3], [0.3; 2], 0.003, faces);
    let scene = PaneScene { distance: 5.0, ..PaneScene::new(vec![glass], point_light([0.0, 0.0, -1.0])) };
    let sms = |constraint| {
        let mut sms = biased_sms(constraint, 20);
        sms["sms"]["chains"] = json!(["R"]);
        sms
    };
    // On glass as gentle as this each search leads to the one path.
    let integrators = [
        json!({"fnee": {"reflected": true}}),
        json!({"fnee": {"reflected": true, "solver": "published"}}),
        sms("angle_difference"),
        sms("half_vector"),
    ];
    let mut random = Random::new(24, 0);
    for side in [-1.0, 1.0, -1.0, 1.0] {
        let mut end = |distance: f64| {
            let mut offset = || 0.15 * (random.uniform() - 0.5);
            DVec3::new(offset(), offset(), side * (distance + offset()))
        };
        let (near, far) = (end(0.4), end(0.8));
        for integrator in &integrators {
            let there = received(&scene, integrator, near, far);
            let again = received(&scene, integrator, far, near);
            assert!(there > 0.0, "{integrator}: no light from {near} to {far}");
            assert!((there / again - 1.0).abs() < 1e-7, "{integrator}: {there} and {again}");
        }
    }
}
