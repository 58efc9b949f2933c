//! A picture over a surface: which file, which coordinates, and how it repeats.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::wrap::{Filter, Wrap};
use super::{Bitmap, Encoding};
use crate::settings::check::{check_asset_name, check_range};
use crate::settings::{Check, JsonPath, Triple, is_default};

/// Largest number in a transformation of texture coordinates.
const MAX_TRANSFORM: f64 = 1e6;

/// A picture, looked up by the mesh's texture coordinates (u, v), repeated, filtered bilinearly. u = 0 is the left
/// border and v = 0 the bottom border of the picture, as in OBJ files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct TextureDescription {
    /// PNG, JPEG or WebP (8 or 16 bits, sRGB) or EXR (linear, channels R, G, B or Y, 0 to 1) file, relative to the
    /// scene file; or a glTF file that has pictures in it.
    pub file: String,
    /// Number of the picture in a glTF file, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<u32>,
    /// Which texture coordinates of the mesh, where it has two: 0 or 1.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(range(min = 0, max = 1))]
    pub coordinates: u32,
    /// How the picture goes on beyond its borders along u and v.
    #[serde(default, skip_serializing_if = "is_default")]
    pub wrap: [Wrap; 2],
    /// How the picture is seen between its texels.
    #[serde(default, skip_serializing_if = "is_default")]
    pub filter: Filter,
    /// Two rows of three numbers, by which (u, v, 1) is multiplied before the picture is looked up.
    #[serde(default, skip_serializing_if = "is_default")]
    pub transform: TextureTransform,
    /// What red, green and blue are multiplied by.
    #[serde(default = "white", skip_serializing_if = "is_white")]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub factor: Triple,
}

fn white() -> Triple {
    [1.0; 3]
}

fn is_white(factor: &Triple) -> bool {
    *factor == white()
}

/// Two rows of a matrix by which (u, v, 1) is multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TextureTransform(pub [[f64; 3]; 2]);

impl Default for TextureTransform {
    fn default() -> Self {
        Self([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    }
}

impl TextureTransform {
    fn apply(self, DVec2 { x, y }: DVec2) -> DVec2 {
        let [u, v] = self.0.map(|[a, b, c]| a * x + b * y + c);
        DVec2::new(u, v)
    }
}

impl TextureDescription {
    /// All of a file, as it is.
    pub fn of_file(file: &str) -> Self {
        Self {
            file: file.to_owned(),
            image: None,
            coordinates: 0,
            wrap: <[Wrap; 2]>::default(),
            filter: Filter::default(),
            transform: TextureTransform::default(),
            factor: white(),
        }
    }

    /// Checks it.
    pub(crate) fn check(&self, path: &JsonPath<'_>) -> Check {
        check_asset_name(&self.file, &path.member("file"))?;
        check_range(self.coordinates, 0, 1, &path.member("coordinates"))?;
        let transform = path.member("transform");
        for (index, row) in self.transform.0.iter().enumerate() {
            let row_path = transform.element(index);
            for (column, number) in row.iter().enumerate() {
                check_range(*number, -MAX_TRANSFORM, MAX_TRANSFORM, &row_path.element(column))?;
            }
        }
        let factor = path.member("factor");
        for (channel, number) in self.factor.iter().enumerate() {
            check_range(*number, 0.0, 1.0, &factor.element(channel))?;
        }
        Ok(())
    }

    /// What has to be decoded for it.
    pub(crate) fn picture(&self, encoding: Encoding) -> PictureKey<'_> {
        PictureKey { file: &self.file, image: self.image, encoding }
    }

    /// The picture on its surface, from pictures that have been decoded.
    pub(crate) fn build(&self, encoding: Encoding, bitmaps: &Bitmaps<'_>) -> MappedPicture {
        MappedPicture {
            bitmap: bitmaps.get(&self.picture(encoding)).expect("every picture is decoded").clone(),
            coordinates: self.coordinates as usize,
            wrap: self.wrap,
            filter: self.filter,
            transform: (self.transform != TextureTransform::default()).then_some(self.transform),
            factor: DVec3::from(self.factor),
        }
    }
}

/// Where settings name a picture.
#[derive(Clone, Debug)]
pub struct TextureUse<'a> {
    /// Its place below the settings.
    pub place: String,
    /// The picture.
    pub texture: &'a TextureDescription,
    /// What its numbers mean.
    pub encoding: Encoding,
}

impl<'a> TextureUse<'a> {
    /// What has to be decoded for it.
    pub(crate) fn picture(&self) -> PictureKey<'a> {
        self.texture.picture(self.encoding)
    }
}

/// A picture as it is decoded: a file, or one of the pictures in it, and what its numbers mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PictureKey<'a> {
    /// Name of the file.
    pub file: &'a str,
    /// Number of the picture in a glTF file.
    pub image: Option<u32>,
    /// What its numbers mean.
    pub encoding: Encoding,
}

/// Decoded pictures.
pub type Bitmaps<'a> = BTreeMap<PictureKey<'a>, Arc<Bitmap>>;

/// Texture coordinates of a point of a surface: two sets, zero where a mesh has none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TextureCoordinates(pub [DVec2; 2]);

/// A decoded picture on a surface.
#[derive(Clone, Debug)]
pub(crate) struct MappedPicture {
    pub(crate) bitmap: Arc<Bitmap>,
    /// Which texture coordinates.
    pub(crate) coordinates: usize,
    pub(crate) wrap: [Wrap; 2],
    pub(crate) filter: Filter,
    /// What happens to texture coordinates; `None` for nothing.
    pub(crate) transform: Option<TextureTransform>,
    /// What red, green and blue are multiplied by.
    pub(crate) factor: DVec3,
}

impl MappedPicture {
    /// The least red, green and blue of all points.
    pub(crate) fn least(&self) -> DVec3 {
        let texels = self.bitmap.texels().iter().map(|texel| DVec3::from(texel.map(f64::from)));
        self.factor * texels.fold(DVec3::INFINITY, DVec3::min)
    }

    /// Red, green and blue at a point.
    pub(crate) fn at(&self, at: TextureCoordinates) -> DVec3 {
        let coordinate = at.0[self.coordinates];
        let coordinate = self.transform.map_or(coordinate, |transform| transform.apply(coordinate));
        self.factor * self.bitmap.lookup(coordinate, self.wrap, self.filter)
    }
}
