//! Checks: nodes that a second worker renders too, the votes on them, and what follows from a wrong one.

pub(in crate::store) mod answers;
pub(in crate::store) mod redo;
pub(in crate::store) mod table;
