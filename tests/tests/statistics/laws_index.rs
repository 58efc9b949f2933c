//! The index theorem (T8): of all paths through an unclipped pane, minima and maxima of the optical length outnumber
//! saddles by one.
//!
//! Connections are drawn so that the whole deflection window lies on the pane. For a method that finds all paths, the
//! sum of their indices is then one. Another sum says that some are missing. The converse does not hold: pairs born at
//! a fold have the sum zero.

use clerestory_film::counters::Counters;
use clerestory_render_core::geometry::{Pane, SurfaceId};
use clerestory_render_core::light::Source;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::fnee::PathSearch;
use clerestory_render_core::specular::newton::Root;
use clerestory_render_core::specular::side::PaneSide;
use clerestory_render_core::specular::window::{SourceBounds, Window};
use clerestory_tests::methods::biased_sms;
use clerestory_tests::pane_scene::{PaneScene, gather, pane};
use clerestory_tests::random::Random;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// Edge of the pane, metres.
const EDGE: f64 = 0.4;

/// Further than this from the outline, metres, neither the border of the height fields nor the slab's shift matters.
const BORDER: f64 = 0.01;

/// Queries of which every path is enumerated, and those of them on which random searches are tried. A quarter of the
/// latter is arbitrary, and the others have several paths.
const QUERIES: usize = 400;
const SEARCHED: usize = 40;

/// Seeds in the window where the enumeration is not complete, and seeds anywhere on the pane for the random searches.
const WINDOW_SEEDS: u32 = 2000;
const SEEDS: u32 = 500;

struct Query {
    origin: DVec3,
    source: DVec3,
}

/// Connections whose windows lie on the pane.
fn queries(glass: &Pane) -> Vec<Query> {
    let mut random = Random::new(31, 0);
    let inside = 0.5 * EDGE - BORDER;
    let mut queries = Vec::new();
    while queries.len() < QUERIES {
        let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
        let through = DVec3::new(between(-0.1, 0.1), between(-0.1, 0.1), 0.0);
        let direction = DVec3::new(between(-0.4, 0.4), between(-0.4, 0.4), 1.0);
        let (origin, source) = (through - direction * between(0.3, 1.5), through + direction * between(0.3, 3.0));
        let Some(side) = PaneSide::facing(glass, origin) else { continue };
        let bounds = SourceBounds::Ball { centre: source, radius: 0.0 };
        let Some(window) = Window::new(&side, origin, &bounds) else { continue };
        let rect = window.rect();
        if rect.min.abs().max(rect.max.abs()).max_element() < inside {
            queries.push(Query { origin, source });
        }
    }
    queries
}

/// Number of minima, saddles and maxima.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Kinds([usize; 3]);

impl Kinds {
    fn of<'a>(roots: impl IntoIterator<Item = &'a Root>) -> Self {
        let mut kinds = Self::default();
        for root in roots {
            let hessian = root.path.hessian();
            let reduced = hessian.near - hessian.mixed * hessian.far.inverse() * hessian.mixed.transpose();
            let kind = if root.determinant < 0.0 {
                1
            } else if reduced.x_axis.x < 0.0 {
                2
            } else {
                0
            };
            kinds.0[kind] += 1;
        }
        kinds
    }

    fn index(&self) -> i64 {
        let [minima, saddles, maxima] = self.0.map(|count| count as i64);
        minima - saddles + maxima
    }

    fn count(&self) -> usize {
        self.0.iter().sum()
    }
}

/// What a search has found over all queries.
fn report(name: &str, found: &[Kinds]) -> f64 {
    let whole = found.iter().filter(|kinds| kinds.index() == 1).count() as f64 / found.len() as f64;
    let sums = found.iter().fold([0; 3], |sum, kinds| [0, 1, 2].map(|kind| sum[kind] + kinds.0[kind]));
    println!(
        "{name}: {} queries, {:.1} percent with index 1; minima, saddles and maxima: {sums:?}",
        found.len(),
        100.0 * whole
    );
    whole
}

/// Paths of a query that random seeds of the published solver find.
fn published(glass: &Pane, query: &Query, random: &mut Random) -> Kinds {
    let side = PaneSide::facing(glass, query.origin).expect("the query is in front of the pane");
    let search = PathSearch::new(side, query.origin, Source::Point(query.source), FneeSolver::Published);
    let search = search.expect("the query has a window");
    let counters = &mut Counters::default();
    let mut found: Vec<Root> = Vec::new();
    for _ in 0..SEEDS {
        let seed = || DVec2::new(random.uniform(), random.uniform());
        if let Some(root) = search.solve(seed, counters)
            && search.transmission(&root, counters).is_some()
            && !found.iter().any(|known| search.same(known, &root))
        {
            found.push(root);
        }
    }
    Kinds::of(&found)
}

/// Those of the enumerated paths that walks over the manifold find; each of their arrivals has to be one of them.
fn walked(scene: &PaneScene, query: &Query, roots: &[Root]) -> Kinds {
    let light = json!({"point": {"name": "lamp", "position": query.source.to_array(), "intensity": [1, 1, 1]}});
    let scene = PaneScene { lights: vec![light], distance: 5.0, ..scene.clone() };
    let point = ShadingPoint { position: query.origin, normal: DVec3::Z, surface: SurfaceId::Nothing, bounces: 0 };
    let built = scene.build(&biased_sms("angle_difference", SEEDS), 1);
    let arrivals = gather(&built, &point, 0, &mut Counters::default());
    Kinds::of(arrivals.iter().filter_map(|(direction, _)| {
        let nearest = |root: &&Root| (root.path.directions[0] - *direction).length() < 1e-8;
        let root = roots.iter().find(nearest);
        assert!(
            root.is_some(),
            "a walk has found a path that was not enumerated, from {} along {direction}",
            query.origin
        );
        root
    }))
}

