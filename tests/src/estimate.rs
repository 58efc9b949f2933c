//! Means of independent replicates, and whether two of them can be estimates of the same values.

use std::fmt;

use statrs::distribution::{ContinuousCDF, StudentsT};

/// A mean with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Variance of the mean.
    pub variance: f64,
    /// Degrees of freedom of that variance.
    pub degrees: f64,
}

/// Images are stored in single precision: means can be wrong by this part.
const ROUNDING: f64 = 2e-7;

impl Estimate {
    /// The mean of independent, equally distributed values, two at the least.
    pub fn of(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        Self { mean, variance: squares / (count * (count - 1.0)), degrees: count - 1.0 }
    }

    /// A value that is known.
    pub fn exact(value: f64) -> Self {
        Self { mean: value, variance: 0.0, degrees: f64::INFINITY }
    }

    /// The mean over several estimates that are independent.
    pub fn mean(estimates: &[Self]) -> Self {
        let count = estimates.len() as f64;
        let total = estimates.iter().copied().fold(Self::exact(0.0), |total, estimate| total.plus(&estimate));
        total.scaled(1.0 / count)
    }

    /// The sum with an independent estimate.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let variance = self.variance + other.variance;
        // Welch and Satterthwaite.
        let share = |estimate: &Self| estimate.variance * estimate.variance / estimate.degrees;
        let shares = share(self) + share(other);
        let degrees = if shares > 0.0 { variance * variance / shares } else { f64::INFINITY };
        Self { mean: self.mean + other.mean, variance, degrees }
    }

    /// The estimate times a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self { mean: self.mean * factor, variance: self.variance * factor * factor, ..*self }
    }

    /// Standard error over the mean.
    pub fn relative_error(&self) -> f64 {
        self.variance.sqrt() / self.mean
    }

    /// How many standard errors lie between two independent estimates.
    pub fn deviates(&self, other: &Self) -> f64 {
        let rounding = ROUNDING * self.mean.abs().max(other.mean.abs());
        let difference = self.plus(&other.scaled(-1.0));
        let error = (difference.variance + rounding * rounding).sqrt();
        if difference.mean == 0.0 { 0.0 } else { difference.mean / error }
    }

    /// Probability that two independent estimates of one value are at least as far apart as these.
    pub fn probability(&self, other: &Self) -> f64 {
        let degrees = self.plus(&other.scaled(-1.0)).degrees.min(1e6);
        let distribution = StudentsT::new(0.0, 1.0, degrees).expect("positive degrees of freedom");
        2.0 * distribution.cdf(-self.deviates(other).abs())
    }
}

impl fmt::Display for Estimate {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:.6} (1 +- {:.5})", self.mean, self.relative_error())
    }
}

/// The outcome of a comparison of two sets of estimates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Number of pairs.
    pub pairs: usize,
    /// Probability that the pair that is farthest apart is so far apart, by Bonferroni.
    pub worst: f64,
    /// Probability that the means over all are so far apart.
    pub total: f64,
    /// Ratio of the means over all.
    pub ratio: f64,
    /// Standard error of that ratio.
    pub error: f64,
}

/// Two sets of estimates of the same values differ as much as this less often.
const REJECTED: f64 = 1e-4;

impl Agreement {
    /// Compares estimates pair by pair, and their means.
    pub fn of(ours: &[Estimate], theirs: &[Estimate]) -> Self {
        let pairs = ours.len().min(theirs.len());
        let least = ours.iter().zip(theirs).map(|(a, b)| a.probability(b)).fold(1.0, f64::min);
        let (our_mean, their_mean) = (Estimate::mean(ours), Estimate::mean(theirs));
        let errors = [our_mean, their_mean].map(|mean| mean.relative_error());
        Self {
            pairs,
            worst: (least * pairs as f64).min(1.0),
            total: our_mean.probability(&their_mean),
            ratio: our_mean.mean / their_mean.mean,
            error: (errors[0] * errors[0] + errors[1] * errors[1]).sqrt(),
        }
    }

    /// Whether nothing speaks against both being estimates of the same values.
    pub fn holds(&self) -> bool {
        self.worst > REJECTED && self.total > REJECTED
    }
}

impl fmt::Display for Agreement {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "ratio {:.5} +- {:.5} (p = {:.2e}), worst of {} cells p = {:.2e}",
            self.ratio, self.error, self.total, self.pairs, self.worst
        )
    }
}

/// Checks that estimates agree, and that they would not if ours were `1 + fault` times as large, or as small.
///
/// # Panics
///
/// When they do not agree, or agree with one of the faults as well.
#[track_caller]
pub fn check_agreement(name: &str, ours: &[Estimate], theirs: &[Estimate], fault: f64) {
    let agreement = Agreement::of(ours, theirs);
    println!("{name}: {agreement}");
    assert!(agreement.holds(), "{name}: {agreement}");
    for factor in [1.0 + fault, 1.0 / (1.0 + fault)] {
        let faulty: Vec<Estimate> = ours.iter().map(|estimate| estimate.scaled(factor)).collect();
        let agreement = Agreement::of(&faulty, theirs);
        assert!(!agreement.holds(), "{name}: a factor of {factor} is not noticed: {agreement}");
    }
}
