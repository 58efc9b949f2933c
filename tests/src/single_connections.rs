//! The light of single connections between a point of a receiver and a point of a light, relative to what a complete
//! search finds there.
//!
//! Near a fold, the light of a path has no finite mean square over a picture. Some methods also weight it by an
//! estimate of 1/p. No practical number of samples tells such a method from one that is a thousandth too dark. Divided
//! by the light of its own connection, a path has such a tail no more: what is left is the noise of the estimate. So
//! methods are held here, connection by connection, to the complete search of `fnee`, which the bias test holds to
//! light traced forward.
//!
//! Some paths are found so rarely that their estimates of 1/p have tails again. There, separate walks (scouts) have to
//! find each listed path of a connection twice; otherwise the connection is left out. N scouts keep a path of a small
//! probability p with (N p)^2 / 2. Its estimate has a mean square of about 2/p and a third moment of 6/p^2. So both are
//! bounded for the paths that are kept. Of what is left out some is searched with patience, so that light which walks
//! never find would show. Of `fnee` in the room, connections are left out whose enumeration is not complete: what
//! chance adds there has the tails of 1/p again. In what is left, method and truth list paths by the same search, so
//! that this tests the choice of panes and nothing else.
//!
//! `fnee` as published finds some paths behind strong relief once in thousands of searches, and so does `sms` with
//! walks as published. Their estimates are cut off at M trials. Then a path of probability p has the part
//! `1 - (1 - p)^M` of its light on average. One of M searches finds it just as often. So these methods are compared
//! with the light of the listed paths that M separate searches find. No connection with listed light is left out.

use std::fmt;

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::geometry::{Face, Ray, Surface, SurfaceId};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::LightBounds;
use clerestory_render_core::light::Source;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::fnee::FneeSettings;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::registry::IntegratorDescription;
use clerestory_render_core::specular::sms::ManifoldEstimator;
use clerestory_render_core::specular::sms::SmsSettings;
use clerestory_render_core::specular::{SpecularMethod, THROUGH_PANE};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use statrs::distribution::{Beta, ContinuousCDF};

use crate::comparisons::setting;
use crate::estimate::{Agreement, Estimate};
use crate::known_paths::{Known, Search, ThroughPane};
use crate::methods;
use crate::random::Random;

/// Independent sets of connections, from whose spread the standard errors come.
pub(crate) const REPLICATES: u32 = 32;

/// Light relative to that of the known paths of its connection, means over connections.
#[derive(Clone, Debug)]
pub struct RelativeLight {
    /// What the method finds.
    pub ours: Estimate,
    /// What it has to find: the known paths and an estimate of the others, or what searches of their own find of the
    /// known paths.
    pub theirs: Estimate,
    /// The same but for the saddles of the optical length.
    pub without_saddles: Estimate,
    /// Share of the light that is in saddles, over all connections.
    pub saddles: f64,
    /// Light that the method finds along other paths than those that are asked for, relative to the known paths.
    pub elsewhere: f64,
    /// Share of the connections that are left out, as too hard.
    pub left_out: f64,
    /// Connections that are searched with many trials.
    pub searched: f64,
    /// Share of the light of these that no search finds.
    pub unreached: f64,
    /// Share of all connections of which these are a sample.
    pub uncertain: f64,
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

    /// A bound of the light of all connections that no search finds, with a confidence of 95 percent (Clopper and
    /// Pearson 1934). Shares between 0 and 1 vary less than hits and misses. Zero where no connection needs many
    /// trials.
    pub fn most_unreached(&self) -> f64 {
        let hits = self.unreached * self.searched;
        let misses = self.searched - hits;
        let bound = Beta::new(hits + 1.0, misses).map_or(1.0, |posterior| posterior.inverse_cdf(0.95));
        if self.uncertain > 0.0 { self.uncertain * bound } else { 0.0 }
    }

    /// Whether light that is `1 + fault` times as bright or as dark would be rejected, and light without saddles where
    /// they carry more than that.
    pub fn would_notice(&self, fault: f64) -> bool {
        let rejected = |ours: Estimate, theirs: Estimate| !Agreement::of(&[ours], &[theirs]).holds();
        let scaled = [1.0 + fault, 1.0 / (1.0 + fault)].map(|factor| rejected(self.ours.scaled(factor), self.theirs));
        scaled == [true; 2] && (self.saddles < fault || rejected(self.ours, self.without_saddles))
    }
}

impl fmt::Display for RelativeLight {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let agreement = Agreement::of(&[self.ours], &[self.theirs]);
        write!(
            formatter,
            "{agreement}, {:.2} % of the light looked for, {:.2} % of it in saddles, {:.3} % found elsewhere",
            100.0 * self.theirs.mean,
            100.0 * (1.0 - self.without_saddles.mean / self.theirs.mean),
            100.0 * self.elsewhere,
        )?;
        if self.searched > 0.0 {
            write!(
                formatter,
                ", {:.2} % left out, {:.3} % not reached by {} searches, below {:.3} %",
                100.0 * self.left_out,
                100.0 * self.uncertain * self.unreached,
                self.searched,
                100.0 * self.most_unreached(),
            )?;
        }
        Ok(())
    }
}

