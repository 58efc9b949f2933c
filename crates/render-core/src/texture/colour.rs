//! A colour, the same everywhere or from a picture.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Bitmap;
use crate::settings::check::{check_asset_name, check_triple};
use crate::settings::{Check, JsonPath, Triple};

/// Decoded pictures by the names of their files.
pub type Bitmaps<'a> = BTreeMap<&'a str, Arc<Bitmap>>;

/// Diffuse reflectance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ColourDescription {
    /// The same everywhere; each channel between 0 and 1.
    Colour(#[schemars(inner(range(min = 0.0, max = 1.0)))] Triple),
    /// A picture, looked up by the mesh's texture coordinates (u, v), repeated, filtered bilinearly. u = 0 is the left
    /// border and v = 0 the bottom border of the picture, as in OBJ files.
    Texture {
        /// PNG (8 or 16 bits, sRGB) or EXR (linear, channels R, G, B or Y, 0 to 1) file, relative to the scene file.
        file: String,
    },
}

impl ColourDescription {
    /// Checks it.
    pub(crate) fn check(&self, path: &JsonPath<'_>) -> Check {
        match self {
            Self::Colour(colour) => check_triple(*colour, 0.0, 1.0, &path.member("colour")),
            Self::Texture { file } => check_asset_name(file, &path.member("texture").member("file")),
        }
    }

    /// The file that it names, with its place below this one.
    pub(crate) fn file(&self) -> Option<(&'static str, &str)> {
        match self {
            Self::Colour(_) => None,
            Self::Texture { file } => Some(("texture.file", file)),
        }
    }

    /// The colour, with a picture that has been decoded.
    pub(crate) fn build(&self, bitmaps: &Bitmaps<'_>) -> Colour {
        match self {
            Self::Colour(colour) => Colour::Uniform(DVec3::from(*colour)),
            Self::Texture { file } => {
                Colour::Textured(bitmaps.get(file.as_str()).expect("every picture is decoded").clone())
            }
        }
    }
}

/// A colour over a surface, linear Rec.709.
#[derive(Clone, Debug)]
pub(crate) enum Colour {
    /// The same everywhere.
    Uniform(DVec3),
    /// A picture.
    Textured(Arc<Bitmap>),
}

impl Colour {
    /// The value at a texture coordinate.
    pub(crate) fn at(&self, coordinate: DVec2) -> DVec3 {
        match self {
            Self::Uniform(colour) => *colour,
            Self::Textured(bitmap) => bitmap.lookup(coordinate),
        }
    }
}
