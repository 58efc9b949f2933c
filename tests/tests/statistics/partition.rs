//! Every path of light is found once: by the specular method that owns it, or by chance.

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::geometry::{Face, SurfaceId};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::{Source, SourceSample};
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::constraint::ManifoldConstraint;
use clerestory_render_core::specular::manifold::WalkSteps;
use clerestory_render_core::specular::side::PaneSide;
use clerestory_render_core::specular::sms::ManifoldSearch;
use clerestory_render_core::specular::{SpecularMethod, THROUGH_PANE};
use clerestory_tests::found_paths::{FoundPath, listed_paths};
use clerestory_tests::methods::{biased_sms, selections, settings, unbiased_integrators};
use clerestory_tests::pane_scene::{PaneScene, pane};
use clerestory_tests::random::Random;
use clerestory_tests::solution_lists::{ListedPoint, load_case_for, load_list};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// How a method finds the paths that it owns.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Finds {
    /// All of them every time.
    Surely,
    /// By random walks, some of them rarely.
    ByWalks,
    /// Some, in other places of the light than the one that is drawn first.
    ByRays,
}

/// Numbers of paths.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    /// Gathered by the method.
    gathered: u32,
    /// Left to chance.
    left: u32,
    /// Owned by the method and found so rarely that they were not gathered.
    rare: u32,
    /// Gathered, and not listed.
    unlisted: u32,
}

/// Walks of one estimate, and of the search for what it has missed.
const WALKS: u32 = 1000;

/// An estimate misses a path that this many walks find less than once in 10^9 times.
const OFTEN: u32 = 40;

/// A scene with a method and one light.
struct Partition {
    name: String,
    scene: PreparedScene,
    finds: Finds,
    /// Estimates at each point, of which each takes panes at random.
    estimates: u32,
    tally: Tally,
}

fn stream(number: [u32; 2]) -> SampleStream {
    let settings = SamplerSettings { seed: 23, samples_per_block: 1 };
    SampleStream::new(&settings, 0, number, 0)
}

impl Partition {
    fn new(name: &str, scene: PreparedScene, finds: Finds, estimates: u32) -> Self {
        Self { name: name.to_owned(), scene, finds, estimates, tally: Tally::default() }
    }

    fn method(&self) -> &dyn SpecularMethod {
        self.scene.method().expect("a specular method")
    }

    /// The point of the light that an estimate draws.
    fn source(&self, number: [u32; 2]) -> SourceSample {
        let (centre, radius) = self.scene.scene().specular_ball();
        self.scene.scene().lights()[0].sample_source(centre, radius, stream(number).next_2d())
    }

    fn owns(&self, point: &ShadingPoint, path: &FoundPath) -> bool {
        self.method().owns(self.scene.scene(), point, &path.described(), &mut Counters::default())
    }

