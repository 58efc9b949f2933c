//! The light of single connections between a point of a receiver and a point of a light, relative to what a complete search
//! finds there.
//!
//! Near a fold, the light of a path has no finite mean square over a picture. A method that also weights it by an estimate of
//! 1/p cannot be told from one that is a thousandth too dark by any number of samples that can be rendered. Divided by the
//! light of its own connection, a path has such a tail no more: what is left is the noise of the estimate. So methods are held
//! here, connection by connection, to the complete search of `fnee`, which the bias test holds to light traced forward.
//!
//! Where paths are found so rarely that their estimates of 1/p have tails again, walks of their own, the scouts, have to find
//! each listed path of a connection twice; otherwise it is left out. N scouts keep a path of a small probability p with (N p)^2 / 2,
//! while its estimate has a mean square of about 2/p and a third moment of 6/p^2, so that both are bounded in what is kept. Of what is
//! left out some is searched with patience, so that light which walks never find would show. Of `fnee` in the room, connections are
//! left out whose enumeration is not complete: what chance adds there has the tails of 1/p again. In what is left, method and truth
//! list paths by the same search, so that this tests the choice of panes and nothing else. For `fnee` as published, which lists
//! nothing, line searches are the scouts.

use std::fmt;

use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{SampleStream, SamplerSettings};
use clerestory_render_core::geometry::{Face, Leaving, Ray, Surface};
use clerestory_render_core::integrator::specular_method;
use clerestory_render_core::optics::{LightKind, Source, light_sampling::SourceSample};
use clerestory_render_core::scene::{
    Scene,
    description::{FneeSolver, IntegratorDescription, ManifoldConstraint, WalkSteps},
};
use clerestory_render_core::specular::{
    ShadingPoint, SpecularMethod, THROUGH_PANE, fnee::PathSearch, newton::Root, side::PaneSide, sms::ManifoldSearch,
};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::comparisons::setting;
use crate::estimate::{Agreement, Estimate};
use crate::found_paths::{FoundPath, search_through};
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
    /// Share of the connections that are left out, as too hard.
    pub left_out: f64,
    /// Connections that are searched with patience, of those left out.
    pub searched: f64,
    /// Share of the light of all connections that no walk finds, by these.
    pub unreached: f64,
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

    /// A bound of the light that no walk finds: were it more, searches that all find everything had a probability below 0.05. Zero
    /// where nothing has to be searched with patience.
    pub fn most_unreached(&self) -> f64 {
        if self.searched > 0.0 { self.unreached + 3.0 * self.left_out / self.searched } else { 0.0 }
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
            "{agreement}, {:.2} % in saddles, {:.2} % left out, {:.3} % not reached by {} searches, below {:.3} %",
            100.0 * (1.0 - self.without_saddles.mean / self.theirs.mean),
            100.0 * self.left_out,
            100.0 * self.unreached,
            self.searched,
            100.0 * self.most_unreached(),
        )
    }
}

/// A scene with one light that matters, and a method.
pub struct Connections {
    /// Name of the method, of the case and of the light.
    pub name: String,
    scene: Scene,
    /// Index of the light.
    light: u32,
    left_out: LeftOut,
}

/// Which connections are not looked at.
#[derive(Clone, Copy, Debug)]
enum LeftOut {
    /// None.
    Nothing,
    /// Those of which [`SCOUTS`] searches through each pane do not find each listed path twice.
    MissedByScouts(Scouts),
    /// Those whose enumeration is not complete.
    Incomplete,
}

/// Searches from uniform seeds that have to find what the method under test is held to: of its own kind.
#[derive(Clone, Copy, Debug)]
enum Scouts {
    /// Manifold walks.
    Walks { constraint: ManifoldConstraint, steps: WalkSteps },
    /// Line searches on the optical length.
    LineSearches,
}

/// Runs a search from a uniform seed and tells where the path that it finds enters the pane, in the pane's frame.
type Scout<'a> = Box<dyn FnMut(&mut Random, &mut Counters) -> Option<DVec3> + 'a>;

