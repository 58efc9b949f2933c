//! Caustics of triangle meshes with interpolated normals. Manifold methods are compared with the path tracer, with
//! closed forms, and with the same glass as a height field.

use std::collections::BTreeMap;

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::geometry::{Face, Pane, SurfaceId};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::LightBounds;
use clerestory_render_core::light::Source;
use clerestory_render_core::scene::Asset;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::cache::MethodCache;
use clerestory_render_core::specular::conic::{Conic, ConicSearch};
use clerestory_render_core::specular::constraint::ManifoldConstraint;
use clerestory_render_core::specular::fermat::Connection;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::fnee::PathSearch;
use clerestory_render_core::specular::manifold::WalkSteps;
use clerestory_render_core::specular::mnee::MissedPaths;
use clerestory_render_core::specular::mnee::Mnee;
use clerestory_render_core::specular::newton::Root;
use clerestory_render_core::specular::scope::Scope;
use clerestory_render_core::specular::selection::PaneSelection;
use clerestory_render_core::specular::side::PaneSide;
use clerestory_render_core::specular::sms::ManifoldEstimator;
use clerestory_render_core::specular::sms::Sms;
use clerestory_render_core::specular::{SpecularEvent, SpecularMethod, THROUGH_PANE};
use clerestory_tests::estimate::{Agreement, Estimate, check_agreement};
use clerestory_tests::pane_mesh::as_mesh;
use clerestory_tests::rendering::block_means;
use clerestory_tests::solution_lists::{ListedPoint, ListedSolution, load_case, load_list};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde_json::{Value, json};

/// Parts of the picture along each edge.
const BLOCKS: usize = 4;

/// A grid of quads over a square around the origin, cut into triangles that are seen counterclockwise from +z, with
/// heights and normals.
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

/// A floor seen from above, 0.4 m wide, in a picture of 8 x 8 pixels, and a specular mesh.
fn scene(material: Value, mesh: Value, lights: Value, filter: &str, integrator: Value) -> PreparedScene {
    let description = json!({
        "version": 1, "name": "specular mesh", "seed": 3,
        "film": {"width": 8, "height": 8},
        "camera": {"orthographic": {"position": [0, 0, -0.9], "look_at": [0, 0, -1], "up": [0, 1, 0], "height": 0.4}},
        "integrator": integrator,
        "path_filter": filter,
        "materials": {"smooth": material, "floor": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}}},
        "meshes": [
            {"name": "floor", "material": "floor", "source": {"inline": {
                "positions": [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]],
                "triangles": [[0, 1, 2], [0, 2, 3]]}}},
            {"name": "sheet", "material": "smooth", "source": mesh},
        ],
        "lights": lights,
    });
    build(&description, BTreeMap::new())
}

fn build(description: &Value, assets: BTreeMap<String, Asset>) -> PreparedScene {
    let description = SceneDescription::parse(description.to_string().as_bytes()).expect("a valid scene");
    let bundle = SceneBundle::from_parts(description, assets).expect("no assets are missing");
    PreparedScene::build(&bundle).expect("a scene that can be built")
}

/// Checks the manifold methods, and `conic` where it can, on one chain over one specular mesh against the path tracer.
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
#[ignore = "takes a minute; `tests/run long` has it"]
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
    let panel = json!([{"rectangle": {"name": "panel", "centre": [0.5, 0, -0.7],
        "edge_u": [0.3, 0, 0.4], "edge_v": [0, 0.6, 0], "radiance": [9, 9, 9]}}]);
    let gentle = |place| {
        let (height, slope) = waves(place);
        (0.3 * height, 0.3 * slope)
    };
    check_by_chance("mirror", "R", [&mirror, &sheet(0.6, 24, gentle), &panel], false, 0.05);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
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
fn irradiance(
    scene: &PreparedScene,
    point: &ShadingPoint,
    method: &dyn SpecularMethod,
    events: &[SpecularEvent],
) -> f64 {
    let mut stream = SampleStream::new(&SamplerSettings { seed: 5, samples_per_block: 1 }, 0, [0, 0], 0);
    let mut sum = 0.0;
    method.sample_li(scene.scene(), point, 0, events, &mut stream, &mut Counters::default(), &mut |arrival| {
        sum += arrival.weight.x * arrival.direction.dot(point.normal);
    });
    let intensity = scene.scene().lights()[0].emission();
    sum / intensity.x
}

