//! What was measured on a pair.

use clerestory_film::decomposition::{mean, standard_error};
use serde::Serialize;

use crate::pairs::Pair;
use crate::pairs::stored::Found;
use crate::ratio::Logarithm;
use crate::table::{Column, column};

/// What is measured on every pair.
pub(super) const AUTO: &str = "auto";

/// One of two measures of error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Metric {
    Mse,
    RelMse,
}

impl Metric {
    pub(super) const ALL: [Self; 2] = [Self::Mse, Self::RelMse];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Mse => "MSE",
            Self::RelMse => "relMSE",
        }
    }
}

/// One render. Errors are less the noise of the reference.
#[derive(Clone, Debug, Default)]
pub(super) struct Render {
    pub(super) seed: u64,
    pub(super) samples_per_pixel: u64,
    pub(super) core_seconds: f64,
    pub(super) mse: f64,
    pub(super) rel_mse: f64,
    pub(super) mean_ratio: f64,
}

impl Render {
    fn error(&self, metric: Metric) -> f64 {
        match metric {
            Metric::Mse => self.mse,
            Metric::RelMse => self.rel_mse,
        }
    }
}

/// The renders of a method with all seeds.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub(super) method: &'static str,
    pub(super) renders: Vec<Render>,
}

impl Measured {
    fn values(&self, of: impl Fn(&Render) -> f64) -> Vec<f64> {
        self.renders.iter().map(of).collect()
    }

    /// Mean error over the seeds; infinite without renders.
    pub(super) fn error(&self, metric: Metric) -> f64 {
        if self.renders.is_empty() { f64::INFINITY } else { mean(&self.values(|render| render.error(metric))) }
    }

    /// Error times core seconds, of each seed.
    fn products(&self, metric: Metric) -> Vec<f64> {
        self.values(|render| render.error(metric) * render.core_seconds)
    }

    /// Mean product of error and core seconds.
    pub(super) fn product(&self, metric: Metric) -> f64 {
        mean(&self.products(metric))
    }

    pub(super) fn logarithm(&self, metric: Metric) -> Option<Logarithm> {
        Logarithm::of_mean(&self.products(metric))
    }
}

/// A pair with its reference and the renders of all methods.
pub(super) struct Compared {
    pub(super) pair: &'static Pair,
    pub(super) reference: Option<Found>,
    /// What the reference adds to MSE and relMSE.
    pub(super) noise: [f64; 2],
    /// `auto` comes first.
    pub(super) methods: Vec<Measured>,
}

impl Compared {
    /// The noise of the reference over the least MSE and the least relMSE that it measures.
    pub(super) fn shares(&self) -> [Option<f64>; 2] {
        let share = |(metric, noise): (Metric, f64)| {
            let least = self.methods.iter().map(|method| method.error(metric)).fold(f64::INFINITY, f64::min);
            least.is_finite().then(|| if least > 0.0 { noise / least } else { f64::INFINITY })
        };
        let [mse, rel_mse] = Metric::ALL;
        [(mse, self.noise[0]), (rel_mse, self.noise[1])].map(share)
    }

    /// A method by its name.
    pub(super) fn of(&self, method: &str) -> Option<&Measured> {
        self.methods.iter().find(|measured| measured.method == method)
    }

    pub(super) fn measurements(&self) -> impl Iterator<Item = Measurement> {
        let pair = self.pair.name;
        let of_method = move |measured: &Measured| {
            let method = measured.method;
            let row = move |render: &Render| Measurement {
                pair,
                method,
                seed: render.seed,
                samples_per_pixel: render.samples_per_pixel,
                core_seconds: render.core_seconds,
                mse: render.mse,
                rel_mse: render.rel_mse,
                mean_ratio: render.mean_ratio,
            };
            measured.renders.iter().map(row).collect::<Vec<_>>()
        };
        self.methods.iter().flat_map(of_method)
    }

    pub(super) fn summaries(&self) -> impl Iterator<Item = Summary> {
        let pair = self.pair.name;
        let row = move |measured: &Measured| {
            let ratios = measured.values(|render| render.mean_ratio);
            Summary {
                pair,
                method: measured.method,
                seeds: measured.renders.len(),
                samples_per_pixel: mean(&measured.values(|render| render.samples_per_pixel as f64)),
                core_seconds: mean(&measured.values(|render| render.core_seconds)),
                mse: measured.error(Metric::Mse),
                rel_mse: measured.error(Metric::RelMse),
                mse_times_seconds: measured.product(Metric::Mse),
                rel_mse_times_seconds: measured.product(Metric::RelMse),
                mean_ratio: mean(&ratios),
                mean_ratio_standard_error: standard_error(&ratios),
            }
        };
        self.methods.iter().filter(|measured| !measured.renders.is_empty()).map(row)
    }
}

/// One render: a row of `measurements`.
#[derive(Serialize)]
pub(super) struct Measurement {
    pair: &'static str,
    method: &'static str,
    seed: u64,
    samples_per_pixel: u64,
    core_seconds: f64,
    mse: f64,
    rel_mse: f64,
    mean_ratio: f64,
}

pub(super) const MEASUREMENT_COLUMNS: [Column; 8] = [
    column("pair", "the scene and its light"),
    column("method", "the integrator"),
    column("seed", "seed of the random numbers"),
    column("samples_per_pixel", "camera samples in each pixel"),
    column("core_seconds", "time of one core, s"),
    column("mse", "1/N sum (x - r)^2 less the noise of the reference"),
    column("rel_mse", "1/N sum (x - r)^2 / (r^2 + 0.01 m^2), m being the mean of |r|, less the noise of the reference"),
    column("mean_ratio", "mean over that of the reference"),
];

/// All seeds of a method: a row of `methods`.
#[derive(Serialize)]
pub(super) struct Summary {
    pair: &'static str,
    method: &'static str,
    seeds: usize,
    samples_per_pixel: f64,
    core_seconds: f64,
    mse: f64,
    rel_mse: f64,
    mse_times_seconds: f64,
    rel_mse_times_seconds: f64,
    mean_ratio: f64,
    mean_ratio_standard_error: Option<f64>,
}

pub(super) const METHOD_COLUMNS: [Column; 11] = [
    column("pair", "the scene and its light"),
    column("method", "the integrator"),
    column("seeds", "renders with independent random numbers"),
    column("samples_per_pixel", "camera samples in each pixel, mean over the seeds"),
    column("core_seconds", "time of one core, s, mean over the seeds"),
    column("mse", "1/N sum (x - r)^2 less the noise of the reference, mean over the seeds"),
    column("rel_mse", "1/N sum (x - r)^2 / (r^2 + 0.01 m^2), less the noise of the reference, mean over the seeds"),
    column("mse_times_seconds", "mse times core_seconds, mean over the seeds: what the method costs whatever the time"),
    column("rel_mse_times_seconds", "the same of rel_mse"),
    column("mean_ratio", "mean over that of the reference, mean over the seeds"),
    column("mean_ratio_standard_error", "standard error of mean_ratio by the spread of the seeds"),
];
