//! Leaded windows in the plane: from a design to pieces of glass, cames, bars and tracery.
//!
//! A [`WindowDesign`] says how a window is made, as a glazier and a mason would. Its [plan](WindowDesign::plan) has the
//! pieces as convex polygons, the cames and bars as lines, and the stone as polygons with holes. A plan becomes
//! [triangles](WindowPlan::meshes) or a [drawing](svg). The crate knows nothing of scenes and rays.
//!
//! An opening is a closed outline of lines and arcs. Tracery cuts it into lights, which are such outlines again. In
//! each light, the filling draws lead lines, whose arrangement has the pieces as its faces.
//!
//! Results are the same on every machine: transcendental functions are those of `libm`.

mod arrangement;
mod bars;
mod clip;
mod convex;
mod curve;
mod design;
mod drawing;
mod error;
mod filling;
mod glass;
mod glaze;
mod grid;
mod lead;
mod mesh;
mod opening;
mod outline;
mod plan;
mod polygon;
mod random;
mod stone;
mod svg;
mod tracery;
mod wall;

pub use bars::{Bar, BarSection, Bars, Ferramenta, SaddleBars};
pub use design::WindowDesign;
pub use error::GlazingError;
pub use filling::{Border, Diamonds, Drawn, DrawnPiece, Filling, Rectangles, Roundels};
pub use glass::{GlassCycle, GlassPattern, MixedGlass, UniformGlass, WeightedGlass};
pub use lead::{CameProfile, Cames, Lead};
pub use mesh::{MeshPart, PlanMesh};
pub use opening::{Arch, DrawnOpening, Drop, Foil, Head, Lancet, Ogee, Opening, Roundel, Segmental, Tudor};
pub use plan::{Came, Piece, PiecePlace, SheetCut, SolderJoint, WindowPlan, Zone};
pub use polygon::{area, convex_hull, inset_convex};
pub use stone::{StoneFrame, StoneHole, StoneSection};
pub use svg::{DrawingStyle, svg};
pub use tracery::{Geometrical, Intersecting, Mullions, Reticulated, Tracery};
pub use wall::{PlannedWall, Wall};

#[cfg(test)]
mod tests;
