//! Fixed connection problems: which paths a method finds from points of the receivers through old glass to a point
//! light.
//!
//! The points are those of the solution lists, and the random numbers are the same every time. So the paths are a
//! property of a method. The time to find them can be compared between two versions of the code that find the same
//! paths.

use std::time::{Duration, Instant};

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::document::load;
use clerestory_render_core::geometry::SurfaceId;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::scene::description::ProfileDescription;
use clerestory_render_core::specular::constraint::ManifoldConstraint;
use clerestory_render_core::specular::fnee::Fnee;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::manifold::WalkSteps;
use clerestory_render_core::specular::scope::Scope;
use clerestory_render_core::specular::selection::PaneSelection;
use clerestory_render_core::specular::sms::ManifoldEstimator;
use clerestory_render_core::specular::sms::Sms;
use clerestory_render_core::specular::{SpecularMethod, THROUGH_PANE};
use glam::DVec3;

use crate::comparisons::reference_folder;
use crate::solution_lists::{load_case, load_list};

/// The glass through which paths are sought.
pub const GLASS: [&str; 4] = ["crown", "bump", "cathedral", "fine"];

/// The methods that seek them.
pub const METHODS: [&str; 3] = ["fnee-complete", "fnee-published", "sms"];

/// A path that was found: the index of its point, and where it crosses the plane through the pane's centre, nanometres.
pub type FoundPath = (usize, [i64; 2]);

/// Paths from one point that differ by less than this, nanometres, are the same. Solvers stop a third of a nanometre
/// from a path, and distinguish paths that are 30 nanometres apart.
const SAME_PATH: i64 = 3;

/// The problems of one kind of glass.
pub struct Problems {
    scene: PreparedScene,
    points: Vec<[f64; 3]>,
}

/// What one run of a method over problems gave.
#[derive(Clone, Debug)]
pub struct Found {
    /// The distinct paths, in order.
    pub paths: Vec<FoundPath>,
    /// A hash of the bits of all light that arrived, in order.
    pub light: u64,
    /// The work.
    pub counters: Counters,
    /// How long it took.
    pub time: Duration,
}

/// The problems of one of [`GLASS`].
///
/// # Panics
///
/// When there is no such glass.
pub fn problems(glass: &str) -> Problems {
    let (scene, list) = match glass {
        "fine" => (fine_glass(), "crown-folds.json"),
        "crown" => (load_case(glass), "crown-folds.json"),
        "bump" => (load_case(glass), "bump-folds.json"),
        "cathedral" => (load_case(glass), "cathedral-folds.json"),
        _ => panic!("no glass is called {glass}"),
    };
    Problems { scene, points: load_list(list).into_iter().map(|point| point.origin).step_by(4).collect() }
}

/// The pane of the case `crown` with hammered faces: dimples of less than a centimetre.
fn fine_glass() -> PreparedScene {
    let bundle = load(&reference_folder().join("crown-point.json")).expect("the scene ships");
    let mut description = bundle.description().clone();
    let hammered = |seed| ProfileDescription::Hammered { wavelength: 0.008, amplitude: 3e-6, seed };
    (description.panes[0].front, description.panes[0].back) = (hammered(1), hammered(2));
    // The height maps are used no more, and those of a bundle are just those which its description names.
    let bundle = bundle.with_description(description).expect("the description is valid");
    PreparedScene::build(&bundle).expect("the scene is valid")
}

impl Problems {
    /// One of [`METHODS`].
    ///
    /// # Panics
    ///
    /// When there is no such method.
    pub fn method(&self, name: &str) -> Box<dyn SpecularMethod> {
        let fnee = |solver| Fnee { solver, selection: PaneSelection::All, max_trials: 1000, reflected: false };
        match name {
            "fnee-complete" => Box::new(fnee(FneeSolver::Complete)),
            "fnee-published" => Box::new(fnee(FneeSolver::Published)),
            "sms" => Box::new(Sms {
                constraint: ManifoldConstraint::AngleDifference,
                steps: WalkSteps::default(),
                estimator: ManifoldEstimator::Unbiased { max_trials: 1000 },
                selection: PaneSelection::All,
                scope: Scope::new(self.scene.scene(), &["TT".to_owned()], None, None),
            }),
            _ => panic!("no method is called {name}"),
        }
    }

    /// Lets a method seek the paths of all points, with the random numbers of `samples` camera samples each.
    pub fn solve(&self, method: &dyn SpecularMethod, samples: u32) -> Found {
        let settings = SamplerSettings { seed: 11, samples_per_block: 256 };
        let frame = self.scene.scene().accelerator().panes()[0].frame;
        let mut found = Found { paths: Vec::new(), light: 0, counters: Counters::default(), time: Duration::default() };
        let mut arrivals = Vec::new();
        for (index, origin) in self.points.iter().enumerate() {
            let position = DVec3::from(*origin);
            let normal = self.scene.scene().triangle_normal(0);
            let normal = if normal.dot(frame.origin - position) > 0.0 { normal } else { -normal };
            let point = ShadingPoint { position, normal, surface: SurfaceId::Triangle(0), bounces: 0 };
            let start = Instant::now();
            for sample in 0..samples {
                let mut stream = SampleStream::new(&settings, 0, [index as u32, 0], sample);
                let arrive = &mut |arrival| arrivals.push(arrival);
                method.sample_li(
                    self.scene.scene(),
                    &point,
                    0,
                    &THROUGH_PANE,
                    &mut stream,
                    &mut found.counters,
                    arrive,
                );
            }
            found.time += start.elapsed();
            let origin = frame.point_to_local(position);
            for arrival in arrivals.drain(..) {
                let direction = frame.vector_to_local(arrival.direction);
                let place = origin - direction * (origin.z / direction.z);
                let path = (index, [place.x, place.y].map(|metres| libm::round(metres * 1e9) as i64));
                if !holds(&found.paths, &path) {
                    found.paths.push(path);
                }
                for number in arrival.direction.to_array().into_iter().chain(arrival.weight.to_array()) {
                    // The hash of Fowler, Noll and Vo, by words.
                    found.light = (found.light ^ number.to_bits()).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
                }
            }
        }
        found.paths.sort_unstable();
        found
    }
}

/// Whether a path is among others.
fn holds(paths: &[FoundPath], (point, place): &FoundPath) -> bool {
    let same =
        |(at, other): &FoundPath| at == point && (0..2).all(|axis| (other[axis] - place[axis]).abs() <= SAME_PATH);
    paths.iter().any(same)
}

/// Whether two lists hold the same paths.
pub fn agree(first: &[FoundPath], second: &[FoundPath]) -> bool {
    first.len() == second.len() && first.iter().all(|path| holds(second, path))
}

/// Paths as text, one in a line: index of the point and both coordinates.
pub fn write_list(paths: &[FoundPath]) -> String {
    paths.iter().map(|(point, [x, y])| format!("{point} {x} {y}\n")).collect()
}

/// What [`write_list`] has written.
///
/// # Panics
///
/// When the text is no such list.
pub fn read_list(text: &str) -> Vec<FoundPath> {
    let path = |line: &str| {
        let [point, x, y] = line.split(' ').map(|word| word.parse().expect("a number")).collect::<Vec<i64>>()[..]
        else {
            panic!("three numbers instead of {line:?}")
        };
        (point as usize, [x, y])
    };
    text.lines().map(path).collect()
}
