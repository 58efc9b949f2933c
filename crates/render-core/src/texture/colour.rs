//! A colour, the same everywhere or from a picture.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Encoding;
use super::mapped::{Bitmaps, MappedPicture, TextureCoordinates, TextureDescription, TextureUse};
use crate::settings::check::check_triple;
use crate::settings::{Check, JsonPath, Triple};

/// A colour over a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ColourDescription {
    /// The same everywhere; each channel between 0 and 1.
    Colour(#[schemars(inner(range(min = 0.0, max = 1.0)))] Triple),
    /// A picture.
    Texture(Box<TextureDescription>),
}

impl ColourDescription {
    /// White everywhere.
    pub(crate) fn white() -> Self {
        Self::Colour([1.0; 3])
    }

    /// A picture that repeats.
    pub(crate) fn picture(file: &str) -> Self {
        Self::Texture(Box::new(TextureDescription::of_file(file)))
    }

    /// Checks it.
    pub(crate) fn check(&self, path: &JsonPath<'_>) -> Check {
        match self {
            Self::Colour(colour) => check_triple(*colour, 0.0, 1.0, &path.member("colour")),
            Self::Texture(texture) => texture.check(&path.member("texture")),
        }
    }

    /// Its picture, where it has one. `place` is its own place.
    pub(crate) fn texture(&self, place: &str) -> Option<TextureUse<'_>> {
        match self {
            Self::Colour(_) => None,
            Self::Texture(texture) => {
                Some(TextureUse { place: format!("{place}.texture"), texture, encoding: Encoding::Colour })
            }
        }
    }

    /// The colour, with pictures that have been decoded.
    pub(crate) fn build(&self, bitmaps: &Bitmaps<'_>) -> Colour {
        match self {
            Self::Colour(colour) => Colour::Uniform(DVec3::from(*colour)),
            Self::Texture(texture) => Colour::Textured(texture.build(Encoding::Colour, bitmaps)),
        }
    }
}

/// A colour over a surface, linear Rec.709.
#[derive(Clone, Debug)]
pub(crate) enum Colour {
    /// The same everywhere.
    Uniform(DVec3),
    /// A picture.
    Textured(MappedPicture),
}

impl Colour {
    /// The value at a point.
    pub(crate) fn at(&self, at: TextureCoordinates) -> DVec3 {
        match self {
            Self::Uniform(colour) => *colour,
            Self::Textured(picture) => picture.at(at),
        }
    }
}