/// Scouts through each pane, some of which have paths that a search finds once in 60 times and less.
const SCOUTS: u32 = 32;

/// One of so many connections that are left out is searched with patience.
const PATIENTLY: f64 = 1024.0;

/// Searches through each pane that find what there is to be found.
const PATIENCE: u32 = 20_000;

/// Two searches that end as near to each other found the same path, relative to the shortest of its three parts.
const SAME_PATH: f64 = 1e-6;

/// Places are drawn from a rectangle so much wider than the pane, since glass deflects light.
const WIDER: f64 = 1.1;

/// Sums over connections.
#[derive(Clone, Copy, Default)]
struct Sums {
    ours: f64,
    theirs: f64,
    saddles: f64,
    connections: f64,
    left_out: f64,
    searched: f64,
    unreached: f64,
}

/// Name of the connections of a case under a light, for a method.
pub fn connections_name(case: &str, light: &str, method: &str) -> String {
    format!("{method} {case}-{light}, single connections")
}

impl Connections {
    /// Those of a case under a light, as in [`crate::comparisons::comparison`], for a method (a name of [`methods::settings`])
    /// that draws a point of the light first. In the room, connections that are too hard are left out.
    ///
    /// # Panics
    ///
    /// When there is no such scene or method.
    pub fn new(case: &str, light: &str, method: &str) -> Self {
        let bundle = setting(case, light).bundle;
        let mut description = bundle.description().clone();
        description.integrator = methods::integrator(method, description.integrator.max_depth());
        let left_out = match description.integrator {
            _ if case != "room" && !(case == "cathedral" && method.ends_with("published")) => LeftOut::Nothing,
            IntegratorDescription::Sms { constraint, steps, .. } => {
                LeftOut::MissedByScouts(Scouts::Walks { constraint, steps })
            }
            IntegratorDescription::Fnee { solver: FneeSolver::Published, .. } => {
                LeftOut::MissedByScouts(Scouts::LineSearches)
            }
            _ => LeftOut::Incomplete,
        };
        let bundle = bundle.with_description(description).expect("the changed scene is valid");
        let scene = Scene::build(&bundle).expect("the scene can be built");
        // The room's lamp shines from inside.
        let sun = scene.lights().iter().position(|light| matches!(light.kind, LightKind::Sun { .. }));
        Self { name: connections_name(case, light, method), light: sun.unwrap_or(0) as u32, left_out, scene }
    }

    /// Whether patience has to reach all light: not by line searches, of which some paths lie beyond any patience
    /// (`docs/decisions/0015-what-is-held-to-its-parts.md`).
    pub fn all_is_reached(&self) -> bool {
        !matches!(self.left_out, LeftOut::MissedByScouts(Scouts::LineSearches))
    }

