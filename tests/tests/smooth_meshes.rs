//! Caustics of triangle meshes with interpolated normals: manifold methods against the path tracer, which finds the light by
//! chance, against closed forms, and against the same glass as a height field.

use std::collections::BTreeMap;

use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{SampleStream, SamplerSettings};
use clerestory_render_core::geometry::Leaving;
use clerestory_render_core::optics::LightKind;
use clerestory_render_core::scene::description::{
    ConicSearch, ManifoldConstraint, ManifoldEstimator, MissedPaths, PaneSelection, WalkSteps,
};
use clerestory_render_core::scene::{Asset, Scene, SceneBundle, SceneDescription};
use clerestory_render_core::specular::{
    ShadingPoint, SpecularEvent, SpecularMethod, conic::Conic, mnee::Mnee, scope::Scope, sms::Sms,
};
use clerestory_tests::estimate::check_agreement;
use clerestory_tests::pane_mesh::as_mesh;
use clerestory_tests::rendering::block_means;
use clerestory_tests::solution_lists::{load_case, load_list};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// Parts of the picture along each edge.
const BLOCKS: usize = 4;

/// A grid of quads over a square around the origin, cut into triangles that are seen counterclockwise from +z, with heights
/// and normals.
fn sheet(half: f64, cells: u32, height: impl Fn(DVec2) -> (f64, DVec2)) -> Value {
    let (mut positions, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..=cells {
        for column in 0..=cells {
            let place = DVec2::new(f64::from(column), f64::from(row)) / f64::from(cells) * (2.0 * half) - half;
            let (height, slope) = height(place);
            positions.push([place.x, place.y, height]);
            normals.push([-slope.x, -slope.y, 1.0]);
        }
    }
    let vertex = |row, column| row * (cells + 1) + column;
    for row in 0..cells {
        for column in 0..cells {
            let [a, b] = [vertex(row, column), vertex(row, column + 1)];
            let [c, d] = [vertex(row + 1, column + 1), vertex(row + 1, column)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    json!({"inline": {"positions": positions, "normals": normals, "triangles": triangles}})
}

/// Gentle waves.
fn waves(place: DVec2) -> (f64, DVec2) {
    let phase = place * DVec2::new(19.0, 14.0) + DVec2::new(0.4, 1.1);
    let amplitude = 0.004;
    let height = amplitude * (libm::sin(phase.x) + libm::cos(phase.y));
    (height, amplitude * DVec2::new(19.0 * libm::cos(phase.x), -14.0 * libm::sin(phase.y)))
}

/// A floor seen from above, 0.4 m wide, in a picture of 8 x 8 pixels, and a smooth mesh.
fn scene(material: Value, mesh: Value, lights: Value, filter: &str, integrator: Value) -> Scene {
    let description = json!({
        "version": 1, "name": "smooth mesh", "seed": 3,
        "film": {"width": 8, "height": 8},
        "camera": {"orthographic": {"position": [0, 0, -0.9], "look_at": [0, 0, -1], "up": [0, 1, 0], "height": 0.4}},
        "integrator": integrator,
        "path_filter": filter,
        "materials": {"smooth": material, "floor": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}}},
        "meshes": [
            {"name": "floor", "material": "floor", "source": {"inline": {
                "positions": [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]], "triangles": [[0, 1, 2], [0, 2, 3]]}}},
            {"name": "sheet", "material": "smooth", "source": mesh},
        ],
        "lights": lights,
    });
    build(&description, BTreeMap::new())
}

fn build(description: &Value, assets: BTreeMap<String, Asset>) -> Scene {
    let description = SceneDescription::parse(description.to_string().as_bytes()).expect("a valid scene");
    let bundle = SceneBundle::from_parts(description, assets).expect("no assets are missing");
    Scene::build(&bundle).expect("a scene that can be built")
}

/// Checks the manifold methods, and `conic` where it can, on one chain over one smooth mesh against the path tracer.
#[track_caller]
fn check_by_chance(name: &str, chain: &str, parts: [&Value; 3], with_mnee: bool, fault: f64) {
    let [material, mesh, lights] = parts;
    let filter = format!("D {chain} L");
    let build = |integrator| scene(material.clone(), mesh.clone(), lights.clone(), &filter, integrator);
    let chance = block_means(&build(json!({"path": {}})), 4000, BLOCKS);
    for constraint in ["angle_difference", "half_vector"] {
        let sms = build(json!({"sms": {"chains": [chain], "constraint": constraint}}));
        check_agreement(&format!("{name}, sms, {constraint}"), &block_means(&sms, 150, BLOCKS), &chance, fault);
    }
    if chain.len() == 1 {
        let conic = build(json!({"conic": {"chains": [chain]}}));
        check_agreement(&format!("{name}, conic"), &block_means(&conic, 30, BLOCKS), &chance, fault);
    }
    if with_mnee {
        let mnee = build(json!({"mnee": {"chains": [chain]}}));
        check_agreement(&format!("{name}, mnee"), &block_means(&mnee, 100, BLOCKS), &chance, fault);
    }
}

#[test]
fn the_caustic_of_water_is_what_the_path_tracer_finds() {
    let water = json!({"dielectric": {"index_of_refraction": 1.33}});
    let lamp = json!([{"sphere": {"name": "lamp", "centre": [0.3, 0.2, 1.5], "radius": 0.25, "radiance": [9, 9, 9]}}]);
    check_by_chance("water under a lamp", "T", [&water, &sheet(1.0, 40, waves), &lamp], true, 0.05);
    let sun = json!([{"sun": {"name": "sun", "direction": [0.4, 0.1, 1], "angular_radius": 8, "radiance": [9, 9, 9]}}]);
    check_by_chance("water in the sun", "T", [&water, &sheet(1.0, 40, waves), &sun], true, 0.05);
}

#[test]
fn the_caustic_of_a_mirror_is_what_the_path_tracer_finds() {
    let mirror = json!({"mirror": {"reflectance": [0.9, 0.9, 0.9]}});
    let panel = json!([{"rectangle": {"name": "panel", "centre": [0.5, 0, -0.7], "edge_u": [0.3, 0, 0.4], "edge_v": [0, 0.6, 0],
        "radiance": [9, 9, 9]}}]);
    let gentle = |place| {
        let (height, slope) = waves(place);
        (0.3 * height, 0.3 * slope)
    };
    check_by_chance("mirror", "R", [&mirror, &sheet(0.6, 24, gentle), &panel], false, 0.05);
}

#[test]
fn the_caustic_of_a_glass_body_is_what_the_path_tracer_finds() {
    // A ball of 48 x 24 faces, squeezed to a lens.
    let (mut positions, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    let (around, down) = (48u32, 24u32);
    for row in 0..=down {
        for column in 0..around {
            let (sin, cos) = libm::sincos(std::f64::consts::PI * f64::from(row) / f64::from(down));
            let (y, x) = libm::sincos(std::f64::consts::TAU * f64::from(column) / f64::from(around));
            positions.push([0.3 * sin * x, 0.3 * sin * y, 0.1 * cos - 0.3]);
            normals.push([sin * x / 0.3, sin * y / 0.3, cos / 0.1]);
        }
    }
    for row in 0..down {
        for column in 0..around {
            let vertex = |row: u32, column: u32| row * around + column % around;
            let [a, b] = [vertex(row, column), vertex(row, column + 1)];
            let [c, d] = [vertex(row + 1, column + 1), vertex(row + 1, column)];
            if row > 0 {
                triangles.push([a, d, b]);
            }
            if row + 1 < down {
                triangles.push([b, d, c]);
            }
        }
    }
    // The poles have a vertex for each column: their normals are the axis.
    let lens = json!({"inline": {"positions": positions, "normals": normals, "triangles": triangles}});
    let glass = json!({"dielectric": {"index_of_refraction": 1.5}});
    let lamp = json!([{"sphere": {"name": "lamp", "centre": [0.2, 0.1, 1.5], "radius": 0.6, "radiance": [9, 9, 9]}}]);
    check_by_chance("lens", "TT", [&glass, &lens, &lamp], true, 0.2);
}

/// The irradiance at a point, for a point light of unit intensity.
fn irradiance(scene: &Scene, point: &ShadingPoint, method: &dyn SpecularMethod, events: &[SpecularEvent]) -> f64 {
    let mut stream = SampleStream::new(&SamplerSettings { seed: 5, samples_per_block: 1 }, 0, [0, 0], 0);
    let mut sum = 0.0;
    method.gather(scene, point, 0, events, &mut stream, &mut Counters::default(), &mut |arrival| {
        sum += arrival.weight.x * arrival.direction.dot(point.normal);
    });
    let LightKind::Point { intensity, .. } = scene.lights()[0].kind else { panic!("a point light") };
    sum / intensity.x
}

fn floor_point(x: f64, y: f64) -> ShadingPoint {
    ShadingPoint { position: DVec3::new(x, y, -1.0), normal: DVec3::Z, leaving: Leaving::Triangle(0), bounces: 0 }
}

#[test]
fn flat_water_and_flat_mirrors_throw_the_light_of_closed_forms() {
    let light = json!([{"point": {"name": "lamp", "position": [0.2, 0.1, 0.8], "intensity": [1, 1, 1]}}]);
    let flat = sheet(1.0, 3, |_| (0.0, DVec2::ZERO));
    let mirror_light = json!([{"point": {"name": "lamp", "position": [0.2, 0.1, -0.8], "intensity": [1, 1, 1]}}]);
    let index = 1.33;
    let water =
        scene(json!({"dielectric": {"index_of_refraction": index}}), flat.clone(), light, "D T L", json!({"path": {}}));
    let mirror =
        scene(json!({"mirror": {"reflectance": [0.8, 0.8, 0.8]}}), flat, mirror_light, "D R L", json!({"path": {}}));
    for (x, y) in [(0.0, 0.0), (-0.3, 0.2), (0.2, 0.1), (0.5, -0.4)] {
        let point = floor_point(x, y);
        // Reflection: the light's image, 1 m + 0.8 m away in height.
        let image = DVec3::new(0.2, 0.1, 0.8) - point.position;
        let expected = 0.8 * image.normalize().z / image.length_squared();
        let constraint = ManifoldConstraint::AngleDifference;
        let estimator = ManifoldEstimator::Biased { trials: 8 };
        let sms = |scene: &Scene, chain: &str| Sms {
            constraint,
            steps: WalkSteps::default(),
            estimator,
            selection: PaneSelection::All,
            scope: Scope::new(scene, &[chain.to_owned()], None, None),
        };
        let reflected = irradiance(&mirror, &point, &sms(&mirror, "R"), &[SpecularEvent::Reflection]);
        assert!((reflected - expected).abs() < 1e-7 * expected, "{reflected} {expected}");
        // On flat triangles the curve is a straight line, and right below the light there is none.
        let conic = |scene: &Scene, chain: &str, search| Conic {
            search,
            scope: Scope::new(scene, &[chain.to_owned()], None, None),
        };
        for search in [ConicSearch::Complete, ConicSearch::Published] {
            let reflected = irradiance(&mirror, &point, &conic(&mirror, "R", search), &[SpecularEvent::Reflection]);
            // The walk starts where the straight line meets the mirror, which it does not.
            let expected = if search == ConicSearch::Complete { expected } else { 0.0 };
            assert!((reflected - expected).abs() <= 1e-7 * expected, "conic, {search:?}: {reflected} {expected}");
        }
        // Refraction: angles by bisection on the lateral distance, irradiance from the width of a ring of rays.
        let lateral = (DVec2::new(0.2, 0.1) - DVec2::new(x, y)).length();
        let reach = |sine: f64| {
            let below = sine / index;
            0.8 * sine / (1.0 - sine * sine).sqrt() + below / (1.0 - below * below).sqrt()
        };
        let (mut low, mut high) = (0.0, 1.0 - 1e-12);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if reach(middle) < lateral { low = middle } else { high = middle }
        }
        let sine = low;
        let (cos_above, cos_below) = ((1.0 - sine * sine).sqrt(), (1.0 - (sine / index).powi(2)).sqrt());
        let fresnel = {
            let s = (cos_above - index * cos_below) / (cos_above + index * cos_below);
            let p = (index * cos_above - cos_below) / (index * cos_above + cos_below);
            1.0 - 0.5 * (s * s + p * p)
        };
        // dE = I dOmega / dA with dOmega = sin dtheta dphi, dA = r dr dphi.
        let by_angle = 0.8 / cos_above.powi(2) + cos_above / (index * cos_below.powi(3));
        let around = 0.8 / cos_above + 1.0 / (index * cos_below);
        let expected = fresnel / (around * by_angle);
        for estimator_name in ["sms", "mnee"] {
            let found = if estimator_name == "sms" {
                irradiance(&water, &point, &sms(&water, "T"), &[SpecularEvent::Transmission])
            } else {
                let scope = Scope::new(&water, &["T".to_owned()], None, None);
                irradiance(
                    &water,
                    &point,
                    &Mnee { missed: MissedPaths::Dropped, scope },
                    &[SpecularEvent::Transmission],
                )
            };
            assert!((found - expected).abs() < 1e-7 * expected, "{estimator_name}: {found} {expected}");
        }
        for search in [ConicSearch::Complete, ConicSearch::Published] {
            let found = irradiance(&water, &point, &conic(&water, "T", search), &[SpecularEvent::Transmission]);
            assert!((found - expected).abs() < 1e-7 * expected, "conic, {search:?}: {found} {expected}");
        }
    }
}

#[test]
fn finer_meshes_of_a_pane_throw_the_light_of_its_height_field() {
    for case in ["crown", "bump"] {
        let original = load_case(case);
        let mut errors = Vec::new();
        for cells in [128, 256, 512] {
            let meshed = as_mesh(&original, cells);
            let method = |scene: &Scene| Sms {
                constraint: ManifoldConstraint::AngleDifference,
                steps: WalkSteps::default(),
                estimator: ManifoldEstimator::Biased { trials: 400 },
                selection: PaneSelection::All,
                scope: Scope::new(scene, &["TT".to_owned()], None, None),
            };
            let (mut difference, mut sum) = (0.0, 0.0);
            for point in load_list(&format!("{case}.json")).iter().filter(|point| point.solutions.len() == 1) {
                let normal = original.triangle_normal(0);
                let to_pane = original.panes()[0].frame.point_to_world(DVec3::ZERO) - DVec3::from(point.origin);
                let normal = if normal.dot(to_pane) > 0.0 { normal } else { -normal };
                let shading =
                    ShadingPoint { position: point.origin.into(), normal, leaving: Leaving::Triangle(0), bounces: 0 };
                let through = [SpecularEvent::Transmission; 2];
                let found = irradiance(&meshed, &shading, &method(&meshed), &through);
                let expected = irradiance(&original, &shading, &method(&original), &through);
                difference += (found - expected).abs();
                sum += expected;
            }
            errors.push(difference / sum);
        }
        println!("{case}: mean relative difference {errors:?} for 128, 256 and 512 cells");
        // Linear interpolation of normals is of second order, its derivative, which decides on the light, of first order.
        assert!(errors[2] < 0.3 * errors[0] && errors[2] < 0.02, "{case}: {errors:?}");
    }
}