/// Least part of the queries of which walks find all paths. If one walk in a hundred leads to a path, [`SEEDS`] walks
/// miss it less than once in a hundred times. Few paths are as rare.
const LEAST_WALKED: f64 = 0.95;

/// Checks the index sum of all queries through a pane both faces of which have this profile. The published search has
/// to find all paths of the part `least_found` of them: it misses most maxima.
#[track_caller]
fn check(name: &str, [front, back]: [Value; 2], least_paths: f64, least_found: f64) {
    let light = json!({"point": {"name": "lamp", "position": [0, 0, 1], "intensity": [1, 1, 1]}});
    let scene = PaneScene::new(vec![pane("pane", [0.0; 3], [EDGE; 2], 0.003, [front, back])], light);
    let built = scene.build(&json!({"fnee": {}}), 1);
    let glass = &built.scene().panes()[0];
    let counters = &mut Counters::default();
    let mut random = Random::new(37, 0);
    let (mut enumerated, mut sought, mut by_published, mut by_walks) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut complete = 0;
    for (number, query) in queries(glass).iter().enumerate() {
        let side = PaneSide::facing(glass, query.origin).expect("the query is in front of the pane");
        let source = Source::Point(query.source);
        let search = PathSearch::new(side, query.origin, source, FneeSolver::Complete);
        let search = search.expect("the query has a window");
        let enumeration = search.enumerate(counters);
        let mut roots: Vec<Root> = enumeration.roots.into_iter().filter(|root| root.path.crosses(1.0)).collect();
        let kinds = Kinds::of(&roots);
        if enumeration.complete {
            complete += 1;
            assert_eq!(kinds.index(), 1, "{name}: {kinds:?} from {} to {}", query.origin, query.source);
        }
        enumerated.push(kinds);
        if !enumeration.complete {
            // The method goes on with random seeds.
            for _ in 0..WINDOW_SEEDS {
                let seed = || DVec2::new(random.uniform(), random.uniform());
                if let Some(root) = search.solve(seed, counters)
                    && root.path.crosses(1.0)
                    && !roots.iter().any(|known| search.same(known, &root))
                {
                    roots.push(root);
                }
            }
        }
        sought.push(Kinds::of(&roots));
        if by_walks.len() < SEARCHED && (roots.len() > 1 || number < SEARCHED / 4) {
            by_published.push(published(glass, query, &mut random));
            by_walks.push(walked(&scene, query, &roots));
        }
    }
    report(&format!("{name}, fnee's enumeration, {complete} proven complete"), &enumerated);
    let whole =
        report(&format!("{name}, fnee's enumeration and {WINDOW_SEEDS} seeds where it is not complete"), &sought);
    assert!(whole > 0.99, "{name}: {whole}");
    let paths: usize = sought.iter().map(Kinds::count).sum();
    assert!(paths as f64 > least_paths * QUERIES as f64, "{name}: {paths} paths");
    let walked = report(&format!("{name}, sms, {SEEDS} walks"), &by_walks);
    assert!(walked >= LEAST_WALKED, "{name}: {walked}");
    let found = report(&format!("{name}, fnee as published, {SEEDS} seeds"), &by_published);
    // The index of minima alone is their number.
    let several = sought.iter().filter(|kinds| kinds.count() > 1).count() as f64 / QUERIES as f64;
    let without_saddles = sought.iter().map(|kinds| Kinds([kinds.0[0], 0, kinds.0[2]]));
    let noticed = without_saddles.filter(|kinds| kinds.index() != 1).count() as f64 / QUERIES as f64;
    println!("{name}: {:.1} percent of the queries have several paths", 100.0 * several);
    assert!(noticed >= 0.99 * several, "{name}: lost saddles are noticed in {noticed} of {several}");
    assert!(found >= least_found, "{name}: {found}");
}

#[test]
fn the_indices_of_all_paths_through_gentle_glass_sum_to_one() {
    let crown = |seed| json!({"crown": {"centre": [0.3, 0.2], "wavelength": 0.08, "amplitude": 2.5e-4, "seed": seed}});
    check("crown", [crown(1), crown(2)], 1.005, 0.8);
}

#[test]
fn the_indices_of_all_paths_through_rippled_glass_sum_to_one() {
    let cylinder = |axis: f64| json!({"cylinder": {"axis": axis, "wavelength": 0.04, "amplitude": 2e-4, "seed": 3}});
    check("cylinder", [cylinder(0.0), cylinder(70.0)], 1.05, 0.5);
}

#[test]
fn the_indices_of_all_paths_through_hammered_glass_sum_to_one() {
    let hammered = |seed| json!({"hammered": {"wavelength": 0.03, "amplitude": 5e-5, "seed": seed}});
    check("hammered", [hammered(8), hammered(9)], 1.3, 0.2);
}
