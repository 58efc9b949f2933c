//! What a picture is beyond its borders and between its texels.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a picture goes on beyond its border.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// It begins again.
    #[default]
    Repeat,
    /// It is mirrored.
    Mirror,
    /// Its last texel goes on.
    Clamp,
}

/// How a picture is seen between its texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Filter {
    /// The four texels around are blended.
    #[default]
    Linear,
    /// The nearest texel counts.
    Nearest,
}
