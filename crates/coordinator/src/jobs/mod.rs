//! Jobs: submitted, worked on under leases, watched until their end.

pub(crate) mod claims;
pub(crate) mod deadlines;
mod idle_workers;
pub(crate) mod lifecycle;
pub(crate) mod submission;
pub(crate) mod submission_error;
pub(crate) mod submission_memory;
pub(crate) mod upload_linger;
pub(crate) mod workers;
