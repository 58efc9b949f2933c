//! The coverage rule `K(path)`: which paths a specular method owns.
//!
//! A method owns the path O, X1, X2, S when O is a vertex that is not specular, the path enters one pane through the
//! face that looks at O and leaves it through the other, with exactly these two transmissions between O and the light,
//! and all of the following hold:
//!
//! - O does not lie between the highest and the lowest point of a face or its plane ([`PaneSide::facing`]);
//! - no segment runs along the pane (cosine at least [`GRAZING_COSINE`]);
//! - the method's selection of panes would have looked at this pane for this O and S
//!   ([`super::SpecularMethod::selects`]).
//!
//! The path tracer leaves out the light of exactly these paths, whatever it was that sampled them, and keeps all others:
//! reflections, internal reflections, two panes in a row.

use glam::DVec3;

use super::side::{GRAZING_COSINE, PaneSide};

/// Whether the segments `directions` (towards the light, in the pane's frame) are steep enough to be owned.
pub fn owns(side: &PaneSide<'_>, directions: [DVec3; 3]) -> bool {
    directions.into_iter().all(|direction| direction.z * side.sign >= GRAZING_COSINE)
}
