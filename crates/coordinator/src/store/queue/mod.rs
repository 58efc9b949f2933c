//! The queue: pending work, and the claims that choose nodes of it.

pub(in crate::store) mod backlog;
pub(in crate::store) mod claim;
pub(in crate::store) mod open_jobs;
pub(in crate::store) mod splits;
pub(in crate::store) mod stragglers;
pub(in crate::store) mod strips;
pub(in crate::store) mod suspects;
