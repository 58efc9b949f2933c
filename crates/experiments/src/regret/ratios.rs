//! Ratios of error times time, and the limits that they are held to.

use std::fmt;

use serde::Serialize;

use super::measured::{AUTO, Compared, Measured, Metric};
use crate::pairs::TAXES;
use crate::ratio::{Interval, Logarithm};
use crate::table::{Column, column, rounded_number};

/// Limit of `auto` over the best single method on required pairs.
const REQUIRED: f64 = 1.1;

/// The same on all other pairs.
const EACH: f64 = 1.25;

/// The same of the geometric mean over all pairs.
const MEAN: f64 = 1.05;

/// Fewest pairs for a geometric mean that counts.
const LEAST_PAIRS: usize = 16;

/// Most of the least error that may be the noise of the reference, or the square of a bias that it could hide.
const LARGEST_SHARE: f64 = 0.1;

/// Standard errors of the bias that a comparison of two halves could miss.
const MISSED: f64 = 3.0;

/// What a ratio is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Figure {
    /// `auto` over the best single method, on a pair on which it must be as good.
    Required,
    /// The same on any other pair.
    Regret,
    /// The geometric mean of the regret of all pairs.
    MeanRegret,
    /// `auto` with panes over `auto` without.
    GlassTax,
    /// `auto` over `light`.
    OverLight,
}

/// A ratio: a row of `ratios`.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Ratio {
    pub(super) figure: Figure,
    /// The pair, or the scene and its glass.
    pub(super) pair: String,
    pub(super) light: String,
    pub(super) glass: String,
    pub(super) metric: &'static str,
    /// What `auto` is divided by.
    pub(super) against: String,
    #[serde(flatten)]
    pub(super) interval: Option<Interval>,
    /// Most that the lower end may be.
    pub(super) limit: Option<f64>,
    /// Why there is no ratio.
    pub(super) remark: Option<String>,
    verdict: &'static str,
}

pub(super) const RATIO_COLUMNS: [Column; 12] = [
    column(
        "figure",
        "required, regret: auto over the best single method; mean_regret: its geometric mean; glass_tax: auto with \
         panes over auto without; over_light: auto over light",
    ),
    column("pair", "the scene and its light, or the scene and its glass"),
    column("light", "what lights it"),
    column("glass", "what the light goes through"),
    column("metric", "the error that is multiplied by time"),
    column("against", "what auto is divided by"),
    column("estimate", "the ratio of error times core seconds"),
    column("lower", "lower end of its interval of 95 percent"),
    column("upper", "upper end of its interval of 95 percent"),
    column("limit", "most that the lower end may be"),
    column("verdict", "whether the lower end is at most the limit"),
    column("remark", "why there is no ratio"),
];

impl Ratio {
    fn new(figure: Figure, metric: Metric, limit: Option<f64>) -> Self {
        let text = String::new;
        Self {
            figure,
            pair: text(),
            light: text(),
            glass: text(),
            metric: metric.name(),
            against: text(),
            interval: None,
            limit,
            remark: None,
            verdict: "",
        }
    }

    /// With its interval, or why there is none.
    fn with(self, interval: Result<Interval, String>) -> Self {
        let (interval, remark) = match interval {
            Ok(interval) => (Some(interval), None),
            Err(remark) => (None, Some(remark)),
        };
        let mut ratio = Self { interval, remark: self.remark.clone().or(remark), ..self };
        ratio.verdict = match ratio.limit {
            None => "",
            Some(_) if ratio.is_met() => "met",
            Some(_) if ratio.remark.is_some() => "not known",
            Some(_) => "missed",
        };
        ratio
    }

    /// Whether the lower end of its interval is at most its limit. What is not known is not met.
    pub(super) fn is_met(&self) -> bool {
        let is_low = self.interval.zip(self.limit).is_some_and(|(interval, limit)| interval.lower <= limit);
        self.remark.is_none() && is_low
    }

    /// The ratio as a cell of a table.
    pub(super) fn cell(&self) -> String {
        match (&self.interval, &self.remark) {
            (_, Some(remark)) => remark.clone(),
            (Some(Interval { estimate, lower, upper }), None) => {
                format!("{} [{}, {}]", short(*estimate), short(*lower), short(*upper))
            }
            (None, None) => String::new(),
        }
    }

    pub(super) fn verdict(&self) -> &'static str {
        self.verdict
    }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { pair, metric, against, verdict, .. } = self;
        write!(f, "{pair}: {metric} times time of auto over that of {against}: {}", self.cell())?;
        match self.limit {
            Some(limit) => write!(f, "; limit {limit}: {verdict}."),
            None => f.write_str("."),
        }
    }
}

/// A ratio with two or three digits.
fn short(number: f64) -> String {
    if (0.01..99.5).contains(&number) { format!("{number:.2}") } else { rounded_number(number) }
}