fn floor_point(x: f64, y: f64) -> ShadingPoint {
    ShadingPoint { position: DVec3::new(x, y, -1.0), normal: DVec3::Z, surface: SurfaceId::Triangle(0), bounces: 0 }
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
        let sms = |scene: &PreparedScene, chain: &str| Sms {
            constraint,
            steps: WalkSteps::default(),
            estimator,
            selection: PaneSelection::All,
            scope: Scope::new(scene.scene(), &[chain.to_owned()], None, None),
        };
        let reflected = irradiance(&mirror, &point, &sms(&mirror, "R"), &[SpecularEvent::Reflection]);
        assert!((reflected - expected).abs() < 1e-7 * expected, "{reflected} {expected}");
        // On flat triangles the curve is a straight line, and right below the light there is none.
        let conic = |scene: &PreparedScene, chain: &str, search| {
            let scope = Scope::new(scene.scene(), &[chain.to_owned()], None, None);
            Conic::new(scene.scene(), search, scope, &MethodCache::default())
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
                let scope = Scope::new(water.scene(), &["T".to_owned()], None, None);
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

/// Squares along each edge of a pane's meshes, each twice as many as those before.
const SQUARES: [u32; 3] = [128, 256, 512];

/// Walks that look for the paths over a mesh.
const WALKS: u32 = 1500;

/// A path from a point through a pane, or through its mesh.
#[derive(Clone, Copy, Debug)]
struct Path {
    /// Unit direction in which it leaves the point.
    direction: DVec3,
    /// Irradiance at the point for a light of unit intensity.
    light: f64,
}

/// A pane of the lists and its point light, by the complete search of `fnee`.
struct Glass<'a> {
    pane: &'a Pane,
    source: Source,
}

impl<'a> Glass<'a> {
    fn new(scene: &'a PreparedScene) -> Self {
        let pane = &scene.scene().panes()[0];
        let LightBounds::Ball { centre: position, .. } = scene.scene().lights()[0].bounds() else {
            panic!("a point light")
        };
        Self { pane, source: Source::Point(pane.frame.point_to_local(position)) }
    }

    fn side(&self, origin: DVec3) -> PaneSide<'a> {
        PaneSide::facing(self.pane, origin).expect("receivers lie in front of their pane")
    }

    /// The paths to a place in the pane's frame; `None` unless it is known that these are all.
    fn paths(&self, origin: DVec3) -> Option<Vec<Root>> {
        let Some(search) = PathSearch::new(self.side(origin), origin, self.source, FneeSolver::Complete) else {
            return Some(Vec::new());
        };
        let counters = &mut Counters::default();
        let found = search.enumerate(counters);
        let lit = found.roots.into_iter().filter(|root| search.transmission(root, counters).is_some()).collect();
        found.complete.then_some(lit)
    }

    /// Whether meshes of this many squares along each edge have the paths of the height field and no others.
    ///
    /// Wrong slopes move the place at which light lands. Interpolated slopes move the point by a bounded error. If all
    /// places within that bound have as many paths, no fold of the caustic and no shadow of the border is so near. The
    /// mesh's curvatures are differences of slopes over a square. If the determinant of the optical length's Hessian
    /// keeps its sign within a square of the path, no path splits in the mesh.
    fn is_regular(&self, origin: DVec3, roots: &[Root], cells: u32) -> bool {
        let index = self.pane.index_of_refraction;
        let connection = Connection::new(&self.side(origin), origin, self.source);
        let square = self.pane.size() / f64::from(cells);
        let diagonals = [square, square * DVec2::new(1.0, -1.0)];
        // Of the slopes in the middle of a square, between its corners.
        let slope_error = |face: Face, place: DVec2| {
            let slope = |place| self.pane.surface(face).jet(place).gradient;
            let error = |by: DVec2| (0.5 * (slope(place + by * 0.5) + slope(place - by * 0.5)) - slope(place)).length();
            diagonals.map(error).into_iter().fold(0.0, f64::max)
        };
        let reach = |root: &Root| {
            let errors = slope_error(Face::Front, root.theta[0]) + slope_error(Face::Back, root.theta[1]);
            let bend = (index * index - 1.0).sqrt() * errors;
            bend * root.path.lengths[0] / root.path.directions[0].z.powi(2)
        };
        let reach = roots.iter().map(reach).fold(0.0, f64::max);
        let has_as_many = |k: u32| {
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(k) / 16.0);
            self.paths(origin + DVec3::new(cos, sin, 0.0) * reach).is_some_and(|paths| paths.len() == roots.len())
        };
        let keeps_sign = |root: &Root| {
            let determinant = |by: DVec2| {
                let path = connection.path(&root.theta.map(|vertex| vertex + by), &mut Counters::default());
                path.hessian().factorise().map_or(0.0, |hessian| hessian.determinant)
            };
            diagonals.iter().all(|by| [1.0, -1.0].iter().all(|side| determinant(*by * *side) * root.determinant > 0.0))
        };
        (0..16).all(has_as_many) && roots.iter().all(keeps_sign)
    }
}

