//! Renders the image of a scene in this process.
//!
//! Passes and their sums are those of a farm, so the image has the same bits. [`render`] renders round by round, up to
//! a [`PassPlan`]. [`LocalFilm`] renders pass by pass, for a caller that decides after each one. [`image()`] makes the
//! image of the sums. A [`Control`] stops a render from another thread.

mod clocks;
mod control;
mod error;
mod film;
mod image;
mod plan;
mod render;

pub use clocks::{Clocks, Spent};
pub use control::Control;
pub use error::LocalRenderError;
pub use film::LocalFilm;
pub use image::{Provenance, image};
pub use plan::PassPlan;
pub use render::{Outcome, Round, render};
