//! The path tracer, which asks [`crate::specular`] for the light that next event estimation cannot see.

pub mod path;
pub mod path_filter;
pub mod render;

pub use path_filter::PathFilter;
pub use render::{RenderError, render_node, specular_method};

pub use clerestory_film::Rendered;
