//! Numbers: intervals and rectangles of them, Bernstein polynomials, and several side by side.

mod attenuation;
pub(crate) mod bernstein;
pub(crate) mod hash;
pub mod interval;
pub(crate) mod simd;

pub use attenuation::absorption;
pub use interval::{Interval, Rect};
