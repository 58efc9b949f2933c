//! Counters: how much work a render took.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Work counted while rendering. Every method counts the same way, so that their figures can be compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
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
