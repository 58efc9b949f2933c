//! Light subpaths: from a light into the room, as far as surfaces that scatter light into a solid angle.
//!
//! What came through glass goes on bouncing. A path from the camera seldom finds the small bright patch from which that
//! light comes; a light subpath begins there. Each camera sample has its own, and connects its vertices to it (Veach
//! and Guibas 1994, "Bidirectional estimators for light transport"). Those of the light plane leave a splat wherever
//! the camera sees a vertex of theirs. `starts` chooses where a light subpath begins: on a face of a pane, in an
//! opening, or on a light itself. `weights` says how techniques that find the same path share it.

mod on_face;
mod on_light;
mod on_opening;
mod start;
mod starts;
mod weights;

pub(super) use self::start::{On, PlaceOnFace, Start};
pub(super) use self::starts::Starts;
pub(super) use self::weights::{Edge, FromCamera, FromLight, SUBPATHS, connection_share, splat_share};
