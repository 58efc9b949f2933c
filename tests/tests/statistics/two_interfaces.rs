//! Paths through both faces of old glass, found along curves. They are compared with lists found by brute force, and
//! with the paths that random walks find through the same glass as a mesh.

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::geometry::SurfaceId;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::LightBounds;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::constraint::ManifoldConstraint;
use clerestory_render_core::specular::manifold::WalkSteps;
use clerestory_render_core::specular::scope::Scope;
use clerestory_render_core::specular::selection::PaneSelection;
use clerestory_render_core::specular::sms::ManifoldEstimator;
use clerestory_render_core::specular::sms::Sms;
use clerestory_render_core::specular::{SpecularMethod, THROUGH_PANE};
use clerestory_tests::comparisons::reference_folder;
use clerestory_tests::forward_tracer::LightSample;
use clerestory_tests::pane_mesh::as_mesh;
use clerestory_tests::solution_lists::{load_case, load_list};
use clerestory_tests::traced_scene::TracedScene;
use clerestory_tests::two_interfaces::TwoInterfaces;
use glam::{DVec2, DVec3};

/// Cells along each edge of the pane.
const CELLS: usize = 384;

/// Places nearer than this, metres, are the same.
const SAME: f64 = 1e-7;

/// Whether the grid need not tell a path apart: it is at the border, or next to another one.
fn is_hidden(path: DVec2, others: &[DVec2], size: DVec2) -> bool {
    let cell = size / CELLS as f64;
    let at_border = (path.abs() + 2.0 * cell).cmpgt(0.5 * size).any();
    at_border || others.iter().any(|other| *other != path && ((*other - path) / cell).abs().max_element() < 2.0)
}

fn holds(paths: &[DVec2], path: DVec2) -> bool {
    paths.iter().any(|other| other.distance(path) < SAME)
}

/// Counts of paths.
#[derive(Default)]
struct Tally {
    known: usize,
    hidden: usize,
}

impl Tally {
    /// Checks that found and known paths are the same, except for paths that the grid need not separate.
    #[track_caller]
    fn check(&mut self, found: &[DVec2], known: &[DVec2], size: DVec2) {
        for path in found {
            // What is at the border may be cut off by rounding.
            let at_border = is_hidden(*path, &[], size);
            assert!(at_border || holds(known, *path), "a path through {path} that is not known");
        }
        for path in known {
            let hidden = is_hidden(*path, known, size);
            assert!(hidden || holds(found, *path), "the path through {path} was not found");
            self.known += 1;
            self.hidden += usize::from(hidden);
        }
    }
}

#[track_caller]
fn check_height_fields(case: &str, list: &str, step: usize) {
    let scene = TracedScene::load(&reference_folder().join(format!("{case}-point.json"))).expect("the scene ships");
    let pane = &scene.panes[0];
    let light = LightSample::Point(lamp(&load_case(case)));
    let mut tally = Tally::default();
    for point in load_list(list).iter().step_by(step) {
        let known: Vec<DVec2> =
            point.solutions.iter().map(|path| (DVec2::from(path.front_uv) - 0.5) * pane.size).collect();
        let found = TwoInterfaces::of_pane(pane, point.origin.into(), light).paths(CELLS);
        tally.check(&found, &known, pane.size);
    }
    println!("{list}: {} paths, of which {} need not be told apart", tally.known, tally.hidden);
    assert!(10 * tally.hidden < 3 * tally.known, "{list}: the grid is too coarse");
}

fn lamp(scene: &PreparedScene) -> DVec3 {
    let LightBounds::Ball { centre: position, .. } = scene.scene().lights()[0].bounds() else {
        panic!("a point light")
    };
    position
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn curves_lead_to_all_paths_through_height_fields() {
    check_height_fields("flat", "flat.json", 1);
    check_height_fields("crown", "crown.json", 1);
    check_height_fields("bump", "bump.json", 1);
    check_height_fields("cathedral", "cathedral.json", 1);
    check_height_fields("bump", "bump-folds.json", 8);
    check_height_fields("cathedral", "cathedral-folds.json", 8);
}

#[test]
fn curves_lead_to_the_paths_through_meshes_that_random_walks_find() {
    for case in ["crown", "bump"] {
        let original = load_case(case);
        let pane = &original.scene().panes()[0];
        let scene = as_mesh(&original, 128);
        let sms = Sms {
            constraint: ManifoldConstraint::AngleDifference,
            steps: WalkSteps::default(),
            estimator: ManifoldEstimator::Biased { trials: 3000 },
            selection: PaneSelection::All,
            scope: Scope::new(scene.scene(), &["TT".to_owned()], None, None),
        };
        let mut tally = Tally::default();
        for listed in load_list(&format!("{case}-folds.json")).iter().step_by(10) {
            let position = DVec3::from(listed.origin);
            let normal = scene.scene().triangle_normal(0);
            let normal = if normal.dot(pane.frame.origin - position) > 0.0 { normal } else { -normal };
            let point = ShadingPoint { position, normal, surface: SurfaceId::Triangle(0), bounces: 0 };
            let mut stream = SampleStream::new(&SamplerSettings { seed: 5, samples_per_block: 1 }, 0, [0, 0], 0);
            let mut known = Vec::new();
            let origin = pane.frame.point_to_local(position);
            sms.sample_li(
                scene.scene(),
                &point,
                0,
                &THROUGH_PANE,
                &mut stream,
                &mut Counters::default(),
                &mut |arrival| {
                    let direction = pane.frame.vector_to_local(arrival.direction);
                    known.push((origin - direction * (origin.z / direction.z)).truncate());
                },
            );
            let light = LightSample::Point(lamp(&scene));
            let found = TwoInterfaces::of_meshes(scene.scene(), &point, light, &pane.frame, pane.size()).paths(CELLS);
            tally.check(&found, &known, pane.size());
        }
        println!("{case} as a mesh: {} paths, of which {} need not be told apart", tally.known, tally.hidden);
        assert!(tally.known > 30 && 10 * tally.hidden < 3 * tally.known, "{case}: {} {}", tally.known, tally.hidden);
    }
}
