//! What a search that finds paths by chance says about their light (Zeltner et al. 2020, section 4.3).
//!
//! One run finds path k with an unknown probability `p_k`. Two estimators make something of that:
//!
//! - **unbiased**: the path of the first run, times the number of further independent runs until one finds the same
//!   path again. The expectation of that number is `1 / p_k` (Booth 2007);
//! - **biased**: the distinct paths that a fixed number M of runs finds, each counted once. Its expectation lacks the
//!   part `(1 - p_k)^M` of each path's light: too dark, never too bright.

use clerestory_film::TrialStream;
use clerestory_film::counters::Counters;

/// A search for the paths of one connection from random seeds.
pub(crate) trait RandomSearch {
    /// A path.
    type Path;

    /// Runs once: a function of the numbers that it draws and of nothing else that is random.
    fn solve(&self, random: &mut TrialStream, counters: &mut Counters) -> Option<Self::Path>;

    /// Whether two of them are the same path.
    fn same(&self, first: &Self::Path, second: &Self::Path) -> bool;

    /// Number of independent runs until `path` is found again: an unbiased estimate of one over its probability. Cut
    /// off at `max_trials`.
    fn inverse_probability(
        &self,
        path: &Self::Path,
        max_trials: u32,
        random: &mut TrialStream,
        counters: &mut Counters,
    ) -> f64 {
        for trial in 1..=max_trials {
            counters.trials += 1;
            if self.solve(random, counters).is_some_and(|found| self.same(path, &found)) {
                return f64::from(trial);
            }
        }
        counters.truncated += 1;
        f64::from(max_trials)
    }

    /// The distinct paths that `runs` runs find.
    fn distinct(&self, runs: u32, random: &mut TrialStream, counters: &mut Counters) -> Vec<Self::Path> {
        let mut paths: Vec<Self::Path> = Vec::new();
        for _ in 0..runs {
            counters.trials += 1;
            if let Some(path) = self.solve(random, counters)
                && !paths.iter().any(|known| self.same(known, &path))
            {
                paths.push(path);
            }
        }
        paths
    }
}
