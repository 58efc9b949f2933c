//! Every connection of a receiver point to a point light through old glass, against lists found by brute force.

use clerestory_film::counters::Counters;
use clerestory_render_core::geometry::Face;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::LightBounds;
use clerestory_render_core::light::Source;
use clerestory_render_core::specular::fnee::{FneeSolver, PathSearch};
use clerestory_render_core::specular::newton::Root;
use clerestory_render_core::specular::side::PaneSide;
use clerestory_tests::random::Random;
use clerestory_tests::solution_lists::{ListedPoint, load_case, load_list};

/// A vertex this near the outline, in units of the pane's size, lies on it but for rounding. Some points of the lists
/// are images of border vertices.
const ON_THE_BORDER: f64 = 1e-12;

struct FoundSolution {
    root: Root,
    irradiance: f64,
}

/// Seeds at each point. Every listed path has a basin of more than a hundredth of the window, except at folds. So none
/// is missed by chance.
const SEEDS: u32 = 2000;

/// The search for the paths of a listed point; `None` when the bounds say that there are none.
fn search<'a>(scene: &'a PreparedScene, point: &ListedPoint, solver: FneeSolver) -> Option<PathSearch<'a>> {
    let pane = &scene.scene().accelerator().panes()[0];
    let LightBounds::Ball { centre: position, .. } = scene.scene().lights()[0].bounds() else {
        panic!("a point light")
    };
    let origin = pane.frame.point_to_local(point.origin.into());
    let source = Source::Point(pane.frame.point_to_local(position));
    let side = PaneSide::facing(pane, origin).expect("receivers lie in front of their pane");
    PathSearch::new(side, origin, source, solver)
}

fn find_all(
    scene: &PreparedScene,
    point: &ListedPoint,
    solver: FneeSolver,
    counters: &mut Counters,
) -> Vec<FoundSolution> {
    let Some(search) = search(scene, point, solver) else { return Vec::new() };
    let mut random = Random::new(7, 0);
    let mut found: Vec<FoundSolution> = Vec::new();
    for _ in 0..SEEDS {
        let seed = || seed_coordinates(&mut random);
        let Some(root) = search.solve(seed, counters) else { continue };
        if found.iter().any(|solution| search.same(&solution.root, &root)) {
            continue;
        }
        let Some(through) = search.transmission(&root, counters) else { continue };
        let cosine = root.path.directions[0].z.abs() * receiver_cosine(scene, &root);
        let irradiance = through.transmittance.x * root.path.geometry_factor(root.determinant) * cosine;
        found.push(FoundSolution { root, irradiance });
    }
    found
}

/// Counts of what enumerating by bounds finds, without any random seed.
#[derive(Default)]
struct Enumerated {
    points: usize,
    /// Points whose paths are all known by the bounds.
    complete: usize,
    /// Listed paths, at the other points, that were not among them.
    missed: usize,
}

/// Checks that an enumeration which calls itself complete has found just what `found` holds.
#[track_caller]
fn check_enumeration(scene: &PreparedScene, point: &ListedPoint, found: &[FoundSolution], tally: &mut Enumerated) {
    tally.points += 1;
    let Some(search) = search(scene, point, FneeSolver::Complete) else {
        assert!(found.is_empty(), "{} paths where the bounds allow none", found.len());
        tally.complete += 1;
        return;
    };
    let counters = &mut Counters::default();
    let enumeration = search.enumerate(counters);
    let light: Vec<&Root> =
        enumeration.roots.iter().filter(|root| search.transmission(root, counters).is_some()).collect();
    for root in &light {
        let known = found.iter().any(|solution| search.same(&solution.root, root));
        assert!(known, "the enumeration found {:?}, which no seed did", root.theta);
    }
    let missed = found.iter().filter(|solution| !light.iter().any(|root| search.same(&solution.root, root))).count();
    assert!(!enumeration.complete || missed == 0, "{missed} of {} paths missed by a complete enumeration", found.len());
    tally.complete += usize::from(enumeration.complete);
    tally.missed += missed;
}

fn on_the_border(root: &Root, size: glam::DVec2) -> bool {
    root.theta.iter().any(|vertex| {
        let margin = (0.5 - (*vertex / size).abs()).min_element();
        margin.abs() < ON_THE_BORDER
    })
}

fn seed_coordinates(random: &mut Random) -> glam::DVec2 {
    glam::DVec2::new(random.uniform(), random.uniform())
}

