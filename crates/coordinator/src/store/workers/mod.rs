//! TODO

pub(in crate::store) mod heartbeats;
pub(in crate::store) mod table;
