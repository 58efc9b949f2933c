//! Targets: the errors at which a render ends.
//!
//! A target is compared with the error at complete rounds only, where every tile has the same passes. So the image that
//! a target ends does not depend on the speed of any worker.
//!
//! The error that a target is compared with is a random number like the image itself. An error against a reference is
//! the error of this very image, so it may end a render at its first round. An error that is estimated from the image's
//! own block means knows nothing of light that no sample has met. With few blocks it is often too low, so it does not
//! count before there are `FEWEST_BLOCKS`.

use crate::adaptive::Adaptation;
use crate::sampling::Sampling;

/// Blocks of samples in each pixel before an estimated error counts. The variance of a pixel that n blocks tell has a
/// relative standard deviation of `sqrt(2 / (n - 1))` even where block means are normal: 1.4 with two blocks, 0.8 with
/// four.
const FEWEST_BLOCKS: u32 = 4;

/// Blocks in each pixel before passes are shared out by noise: one block has no standard error.
const FEWEST_SHARED_BLOCKS: u32 = 2;

/// The errors of a frame at a complete round; an error that is not known is absent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RoundError {
    /// Samples in each pixel.
    pub samples_per_pixel: u64,
    /// Mean squared error against the reference.
    pub mse: Option<f64>,
    /// The same without the noise of the reference.
    pub corrected_mse: Option<f64>,
    /// Mean squared standard error of the image itself.
    pub estimated_mse: Option<f64>,
}

/// One of the two targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Error against the reference.
    Mse,
    /// Standard error of the image itself.
    EstimatedMse,
}

/// Errors at which a render ends, in squared units of radiance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Targets {
    /// Mean squared error against the reference.
    pub mse: Option<f64>,
    /// Mean squared standard error of the image itself.
    pub estimated_mse: Option<f64>,
}

/// A target cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub struct InvalidTarget {
    /// Its name in a submission.
    pub field: &'static str,
    /// Its value.
    pub value: f64,
    /// What would be right.
    pub expected: String,
}

/// The targets, the measured one first: where both are reached, it says more.
const TARGETS: [Target; 2] = [Target::Mse, Target::EstimatedMse];

impl Targets {
    /// Checks them for a job that has a reference or not, with the mean square of its standard-error layer where that
    /// is known.
    ///
    /// # Errors
    ///
    /// [`InvalidTarget`] for one that is no positive number, or that no error can be compared with: for want of a
    /// reference, or because the noise of the reference is not below it. What is left of an error when so much noise is
    /// taken off says more about the reference than about the image.
    pub fn check(&self, has_reference: bool, reference_noise: Option<f64>) -> Result<(), InvalidTarget> {
        for (field, target) in [("target_mse", self.mse), ("target_estimated_mse", self.estimated_mse)] {
            if let Some(value) = target.filter(|target| !(target.is_finite() && *target > 0.0)) {
                return Err(InvalidTarget { field, value, expected: "a positive number".to_owned() });
            }
        }
        let Some(value) = self.mse else { return Ok(()) };
        let expected = match reference_noise {
            _ if !has_reference => "a reference beside it, which the error is measured against".to_owned(),
            Some(noise) if value <= noise => {
                format!("more than {noise:e}, the mean squared standard error of the reference")
            }
            _ => return Ok(()),
        };
        Err(InvalidTarget { field: "target_mse", value, expected })
    }

    /// How an adaptive render shares out its passes.
    ///
    /// # Errors
    ///
    /// The fewest samples in a pixel that would leave something to share out, where `passes` are too few.
    pub fn adaptation(&self, sampling: Sampling, passes: u32) -> Result<Adaptation, u32> {
        let blocks = self.estimated_mse.map_or(FEWEST_SHARED_BLOCKS, |_| FEWEST_BLOCKS);
        let too_few = || blocks.saturating_mul(sampling.samples_per_block()).saturating_add(1);
        Adaptation::new(sampling, passes, blocks).ok_or_else(too_few)
    }

    /// Whether the end of the render can be predicted: without a target always, with one once its error is known.
    pub fn is_end_known(&self, samples_per_block: u32, latest: Option<&RoundError>) -> bool {
        let has_target = self.mse.is_some() || self.estimated_mse.is_some();
        !has_target || latest.is_some_and(|point| self.expected_samples(samples_per_block, point).is_some())
    }

    /// The target that every frame has reached at a complete round, if there is one.
    pub fn reached(&self, samples_per_block: u32, frames: &[RoundError]) -> Option<Target> {
        let has_reached = |target, point| {
            self.error_and_target(target, samples_per_block, point).is_some_and(|[error, target]| error <= target)
        };
        // A round without frames has reached nothing.
        let mut targets = TARGETS.into_iter().filter(|_| !frames.is_empty());
        targets.find(|target| frames.iter().all(|point| has_reached(*target, point)))
    }

    /// Samples in a pixel at which the first target will be reached, as far as the last round of a frame tells: the
    /// error of an image falls as the inverse of their number. `None` where nothing can be told.
    pub fn expected_samples(&self, samples_per_block: u32, point: &RoundError) -> Option<f64> {
        let targets = TARGETS.into_iter().filter_map(|target| self.error_and_target(target, samples_per_block, point));
        let excess = targets.map(|[error, target]| error / target).reduce(f64::min)?;
        Some(point.samples_per_pixel as f64 * excess.max(0.0))
    }

