//! What the methods did: the figures by which papers compare solvers.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

/// Work counted while rendering. Every method counts the same way, so that their figures can be compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Evaluations of a height field (with or without derivatives) at one point.
    pub height_evaluations: u64,
    /// Starts of an iterative solver from one seed.
    pub solver_calls: u64,
    /// Solver calls that converged to an admissible path.
    pub converged: u64,
    /// Distinct solutions that entered an estimate.
    pub unique_solutions: u64,
    /// Trials spent on estimating inverse probabilities.
    pub trials: u64,
    /// Inverse-probability estimates cut off at the largest number of trials.
    pub truncated: u64,
    /// Rays traced against the scene.
    pub rays: u64,
    /// Camera samples rendered.
    pub samples: u64,
}

impl Counters {
    /// The `number`-th of `count` parts, from 0 on. All of them together are the whole.
    #[must_use]
    pub fn part(&self, number: u32, count: u32) -> Self {
        let up_to =
            |counted: u64, parts: u32| (u128::from(counted) * u128::from(parts) / u128::from(count.max(1))) as u64;
        let part = |counted: u64| up_to(counted, number.saturating_add(1)) - up_to(counted, number);
        Self {
            height_evaluations: part(self.height_evaluations),
            solver_calls: part(self.solver_calls),
            converged: part(self.converged),
            unique_solutions: part(self.unique_solutions),
            trials: part(self.trials),
            truncated: part(self.truncated),
            rays: part(self.rays),
            samples: part(self.samples),
        }
    }
}

/// Sums saturate: those of a farm have terms that were counted by others.
impl AddAssign for Counters {
    fn add_assign(&mut self, other: Self) {
        self.height_evaluations = self.height_evaluations.saturating_add(other.height_evaluations);
        self.solver_calls = self.solver_calls.saturating_add(other.solver_calls);
        self.converged = self.converged.saturating_add(other.converged);
        self.unique_solutions = self.unique_solutions.saturating_add(other.unique_solutions);
        self.trials = self.trials.saturating_add(other.trials);
        self.truncated = self.truncated.saturating_add(other.truncated);
        self.rays = self.rays.saturating_add(other.rays);
        self.samples = self.samples.saturating_add(other.samples);
    }
}
