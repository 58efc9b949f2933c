//! The uses of textures by materials, and the pictures that they need.

use std::collections::BTreeMap;

use glam::{DAffine2, DMat2, DVec2};
use serde::Deserialize;

use super::buffers::Buffers;
use super::extensions::{TRANSFORM, WEBP};
use super::fault::{fault, lookup};
use super::notes::{Note, Notes};
use super::schema::{Document, TextureInfo, extension};
use super::uri::Resource;
use crate::settings::AssetProblem;
use clerestory_film::file_format::FileFormat;

/// A picture over a surface.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Texture {
    /// The number of its picture.
    pub(crate) image: usize,
    /// The set of texture coordinates, 0 or 1.
    pub(crate) set: usize,
    /// What is done to texture coordinates first.
    pub(crate) transform: TextureTransform,
    /// What lies beyond the edges, along u and along v.
    pub(crate) wrap: [Wrap; 2],
    /// Whether enlarged pixels keep hard edges.
    pub(crate) is_nearest: bool,
}

/// What is done to texture coordinates: they are scaled, turned, then moved (`KHR_texture_transform`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TextureTransform {
    /// Added last.
    pub(crate) offset: [f64; 2],
    /// Radians, from u towards -v: counterclockwise on the picture.
    pub(crate) rotation: f64,
    /// Factors of u and v, applied first.
    pub(crate) scale: [f64; 2],
}

impl TextureTransform {
    /// What takes texture coordinates of the file to those of the picture, v = 0 at its top.
    pub(crate) fn affine(&self) -> DAffine2 {
        // The listing in the text of the extension turns the other way. All readers turn this way, and so does its
        // test model: https://github.com/KhronosGroup/glTF/issues/1563
        let (sine, cosine) = libm::sincos(self.rotation);
        let rotation = DMat2::from_cols(DVec2::new(cosine, -sine), DVec2::new(sine, cosine));
        let matrix2 = rotation * DMat2::from_diagonal(DVec2::from(self.scale));
        DAffine2 { matrix2, translation: DVec2::from(self.offset) }
    }
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2] }
    }
}

/// What lies beyond the edge of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// The picture mirrored, then again.
    Mirror,
    /// Its last pixels.
    Clamp,
}

/// A picture that a material uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Image<'f> {
    /// Its name, as written.
    pub(crate) name: Option<&'f str>,
    /// Where its bytes are.
    pub(crate) source: ImageSource<'f>,
}

/// Where the bytes of a picture are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ImageSource<'f> {
    /// In the file: a PNG, JPEG or WebP file.
    Embedded(&'f [u8]),
    /// In a file of this name, relative to the glTF file.
    File(&'f str),
}

/// A texture transform of the file.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct StoredTransform {
    offset: [f64; 2],
    rotation: f64,
    scale: [f64; 2],
    tex_coord: Option<usize>,
}

impl Default for StoredTransform {
    fn default() -> Self {
        let TextureTransform { offset, rotation, scale } = TextureTransform::default();
        Self { offset, rotation, scale, tex_coord: None }
    }
}

#[derive(Deserialize)]
struct WebpSource {
    source: usize,
}

/// Reads the use of a texture. Without a picture that can be read it is left out and counted.
pub(super) fn read(
    document: &Document<'_>,
    info: Option<&TextureInfo>,
    place: &str,
    notes: &mut Notes,
) -> Result<Option<Texture>, AssetProblem> {
    let Some(info) = info else { return Ok(None) };
    let stored: StoredTransform = extension(&info.extensions, TRANSFORM, place)?.unwrap_or_default();
    let texture = lookup(&document.textures, info.index, "textures", format_args!("{place}.index"))?;
    let texture_place = format!("textures[{}]", info.index);
    let webp: Option<WebpSource> = extension(&texture.extensions, WEBP, &texture_place)?;
    let Some(image) = webp.map(|webp| webp.source).or(texture.source) else {
        notes.add(Note::TexturesWithoutPicture);
        return Ok(None);
    };
    lookup(&document.images, image, "images", format_args!("{texture_place}.source"))?;
    let set = stored.tex_coord.unwrap_or(info.tex_coord);
    if set > 1 {
        notes.add(Note::TextureSets);
        return Ok(None);
    }
    let mut wrap = [Wrap::default(); 2];
    let mut is_nearest = false;
    if let Some(index) = texture.sampler {
        let sampler = lookup(&document.samplers, index, "samplers", format_args!("{texture_place}.sampler"))?;
        let place = |axis: &str| format!("samplers[{index}].{axis}");
        wrap = [read_wrap(sampler.wrap_s, place("wrapS"))?, read_wrap(sampler.wrap_t, place("wrapT"))?];
        is_nearest = sampler.mag_filter == Some(NEAREST);
    }
    let transform = TextureTransform { offset: stored.offset, rotation: stored.rotation, scale: stored.scale };
    Ok(Some(Texture { image, set, transform, wrap, is_nearest }))
}

