//! Whether Mitsuba 3 renders the same picture of a scene, once it is exported.
//!
//! Both renderers make several independent pictures of each scene. The `statistic` module says whether they agree.
//! Faults that are planted into the exported scene show that it would notice them.

mod interior;
pub mod mitsuba;
pub mod pictures;
pub mod scenes;
mod shapes;
pub mod statistic;
