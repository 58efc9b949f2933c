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

impl AddAssign for Counters {
    fn add_assign(&mut self, other: Self) {
        self.height_evaluations += other.height_evaluations;
        self.solver_calls += other.solver_calls;
        self.converged += other.converged;
        self.unique_solutions += other.unique_solutions;
        self.trials += other.trials;
        self.truncated += other.truncated;
        self.rays += other.rays;
        self.samples += other.samples;
    }
}
