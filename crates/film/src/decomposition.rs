//! The error of an estimator, taken apart into variance and bias by the spread of independent renders.
//!
//! Images are given as their numbers, in any order that is the same for all. All sums run in that order, in double
//! precision, so the same images give the same numbers everywhere.

/// The error of one estimator, measured on independent renders of one picture. In the square of the unit of the numbers
/// where nothing else is said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decomposition {
    /// Mean over the renders of `1/N sum (x - r)^2`, less the noise of the reference.
    pub mse: f64,
    /// Standard error of `mse` by the spread of the renders; `None` for a single render.
    pub mse_standard_error: Option<f64>,
    /// Variance of one render, `1/N sum var(x)`; `None` for a single render.
    pub variance: Option<f64>,
    /// `1/N sum (E x - r)^2`, without bias: what is left of `mse` without the variance. Below zero as often as above
    /// where there is no bias. `None` for a single render.
    pub bias_squared: Option<f64>,
    /// Standard error of `bias_squared` by the jackknife; `None` for fewer than three renders.
    pub bias_squared_standard_error: Option<f64>,
    /// Mean of all numbers of all renders, in their unit.
    pub mean: f64,
    /// Standard error of `mean` by the spread of the renders, in the unit of the numbers; `None` for a single render.
    pub mean_standard_error: Option<f64>,
}

/// Takes apart the error of renders with independent random numbers. `noise` is the mean over the reference's numbers
/// of their squared standard error. `None` without renders, without numbers, or where the lengths differ.
pub fn decompose(renders: &[&[f64]], reference: &[f64], noise: f64) -> Option<Decomposition> {
    let count = renders.len();
    if count == 0 || reference.is_empty() || renders.iter().any(|render| render.len() != reference.len()) {
        return None;
    }
    let errors: Vec<f64> =
        renders.iter().map(|render| mean_squared_difference(render, reference.iter().copied()) - noise).collect();
    let means: Vec<f64> = renders.iter().map(|render| mean(render)).collect();
    let numbers = reference.len();
    let sums: Vec<f64> = (0..numbers).map(|index| renders.iter().map(|render| render[index]).sum()).collect();
    let split = split(renders, None, &sums, reference, noise);
    let bias_squared_standard_error = (count > 2).then(|| {
        let leave_one_out = (0..count).filter_map(|omitted| split_without(renders, omitted, &sums, reference, noise));
        let estimates: Vec<f64> = leave_one_out.collect();
        let centre = mean(&estimates);
        let squares: f64 = estimates.iter().map(|estimate| (estimate - centre) * (estimate - centre)).sum();
        ((count - 1) as f64 / count as f64 * squares).sqrt()
    });
    Some(Decomposition {
        mse: mean(&errors),
        mse_standard_error: standard_error(&errors),
        variance: split.map(|(variance, _)| variance),
        bias_squared: split.map(|(_, bias_squared)| bias_squared),
        bias_squared_standard_error,
        mean: mean(&means),
        mean_standard_error: standard_error(&means),
    })
}

/// Mean of numbers; zero of none.
pub fn mean(numbers: &[f64]) -> f64 {
    numbers.iter().sum::<f64>() / numbers.len().max(1) as f64
}

/// Standard error of the mean of independent numbers; `None` for fewer than two.
pub fn standard_error(numbers: &[f64]) -> Option<f64> {
    let count = numbers.len() as f64;
    let centre = mean(numbers);
    let squares: f64 = numbers.iter().map(|number| (number - centre) * (number - centre)).sum();
    (numbers.len() > 1).then(|| (squares / (count * (count - 1.0))).sqrt())
}

fn split_without(renders: &[&[f64]], omitted: usize, sums: &[f64], reference: &[f64], noise: f64) -> Option<f64> {
    split(renders, Some(omitted), sums, reference, noise).map(|(_, bias_squared)| bias_squared)
}

