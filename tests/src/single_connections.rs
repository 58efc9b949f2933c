//! The light of single connections between a point of a receiver and a point of a light, relative to what a complete search
//! finds there.
//!
//! Near a fold, the light of a path has no finite mean square over a picture. A method that also weights it by an estimate of
//! 1/p cannot be told from one that is a thousandth too dark by any number of samples that can be rendered. Divided by the
//! light of its own connection, a path has such a tail no more: what is left is the noise of the estimate. So methods are held
//! here, connection by connection, to the complete search of `fnee`, which the bias test holds to light traced forward.

use std::fmt;

use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{SampleStream, SamplerSettings};
use clerestory_render_core::geometry::Leaving;
use clerestory_render_core::integrator::specular_method;
use clerestory_render_core::optics::{Source, light_sampling::SourceSample};
use clerestory_render_core::scene::description::{CameraDescription, FneeSolver};
use clerestory_render_core::scene::{Scene, load};
use clerestory_render_core::specular::{
    ShadingPoint, SpecularMethod, THROUGH_PANE, fnee::PathSearch, newton::Root, side::PaneSide,
};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::comparisons::reference_folder;
use crate::estimate::{Agreement, Estimate};
use crate::methods;
use crate::random::Random;

/// Independent sets of connections, from whose spread the standard errors come.
const REPLICATES: u32 = 32;

/// Searches for a path that one search found, at the most.
const MOST_TRIALS: u32 = 10_000_000;

/// Light relative to that of the known paths of its connection, means over connections.
#[derive(Clone, Debug)]
pub struct RelativeLight {
    /// What the method finds.
    pub ours: Estimate,
    /// What is there: the known paths, and an estimate of the others.
    pub theirs: Estimate,
    /// What is there but for the saddles of the optical length.
    pub without_saddles: Estimate,
}

impl RelativeLight {
    /// Whether the method finds what is there, as far as can be told.
    pub fn agrees(&self) -> bool {
        Agreement::of(&[self.ours], &[self.theirs]).holds()
    }

    /// How much of the light the method finds, and the combined standard error.
    pub fn ratio(&self) -> (f64, f64) {
        let Agreement { ratio, error, .. } = Agreement::of(&[self.ours], &[self.theirs]);
        (ratio, error)
    }

    /// Whether light that is `1 + fault` times as bright or as dark would be rejected, and light without saddles where they
    /// carry more than that.
    pub fn would_notice(&self, fault: f64) -> bool {
        let rejected = |ours: Estimate, theirs: Estimate| !Agreement::of(&[ours], &[theirs]).holds();
        let scaled = [1.0 + fault, 1.0 / (1.0 + fault)].map(|factor| rejected(self.ours.scaled(factor), self.theirs));
        let has_saddles = self.without_saddles.mean * (1.0 + fault) < self.theirs.mean;
        scaled == [true; 2] && (!has_saddles || rejected(self.ours, self.without_saddles))
    }
}

impl fmt::Display for RelativeLight {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let agreement = Agreement::of(&[self.ours], &[self.theirs]);
        write!(
            formatter,
            "{agreement}, {:.2} % in saddles",
            100.0 * (1.0 - self.without_saddles.mean / self.theirs.mean)
        )
    }
}

/// A pane, a receiver and a light of the reference scenes, and a method.
pub struct Connections {
    /// Name of the method, of the case and of the light.
    pub name: String,
    scene: Scene,
    /// Middle and half the edge of the part of the receiver that the picture shows.
    middle: DVec3,
    half: f64,
}

/// Sums over connections.
#[derive(Clone, Copy, Default)]
struct Sums {
    ours: f64,
    theirs: f64,
    saddles: f64,
    connections: f64,
}

/// Name of the connections of a case under a light, for a method.
pub fn connections_name(case: &str, light: &str, method: &str) -> String {
    format!("{method} {case}-{light}, single connections")
}

impl Connections {
    /// Those of a case (`crown`, `bump`, `flat`, `cathedral`) under a light (`point`, `sphere`, `sun`), for a method (a name of
    /// [`methods::settings`]) that draws a point of the light first.
    ///
    /// # Panics
    ///
    /// When there is no such scene or method.
    pub fn new(case: &str, light: &str, method: &str) -> Self {
        let bundle = load(&reference_folder().join(format!("{case}-{light}.json"))).expect("the scene ships");
        let CameraDescription::Orthographic { look_at, height, .. } = &bundle.description().camera else {
            panic!("the reference scenes have orthographic cameras")
        };
        let (middle, half) = (DVec3::from(*look_at), 0.5 * height);
        let mut description = bundle.description().clone();
        description.integrator = methods::integrator(method, description.integrator.max_depth());
        let bundle = bundle.with_description(description).expect("the changed scene is valid");
        let scene = Scene::build(&bundle).expect("the scene can be built");
        Self { name: connections_name(case, light, method), scene, middle, half }
    }