    /// The light that the method finds over about `count` connections, and what is there of what the method looks for.
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
        let all = |value: fn(&Sums) -> f64| sums.iter().map(value).sum::<f64>();
        let left_out = all(|sums| sums.left_out);
        RelativeLight {
            searched: all(|sums| sums.searched),
            left_out: left_out / (left_out + all(|sums| sums.connections)),
            unreached: all(|sums| sums.unreached) / all(|sums| sums.searched).max(1.0) * left_out
                / (left_out + all(|sums| sums.connections)),
            ours: mean(|sums| sums.ours),
            theirs: mean(|sums| sums.theirs),
            without_saddles: mean(|sums| sums.theirs - sums.saddles),
        }
    }

    /// Where the straight line from a source through a random place of a random pane, or somewhat beside it, ends.
    fn random_point(&self, source: Source, random: &mut Random, counters: &mut Counters) -> Option<ShadingPoint> {
        let panes = self.scene.panes();
        let index = (random.uniform() * panes.len() as f64) as usize;
        let pane = &panes[index];
        let place = (DVec2::new(random.uniform(), random.uniform()) - 0.5) * pane.size * WIDER;
        let through = pane.frame.point_to_world(place.extend(0.0));
        let direction = match source {
            Source::Point(position) => (through - position).normalize(),
            Source::Direction(direction) => -direction,
        };
        let ray = Ray::new(through, direction);
        let leaving = Leaving::Pane { index: index as u32, face: Face::Front };
        let hit = self.scene.accelerator().closest_hit(&ray, f64::INFINITY, leaving, counters)?;
        let Surface::Triangle { index, .. } = hit.surface else { return None };
        let normal = self.scene.triangle_normal(index);
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        Some(ShadingPoint { position: ray.at(hit.distance), normal, leaving: Leaving::Triangle(index), bounces: 0 })
    }

    fn connect(&self, method: &dyn SpecularMethod, number: [u32; 2], seed: u64, random: &mut Random, sums: &mut Sums) {
        let counters = &mut Counters::default();
        let settings = SamplerSettings { seed, samples_per_block: 1 };
        let stream = || SampleStream::new(&settings, 0, number, 0);
        let (centre, radius) = self.scene.specular_ball();
        // The first thing that a method draws is the point of the light.
        let light = &self.scene.lights()[self.light as usize];
        let sample = light.sample_source(centre, radius, stream().next_2d());
        let Some(point) = self.random_point(sample.source, random, counters) else { return };
        let panes: Vec<ThroughPane<'_>> = (0..self.scene.panes().len() as u32)
            .filter_map(|pane| ThroughPane::new(&self.scene, method, &point, self.light, &sample, pane))
            .collect();
        let (mut listed, mut complete): (Vec<(usize, Root, f64)>, bool) = (Vec::new(), true);
        for (index, pane) in panes.iter().enumerate() {
            let found = pane.search.enumerate(counters);
            complete &= found.complete;
            listed.extend(found.roots.into_iter().map(|root| (index, root, pane.light_of(&root, counters))));
        }
        let whole: f64 = listed.iter().map(|(_, _, light)| light).sum();
        // Which connections are looked at is a function of the connection, and of scouts that nothing else depends on.
        if whole <= 0.0 {
            return;
        }
        let of_pane = |index: usize| listed.iter().filter(move |(other, ..)| *other == index);
        if matches!(self.left_out, LeftOut::Incomplete) && !complete {
            sums.left_out += 1.0;
            return;
        }
        if let LeftOut::MissedByScouts(scouts) = self.left_out {
            let mut missed_by = |searches, times| -> f64 {
                let unfound = |(index, pane): (usize, &ThroughPane<'_>)| {
                    let lit = of_pane(index).filter(|(.., light)| *light > 0.0).map(|(_, root, light)| (root, *light));
                    pane.unfound(lit.collect(), scouts, searches, times, random, counters)
                };
                panes.iter().enumerate().map(unfound).sum()
            };
            if missed_by(SCOUTS, 2) > 0.0 {
                if sums.left_out % PATIENTLY == 0.0 {
                    sums.unreached += missed_by(PATIENCE, 1) / whole;
                    sums.searched += 1.0;
                }
                sums.left_out += 1.0;
                return;
            }
        }
        let others: f64 = panes
            .iter()
            .enumerate()
            .map(|(index, pane)| pane.others(of_pane(index).map(|(_, root, _)| root), random, counters))
            .sum();
        let mut ours = 0.0;
        method.gather(&self.scene, &point, self.light, &THROUGH_PANE, &mut stream(), counters, &mut |arrival| {
            ours += arrival.weight.x * arrival.direction.dot(point.normal);
        });
        let saddles = listed.iter().filter(|(_, root, _)| root.determinant < 0.0).map(|(.., light)| light);
        sums.ours += ours / whole;
        sums.theirs += 1.0 + others / whole;
        sums.saddles += saddles.sum::<f64>() / whole;
        sums.connections += 1.0;
    }
}

/// The complete search from a point to a point of a light through one pane.
struct ThroughPane<'a> {
    scene: &'a Scene,
    method: &'a dyn SpecularMethod,
    point: &'a ShadingPoint,
    light: u32,
    sample: &'a SourceSample,
    pane: u32,
    search: PathSearch<'a>,
}

