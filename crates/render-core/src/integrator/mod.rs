//! The path tracer, which asks [`crate::specular`] for the light that next event estimation cannot see.

mod allocation;
mod light_pass;
mod light_subpaths;
pub mod path;
mod pilot;
mod prepared;
pub mod render;
#[cfg(test)]
mod strips_tests;

pub use prepared::PreparedScene;
pub use render::{RenderError, render_node, render_nodes, rendered_together};

pub use clerestory_film::Rendered;
