//! How long one method takes to an error that another one has.

use serde::Serialize;

use super::measured::Measured;
use crate::table::{Column, column, rounded_number};

/// Biased sampling is done when its error is no more than this times that of its last number of samples.
const SETTLED: f64 = 1.05;

/// An error that manifold sampling reaches, and how long a method along the conic takes to it.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Equal {
    variant: String,
    point: &'static str,
    mse: f64,
    samples_per_pixel: f64,
    core_seconds: f64,
    method: String,
    method_samples_per_pixel: Option<f64>,
    method_core_seconds: Option<f64>,
    bound: Option<&'static str>,
    ratio: Option<f64>,
}

pub(super) const COLUMNS: [Column; 10] = [
    column("variant", "manifold sampling, listed under variants"),
    column(
        "point",
        "rendered: a number of samples; settled: where the error first is 1.05 times that of the last number",
    ),
    column("mse", "mean squared error there"),
    column("samples_per_pixel", "samples in each pixel up to there"),
    column("core_seconds", "time that all cores together spent up to there, with the preparation, s"),
    column("method", "a method along the conic"),
    column("method_samples_per_pixel", "its samples where it first has that error, if it has"),
    column("method_core_seconds", "its time up to there, with the preparation, s"),
    column("bound", "at least: it has that error, or a smaller one, by its first sample, than which nothing is faster"),
    column("ratio", "core_seconds over method_core_seconds"),
];

/// Samples in each pixel, and core seconds, that a method takes to an error.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cost {
    samples: f64,
    core_seconds: f64,
}

impl Cost {
    fn of(measured: &Measured) -> Self {
        Self { samples: measured.samples_per_pixel, core_seconds: measured.core_seconds }
    }

    /// The cost of a method until it first has an error, by measurements with ascending numbers of samples. `None`
    /// where it never has the error. Between two numbers, the error falls linearly over the inverse of the samples, and
    /// time grows linearly with the samples.
    fn to(measured: &[Measured], mse: f64) -> Option<Self> {
        let first = measured.first()?;
        if first.mse <= mse {
            return Some(Self::of(first));
        }
        let pair = measured.windows(2).find(|pair| pair[1].mse <= mse)?;
        let [before, after] = [0, 1].map(|index| Self::of(&pair[index]));
        let part = (pair[0].mse - mse) / (pair[0].mse - pair[1].mse);
        let samples = 1.0 / ((1.0 - part) / before.samples + part / after.samples);
        let passed = (samples - before.samples) / (after.samples - before.samples);
        let core_seconds = before.core_seconds + passed * (after.core_seconds - before.core_seconds);
        Some(Self { samples, core_seconds })
    }
}

/// An error of a method, and what it takes to it.
#[derive(Clone, Debug)]
pub(super) struct At {
    variant: String,
    point: &'static str,
    mse: f64,
    cost: Cost,
}

impl At {
    /// With a number of samples.
    pub(super) fn rendered(measured: &Measured) -> Self {
        Self { variant: measured.variant.clone(), point: "rendered", mse: measured.mse, cost: Cost::of(measured) }
    }

    /// The points of biased sampling: its first number of samples, one as in the paper, and the number from which more
    /// hardly help.
    pub(super) fn of_biased(measured: &[Measured]) -> Vec<Self> {
        let settled = || {
            let last = measured.last()?;
            let mse = SETTLED * last.mse;
            Some(Self { variant: last.variant.clone(), point: "settled", mse, cost: Cost::to(measured, mse)? })
        };
        measured.first().map(Self::rendered).into_iter().chain(settled()).collect()
    }

    /// How long other methods take to the same error.
    pub(super) fn equals(&self, others: &[Vec<Measured>]) -> Vec<Equal> {
        others.iter().filter_map(|measured| self.equal(measured)).collect()
    }

    fn equal(&self, measured: &[Measured]) -> Option<Equal> {
        let first = measured.first()?;
        let cost = Cost::to(measured, self.mse);
        Some(Equal {
            variant: self.variant.clone(),
            point: self.point,
            mse: self.mse,
            samples_per_pixel: self.cost.samples,
            core_seconds: self.cost.core_seconds,
            method: first.variant.clone(),
            method_samples_per_pixel: cost.map(|cost| cost.samples),
            method_core_seconds: cost.map(|cost| cost.core_seconds),
            bound: (first.mse <= self.mse).then_some("at least"),
            ratio: cost.map(|cost| self.cost.core_seconds / cost.core_seconds),
        })
    }
}

/// The statement on an error, with all methods that may reach it.
pub(super) fn statement(equals: &[Equal]) -> Option<String> {
    let Equal { variant, point, mse, samples_per_pixel, core_seconds, .. } = equals.first()?;
    let [mse, samples, seconds] = [mse, samples_per_pixel, core_seconds].map(|number| rounded_number(*number));
    let faster = |Equal { method, bound, ratio, .. }: &Equal| match ratio {
        Some(ratio) => format!("{method} is {} {} times as fast", bound.unwrap_or("about"), rounded_number(*ratio)),
        None => format!("{method} does not reach that error"),
    };
    let methods = equals.iter().map(faster).collect::<Vec<_>>().join(", ");
    Some(format!("{variant}, {point}: MSE {mse} by {samples} samples a pixel after {seconds} core seconds; {methods}."))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(samples_per_pixel: f64, core_seconds: f64, mse: f64) -> Measured {
        Measured {
            variant: "it".to_owned(),
            samples_per_pixel,
            core_seconds,
            preparation_seconds: 1.0,
            mse,
            mse_standard_error: None,
            bias_squared: None,
            bias_squared_standard_error: None,
            mean_ratio: 1.0,
            mean_ratio_standard_error: None,
        }
    }

    #[test]
    fn an_error_is_first_reached_between_two_numbers_of_samples_or_by_the_first() {
        // A second to prepare and one for each sample; a variance of 4 for each, and what is missing 1.
        let rows = [1.0, 2.0, 4.0, 64.0].map(|samples| measured(samples, 1.0 + samples, 1.0 + 4.0 / samples));
        let to = |mse| Cost::to(&rows, mse).map(|cost| (cost.samples, cost.core_seconds));
        assert_eq!((to(3.0), to(2.0), to(9.0)), (Some((2.0, 3.0)), Some((4.0, 5.0)), Some((1.0, 2.0))));
        let (samples, core_seconds) = to(1.5).unwrap();
        assert!((samples - 8.0).abs() < 1e-9 && (core_seconds - 9.0).abs() < 1e-9, "{samples} {core_seconds}");
        assert_eq!((to(1.0), Cost::to(&[], 1.0)), (None, None));
    }

    #[test]
    fn what_more_samples_do_not_mend_takes_no_longer_with_them() {
        let rows = [1.0, 2.0, 4.0, 8.0].map(|samples| measured(samples, samples, 1.0 + 0.02 / samples));
        let [first, settled] = &At::of_biased(&rows)[..] else { panic!("two points") };
        assert_eq!((first.point, settled.point, settled.cost), ("rendered", "settled", Cost::of(&rows[0])));
        let dear = |mse| At::rendered(&measured(1.0, 10.0, mse)).equal(&rows).unwrap();
        assert_eq!((dear(2.0).ratio, dear(2.0).bound), (Some(10.0), Some("at least")));
        assert_eq!((dear(0.5).ratio, dear(0.5).bound), (None, None));
    }
}