/// A scene with one light that matters, and a method.
pub struct Connections {
    /// Name of the method, of the case and of the light.
    pub name: String,
    scene: PreparedScene,
    /// Index of the light.
    light: u32,
    held_to: HeldTo,
}

/// What of its connections a method is held to.
#[derive(Clone, Copy, Debug)]
enum HeldTo {
    /// All light.
    All,
    /// All, where the enumeration is complete. Other connections are left out.
    Complete,
    /// All, where [`SCOUTS`] walks through each pane find each listed path twice. Other connections are left out.
    Scouted(Search),
    /// The light of the listed paths that this many searches find. Light along other paths does not count.
    FoundBy(u32, Search),
}

/// Scouts through each pane. Some panes have paths that a walk finds once in 60 times or less.
const SCOUTS: u32 = 32;

/// One of this many excluded or capped connections is searched with many trials.
const SEARCHED_ONCE_IN: f64 = 1024.0;

/// Searches through each pane that find practically all paths.
const MANY_TRIALS: u32 = 20_000;

/// Most trials of an estimate for which each connection makes as many searches.
const MOST_SEARCHES: u32 = 1000;

/// Places are drawn from a rectangle so much wider than the pane, since glass deflects light.
const WIDER: f64 = 1.1;

/// Sums over connections.
#[derive(Clone, Copy, Default)]
struct Sums {
    ours: f64,
    theirs: f64,
    saddles: f64,
    connections: f64,
    all_saddles: f64,
    elsewhere: f64,
    left_out: f64,
    searched: f64,
    unreached: f64,
}

/// Name of the connections of a case under a light, for a method.
pub fn connections_name(case: &str, light: &str, method: &str) -> String {
    format!("{method} {case}-{light}, single connections")
}

impl Connections {
    /// Those of a case under a light, as in [`crate::comparisons::comparison`], for a method (a name of
    /// [`methods::settings`]) that draws a point of the light first. In the room, connections that are too hard are
    /// left out. Of estimates of at most 1000 trials, what as many searches find is asked for.
    ///
    /// # Panics
    ///
    /// When there is no such scene or method.
    pub fn new(case: &str, light: &str, method: &str) -> Self {
        let bundle = setting(case, light).bundle;
        let mut description = bundle.description().clone();
        description.integrator = methods::integrator(method, description.integrator.max_depth());
        let held_to = match description.integrator {
            IntegratorDescription::Fnee(FneeSettings { solver: FneeSolver::Published, max_trials, .. })
                if max_trials <= MOST_SEARCHES =>
            {
                HeldTo::FoundBy(max_trials, Search::LineSearch)
            }
            IntegratorDescription::Sms(SmsSettings {
                constraint,
                steps,
                estimator: ManifoldEstimator::Unbiased { max_trials },
                ..
            }) if max_trials <= MOST_SEARCHES => HeldTo::FoundBy(max_trials, Search::Walk { constraint, steps }),
            IntegratorDescription::Sms(SmsSettings { constraint, steps, .. }) if case == "room" => {
                HeldTo::Scouted(Search::Walk { constraint, steps })
            }
            IntegratorDescription::Fnee(FneeSettings { solver: FneeSolver::Complete, .. }) if case == "room" => {
                HeldTo::Complete
            }
            _ => HeldTo::All,
        };
        let bundle = bundle.with_description(description).expect("the changed scene is valid");
        let scene = PreparedScene::build(&bundle).expect("the scene can be built");
        // The room's lamp shines from inside.
        let sun = scene.scene().lights().iter().position(|light| matches!(light.bounds(), LightBounds::Cap { .. }));
        Self { name: connections_name(case, light, method), light: sun.unwrap_or(0) as u32, held_to, scene }
    }

    /// Whether searches with many trials have to reach all light: where connections are left out, and where walks are
    /// compared with what walks find. Line searches miss some.
    pub fn must_reach_all(&self) -> bool {
        matches!(self.held_to, HeldTo::Scouted(_) | HeldTo::FoundBy(_, Search::Walk { .. }))
    }

