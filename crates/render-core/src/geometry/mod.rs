//! Shapes and the rays that meet them: height-field panes, triangles, and the hierarchy over both.
//!
//! Everything is in double precision and in metres. Only the hierarchy's boxes are in single precision, recentred,
//! rescaled and padded. What a ray has just left is skipped by identity ([`SurfaceId`]), never by an epsilon.

pub mod accelerator;
pub(crate) mod boxes;
pub(crate) mod closed;
pub(crate) mod coincidence;
pub(crate) mod contact;
mod containment;
mod coverage;
mod crossing;
pub mod differential;
pub mod frame;
mod half_plane;
pub mod height_field;
mod hierarchy;
pub(crate) mod large_pages;
mod outline;
pub mod pane;
mod pyramid;
pub mod ray;
pub(crate) mod rotation;
mod sheet;
mod sphere_tracing;
pub(crate) mod spherical_rectangle;
mod spline;
mod tangent;
#[cfg(test)]
pub(crate) mod testing;
mod thickness;
mod triangle;

pub use accelerator::{
    Accelerator, AcceleratorError, Hit, MOST_PASSED, Passed, PassedTriangle, Solid, Surface, Within,
};
pub use coverage::Coverage;
pub use differential::SurfaceDifferential;
pub use frame::Frame;
pub use half_plane::HalfPlane;
pub(crate) use half_plane::Shape;
pub(crate) use height_field::{FacePoints, ShapeBounds, Symmetric};
pub use height_field::{HeightField, HeightFieldError, JetBounds, SurfaceJet};
pub use outline::{MOST_CORNERS, Outline, OutlineError};
pub(crate) use outline::{SeenOutline, Widened};
pub use pane::{FaceCrossing, Pane, PaneBoundary, PaneError, PaneHit, PaneParts};
pub use ray::{Face, Ray, SurfaceId};
pub use tangent::{MappedTriangles, Tangent, mapped_normal};
pub(crate) use triangle::ShearedRay;
