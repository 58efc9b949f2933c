//! How far an image is from a reference.

use clerestory_film::{FrameImage, Metrics, ToneCurve, compare, mean_flip};
use serde::Serialize;

use crate::failure::Failure;

/// How far an image is from a reference.
#[derive(Serialize)]
pub(crate) struct Measures {
    #[serde(flatten)]
    pub(crate) metrics: Metrics,
    pub(crate) flip: f64,
}

impl Measures {
    pub(crate) fn of(image: &FrameImage, reference: &FrameImage) -> Result<Self, Failure> {
        let metrics = compare(image, reference).map_err(Failure::Compare)?;
        let flip = mean_flip(image, reference, ToneCurve::Filmic).map_err(Failure::Compare)?;
        Ok(Self { metrics, flip })
    }
}
