//! Workers: registered, and last heard of.

pub(in crate::store) mod heartbeats;
pub(in crate::store) mod pins;
pub(in crate::store) mod table;
