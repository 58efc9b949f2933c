//! What follows from the nodes that workers bring: acceptance, votes on checked nodes, and nodes that are rendered
//! again.

pub(in crate::store) mod acceptance;
pub(in crate::store) mod answers;
pub(in crate::store) mod lost_nodes;
pub(in crate::store) mod redo;
