//! Ratios of means of few numbers, with their intervals.
//!
//! The logarithm of a mean has the standard error of the jackknife over its numbers. Variances of independent
//! logarithms add up. The sum of variances has the degrees of freedom of Welch and Satterthwaite.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Probability that an interval holds what it estimates.
const CONFIDENCE: f64 = 0.95;

/// An estimate with its interval of 95 percent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The most likely value.
    pub estimate: f64,
    /// The lower end.
    pub lower: f64,
    /// The upper end.
    pub upper: f64,
}

/// The logarithm of something positive that is estimated.
#[derive(Clone, Copy, Debug)]
pub struct Logarithm {
    value: f64,
    variance: f64,
    /// Degrees of freedom of the variance.
    freedom: f64,
}

impl Logarithm {
    /// The logarithm of the mean of independent numbers. `None` for fewer than two, or where a mean is not positive.
    pub fn of_mean(numbers: &[f64]) -> Option<Self> {
        let count = numbers.len() as f64;
        let sum: f64 = numbers.iter().sum();
        let without: Vec<f64> = numbers.iter().map(|number| (sum - number) / (count - 1.0)).collect();
        if numbers.len() < 2 || without.iter().any(|mean| *mean <= 0.0 || !mean.is_finite()) {
            return None;
        }
        let without: Vec<f64> = without.into_iter().map(libm::log).collect();
        let centre = without.iter().sum::<f64>() / count;
        let squares: f64 = without.iter().map(|value| (value - centre) * (value - centre)).sum();
        let variance = (count - 1.0) / count * squares;
        Some(Self { value: libm::log(sum / count), variance, freedom: count - 1.0 })
    }

    /// The logarithm of the ratio of two that are independent.
    pub fn over(self, other: Self) -> Self {
        Self { value: self.value - other.value, ..added(&[self, other]) }
    }

    /// The logarithm of the geometric mean of independent ones; `None` without any.
    pub fn geometric_mean(all: &[Self]) -> Option<Self> {
        let count = all.len() as f64;
        let Self { value, variance, freedom } = added(all);
        (!all.is_empty()).then(|| Self { value: value / count, variance: variance / (count * count), freedom })
    }

    /// What it is the logarithm of.
    pub fn interval(self) -> Interval {
        let quantile = StudentsT::new(0.0, 1.0, self.freedom.max(1.0))
            .map_or(f64::INFINITY, |t| t.inverse_cdf(0.5 + 0.5 * CONFIDENCE));
        let reach = quantile * self.variance.sqrt();
        let [estimate, lower, upper] = [self.value, self.value - reach, self.value + reach].map(libm::exp);
        Interval { estimate, lower, upper }
    }
}

/// The sum of independent logarithms.
fn added(all: &[Logarithm]) -> Logarithm {
    let value = all.iter().map(|one| one.value).sum();
    let variance: f64 = all.iter().map(|one| one.variance).sum();
    let squares: f64 = all.iter().map(|one| one.variance * one.variance / one.freedom).sum();
    let least = all.iter().map(|one| one.freedom).fold(f64::INFINITY, f64::min);
    let freedom = if squares > 0.0 { variance * variance / squares } else { least };
    Logarithm { value, variance, freedom }
}

#[cfg(test)]
mod tests {
    use clerestory_film::{SampleStream, SamplerSettings};

    use super::*;

    #[test]
    fn numbers_without_spread_have_an_interval_without_width() {
        let mean = |number: f64| Logarithm::of_mean(&[number; 5]).unwrap();
        let interval = mean(6.0).over(mean(4.0)).interval();
        for end in [interval.estimate, interval.lower, interval.upper] {
            assert!((end - 1.5).abs() < 1e-12, "{interval:?}");
        }
        let both = [mean(1.0).over(mean(2.0)), mean(8.0).over(mean(1.0))];
        assert!((Logarithm::geometric_mean(&both).unwrap().interval().estimate - 2.0).abs() < 1e-12);
    }

    #[test]
    fn what_has_no_interval_has_none() {
        assert!(Logarithm::of_mean(&[1.0]).is_none() && Logarithm::of_mean(&[]).is_none());
        assert!(Logarithm::of_mean(&[3.0, -1.0, -1.0]).is_none(), "a mean below zero without the first");
        assert!(Logarithm::geometric_mean(&[]).is_none());
    }

    /// Of 1000 intervals of a ratio of means of five numbers, those that hold it.
    fn coverage(draw: impl Fn(f64) -> f64) -> f64 {
        let settings = SamplerSettings { seed: 7, samples_per_block: 1 };
        let mut random = SampleStream::new(&settings, 0, [0, 0], 0).trials();
        // The mean of what is drawn is 1 in all cases below.
        let mut mean = |scale: f64| {
            let numbers: Vec<f64> = (0..5).map(|_| scale * draw(random.next_f64())).collect();
            Logarithm::of_mean(&numbers).unwrap()
        };
        let holds = |interval: Interval| interval.lower <= 1.5 && 1.5 <= interval.upper;
        (0..1000).filter(|_| holds(mean(3.0).over(mean(2.0)).interval())).count() as f64 / 1000.0
    }

    #[test]
    fn intervals_hold_the_ratio_as_often_as_they_say() {
        // Errors of pictures: those of most have a spread of some percent, those with rare samples one of their size.
        let even = coverage(|uniform| 0.9 + 0.2 * uniform);
        assert!((0.93..=0.995).contains(&even), "{even}");
        let skewed = coverage(|uniform| -libm::log(1.0 - uniform));
        assert!((0.88..=0.99).contains(&skewed), "{skewed}");
    }

    #[test]
    fn a_geometric_mean_is_known_better_than_each_of_its_ratios() {
        let ratio = Logarithm::of_mean(&[1.0, 1.1, 0.9, 1.2, 0.8]).unwrap();
        let of_many = Logarithm::geometric_mean(&[ratio; 16]).unwrap().interval();
        let width = |interval: Interval| libm::log(interval.upper / interval.lower);
        let shrunk = width(ratio.interval()) / width(of_many);
        assert!((4.0..6.5).contains(&shrunk), "a quarter, and less for more degrees of freedom: {shrunk}");
    }
}