    /// Checks that, of the given paths to a point, those are gathered that the method owns, and of all paths none that
    /// it does not.
    #[track_caller]
    fn check(&mut self, point: &ShadingPoint, index: u32, paths: &[FoundPath]) {
        let Self { name, scene, .. } = &*self;
        let mut gathered = vec![0; paths.len()];
        let mut unlisted = 0;
        for estimate in 0..self.estimates {
            let mut arrivals = Vec::new();
            let number = [index, estimate];
            let counters = &mut Counters::default();
            self.method().sample_li(
                scene.scene(),
                point,
                0,
                &THROUGH_PANE,
                &mut stream(number),
                counters,
                &mut |arrival| {
                    arrivals.push(arrival.direction);
                },
            );
            let mut times = vec![0; paths.len()];
            for direction in arrivals {
                if let Some(known) = paths.iter().position(|path| path.is_in_direction(point, direction)) {
                    times[known] += 1;
                    continue;
                }
                let followed = |end| FoundPath::followed(scene.scene(), point, direction, &THROUGH_PANE, end);
                let path = followed(None).or_else(|| followed(Some((0, self.source(number).source))));
                let path = path.expect("light that is gathered comes through a pane");
                assert!(self.owns(point, &path), "{name}, {index}: {path:?} is gathered and not owned");
                unlisted += 1;
            }
            assert!(times.iter().all(|times| *times <= 1), "{name}, {index}: {times:?} times in one estimate");
            gathered.iter_mut().zip(times).for_each(|(sum, times)| *sum += times);
        }
        let mut tally = self.tally;
        tally.unlisted += unlisted;
        for (path, times) in paths.iter().zip(gathered) {
            let owned = self.owns(point, path);
            assert!(owned || times == 0, "{name}, {index}: {path:?} is gathered and not owned");
            tally.left += u32::from(!owned);
            tally.gathered += u32::from(times > 0);
            if owned && times == 0 && self.finds == Finds::ByWalks {
                let hits = hits(scene, point, path);
                assert!(hits < OFTEN, "{name}, {index}: {path:?} is owned, found by {hits} walks and never gathered");
                tally.rare += 1;
            } else if self.finds == Finds::Surely {
                assert!(!owned || times > 0, "{name}, {index}: {path:?} is owned and never gathered");
            }
        }
        self.tally = tally;
    }
}

/// How many walks through the pane of a path find it.
fn hits(scene: &PreparedScene, point: &ShadingPoint, path: &FoundPath) -> u32 {
    let SurfaceId::Pane { index, face } = path.links[0].surface else { panic!("a path through a pane") };
    let pane = &scene.scene().panes()[index as usize];
    let constraint = ManifoldConstraint::AngleDifference;
    let Some(search) = ManifoldSearch::new(scene.scene(), point, path.source, index, constraint, WalkSteps::default())
    else {
        return 0;
    };
    let mut random = Random::new(29, 0);
    let mut is_hit = || {
        let place = (DVec2::new(random.uniform(), random.uniform()) - 0.5) * pane.size();
        let height = pane.base_height(face) + pane.surface(face).height(place);
        let entry = search.walk_towards(pane.frame.point_to_world(place.extend(height)), &mut Counters::default());
        entry.is_some_and(|entry| path.is_in_direction(point, (entry - point.position).normalize()))
    };
    (0..WALKS).map(|_| u32::from(is_hit())).sum()
}

/// Specular manifold sampling of all that many walks find, with a selection of panes.
fn many_walks(selection: &str) -> Value {
    let mut integrator = biased_sms("angle_difference", WALKS);
    integrator["sms"]["selection"] = selection.into();
    integrator
}

/// Methods that find the paths to a drawn point of a light. With them comes the number of estimates that search all of
/// a few panes.
fn methods_of_points() -> Vec<(&'static str, Value, Finds, u32)> {
    vec![
        ("fnee", settings("fnee"), Finds::Surely, 1),
        ("fnee, reflected", json!({"fnee": {"reflected": true}}), Finds::Surely, 1),
        ("fnee, sharp", settings("fnee, sharp"), Finds::Surely, 1),
        ("fnee, bleed", settings("fnee, bleed"), Finds::Surely, 40),
        ("fnee, random", settings("fnee, random"), Finds::Surely, 40),
        ("sms", many_walks("all"), Finds::ByWalks, 1),
        ("sms, sharp", many_walks("sharp"), Finds::ByWalks, 1),
        ("sms, bleed", many_walks("bleed"), Finds::ByWalks, 10),
        ("sms, random", many_walks("random"), Finds::ByWalks, 10),
        ("mnee", settings("mnee"), Finds::Surely, 1),
    ]
}

/// A point of a list.
fn shading_point(scene: &PreparedScene, listed: &ListedPoint) -> ShadingPoint {
    let position = DVec3::from(listed.origin);
    let normal = scene.scene().triangle_normal(0);
    let normal = if normal.dot(scene.scene().panes()[0].frame.origin - position) > 0.0 { normal } else { -normal };
    ShadingPoint { position, normal, surface: SurfaceId::Triangle(0), bounces: 0 }
}

