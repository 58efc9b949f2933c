//! A number, the same everywhere or from a channel of a picture.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::Encoding;
use super::mapped::{Bitmaps, MappedPicture, TextureCoordinates, TextureDescription, TextureUse};
use crate::settings::check::check_range;
use crate::settings::{Check, JsonPath};

/// A number between 0 and 1.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum ValueDescription {
    /// The same everywhere.
    Uniform(#[schemars(range(min = 0.0, max = 1.0))] f64),
    /// A channel of a picture.
    Texture(Box<ValueTexture>),
}

impl<'de> Deserialize<'de> for ValueDescription {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrTexture;

        impl<'de> Visitor<'de> for NumberOrTexture {
            type Value = ValueDescription;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("a number between 0 and 1, or an object with texture and channel")
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Self::Value, E> {
                Ok(ValueDescription::Uniform(value))
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<Self::Value, E> {
                Ok(ValueDescription::Uniform(value as f64))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Self::Value, E> {
                Ok(ValueDescription::Uniform(value as f64))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let texture = ValueTexture::deserialize(MapAccessDeserializer::new(map))?;
                Ok(ValueDescription::Texture(Box::new(texture)))
            }
        }

        deserializer.deserialize_any(NumberOrTexture)
    }
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
    /// The opacity; 1 everywhere in a picture without.
    Alpha,
}

impl ValueTexture {
    /// How the picture is decoded.
    fn encoding(&self) -> Encoding {
        if self.channel == Channel::Alpha { Encoding::Opacity } else { Encoding::Data }
    }
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
                encoding: value.encoding(),
            }),
        }
    }

    /// The value, with pictures that have been decoded.
    pub(crate) fn build(&self, bitmaps: &Bitmaps<'_>) -> Value {
        match self {
            Self::Uniform(value) => Value::Uniform(*value),
            Self::Texture(value) => {
                let lane = match value.channel {
                    // Of opacities, all three are the same.
                    Channel::Red | Channel::Alpha => 0,
                    Channel::Green => 1,
                    Channel::Blue => 2,
                };
                Value::Textured(value.texture.build(value.encoding(), bitmaps), lane)
            }
        }
    }
}

/// A number over a surface.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    /// The same everywhere.
    Uniform(f64),
    /// A channel of a picture, by its place among red, green and blue.
    Textured(MappedPicture, usize),
}

impl Value {
    /// The value at a point.
    pub(crate) fn at(&self, at: TextureCoordinates) -> f64 {
        match self {
            Self::Uniform(value) => *value,
            Self::Textured(picture, lane) => picture.at(at)[*lane],
        }
    }

    /// The least value anywhere.
    pub(crate) fn least(&self) -> f64 {
        match self {
            Self::Uniform(value) => *value,
            Self::Textured(picture, lane) => picture.least()[*lane],
        }
    }
}