/// A point and all paths to it through the pane.
struct KnownPoint {
    point: ShadingPoint,
    paths: Vec<Path>,
    /// Index of the first mesh that has as many paths.
    first: usize,
}

/// The points of a case's lists whose paths all meshes have from some one on.
fn known_points(case: &str, original: &PreparedScene) -> Vec<KnownPoint> {
    let glass = Glass::new(original);
    let frame = &glass.pane.frame;
    let known = |listed: ListedPoint| {
        let position = DVec3::from(listed.origin);
        let origin = frame.point_to_local(position);
        let roots = glass.paths(origin)?;
        let first = SQUARES[..2].iter().position(|&squares| glass.is_regular(origin, &roots, squares))?;
        let normal = original.scene().triangle_normal(0);
        let normal = if normal.dot(frame.origin - position) > 0.0 { normal } else { -normal };
        let point = ShadingPoint { position, normal, surface: SurfaceId::Triangle(0), bounces: 0 };
        // The lists are independent of the renderer, and precise enough for the light, but not for directions.
        assert_eq!(roots.len(), listed.solutions.len(), "{case}: {position}");
        let path = |root: &Root| {
            let place = root.theta[0] / glass.pane.size() + 0.5;
            let far = |path: &ListedSolution| (DVec2::from(path.front_uv) - place).length();
            let nearest = listed.solutions.iter().min_by(|a, b| far(a).total_cmp(&far(b))).expect("as many");
            Path { direction: frame.vector_to_world(root.path.directions[0]), light: nearest.irradiance }
        };
        Some(KnownPoint { point, paths: roots.iter().map(path).collect(), first })
    };
    let lists = [format!("{case}.json"), format!("{case}-folds.json")];
    lists.iter().flat_map(|list| load_list(list)).filter_map(known).filter(|known| !known.paths.is_empty()).collect()
}

/// The paths through a pane that one estimate of a method finds; estimates of other numbers are independent.
fn found_paths(scene: &PreparedScene, point: &ShadingPoint, method: &Sms, number: [u32; 2]) -> Vec<Path> {
    let mut stream = SampleStream::new(&SamplerSettings { seed: 5, samples_per_block: 1 }, 0, number, 0);
    let intensity = scene.scene().lights()[0].emission();
    let mut paths = Vec::new();
    method.sample_li(scene.scene(), point, 0, &THROUGH_PANE, &mut stream, &mut Counters::default(), &mut |arrival| {
        let light = arrival.weight.x * arrival.direction.dot(point.normal) / intensity.x;
        paths.push(Path { direction: arrival.direction, light });
    });
    paths
}

fn through_meshes(scene: &PreparedScene, constraint: ManifoldConstraint, estimator: ManifoldEstimator) -> Sms {
    let scope = Scope::new(scene.scene(), &["TT".to_owned()], None, None);
    Sms { constraint, steps: WalkSteps::default(), estimator, selection: PaneSelection::All, scope }
}

/// Checks that estimates of an order of convergence agree with what it should be, and with no other whole number.
#[track_caller]
fn check_order(name: &str, orders: &[f64], expected: f64) {
    let order = Estimate::of(orders);
    let agrees = |expected| Agreement::of(&[order], &[Estimate::exact(expected)]).holds();
    println!("{name}: of order {:.3} +- {:.3}", order.mean, order.variance.sqrt());
    assert!(agrees(expected), "{name}: of order {order}, not {expected}");
    for other in [expected - 1.0, expected + 1.0] {
        assert!(!agrees(other), "{name}: order {other} would not be noticed: {order}");
    }
}

