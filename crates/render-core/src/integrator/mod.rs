//! The path tracer, which asks [`crate::specular`] for the light that next event estimation cannot see.

mod allocation;
mod light_pass;
mod light_subpaths;
pub mod path;
mod pilot;
mod prepared;
pub mod render;

pub use prepared::PreparedScene;
pub use render::{RenderError, render_node};

pub use clerestory_film::Rendered;
