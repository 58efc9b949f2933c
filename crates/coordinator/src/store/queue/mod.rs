//! TODO

pub(in crate::store) mod backlog;
pub(in crate::store) mod claim;
pub(in crate::store) mod open_jobs;
pub(in crate::store) mod splits;
pub(in crate::store) mod stragglers;
pub(in crate::store) mod suspects;
