//! What follows from what workers bring: acceptance of nodes, votes on checked nodes, nodes that are rendered again,
//! and reports on scenes.

pub(in crate::store) mod acceptance;
pub(in crate::store) mod answers;
pub(in crate::store) mod lost_nodes;
pub(in crate::store) mod redo;
pub(in crate::store) mod scene_reports;