/// Cosine at the receiver over the cosine to the pane's axis.
fn receiver_cosine(scene: &PreparedScene, root: &Root) -> f64 {
    let normal = scene.scene().triangle_normal(0);
    let pane = &scene.scene().accelerator().panes()[0];
    let direction = pane.frame.vector_to_world(root.path.directions[0]);
    direction.dot(normal).abs() / root.path.directions[0].z.abs()
}

#[track_caller]
fn check(case: &str, list: &str) {
    let scene = load_case(case);
    let size = scene.scene().accelerator().panes()[0].size();
    let mut complete = Counters::default();
    let mut published = Counters::default();
    let (mut listed, mut missed_by_published) = (0, 0);
    let mut enumerated = Enumerated::default();
    for (index, point) in load_list(list).iter().enumerate() {
        let found = find_all(&scene, point, FneeSolver::Complete, &mut complete);
        check_enumeration(&scene, point, &found, &mut enumerated);
        let on_border = found.iter().filter(|solution| on_the_border(&solution.root, size)).count();
        assert!(
            (point.solutions.len()..=point.solutions.len() + on_border).contains(&found.len()),
            "{list}, point {index}: found {:?} ({on_border} on the border), listed {:?}",
            found.iter().map(|solution| solution.irradiance).collect::<Vec<_>>(),
            point.solutions.iter().map(|solution| solution.irradiance).collect::<Vec<_>>(),
        );
        let by_published = find_all(&scene, point, FneeSolver::Published, &mut published);
        for expected in &point.solutions {
            let matches = |solution: &&FoundSolution| {
                let uv = solution.root.theta.map(|position| position / size + 0.5);
                let far = |uv: glam::DVec2, expected: [f64; 2]| (uv - glam::DVec2::from(expected)).length() > 1e-6;
                !far(uv[0], expected.front_uv) && !far(uv[1], expected.back_uv)
            };
            let solution = found.iter().find(matches).unwrap_or_else(|| {
                panic!("{list}, point {index}: no path through {:?} {:?}", expected.front_uv, expected.back_uv)
            });
            let error = (solution.irradiance / expected.irradiance - 1.0).abs();
            assert!(error < 1e-5, "{list}, point {index}: irradiance off by {error:e}");
            listed += 1;
            missed_by_published += usize::from(!by_published.iter().any(|solution| matches(&solution)));
        }
    }
    println!(
        "{list}: all {listed} listed paths found by `complete`, {missed_by_published} missed by `published`; \
         {:.1} and {:.1} height evaluations for each converged call, {:.1} and {:.1} percent of calls converged",
        evaluations_per_success(&complete),
        evaluations_per_success(&published),
        100.0 * success(&complete),
        100.0 * success(&published),
    );
    assert!(20 * missed_by_published <= listed, "{list}: {missed_by_published} of {listed} missed by `published`");
    println!(
        "{list}: the enumeration finds all paths; the bounds know that these are all of {} of {} points",
        enumerated.complete, enumerated.points,
    );
    // Nothing says that it finds the paths where it is not complete; but on these lists it does.
    assert_eq!(enumerated.missed, 0, "{list}");
}

fn evaluations_per_success(counters: &Counters) -> f64 {
    counters.height_evaluations as f64 / counters.converged as f64
}

fn success(counters: &Counters) -> f64 {
    counters.converged as f64 / counters.solver_calls as f64
}

#[test]
fn all_paths_through_the_flat_pane_are_found() {
    check("flat", "flat.json");
}

#[test]
fn all_paths_through_the_crown_pane_are_found() {
    check("crown", "crown.json");
    check("crown", "crown-folds.json");
}

#[test]
fn all_paths_through_the_bump_pane_are_found() {
    check("bump", "bump.json");
    check("bump", "bump-folds.json");
}

#[test]
fn all_paths_through_the_cathedral_pane_are_found() {
    check("cathedral", "cathedral.json");
    check("cathedral", "cathedral-folds.json");
}

#[test]
fn the_near_face_of_a_receiver_in_front_is_the_front() {
    let scene = load_case("crown");
    let pane = &scene.scene().accelerator().panes()[0];
    let side = PaneSide::facing(pane, glam::DVec3::new(0.0, 0.0, -1.0));
    assert_eq!(side.map(|side| side.near), Some(Face::Front));
}
