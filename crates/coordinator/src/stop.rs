//! Stop rules: at which round a job ends.
//!
//! A job ends with its last round, or before that at its time limit or at a target, whichever comes first. Time is looked at
//! by the clock (in `store`) and keeps what is complete. Everything else is looked at where the image is made of the same
//! passes in every tile: at complete rounds, one after another. So an image that a target ended is the one that has that many
//! samples from the start, and depends on nobody's speed.
//!
//! The error that a target is compared with is a random number like the image itself. Measured against a reference it is the
//! error of this very image, and may end a job at its first round. Estimated from the image's own block means it knows nothing of
//! light that no sample has met yet; the fewer blocks there are, the more often it is too low, so it does not count before there
//! are [`FEWEST_BLOCKS`].

use clerestory_api::{ConvergencePoint, StopReason};

/// Blocks of samples in each pixel before an estimated error counts. The variance of a pixel that n blocks tell has a relative
/// standard deviation of `sqrt(2 / (n - 1))` even where block means are normal: 1.4 with two blocks, 0.8 with four.
pub(crate) const FEWEST_BLOCKS: u32 = 4;

/// Blocks in each pixel of which passes are shared out by noise, without a target that wants more: with one, no standard error is known.
const FEWEST_SHARED_BLOCKS: u32 = 2;

/// Errors at which a job ends, in squared units of radiance.
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
const TARGETS: [StopReason; 2] = [StopReason::Mse, StopReason::EstimatedMse];

impl Targets {
    /// Checks them for a job that has a reference or not, with the mean square of its standard-error layer where that is known.
    ///
    /// # Errors
    ///
    /// [`InvalidTarget`] for one that is no positive number, or that no error can be compared with: for want of a reference, or
    /// because the noise of the reference is not below it. What is left of an error when so much noise is taken off says
    /// more about the reference than about the image.
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

    /// Blocks that each pixel gets before passes are shared out by noise.
    pub(crate) fn fewest_blocks(&self) -> u32 {
        self.estimated_mse.map_or(FEWEST_SHARED_BLOCKS, |_| FEWEST_BLOCKS)
    }

    /// Whether it can be told when the job will end: without a target at its last sample, and otherwise once its error is known.
    pub fn is_end_known(&self, samples_per_block: u32, latest: Option<&ConvergencePoint>) -> bool {
        let has_target = self.mse.is_some() || self.estimated_mse.is_some();
        !has_target || latest.is_some_and(|point| self.expected_samples(samples_per_block, point).is_some())
    }

    /// The target that every frame has reached at a complete round, if there is one.
    pub fn reached(&self, samples_per_block: u32, frames: &[ConvergencePoint]) -> Option<StopReason> {
        let has_reached = |target, point| {
            self.error_and_target(target, samples_per_block, point).is_some_and(|[error, target]| error <= target)
        };
        // A round without frames has reached nothing.
        let mut targets = TARGETS.into_iter().filter(|_| !frames.is_empty());
        targets.find(|target| frames.iter().all(|point| has_reached(*target, point)))
    }

    /// Samples in a pixel at which the first target will be reached, as far as the last round of a frame tells: the error of
    /// an image falls as the inverse of their number. `None` where nothing can be told.
    pub fn expected_samples(&self, samples_per_block: u32, point: &ConvergencePoint) -> Option<f64> {
        let targets = TARGETS.into_iter().filter_map(|target| self.error_and_target(target, samples_per_block, point));
        let excess = targets.map(|[error, target]| error / target).reduce(f64::min)?;
        Some(point.samples_per_pixel as f64 * excess.max(0.0))
    }

    /// The error of a frame that a target is compared with, and the target, where there are both.
    fn error_and_target(
        &self,
        target: StopReason,
        samples_per_block: u32,
        point: &ConvergencePoint,
    ) -> Option<[f64; 2]> {
        match target {
            // The noise of a reference is no error of the image.
            StopReason::Mse => Some([point.corrected_mse.or(point.mse)?, self.mse?]),
            StopReason::EstimatedMse => {
                let fewest_samples = u64::from(FEWEST_BLOCKS) * u64::from(samples_per_block);
                let estimated = point.estimated_mse.filter(|_| point.samples_per_pixel >= fewest_samples);
                Some([estimated?, self.estimated_mse?])
            }
            StopReason::Samples | StopReason::Time => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLOCK: u32 = 16;

    fn point(
        blocks: u64,
        mse: Option<f64>,
        corrected_mse: Option<f64>,
        estimated_mse: Option<f64>,
    ) -> ConvergencePoint {
        let samples_per_pixel = blocks * u64::from(BLOCK);
        ConvergencePoint { samples_per_pixel, mse, corrected_mse, estimated_mse, ..ConvergencePoint::default() }
    }

    #[test]
    fn a_target_is_reached_by_its_own_error_and_no_other() {
        let (mse, estimated) = (Some(StopReason::Mse), Some(StopReason::EstimatedMse));
        #[track_caller]
        fn check(target: [Option<f64>; 2], point: ConvergencePoint, expected: Option<StopReason>) {
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
        assert_eq!(targets.reached(BLOCK, &[point(0, Some(1e-9), None, None)]), Some(StopReason::Mse));
    }

    #[test]
    fn every_frame_has_to_reach_the_same_target_in_the_same_round() {
        let targets = Targets { mse: Some(1e-3), estimated_mse: Some(1e-3) };
        let (good, bad) = (point(9, Some(1e-4), None, Some(1.0)), point(9, Some(1e-2), None, Some(1e-4)));
        assert_eq!(targets.reached(BLOCK, &[good.clone(), good.clone()]), Some(StopReason::Mse));
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
