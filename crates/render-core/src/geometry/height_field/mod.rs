//! The displacement of one face of a pane: a uniform cubic tensor-product B-spline over a grid of heights.
//!
//! The grid values are the spline's *coefficients*: the surface approximates them and is C2 everywhere. Value (i, j)
//! sits at `u = (i + 1/2) / columns`, `v = (j + 1/2) / rows`. Here `u = x / width + 1/2` and `v = y / height + 1/2` run
//! over the outline from 0 to 1. Row 0 is at the smallest v. Beyond the grid the outermost values repeat, so the
//! surface goes on smoothly past the outline and becomes constant two values further out.
//!
//! A *cell* is the square between four neighbouring values, on which the surface is one bicubic polynomial. `bounds`
//! says between which values the surface lies over a rectangle, and `shape` does so for four rectangles that may be
//! small.

mod bounds;
mod cell_bounds;
mod field;
mod patch;
mod shape;
mod third_derivatives;

pub use cell_bounds::JetBounds;
pub use field::{HeightField, HeightFieldError, SurfaceJet};
pub(crate) use shape::{FacePoints, ShapeBounds};
pub(crate) use third_derivatives::Symmetric;