/// Checks that finer and finer meshes of a pane have its paths, and that these converge at the right order. Normals are
/// interpolated linearly, so the error of directions is the square of a square's edge. Light depends on derivatives of
/// normals, so its error is the edge. The error depends on the place of the path in a triangle. So the orders are means
/// over paths, each compared with itself in the finest mesh. There the light has to be right on average.
#[track_caller]
fn check_finer_meshes(case: &str, several: usize) {
    let original = load_case(case);
    let known = known_points(case, &original);
    let count = known.iter().filter(|known| known.paths.len() > 1).count();
    println!("{case}: {} points, {count} with several paths", known.len());
    assert!(count >= several, "{case}: {count} points with several paths");
    let meshes = SQUARES.map(|squares| as_mesh(&original, squares));
    for constraint in [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector] {
        let methods =
            [0, 1, 2].map(|k| through_meshes(&meshes[k], constraint, ManifoldEstimator::Biased { trials: WALKS }));
        // Of a path, in each mesh that has it: how far its direction is off, and the known light over the light found.
        let comparisons = |known: &KnownPoint| -> Vec<Vec<(f64, f64)>> {
            let by_mesh = |mesh: usize| {
                let found = found_paths(&meshes[mesh], &known.point, &methods[mesh], [0; 2]);
                let (position, squares) = (known.point.position, SQUARES[mesh]);
                assert_eq!(
                    found.len(),
                    known.paths.len(),
                    "{case}, {squares} squares, {constraint:?}: paths to {position}"
                );
                found
            };
            let found: Vec<Vec<Path>> = (known.first..SQUARES.len()).map(by_mesh).collect();
            let compared = |path: &Path, found: &Vec<Path>| {
                let off = |other: &&Path| (other.direction - path.direction).length();
                let nearest = found.iter().min_by(|a, b| off(a).total_cmp(&off(b))).expect("as many paths");
                (off(&nearest), path.light / nearest.light)
            };
            known.paths.iter().map(|path| found.iter().map(|found| compared(path, found)).collect()).collect()
        };
        let paths: Vec<Vec<(f64, f64)>> = known.par_iter().flat_map_iter(comparisons).collect();
        let orders = |error: fn(&(f64, f64)) -> f64| -> Vec<f64> {
            let order = |path: &Vec<(f64, f64)>| {
                let halvings = path.len() - 1;
                libm::log2(error(&path[0]) / error(&path[halvings])) / halvings as f64
            };
            paths.iter().map(order).collect()
        };
        check_order(&format!("{case}, {constraint:?}, directions"), &orders(|(direction, _)| *direction), 2.0);
        check_order(&format!("{case}, {constraint:?}, light"), &orders(|(_, light)| (light - 1.0).abs()), 1.0);
        // One over the light is proportional to a determinant, in which the errors of curvatures average out.
        let finest: Vec<f64> = paths.iter().filter_map(|path| path.last()).map(|(_, light)| *light).collect();
        let name = format!("{case}, {constraint:?}, the finest mesh");
        check_agreement(&name, &[Estimate::of(&finest)], &[Estimate::exact(1.0)], FAULT);
    }
}

/// Part of the light by which faults have to be noticed: that of a missing Fresnel factor.
const FAULT: f64 = 0.042;

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn finer_meshes_of_a_pane_throw_the_light_of_its_height_field() {
    check_finer_meshes("crown", 60);
    check_finer_meshes("bump", 45);
    check_finer_meshes("cathedral", 4);
}

#[test]
fn weighted_walks_find_the_light_of_a_height_field_in_its_mesh() {
    const ESTIMATES: u32 = 600;
    let case = "bump";
    let original = load_case(case);
    let mesh = as_mesh(&original, SQUARES[SQUARES.len() - 1]);
    for constraint in [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector] {
        let method = through_meshes(&mesh, constraint, ManifoldEstimator::Unbiased { max_trials: 1_000_000 });
        let total = |paths: &[Path]| paths.iter().map(|path| path.light).sum::<f64>();
        let known = known_points(case, &original);
        // What the mesh's squares make of the light of single points is part of the spread over the points.
        let relative = |(index, known): (usize, &KnownPoint)| {
            let found = (0..ESTIMATES)
                .map(|estimate| total(&found_paths(&mesh, &known.point, &method, [index as u32, estimate])));
            found.sum::<f64>() / (f64::from(ESTIMATES) * total(&known.paths))
        };
        let points: Vec<f64> = known.par_iter().enumerate().map(relative).collect();
        let name = format!("{case}, {constraint:?}, weighted walks to {} points", points.len());
        check_agreement(&name, &[Estimate::of(&points)], &[Estimate::exact(1.0)], FAULT);
    }
}
