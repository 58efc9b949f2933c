//! Numbers: intervals and rectangles of them, Bernstein polynomials, and several side by side.

pub(crate) mod bernstein;
pub(crate) mod hash;
pub mod interval;
pub(crate) mod simd;

pub use interval::{Interval, Rect};
