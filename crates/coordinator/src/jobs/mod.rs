//! TODO

pub(crate) mod idle_workers;
pub(crate) mod submission;
pub(crate) mod submission_memory;
