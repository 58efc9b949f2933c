//! Values over surfaces: pictures, read from files, colours and numbers.

mod bitmap;
mod colour;
mod encoding;
pub(crate) mod height_map;
mod mapped;
mod normal_map;
pub(crate) mod picture;
mod picture_check;
#[cfg(test)]
pub(crate) mod picture_samples;
pub(crate) mod picture_size;
mod png_colour;
mod png_metadata;
mod radiance_file;
mod radiance_picture;
mod value;
mod wrap;

pub use bitmap::{Bitmap, srgb_to_linear};
pub use colour::ColourDescription;
pub use encoding::Encoding;
pub use mapped::{Bitmaps, PictureKey, TextureCoordinates, TextureDescription, TextureTransform, TextureUse};
pub use normal_map::{NormalMap, NormalMapDescription};
pub use radiance_picture::RadiancePicture;
pub use value::{Channel, ValueDescription, ValueTexture};
pub use wrap::{Filter, Wrap};

pub(crate) use colour::Colour;
pub(crate) use mapped::MappedPicture;
pub(crate) use picture_check::unreadable;
pub(crate) use value::Value;
