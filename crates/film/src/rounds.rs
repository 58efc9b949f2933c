//! Rounds: the moments at which every tile of a frame has the same passes, so that its error can be measured.
//!
//! Boundaries lie at 1, 2, 4, 8 and 16 passes and then at every 16th. Early rounds come fast, and later ones come at a
//! steady price.

use crate::address::PassRange;

/// Passes between late boundaries; a power of two.
const LATE_STEP: u32 = 16;

/// The round boundaries of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rounds {
    passes: u32,
}

impl Rounds {
    /// The rounds of a job of `passes` passes.
    pub fn new(passes: u32) -> Self {
        Self { passes }
    }

    /// Passes that are complete after `round`; `None` when the job ends earlier.
    pub fn end(&self, round: u32) -> Option<u32> {
        let doublings = LATE_STEP.ilog2();
        let boundary = |round: u32| match round.checked_sub(doublings) {
            None => 1 << round,
            Some(late) => LATE_STEP.saturating_mul(late.saturating_add(1)),
        };
        let first = if round == 0 { 0 } else { boundary(round - 1) };
        (first < self.passes).then(|| boundary(round).min(self.passes))
    }

    /// The passes that `round` adds to the one before it; `None` when the job ends earlier.
    pub fn passes(&self, round: u32) -> Option<PassRange> {
        let end = self.end(round)?;
        let first = round.checked_sub(1).and_then(|previous| self.end(previous)).unwrap_or(0);
        Some(PassRange { first, count: end - first })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boundaries_double_up_to_sixteen_and_then_follow_every_sixteen() {
        #[track_caller]
        fn check(passes: u32, expected: &[u32]) {
            let rounds = Rounds::new(passes);
            let ends: Vec<u32> = (0..).map_while(|round| rounds.end(round)).collect();
            assert_eq!(ends, expected);
        }
        check(1, &[1]);
        check(3, &[1, 2, 3]);
        check(16, &[1, 2, 4, 8, 16]);
        check(23, &[1, 2, 4, 8, 16, 23]);
        check(53, &[1, 2, 4, 8, 16, 32, 48, 53]);
    }

    #[test]
    fn rounds_cover_every_pass_once() {
        for passes in 1..200 {
            let rounds = Rounds::new(passes);
            let mut next = 0;
            for range in (0..).map_while(|round| rounds.passes(round)) {
                assert_eq!(range.first, next);
                next += range.count;
            }
            assert_eq!(next, passes);
        }
    }
}