impl<'a> ThroughPane<'a> {
    /// `None` when no path leads through the pane.
    fn new(
        scene: &'a Scene,
        method: &'a dyn SpecularMethod,
        point: &'a ShadingPoint,
        light: u32,
        sample: &'a SourceSample,
        pane: u32,
    ) -> Option<Self> {
        let search = search_through(scene, point, sample.source, pane, FneeSolver::Complete)?;
        Some(Self { scene, method, point, light, sample, pane, search })
    }

    /// The light of the paths, of some with their light, that so many scouts do not find so many times.
    fn unfound(
        &self,
        paths: Vec<(&Root, f64)>,
        scouts: Scouts,
        searches: u32,
        times: u32,
        random: &mut Random,
        counters: &mut Counters,
    ) -> f64 {
        let mut missing: Vec<(&Root, f64, u32)> = paths.into_iter().map(|(root, light)| (root, light, times)).collect();
        let mut find = self.scout(scouts);
        for _ in 0..searches {
            if missing.is_empty() {
                break;
            }
            let Some(entry) = find(random, counters) else { continue };
            missing.retain_mut(|(root, _, times)| {
                let shortest = root.path.lengths.into_iter().fold(f64::INFINITY, f64::min);
                *times -= u32::from(entry.distance(root.path.vertices[0]) <= SAME_PATH * shortest);
                *times > 0
            });
        }
        missing.iter().map(|(_, light, _)| light).sum()
    }

    /// A search of the kind that is named.
    fn scout(&self, scouts: Scouts) -> Scout<'_> {
        let Self { scene, point, sample, .. } = *self;
        let PaneSide { near, pane, .. } = *self.search.side();
        match scouts {
            Scouts::Walks { constraint, steps } => {
                let search = ManifoldSearch::new(scene, point, sample.source, self.pane, constraint, steps);
                Box::new(move |random, counters| {
                    let place = (DVec2::new(random.uniform(), random.uniform()) - 0.5) * pane.size;
                    let height = pane.base_height(near) + pane.surface(near).height(place);
                    let target = pane.frame.point_to_world(place.extend(height));
                    let entry = search.as_ref()?.walk_towards(target, counters)?;
                    Some(pane.frame.point_to_local(entry))
                })
            }
            Scouts::LineSearches => {
                let search = search_through(scene, point, sample.source, self.pane, FneeSolver::Published);
                Box::new(move |random, counters| {
                    let seed = || DVec2::new(random.uniform(), random.uniform());
                    search.as_ref()?.solve(seed, counters).map(|root| root.path.vertices[0])
                })
            }
        }
    }

    /// An estimate without bias of the light of the paths that are not listed.
    fn others<'r>(&self, listed: impl Iterator<Item = &'r Root>, random: &mut Random, counters: &mut Counters) -> f64 {
        let mut solve =
            |counters: &mut Counters| self.search.solve(|| DVec2::new(random.uniform(), random.uniform()), counters);
        let Some(root) = solve(counters) else { return 0.0 };
        let is_listed = { listed }.any(|known| self.search.same(known, &root));
        let light = if is_listed { 0.0 } else { self.light_of(&root, counters) };
        if light <= 0.0 {
            return 0.0;
        }
        let mut again = || solve(counters).is_some_and(|other| self.search.same(&root, &other));
        let trials = (1..=MOST_TRIALS).find(|_| again());
        light * f64::from(trials.expect("a path that was found once is found again"))
    }

    /// Irradiance of the red channel by a path, over the density of its point on the light; zero when it is no path of light, is
    /// blocked, or the method does not look for it.
    fn light_of(&self, root: &Root, counters: &mut Counters) -> f64 {
        let Self { scene, point, light, sample, pane, .. } = *self;
        let found = FoundPath::of_root(scene, point, [light, pane], sample, &self.search, root, counters);
        let owned = found.filter(|(path, _)| self.method.owns(scene, point, &path.described(), counters));
        owned.map_or(0.0, |(_, irradiance)| irradiance)
    }
}
