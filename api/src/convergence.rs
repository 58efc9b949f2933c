//! Convergence: how the error of a frame falls from round to round.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::JobId;

/// The convergence of a job, oldest round first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ConvergenceSeries {
    /// The job.
    pub job: JobId,
    /// Whether the error was measured against a reference; otherwise only `estimated_mse` is present.
    pub has_reference: bool,
    /// One point for each complete round.
    pub points: Vec<ConvergencePoint>,
}

/// The present error of a job's first frame, between its rounds. It covers the pixels that have samples, of which one
/// may have more than another. It is measured when it is asked for, never stored, and nothing is stopped by it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LiveMeasurement {
    /// The job.
    pub job: JobId,
    /// Part of the pixels that have samples and are measured, 0 to 1.
    pub covered: f64,
    /// Samples in each of these pixels, on average.
    pub samples_per_pixel: f64,
    /// Mean squared error of these pixels against the reference, over their channels; absent without a reference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mse: Option<f64>,
    /// Mean squared standard error of these pixels, from their block means; absent before all of them have two blocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimated_mse: Option<f64>,
}

/// The error of a frame at a complete round. An error that is not a finite number is absent: without a reference, or,
/// for `psnr`, when the image equals the reference.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ConvergencePoint {
    /// The frame.
    pub frame: u32,
    /// Number of the round, from 0.
    pub round: u32,
    /// Passes in every tile; in those of an adaptive job that have most.
    pub passes: u32,
    /// Samples in every pixel; in those of an adaptive job that have most.
    pub samples_per_pixel: u64,
    /// Time spent rendering everything accepted by then, summed over cores.
    pub core_ms: i64,
    /// Time since the job's first lease.
    pub wall_ms: i64,
    /// When the round was recorded.
    pub recorded_ms: i64,
    /// Mean squared error against the reference, over pixels and channels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mse: Option<f64>,
    /// `mse` less the mean squared standard error of the reference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corrected_mse: Option<f64>,
    /// Relative mean squared error. It weighs dark pixels most, so it can rise from one round to the next when a bright
    /// sample arrives.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rel_mse: Option<f64>,
    /// Peak signal-to-noise ratio, dB.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr: Option<f64>,
    /// Mean FLIP, 0 to 1: how different frame and reference look to someone who alternates between them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flip: Option<f64>,
    /// Mean squared standard error of the image itself, from its block means; absent before there are two blocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimated_mse: Option<f64>,
}