    /// The error of a frame that a target is compared with, and the target, where there are both.
    fn error_and_target(&self, target: Target, samples_per_block: u32, point: &RoundError) -> Option<[f64; 2]> {
        match target {
            // The noise of a reference is no error of the image.
            Target::Mse => Some([point.corrected_mse.or(point.mse)?, self.mse?]),
            Target::EstimatedMse => {
                let fewest_samples = u64::from(FEWEST_BLOCKS) * u64::from(samples_per_block);
                let estimated = point.estimated_mse.filter(|_| point.samples_per_pixel >= fewest_samples);
                Some([estimated?, self.estimated_mse?])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLOCK: u32 = 16;

    fn point(blocks: u64, mse: Option<f64>, corrected_mse: Option<f64>, estimated_mse: Option<f64>) -> RoundError {
        let samples_per_pixel = blocks * u64::from(BLOCK);
        RoundError { samples_per_pixel, mse, corrected_mse, estimated_mse }
    }

    #[test]
    fn a_target_is_reached_by_its_own_error_and_no_other() {
        let (mse, estimated) = (Some(Target::Mse), Some(Target::EstimatedMse));
        #[track_caller]
        fn check(target: [Option<f64>; 2], point: RoundError, expected: Option<Target>) {
            let targets = Targets { mse: target[0], estimated_mse: target[1] };
            assert_eq!(targets.reached(BLOCK, &[point]), expected);
        }
        let measured = [Some(1e-3), None];
        check(measured, point(9, Some(1e-3), None, None), mse);
        check(measured, point(9, Some(1.1e-3), None, Some(1e-9)), None);
        check(measured, point(9, None, None, Some(1e-9)), None);
        // The noise of the reference is no error of the image.
        check(measured, point(9, Some(1.5e-3), Some(9e-4), None), mse);
        check(measured, point(9, Some(1.5e-3), Some(-1e-5), None), mse);
        let own = [None, Some(1e-3)];
        check(own, point(9, Some(1e-9), None, Some(1e-3)), estimated);
        check(own, point(9, Some(1e-9), None, Some(1.1e-3)), None);
        check(own, point(9, Some(1e-9), None, None), None);
        let both = [Some(1e-3), Some(1e-3)];
        check(both, point(9, Some(1e-4), None, Some(1e-4)), mse);
        check(both, point(9, Some(1e-2), None, Some(1e-4)), estimated);
        check([None, None], point(9, Some(0.0), None, Some(0.0)), None);
    }

    #[test]
    fn when_a_job_with_a_target_ends_is_known_from_its_first_error_on() {
        let estimated = |target| Targets { mse: None, estimated_mse: target };
        let [without, with] = [false, true].map(|has_error| point(9, Some(1.0), None, has_error.then_some(1.0)));
        assert!(estimated(None).is_end_known(BLOCK, None));
        assert!(
            !estimated(Some(0.1)).is_end_known(BLOCK, None)
                && !estimated(Some(0.1)).is_end_known(BLOCK, Some(&without))
        );
        assert!(estimated(Some(0.1)).is_end_known(BLOCK, Some(&with)));
    }

    #[test]
    fn an_error_that_few_blocks_tell_ends_no_job_and_a_measured_one_does() {
        let targets = Targets { mse: Some(1e-3), estimated_mse: Some(1e-3) };
        let own = |blocks| point(blocks, None, None, Some(1e-9));
        assert_eq!(
            [2, 3, 4, 5].map(|blocks| targets.reached(BLOCK, &[own(blocks)]).is_some()),
            [false, false, true, true]
        );
        assert_eq!(targets.reached(BLOCK, &[point(0, Some(1e-9), None, None)]), Some(Target::Mse));
    }

    #[test]
    fn every_frame_has_to_reach_the_same_target_in_the_same_round() {
        let targets = Targets { mse: Some(1e-3), estimated_mse: Some(1e-3) };
        let (good, bad) = (point(9, Some(1e-4), None, Some(1.0)), point(9, Some(1e-2), None, Some(1e-4)));
        assert_eq!(targets.reached(BLOCK, &[good, good]), Some(Target::Mse));
        assert_eq!(targets.reached(BLOCK, &[good, bad]), None);
        assert_eq!(targets.reached(BLOCK, &[]), None);
    }

    #[test]
    fn the_end_is_expected_where_the_error_falls_to_the_nearer_target() {
        let targets = Targets { mse: Some(1e-3), estimated_mse: Some(1e-3) };
        let expected = |mse, estimated| targets.expected_samples(BLOCK, &point(4, mse, None, estimated));
        assert_eq!(expected(None, None), None);
        assert_eq!(expected(Some(4e-3), None), Some(256.0));
        assert_eq!(expected(Some(4e-3), Some(2e-3)), Some(128.0));
    }

    #[test]
    fn targets_that_no_error_can_be_compared_with_are_refused_with_their_value() {
        let refused = |mse, estimated_mse, has_reference, noise| {
            let invalid = Targets { mse, estimated_mse }.check(has_reference, noise).unwrap_err();
            (invalid.field, invalid.value, invalid.expected)
        };
        let positive = || "a positive number".to_owned();
        assert_eq!(refused(Some(0.0), None, true, None), ("target_mse", 0.0, positive()));
        assert_eq!(refused(None, Some(-1.0), true, None), ("target_estimated_mse", -1.0, positive()));
        assert_eq!(refused(None, Some(f64::INFINITY), true, None).2, positive());
        assert!(refused(Some(1e-3), None, false, None).2.contains("a reference"));
        assert!(refused(Some(1e-3), None, true, Some(1e-3)).2.contains("more than 1e-3"));
        let sound = Targets { mse: Some(1e-3), estimated_mse: Some(1e-3) };
        assert_eq!((sound.check(true, Some(9e-4)), sound.check(true, None)), (Ok(()), Ok(())));
        assert_eq!(Targets { mse: None, ..sound }.check(false, None), Ok(()));
    }
}
