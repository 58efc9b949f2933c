//! A number, the same everywhere or from a channel of a picture.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Encoding;
use super::mapped::{Bitmaps, MappedPicture, TextureCoordinates, TextureDescription, TextureUse};
use crate::settings::check::check_range;
use crate::settings::{Check, JsonPath};

/// A number between 0 and 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ValueDescription {
    /// The same everywhere.
    Uniform(#[schemars(range(min = 0.0, max = 1.0))] f64),
    /// A channel of a picture.
    Texture(Box<ValueTexture>),
}

/// A channel of a picture, as it stands in the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ValueTexture {
    /// The picture.
    pub texture: TextureDescription,
    /// The channel.
    #[serde(default)]
    pub channel: Channel,
}

/// A channel of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// The first, which is all of a grey picture.
    #[default]
    Red,
    /// The second.
    Green,
    /// The third.
    Blue,
}

impl ValueDescription {
    /// The same number everywhere.
    pub fn number(value: f64) -> Self {
        Self::Uniform(value)
    }

    /// Checks that all values are in a range.
    pub(crate) fn check(&self, min: f64, max: f64, path: &JsonPath<'_>) -> Check {
        match self {
            Self::Uniform(value) => check_range(*value, min, max, path),
            Self::Texture(value) => value.texture.check(&path.member("texture")),
        }
    }

    /// Its picture, where it has one. `place` is its own place.
    pub(crate) fn texture(&self, place: &str) -> Option<TextureUse<'_>> {
        match self {
            Self::Uniform(_) => None,
            Self::Texture(value) => Some(TextureUse {
                place: format!("{place}.texture"),
                texture: &value.texture,
                encoding: Encoding::Data,
            }),
        }
    }

    /// The value, with pictures that have been decoded.
    pub(crate) fn build(&self, bitmaps: &Bitmaps<'_>) -> Value {
        match self {
            Self::Uniform(value) => Value::Uniform(*value),
            Self::Texture(value) => Value::Textured(value.texture.build(Encoding::Data, bitmaps), value.channel),
        }
    }
}

/// A number over a surface.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    /// The same everywhere.
    Uniform(f64),
    /// A channel of a picture.
    Textured(MappedPicture, Channel),
}

impl Value {
    /// The value at a point.
    pub(crate) fn at(&self, at: TextureCoordinates) -> f64 {
        match self {
            Self::Uniform(value) => *value,
            Self::Textured(picture, channel) => picture.at(at)[*channel as usize],
        }
    }
}
