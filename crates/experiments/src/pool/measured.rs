//! The errors of one method at one number of samples.

use serde::Serialize;

/// All seeds of a method with one number of samples.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Measured {
    pub(super) variant: String,
    pub(super) samples_per_pixel: f64,
    pub(super) core_seconds: f64,
    pub(super) preparation_seconds: f64,
    pub(super) mse: f64,
    pub(super) mse_standard_error: Option<f64>,
    pub(super) bias_squared: Option<f64>,
    pub(super) bias_squared_standard_error: Option<f64>,
    pub(super) mean_ratio: f64,
    pub(super) mean_ratio_standard_error: Option<f64>,
}
