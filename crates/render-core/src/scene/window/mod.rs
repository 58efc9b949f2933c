//! Leaded windows: a few lines of a scene file that become panes, lead, iron and stone.
//!
//! The crate `clerestory-glazing` plans a window in its plane: lights, pieces, cames and bars. Here the plan gets its
//! place in the world, and its pieces get glass: each is cut from a sheet, as glaziers did.

mod colour;
mod description;
mod expand;
mod glass;
mod painter;

pub use clerestory_glazing::WindowDesign;
pub use colour::{COLOURS, GlassColour, HistoricalColour, Tint};
pub(crate) use description::check_windows;
pub use description::{OuterGlazing, WindowDescription};
pub(in crate::scene) use description::{own_sheets, paints};
pub use expand::{WindowExpansion, expand, plan};
pub use glass::{Cutting, GlassDescription, GlassSheet};

#[cfg(test)]
mod tests;