/// `NEAREST` of OpenGL.
const NEAREST: u32 = 9728;

fn read_wrap(code: Option<u32>, place: String) -> Result<Wrap, AssetProblem> {
    match code {
        None | Some(10_497) => Ok(Wrap::Repeat),
        Some(33_648) => Ok(Wrap::Mirror),
        Some(33_071) => Ok(Wrap::Clamp),
        Some(code) => {
            let message = format!("found {code}, must be 10497 (repeat), 33648 (mirror) or 33071 (clamp)");
            Err(fault(place, message))
        }
    }
}

/// The pictures that materials use, by their numbers in the file.
pub(super) type Images = BTreeMap<usize, StoredImage>;

/// Where the bytes of a picture are, before they are looked at.
pub(super) enum StoredImage {
    /// In a view of a buffer.
    View(usize),
    /// In a `data:` URI, decoded.
    Data(Vec<u8>),
    /// In a file of this name.
    File(String),
}

/// The names of the files of pictures, in the order of the file.
pub(super) fn files(
    document: &Document<'_>,
    used: impl IntoIterator<Item = usize>,
) -> Result<Vec<String>, AssetProblem> {
    let mut files = Vec::new();
    for index in used {
        let place = format!("images[{index}]");
        let uri = lookup(&document.images, index, "images", &place)?.uri.as_ref();
        if let Some(uri) = uri
            && let Some(name) = Resource::file_of(&uri.0, format_args!("{place}.uri"))?
        {
            files.push(name);
        }
    }
    Ok(files)
}

/// Finds the pictures that materials use. Their content decides what they are, not what the file says of it.
pub(super) fn open(
    document: &Document<'_>,
    buffers: &Buffers<'_>,
    used: impl IntoIterator<Item = usize>,
) -> Result<Images, AssetProblem> {
    let mut images = Images::new();
    for index in used {
        let place = format!("images[{index}]");
        let image = lookup(&document.images, index, "images", &place)?;
        let stored = match (&image.uri, image.buffer_view) {
            (Some(uri), None) => match Resource::of(&uri.0, format_args!("{place}.uri"))? {
                Resource::Data(bytes) => {
                    check_format(&bytes, &place)?;
                    StoredImage::Data(bytes)
                }
                Resource::File(name) => StoredImage::File(name),
            },
            (None, Some(view)) => {
                let bytes = buffers.view(document, view, &format!("{place}.bufferView"))?.bytes;
                check_format(bytes, &place)?;
                StoredImage::View(view)
            }
            _ => return Err(fault(place, "must have either a uri or a bufferView")),
        };
        images.insert(index, stored);
    }
    Ok(images)
}

/// Refuses a picture that is not one of those that glTF allows and textures are read from.
fn check_format(bytes: &[u8], place: &str) -> Result<(), AssetProblem> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] | [0xff, 0xd8, 0xff, ..] => Ok(()),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Ok(()),
        _ => {
            let found = match FileFormat::of(bytes) {
                Some(format) => format!("looks like {format}"),
                None => "is no picture".to_owned(),
            };
            Err(fault(place, format_args!("{found}, must be PNG, JPEG or WebP")))
        }
    }
}
