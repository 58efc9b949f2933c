//! TODO

pub(in crate::store) mod answers;
pub(in crate::store) mod redo;
pub(in crate::store) mod table;