    /// The light that the method finds over about `count` connections, and what is there of what the method looks for.
    ///
    /// # Panics
    ///
    /// When the method is path tracing alone, or a path is found once and never again.
    pub fn relative_light(&self, count: u32, seed: u64) -> RelativeLight {
        let method = self.scene.method().expect("a specular method");
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
        let [left_out, searched] = [all(|sums| sums.left_out), all(|sums| sums.searched)];
        let connections = left_out + all(|sums| sums.connections);
        RelativeLight {
            saddles: all(|sums| sums.all_saddles) / connections,
            elsewhere: all(|sums| sums.elsewhere) / all(|sums| sums.connections),
            left_out: left_out / connections,
            searched,
            unreached: all(|sums| sums.unreached) / searched.max(1.0),
            uncertain: match self.held_to {
                HeldTo::All | HeldTo::Complete => 0.0,
                HeldTo::Scouted(_) => left_out / connections,
                HeldTo::FoundBy(..) => 1.0,
            },
            ours: mean(|sums| sums.ours),
            theirs: mean(|sums| sums.theirs),
            without_saddles: mean(|sums| sums.theirs - sums.saddles),
        }
    }

    /// Where the straight line from a source through a random place of a random pane, or somewhat beside it, ends.
    fn random_point(&self, source: Source, random: &mut Random, counters: &mut Counters) -> Option<ShadingPoint> {
        let panes = self.scene.scene().panes();
        let index = (random.uniform() * panes.len() as f64) as usize;
        let pane = &panes[index];
        let place = (DVec2::new(random.uniform(), random.uniform()) - 0.5) * pane.size() * WIDER;
        let through = pane.frame.point_to_world(place.extend(0.0));
        let direction = match source {
            Source::Point(position) => (through - position).normalize(),
            Source::Direction(direction) => -direction,
        };
        let ray = Ray::new(through, direction);
        let ray_origin = SurfaceId::Pane { index: index as u32, face: Face::Front };
        let hit = self.scene.scene().accelerator().closest_hit(&ray, f64::INFINITY, ray_origin, counters)?;
        let Surface::Triangle { index, .. } = hit.surface else { return None };
        let normal = self.scene.scene().triangle_normal(index);
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        Some(ShadingPoint { position: ray.at(hit.distance), normal, surface: SurfaceId::Triangle(index), bounces: 0 })
    }

    fn connect(&self, method: &dyn SpecularMethod, number: [u32; 2], seed: u64, random: &mut Random, sums: &mut Sums) {
        let counters = &mut Counters::default();
        let settings = SamplerSettings { seed, samples_per_block: 1 };
        let stream = || SampleStream::new(&settings, 0, number, 0);
        let (centre, radius) = self.scene.scene().specular_ball();
        // The first thing that a method draws is the point of the light.
        let light = &self.scene.scene().lights()[self.light as usize];
        let sample = light.sample_source(centre, radius, stream().next_2d());
        let Some(point) = self.random_point(sample.source, random, counters) else { return };
        let panes: Vec<ThroughPane<'_>> = (0..self.scene.scene().panes().len() as u32)
            .filter_map(|pane| ThroughPane::new(self.scene.scene(), method, &point, self.light, &sample, pane))
            .collect();
        // The choice of connections is a function of the connection, and of scouts on which nothing else depends.
        let Some(known) = Known::of(panes, counters) else { return };
        sums.all_saddles += known.in_saddles(known.lit());
        let is_left_out = match self.held_to {
            HeldTo::All | HeldTo::FoundBy(..) => false,
            HeldTo::Complete => !known.complete,
            HeldTo::Scouted(search) => !known.unfound(search, SCOUTS, 2, random).is_empty(),
        };
        let (patiently, so_far) = match self.held_to {
            HeldTo::All | HeldTo::Complete => (None, 0.0),
            HeldTo::Scouted(search) => (Some(search).filter(|_| is_left_out), sums.left_out),
            HeldTo::FoundBy(_, search) => (Some(search), sums.connections),
        };
        if let Some(search) = patiently
            && so_far % SEARCHED_ONCE_IN == 0.0
        {
            sums.unreached += known.share(known.unfound(search, MANY_TRIALS, 1, random));
            sums.searched += 1.0;
        }
        if is_left_out {
            sums.left_out += 1.0;
            return;
        }
        let mut arrivals: Vec<(DVec3, f64)> = Vec::new();
        method.sample_li(
            self.scene.scene(),
            &point,
            self.light,
            &THROUGH_PANE,
            &mut stream(),
            counters,
            &mut |arrival| {
                let light = arrival.weight.x * arrival.direction.dot(point.normal) / known.whole;
                arrivals.push((arrival.direction, light));
            },
        );
        let missed = match self.held_to {
            HeldTo::FoundBy(searches, search) => {
                for (_, light) in arrivals.extract_if(.., |(direction, _)| !known.brings_light(*direction)) {
                    sums.elsewhere += light;
                }
                known.unfound(search, searches, 1, random)
            }
            _ => {
                sums.theirs += known.others(random, counters);
                Vec::new()
            }
        };
        sums.ours += arrivals.iter().map(|(_, light)| light).sum::<f64>();
        sums.theirs += 1.0 - known.share(missed.iter().copied());
        sums.saddles += known.in_saddles(known.lit()) - known.in_saddles(missed);
        sums.connections += 1.0;
    }
}