/// The paths of a list to a point, in its order.
fn paths_of_list(scene: &PreparedScene, point: &ShadingPoint, listed: &ListedPoint) -> Vec<FoundPath> {
    let (centre, radius) = scene.scene().specular_ball();
    let sample = scene.scene().lights()[0].sample_source(centre, radius, DVec2::ZERO);
    let found = listed_paths(scene.scene(), point, 0, &sample, &mut Counters::default());
    let pane = &scene.scene().panes()[0];
    let place = |path: &FoundPath, link: usize| {
        pane.frame.point_to_local(path.links[link].position).truncate() / pane.size() + 0.5
    };
    let is_near = |place: DVec2, listed: [f64; 2]| (place - DVec2::from(listed)).length() <= SAME_PLACE;
    let of_solution = |[front, back]: [[f64; 2]; 2]| {
        let known = found.iter().find(|(path, _)| is_near(place(path, 0), front) && is_near(place(path, 1), back));
        known.expect("a path of the list is found").0.clone()
    };
    listed.solutions.iter().map(|solution| of_solution([solution.front_uv, solution.back_uv])).collect()
}

/// How exactly the lists say where paths cross a pane, in units of its size.
const SAME_PLACE: f64 = 1e-6;

/// The glass of the lists.
const GLASS: [&str; 4] = ["flat", "crown", "bump", "cathedral"];

/// The points of the lists of a case.
fn points_of_lists(case: &str) -> Vec<ListedPoint> {
    let folds = if case == "flat" { Vec::new() } else { load_list(&format!("{case}-folds.json")) };
    load_list(&format!("{case}.json")).into_iter().chain(folds).collect()
}

#[test]
fn of_the_listed_paths_those_are_gathered_that_are_owned() {
    for (method, integrator, finds, _) in methods_of_points() {
        let mut all = Tally::default();
        for case in GLASS {
            let name = format!("{method}, listed paths through {case}");
            let mut partition = Partition::new(&name, load_case_for(case, &integrator), finds, 1);
            let every = if finds == Finds::ByWalks { 4 } else { 1 };
            for (index, listed) in (0..).zip(&points_of_lists(case)).step_by(every) {
                let point = shading_point(&partition.scene, listed);
                let paths = paths_of_list(&partition.scene, &point, listed);
                partition.check(&point, index, &paths);
            }
            println!("{name}: {:?}", partition.tally);
            all.gathered += partition.tally.gathered;
            all.left += partition.tally.left;
        }
        assert!(all.gathered > 20 && (method != "mnee" || all.left > 20), "{method}: {all:?}");
    }
}

/// Two panes, one partly behind the other, before a light that shines past them as well.
fn two_panes(light: &Value) -> PaneScene {
    let crown = |amplitude: f64| json!({"crown": {"centre": [0.3, 0.2], "wavelength": 0.21, "amplitude": amplitude}});
    let hammered = json!({"hammered": {"wavelength": 0.26, "amplitude": 1e-3, "seed": 3}});
    let panes = vec![
        pane("near", [0.0; 3], [1.0, 0.93], 0.006, [crown(1e-3), crown(-6e-4)]),
        pane("far", [0.6, 0.1, 0.4], [1.0, 0.93], 0.006, [json!("flat"), hammered]),
    ];
    PaneScene::new(panes, light.clone())
}

