//! The scene file as a document: places in it by their path, changes of what stands there, and what
//! may stand there.

mod integrators;
mod overrides;
mod path;

pub use integrators::{IntegratorEntry, integrators};
pub use overrides::{Override, OverrideError, apply};
