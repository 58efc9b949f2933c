//! Normal maps: pictures of normals, in a frame that follows the texture coordinates.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Encoding;
use super::mapped::{Bitmaps, MappedPicture, TextureCoordinates, TextureDescription, TextureUse};
use crate::settings::check::check_range;
use crate::settings::{Check, JsonPath};

/// Largest strength of a normal map.
const MAX_STRENGTH: f64 = 1e3;

/// A picture of normals. Red, green and blue from 0 to 1 are the components from -1 to 1 along growing u, along growing
/// v, and along the normal of the surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NormalMapDescription {
    /// The picture, whose numbers are taken as they stand in the file.
    pub texture: TextureDescription,
    /// What the first two components are multiplied by.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    #[schemars(range(min = -MAX_STRENGTH, max = MAX_STRENGTH))]
    pub strength: f64,
}

fn one() -> f64 {
    1.0
}

fn is_one(strength: &f64) -> bool {
    *strength == one()
}

impl NormalMapDescription {
    /// Checks it.
    pub(crate) fn check(&self, path: &JsonPath<'_>) -> Check {
        self.texture.check(&path.member("texture"))?;
        check_range(self.strength, -MAX_STRENGTH, MAX_STRENGTH, &path.member("strength"))
    }

    /// Its picture. `place` is its own place.
    pub(crate) fn texture(&self, place: &str) -> TextureUse<'_> {
        TextureUse { place: format!("{place}.texture"), texture: &self.texture, encoding: Encoding::Data }
    }

    /// The map, with pictures that have been decoded.
    pub(crate) fn build(&self, bitmaps: &Bitmaps<'_>) -> NormalMap {
        NormalMap { picture: self.texture.build(Encoding::Data, bitmaps), strength: self.strength }
    }
}

/// A normal map on a surface.
#[derive(Clone, Debug)]
pub struct NormalMap {
    picture: MappedPicture,
    strength: f64,
}

impl NormalMap {
    /// The picture.
    pub(crate) fn picture(&self) -> &MappedPicture {
        &self.picture
    }

    /// The normal at a point: components along growing u, along growing v and along the normal of the surface, of any
    /// length.
    pub fn at(&self, at: TextureCoordinates) -> DVec3 {
        let DVec3 { x, y, z } = self.picture.at(at) * 2.0 - 1.0;
        DVec3::new(self.strength * x, self.strength * y, z)
    }
}