/// Lights behind the panes.
fn lights() -> [(&'static str, Value); 3] {
    let place = [0.7, -0.4, 3.0];
    [
        ("lamp", json!({"point": {"name": "lamp", "position": place, "intensity": [1, 1, 1]}})),
        ("globe", json!({"sphere": {"name": "globe", "centre": place, "radius": 0.4, "radiance": [1, 1, 1]}})),
        (
            "sun",
            json!({"sun": {"name": "sun", "direction": [0.2, -0.1, 1], "angular_radius": 5, "radiance": [1, 1, 1]}}),
        ),
    ]
}

/// The place on the receiver of light that goes straight through a random pane. Methods that use the straight line
/// differ near borders, so there the place is mostly so near to a border that glass bends light by more.
fn point_in_shadow(bench: &PaneScene, scene: &PreparedScene, source: Source, index: u32) -> ShadingPoint {
    let mut random = Random::new(31, u64::from(index));
    let pane = &scene.scene().panes()[(random.uniform() * scene.scene().panes().len() as f64) as usize];
    let mut place = DVec2::new(random.uniform(), random.uniform()) - 0.5;
    if !index.is_multiple_of(4) {
        let axis = usize::from(random.uniform() < 0.5);
        place[axis] = (0.5 + BORDER * (random.uniform() - 0.5)).copysign(place[axis]);
    }
    let through = pane.frame.point_to_world((place * pane.size()).extend(0.0));
    let direction = match source {
        Source::Point(place) => through - place,
        Source::Direction(direction) => -direction,
    };
    let landing = through + direction * ((-bench.distance - through.z) / direction.z);
    bench.point([landing.x, landing.y])
}

/// Width of the strip around the border of a pane, as a part of its size.
const BORDER: f64 = 0.01;

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn of_the_paths_through_two_panes_those_are_gathered_that_are_owned() {
    for (light_name, light) in lights() {
        let bench = two_panes(&light);
        let is_lamp = light_name == "lamp";
        let rays = [("cone", settings("cone"), Finds::ByRays, 4)];
        for (method, integrator, finds, estimates) in
            methods_of_points().into_iter().chain(rays.into_iter().filter(|_| !is_lamp))
        {
            // Which pane is looked through is chance, and so is another time the point of a light with an extent.
            if !is_lamp && (method.contains("random") || method.contains("bleed")) {
                continue;
            }
            let name = format!("{method}, {light_name} behind two panes");
            let mut partition = Partition::new(&name, bench.build(&integrator, 1), finds, estimates);
            for index in 0..1000 {
                let sample = partition.source([index, 0]);
                let point = point_in_shadow(&bench, &partition.scene, sample.source, index);
                let listed = listed_paths(partition.scene.scene(), &point, 0, &sample, &mut Counters::default());
                let paths: Vec<FoundPath> = match finds {
                    Finds::ByRays => Vec::new(),
                    _ => listed.into_iter().map(|(path, _)| path).collect(),
                };
                // Many walks and many estimates take long.
                let is_slow = finds == Finds::ByWalks || estimates > 1;
                if is_slow && !index.is_multiple_of(20) && paths.iter().all(|path| partition.owns(&point, path)) {
                    continue;
                }
                partition.check(&point, index, &paths);
            }
            let tally = partition.tally;
            println!("{name}: {tally:?}");
            let leaves = method.contains("sharp") || method.contains("bleed") || method == "mnee";
            assert!(tally.gathered.max(tally.unlisted) > 20 && (tally.left > 0) == leaves, "{name}: {tally:?}");
        }
    }
}

#[test]
fn between_the_highest_and_the_lowest_point_of_a_face_all_light_is_left_to_chance() {
    for (light_name, light) in lights().into_iter().skip(1) {
        let bench = two_panes(&light);
        for (name, integrator) in unbiased_integrators().into_iter().skip(1).chain(selections()) {
            let scene = bench.build(&integrator, 1);
            let method = scene.method().expect("a specular method");
            let pane = &scene.scene().panes()[0];
            let lowest = pane.front.all_bounds().height.min;
            let mut random = Random::new(41, 0);
            let (mut paths, mut arrivals) = (0, 0);
            for index in 0..2000 {
                let place = (DVec2::new(random.uniform(), random.uniform()) - 0.5) * pane.size();
                let height = pane.surface(Face::Front).height(place);
                let position = pane.frame.point_to_world(place.extend(0.5 * (lowest + height)));
                let point = ShadingPoint { position, normal: DVec3::Z, surface: SurfaceId::Nothing, bounces: 0 };
                assert!(PaneSide::facing(pane, pane.frame.point_to_local(position)).is_none());
                let sample = scene.scene().lights()[0].sample_source(position, 1.0, stream([index, 0]).next_2d());
                let direction = match sample.source {
                    Source::Point(place) => (place - position).normalize(),
                    Source::Direction(direction) => direction,
                };
                let counters = &mut Counters::default();
                let path = FoundPath::followed(scene.scene(), &point, direction, &THROUGH_PANE, None);
                if let Some(path) =
                    path.filter(|path| matches!(path.links[0].surface, SurfaceId::Pane { index: 0, .. }))
                {
                    assert!(!method.owns(scene.scene(), &point, &path.described(), counters), "{name}, {light_name}");
                    paths += 1;
                }
                method.sample_li(
                    scene.scene(),
                    &point,
                    0,
                    &THROUGH_PANE,
                    &mut stream([index, 0]),
                    counters,
                    &mut |arrival| {
                        let path = FoundPath::followed(scene.scene(), &point, arrival.direction, &THROUGH_PANE, None);
                        let through = path.map(|path| path.links[0].surface);
                        arrivals += u32::from(matches!(through, Some(SurfaceId::Pane { index: 0, .. })));
                    },
                );
            }
            assert!(paths > 100 && arrivals == 0, "{name}, {light_name}: {arrivals} gathered, {paths} paths");
        }
    }
}

/// Relative error of the light in the lists.
const LIST_ERROR: f64 = 1e-5;

#[test]
fn one_walk_that_drops_the_rest_lacks_the_light_of_the_paths_that_it_does_not_find() {
    for case in ["crown", "bump", "cathedral"] {
        let dropping = load_case_for(case, &settings("mnee, dropped"));
        let ray_origin = load_case_for(case, &settings("mnee"));
        let [dropped, left] = [&dropping, &ray_origin].map(|scene| scene.method().expect("a specular method"));
        let intensity = dropping.scene().lights()[0].emission();
        let counters = &mut Counters::default();
        let (mut with_one, mut with_none, mut lacking) = (0, 0, 0.0);
        let several = points_of_lists(case).into_iter().filter(|listed| listed.solutions.len() > 1);
        for (index, listed) in (0..).zip(several) {
            let point = shading_point(&dropping, &listed);
            let (mut found, mut all) = (0.0, 0.0);
            dropped.sample_li(
                dropping.scene(),
                &point,
                0,
                &THROUGH_PANE,
                &mut stream([index, 0]),
                counters,
                &mut |arrival| {
                    found += arrival.weight.x * arrival.direction.dot(point.normal) / intensity.x;
                },
            );
            let (mut missed, mut owned) = (0.0, 0);
            for (path, solution) in paths_of_list(&dropping, &point, &listed).iter().zip(&listed.solutions) {
                let path = path.described();
                all += solution.irradiance;
                assert!(
                    dropped.owns(dropping.scene(), &point, &path, counters),
                    "{case}, {index}: what is dropped is owned"
                );
                if left.owns(ray_origin.scene(), &point, &path, counters) {
                    owned += 1;
                } else {
                    missed += solution.irradiance;
                }
            }
            let difference = (all - found - missed).abs();
            assert!(difference <= LIST_ERROR * all, "{case}, {index}: {found} of {all} and {missed} missed");
            assert!(owned <= 1, "{case}, {index}: one walk finds {owned} paths");
            *(if owned == 1 { &mut with_one } else { &mut with_none }) += 1;
            lacking += missed / all;
        }
        println!(
            "{case}: at {with_one} points with several paths the walk finds one of them, at {with_none} none; {:.1} \
             percent of the light is lacking",
            100.0 * lacking / f64::from(with_one + with_none)
        );
        assert!(with_one > 20, "{case}: {with_one} points only");
    }
}