/// Variance and squared bias of the renders but one, from the sums over all.
fn split(
    renders: &[&[f64]],
    omitted: Option<usize>,
    sums: &[f64],
    reference: &[f64],
    noise: f64,
) -> Option<(f64, f64)> {
    let kept: Vec<&[f64]> =
        renders.iter().enumerate().filter(|(index, _)| Some(*index) != omitted).map(|(_, render)| *render).collect();
    if kept.len() < 2 {
        return None;
    }
    let count = kept.len() as f64;
    let left_out = |index: usize| omitted.map_or(0.0, |omitted| renders[omitted][index]);
    let centre: Vec<f64> = sums.iter().enumerate().map(|(index, sum)| (sum - left_out(index)) / count).collect();
    let spread: f64 = kept.iter().map(|render| mean_squared_difference(render, centre.iter().copied())).sum();
    let variance = spread / (count - 1.0);
    let distance = mean_squared_difference(&centre, reference.iter().copied());
    Some((variance, distance - variance / count - noise))
}

fn mean_squared_difference(first: &[f64], second: impl Iterator<Item = f64>) -> f64 {
    let squares: f64 = first.iter().zip(second).map(|(a, b)| (a - b) * (a - b)).sum();
    squares / first.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{SampleStream, SamplerSettings};

    #[test]
    fn three_renders_of_two_numbers_are_taken_apart_as_by_hand() {
        let result = decompose(&[&[1.0, 2.0], &[3.0, 2.0], &[2.0, 5.0]], &[1.0, 1.0], 0.25).unwrap();
        // Squared errors are (0 + 1)/2, (4 + 1)/2 and (1 + 16)/2.
        assert!((result.mse - (11.5 / 3.0 - 0.25)).abs() < 1e-15);
        // The variances of the numbers are 1 and 3; the mean is (2, 3).
        assert_eq!(result.variance, Some(2.0));
        assert!((result.bias_squared.unwrap() - (2.5 - 2.0 / 3.0 - 0.25)).abs() < 1e-15);
        assert!((result.mse - result.variance.unwrap() - result.bias_squared.unwrap()).abs() < 1e-15);
        assert_eq!(result.mean, 2.5);
        // The renders have the means 1.5, 2.5 and 3.5.
        assert!((result.mean_standard_error.unwrap() - (1.0f64 / 3.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn bias_and_variance_are_found_in_noise_within_their_standard_errors() {
        let numbers = 2000;
        let settings = SamplerSettings { seed: 11, samples_per_block: 1 };
        // Uniform in [-0.5, 0.5] plus 0.2: variance 1/12 and squared bias 0.04.
        let renders: Vec<Vec<f64>> = (0..5)
            .map(|render| {
                let mut trials = SampleStream::new(&settings, 0, [0, 0], render).trials();
                (0..numbers).map(|_| trials.next_f64() - 0.3).collect()
            })
            .collect();
        let renders: Vec<&[f64]> = renders.iter().map(Vec::as_slice).collect();
        let result = decompose(&renders, &vec![0.0; numbers], 0.0).unwrap();
        assert!((result.variance.unwrap() - 1.0 / 12.0).abs() < 0.005, "{result:?}");
        let error = result.bias_squared_standard_error.unwrap();
        assert!(error > 0.0 && error < 0.01, "{result:?}");
        assert!((result.bias_squared.unwrap() - 0.04).abs() < 5.0 * error, "{result:?}");
    }

    #[test]
    fn what_one_render_cannot_tell_is_absent() {
        let result = decompose(&[&[2.0]], &[1.0], 0.0).unwrap();
        assert_eq!((result.mse, result.mean), (1.0, 2.0));
        assert_eq!((result.variance, result.bias_squared, result.mean_standard_error), (None, None, None));
        assert_eq!(decompose(&[], &[1.0], 0.0), None);
        assert_eq!(decompose(&[&[1.0, 2.0]], &[1.0], 0.0), None);
    }
}
