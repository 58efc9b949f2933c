//! Values over surfaces: pictures, read from files, and colours.

mod bitmap;
mod colour;
pub(crate) mod height_map;
pub(crate) mod picture;
#[cfg(test)]
pub(crate) mod picture_samples;
pub(crate) mod picture_size;
mod png_colour;
mod png_metadata;

pub use bitmap::Bitmap;
pub use colour::{Bitmaps, ColourDescription};

pub(crate) use colour::Colour;