    /// The light that the method finds over about `count` connections, and what is there.
    ///
    /// # Panics
    ///
    /// When the method is path tracing alone, or a path is found once and never again.
    pub fn relative_light(&self, count: u32, seed: u64) -> RelativeLight {
        let method = specular_method(&self.scene).expect("a specular method");
        let each = count.div_ceil(REPLICATES);
        let sums: Vec<Sums> = (0..REPLICATES)
            .into_par_iter()
            .map(|replicate| {
                let mut random = Random::new(seed, u64::from(replicate));
                let mut sums = Sums::default();
                for index in 0..each {
                    self.connect(&*method, [index, replicate], seed, &mut random, &mut sums);
                }
                sums
            })
            .collect();
        let mean = |value: fn(&Sums) -> f64| {
            Estimate::of(&sums.iter().map(|sums| value(sums) / sums.connections).collect::<Vec<_>>())
        };
        RelativeLight {
            ours: mean(|sums| sums.ours),
            theirs: mean(|sums| sums.theirs),
            without_saddles: mean(|sums| sums.theirs - sums.saddles),
        }
    }

    fn connect(&self, method: &dyn SpecularMethod, number: [u32; 2], seed: u64, random: &mut Random, sums: &mut Sums) {
        let counters = &mut Counters::default();
        let offset = DVec2::new(random.uniform(), random.uniform()) * 2.0 - 1.0;
        let position = self.middle + offset.extend(0.0) * self.half;
        let point = ShadingPoint { position, normal: DVec3::Z, leaving: Leaving::Triangle(0), bounces: 0 };
        let settings = SamplerSettings { seed, samples_per_block: 1 };
        let stream = || SampleStream::new(&settings, 0, number, 0);
        let (centre, radius) = self.scene.specular_ball();
        // The first thing that a method draws is the point of the light.
        let sample = self.scene.lights()[0].sample_source(centre, radius, stream().next_2d());
        let pane = &self.scene.panes()[0];
        let origin = pane.frame.point_to_local(position);
        let source = match sample.source {
            Source::Point(place) => Source::Point(pane.frame.point_to_local(place)),
            Source::Direction(direction) => Source::Direction(pane.frame.vector_to_local(direction)),
        };
        let Some(side) = PaneSide::facing(pane, origin) else { return };
        let Some(search) = PathSearch::new(side, origin, source, FneeSolver::Complete) else { return };
        let known = search.enumerate(counters).roots;
        let light = |root: &Root, counters: &mut Counters| light_of(&search, root, &sample, counters);
        let lights: Vec<f64> = known.iter().map(|root| light(root, counters)).collect();
        let whole: f64 = lights.iter().sum();
        // Which connections are looked at is a function of the connection alone.
        if whole <= 0.0 {
            return;
        }
        let mut solve =
            |counters: &mut Counters| search.solve(|| DVec2::new(random.uniform(), random.uniform()), counters);
        let mut others = 0.0;
        if let Some(root) = solve(counters)
            && !known.iter().any(|known| search.same(known, &root))
        {
            let found = light(&root, counters);
            if found > 0.0 {
                let mut again =
                    |counters: &mut Counters| solve(counters).is_some_and(|other| search.same(&root, &other));
                let trials = (1..=MOST_TRIALS).find(|_| again(counters));
                others = found * f64::from(trials.expect("a path that was found once is found again"));
            }
        }
        let mut ours = 0.0;
        method.gather(&self.scene, &point, 0, &THROUGH_PANE, &mut stream(), counters, &mut |arrival| {
            ours += arrival.weight.x * arrival.direction.z;
        });
        let saddles = known.iter().zip(&lights).filter(|(root, _)| root.determinant < 0.0).map(|(_, light)| light);
        sums.ours += ours / whole;
        sums.theirs += 1.0 + others / whole;
        sums.saddles += saddles.sum::<f64>() / whole;
        sums.connections += 1.0;
    }
}

/// Irradiance of the red channel by a path, over the density of its point on the light; zero when it is no path of light.
fn light_of(search: &PathSearch<'_>, root: &Root, sample: &SourceSample, counters: &mut Counters) -> f64 {
    let Some(through) = search.transmission(root, counters) else { return 0.0 };
    let frame = &search.side().pane.frame;
    let [first, last] = [0, 2].map(|segment| frame.vector_to_world(root.path.directions[segment]));
    let light_cosine = sample.normal.map_or(1.0, |normal| -normal.dot(last)).max(0.0);
    let factor = root.path.geometry_factor(root.determinant) * light_cosine;
    sample.weight.x * through.transmittance.x * factor * first.z
}