/// All ratios.
pub(super) fn ratios(all: &[Compared]) -> Vec<Ratio> {
    let mut ratios = Vec::new();
    let compared = || all.iter().filter(|compared| !compared.pair.methods.is_empty());
    for compared in compared() {
        for metric in Metric::ALL {
            ratios.push(regret(compared, metric).0);
        }
    }
    for metric in Metric::ALL {
        let known: Vec<Logarithm> = compared().filter_map(|compared| regret(compared, metric).1).collect();
        let remark = (known.len() < LEAST_PAIRS)
            .then(|| format!("known of {} pairs, and at least {LEAST_PAIRS} are needed", known.len()));
        let mean = Logarithm::geometric_mean(&known).map(Logarithm::interval).ok_or_else(|| "no pair".to_owned());
        let pair = format!("geometric mean of {} pairs", known.len());
        let against = "the best single method of each".to_owned();
        ratios.push(Ratio { pair, against, remark, ..Ratio::new(Figure::MeanRegret, metric, Some(MEAN)) }.with(mean));
    }
    ratios.extend(taxes(all));
    for compared in compared() {
        for metric in Metric::ALL {
            let ratio = over(compared, compared.of("light"), metric).map(Logarithm::interval);
            ratios.push(
                Ratio { against: "light".to_owned(), ..of_pair(compared, Figure::OverLight, metric) }.with(ratio),
            );
        }
    }
    ratios
}

fn of_pair(compared: &Compared, figure: Figure, metric: Metric) -> Ratio {
    let limit = match figure {
        Figure::Required => Some(REQUIRED),
        Figure::Regret => Some(EACH),
        _ => None,
    };
    let [pair, light, glass] = [compared.pair.name, compared.pair.light, compared.pair.glass].map(str::to_owned);
    Ratio { pair, light, glass, ..Ratio::new(figure, metric, limit) }
}

/// `auto` over the best single method on a pair, and its logarithm where it is known.
fn regret(compared: &Compared, metric: Metric) -> (Ratio, Option<Logarithm>) {
    let figure = if compared.pair.is_required { Figure::Required } else { Figure::Regret };
    let single = compared.methods.iter().filter(|measured| measured.method != AUTO);
    let best = single.min_by(|a, b| a.product(metric).total_cmp(&b.product(metric)));
    let ratio = over(compared, best, metric);
    let known = ratio.as_ref().ok().copied();
    let against = best.filter(|best| !best.renders.is_empty());
    let against = against.map_or_else(String::new, |best| best.method.to_owned());
    let row = Ratio { against, ..of_pair(compared, figure, metric) };
    (row.with(ratio.map(Logarithm::interval)), known)
}

/// Error times time of `auto` over that of a method.
fn over(compared: &Compared, method: Option<&Measured>, metric: Metric) -> Result<Logarithm, String> {
    check(compared, metric)?;
    let logarithm = |measured: Option<&Measured>| measured.and_then(|measured| measured.logarithm(metric));
    let both = logarithm(compared.of(AUTO)).zip(logarithm(method));
    both.map(|(auto, other)| auto.over(other)).ok_or_else(|| "no interval".to_owned())
}

/// Whether errors on a pair are known: there is a reference, and its noise is small beside them.
fn check(compared: &Compared, metric: Metric) -> Result<(), String> {
    let [mse, rel_mse] = compared.shares();
    let reference = compared.reference.as_ref();
    let (share, noise) = match metric {
        Metric::Mse => (mse, reference.map_or(0.0, |reference| reference.record.noise)),
        Metric::RelMse => (rel_mse, compared.noise[1]),
    };
    match &compared.reference {
        None => Err("no reference".to_owned()),
        Some(reference) if !reference.record.agrees => Err("the halves of the reference disagree".to_owned()),
        Some(_) if share.is_none_or(|share| share > LARGEST_SHARE) => Err("below the reference".to_owned()),
        Some(reference) if could_hide_bias(reference.record.mean_error, share.unwrap_or_default(), noise) => {
            Err("the halves of the reference could hide a bias".to_owned())
        }
        Some(_) => Ok(()),
    }
}

/// Whether the square of a bias that the halves of a reference could hide is too much of the least error. Its noise is
/// the part `share` of that, and relative to the picture it is `noise`.
fn could_hide_bias(mean_error: f64, share: f64, noise: f64) -> bool {
    let bias = MISSED * mean_error;
    bias * bias * share > LARGEST_SHARE * noise
}

/// What glass costs, by relMSE.
fn taxes(all: &[Compared]) -> impl Iterator<Item = Ratio> {
    let metric = Metric::RelMse;
    TAXES.iter().map(move |tax| {
        let of = |name: &str| {
            let compared = all.iter().find(|compared| compared.pair.name == name).ok_or("no such pair")?;
            check(compared, metric)?;
            let auto = compared.of(AUTO).and_then(|auto| auto.logarithm(metric));
            auto.ok_or_else(|| "no interval".to_owned())
        };
        let ratio = of(tax.glazed).and_then(|glazed| Ok(glazed.over(of(tax.bare)?).interval()));
        let [pair, glass] = [tax.scene, tax.glass].map(str::to_owned);
        let against = "the same without panes".to_owned();
        Ratio { pair, glass, against, ..Ratio::new(Figure::GlassTax, metric, Some(tax.limit)) }.with(ratio)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bias_of_three_standard_errors_must_be_small_beside_the_least_error() {
        // The least error is 0.02 of the squared mean.
        let (noise, share) = (0.001, 0.05);
        assert!(!could_hide_bias(0.01, share, noise), "0.0009 is less than a tenth");
        assert!(could_hide_bias(0.02, share, noise), "0.0036 is more than a tenth");
    }
}
