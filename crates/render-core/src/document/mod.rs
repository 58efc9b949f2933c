//! The scene file as a document: places in it by their path, and changes of what stands there.

mod overrides;
mod path;

pub use overrides::{Override, OverrideError, apply};
