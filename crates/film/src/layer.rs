//! Single layers of an OpenEXR file by any program, to look at them.
//!
//! A layer is the channels with one prefix: `albedo.R`, `albedo.G` and `albedo.B` are the layer `albedo`. It is a
//! colour, a vector (`X`, `Y`, `Z`), or one value. Other channels are layers of one value each, under their whole name.
//! Channels without a prefix have the name of their part, if there are several. In a file of one part, `R`, `G` and `B`
//! are the layer `RGB`.

use std::io::{Read, Seek};

use thiserror::Error;

use super::image_error::ImageError;
use super::image_file;
use super::openexr::{DecodeBudget, InputPart, OpenExr, Plane};
use super::openexr_error::OpenExrError;

/// The name of the picture in a file of one part.
const PICTURE: &str = "RGB";

/// Names that a message lists.
const MOST_LISTED: usize = 64;

/// What a layer holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerKind {
    /// Red, green and blue.
    Colour,
    /// Three coordinates.
    Vector,
    /// One value, which is repeated in all three channels.
    Value,
}

/// A layer of an OpenEXR file.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// What it holds.
    pub kind: LayerKind,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Three values for each pixel, in rows from the top left. They need not be finite.
    pub pixels: Vec<[f32; 3]>,
}

/// Why a file has no such layer.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum LayerError {
    /// The file cannot be used.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// No layer has the name.
    #[error("found no layer {name}, expected one of {known}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The names of the layers.
        known: String,
    },
    /// No layer was named, and none is the picture.
    #[error("no layer is its picture (channels R, G and B): expected the name of one of {known}")]
    NoPicture {
        /// The names of the layers.
        known: String,
    },
}

impl From<OpenExrError> for LayerError {
    fn from(error: OpenExrError) -> Self {
        Self::Image(error.into())
    }
}

/// Where a layer lies in a file.
#[derive(Debug)]
struct Place {
    name: String,
    part: usize,
    kind: LayerKind,
    /// One channel, or three.
    channels: Vec<String>,
    /// Whether the channels are `R`, `G` and `B` alone.
    is_picture: bool,
}

/// Reads a layer of a file that may come from anyone. Without a name it is the picture: the first part with the
/// channels `R`, `G` and `B`, or the only layer.
///
/// # Errors
///
/// [`LayerError`] when there is no such layer, it is not the whole picture, its colours are not Rec. 709, it exceeds
/// the budget, or its data are damaged.
pub fn read_layer<R: Read + Seek>(file: R, name: Option<&str>, budget: DecodeBudget) -> Result<Layer, LayerError> {
    let file = OpenExr::read(file)?;
    let places = places(file.parts());
    let known = || places.iter().map(|place| place.name.as_str()).take(MOST_LISTED).collect::<Vec<_>>().join(", ");
    let place = match (name, &places[..]) {
        (Some(name), places) => places
            .iter()
            .find(|place| place.name == name)
            .ok_or_else(|| LayerError::Unknown { name: name.to_owned(), known: known() })?,
        (None, [only]) => only,
        (None, places) => {
            places.iter().find(|place| place.is_picture).ok_or_else(|| LayerError::NoPicture { known: known() })?
        }
    };
    let part = &file.parts()[place.part];
    part.check_windows()?;
    if place.kind == LayerKind::Colour {
        part.check_primaries()?;
    }
    let [width, height] = image_file::size(part)?;
    let Place { part, kind, ref channels, .. } = *place;
    let mut planes = file.decode_rows(part, 0..height, budget, |name| channels.iter().any(|wanted| wanted == name))?;
    let mut values = channels.iter().map(|name| planes.remove(name).map_or_else(Vec::new, floats));
    let first = values.next().unwrap_or_default();
    let pixels = match (values.next(), values.next()) {
        (Some(second), Some(third)) => {
            let pairs = first.into_iter().zip(second).zip(third);
            pairs.map(|((first, second), third)| [first, second, third]).collect()
        }
        _ => first.into_iter().map(|value| [value; 3]).collect(),
    };
    Ok(Layer { kind, width, height, pixels })
}

fn floats(plane: Plane) -> Vec<f32> {
    match plane {
        Plane::Float(values) => values,
        Plane::Integer(values) => values.into_iter().map(|value| value as f32).collect(),
    }
}

/// The layers of all parts, in the order of the file.
fn places(parts: &[InputPart]) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    for (index, part) in parts.iter().enumerate() {
        let of_part = part.name.as_deref().filter(|_| parts.len() > 1).unwrap_or_default();
        for mut place in places_in(index, part, of_part) {
            if places.iter().any(|other| other.name == place.name) {
                place.name = format!("{of_part}/{}", place.name);
            }
            places.push(place);
        }
    }
    places
}

/// The layers of a part, whose channels without a prefix are called `of_part`.
fn places_in(part_index: usize, part: &InputPart, of_part: &str) -> Vec<Place> {
    let mut groups: Vec<(&str, Vec<(&str, &str)>)> = Vec::new();
    for channel in part.channel_names() {
        let (prefix, component) = channel.rsplit_once('.').unwrap_or(("", channel));
        match groups.iter_mut().find(|(other, _)| *other == prefix) {
            Some((_, components)) => components.push((component, channel)),
            None => groups.push((prefix, vec![(component, channel)])),
        }
    }
    let mut places = Vec::new();
    for (prefix, mut components) in groups {
        let name = if prefix.is_empty() { of_part } else { prefix };
        for (kind, wanted) in [(LayerKind::Colour, ["R", "G", "B"]), (LayerKind::Vector, ["X", "Y", "Z"])] {
            let find = |wanted: &str| components.iter().find(|(found, _)| found.eq_ignore_ascii_case(wanted)).copied();
            let [Some(first), Some(second), Some(third)] = wanted.map(find) else { continue };
            let found = [first, second, third];
            components.retain(|component| !found.contains(component));
            let is_picture = prefix.is_empty() && kind == LayerKind::Colour;
            let name = if name.is_empty() && is_picture { PICTURE.to_owned() } else { name.to_owned() };
            let name = if name.is_empty() { wanted.concat() } else { name };
            let channels = found.map(|(_, channel)| channel.to_owned()).to_vec();
            places.push(Place { name, part: part_index, kind, channels, is_picture });
        }
        let is_alone = components.len() == 1 && !places.iter().any(|place| place.name == name) && !name.is_empty();
        for (_, channel) in components {
            let name = if is_alone { name.to_owned() } else { channel.to_owned() };
            let channels = vec![channel.to_owned()];
            places.push(Place { name, part: part_index, kind: LayerKind::Value, channels, is_picture: false });
        }
    }
    places
}

impl Layer {
    /// The part of it that is `width` by `height` pixels large and begins at column `x` and row `y`; `None` when it
    /// reaches beyond the layer or has no pixels.
    pub fn crop(&self, [width, height]: [u32; 2], [x, y]: [u32; 2]) -> Option<Self> {
        let ends = [x.checked_add(width)?, y.checked_add(height)?];
        if width == 0 || height == 0 || ends[0] > self.width || ends[1] > self.height {
            return None;
        }
        let columns = x as usize..ends[0] as usize;
        let rows = self.pixels.chunks_exact(self.width as usize).skip(y as usize).take(height as usize);
        let pixels = rows.flat_map(|row| &row[columns.clone()]).copied().collect();
        Some(Self { kind: self.kind, width, height, pixels })
    }

    /// Replaces coordinates from -1 to 1 by radiances that are shown as colours, as other programs show normals: at an
    /// exposure of 0 and without a tone curve, `(x + 1) / 2` of the largest code.
    pub fn show_coordinates(&mut self) {
        for value in self.pixels.as_flattened_mut() {
            let code = ((f64::from(*value) + 1.0) / 2.0).clamp(0.0, 1.0);
            // The inverse of the transfer function of IEC 61966-2-1.
            let linear = if code <= 0.040_45 { code / 12.92 } else { libm::pow((code + 0.055) / 1.055, 2.4) };
            *value = linear as f32;
        }
    }

    /// How many pixels have a value that is infinite or not a number.
    pub fn not_finite(&self) -> usize {
        self.pixels.iter().filter(|pixel| !pixel.iter().all(|value| value.is_finite())).count()
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use exr::meta::attribute::IntegerBounds;
    use exr::meta::header::ImageAttributes;
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer as ExrLayer, LayerAttributes, WritableImage,
    };

    use super::*;
    use crate::image::tests::image;
    use crate::preview::{Exposure, PreviewSettings, ToneCurve, encode_pixels};

    const BUDGET: DecodeBudget = DecodeBudget { pixel_bytes: 1 << 20 };

    /// A file of parts of 2 x 1 pixels. Each channel has a value of its own.
    fn file(parts: &[(&str, &[&str])]) -> Vec<u8> {
        let mut number = 0.0;
        let mut layer = |(name, channels): &(&str, &[&str])| {
            let channels = channels.iter().map(|channel| {
                number += 1.0;
                AnyChannel::new(*channel, FlatSamples::F32(vec![number, -number]))
            });
            let channels = AnyChannels::sort(channels.collect());
            ExrLayer::new((2, 1), LayerAttributes::named(*name), Encoding::UNCOMPRESSED, channels)
        };
        let layers: Vec<_> = parts.iter().map(&mut layer).collect();
        let mut bytes = Cursor::new(Vec::new());
        let attributes = ImageAttributes::new(IntegerBounds::new((0, 0), (2, 1)));
        Image::from_layers(attributes, layers).write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    fn read(file: &[u8], name: Option<&str>) -> Result<(LayerKind, [f32; 3]), String> {
        let layer = read_layer(Cursor::new(file), name, BUDGET).map_err(|error| error.to_string())?;
        assert_eq!((layer.width, layer.height, layer.pixels.len()), (2, 1, 2));
        assert_eq!(layer.pixels[1], layer.pixels[0].map(|value| -value));
        Ok((layer.kind, layer.pixels[0]))
    }

    #[test]
    fn the_layers_of_an_image_are_found_by_their_names() {
        let image = image();
        let file = image.encode().unwrap();
        let layer = |name| read_layer(Cursor::new(&file), name, BUDGET).unwrap();
        assert_eq!(layer(None), layer(Some("RGB")));
        assert_eq!(layer(None).pixels, image.layers().mean);
        assert_eq!(layer(Some("stderr")).pixels, *image.layers().standard_error.as_ref().unwrap());
        assert_eq!((layer(Some("normal")).kind, layer(Some("depth")).kind), (LayerKind::Vector, LayerKind::Value));
        let samples = layer(Some("samples"));
        let counts = image.layers().samples.as_ref().unwrap();
        assert!(samples.pixels.iter().zip(counts).all(|(pixel, count)| *pixel == [*count as f32; 3]));
        let error = read_layer(Cursor::new(&file), Some("albdo"), BUDGET).unwrap_err().to_string();
        assert_eq!(error, "found no layer albdo, expected one of RGB, samples, albedo, depth, normal, stderr");
    }

    #[test]
    fn layers_of_other_programs_are_found() {
        let many = ["View.Combined.R", "View.Combined.G", "View.Combined.B", "View.Combined.A", "View.Depth.Z"];
        let blender = file(&[("", &many)]);
        assert_eq!(read(&blender, Some("View.Combined")), Ok((LayerKind::Colour, [1.0, 2.0, 3.0])));
        assert_eq!(read(&blender, Some("View.Combined.A")), Ok((LayerKind::Value, [4.0; 3])));
        assert_eq!(read(&blender, Some("View.Depth")), Ok((LayerKind::Value, [5.0; 3])));
        let error = read(&blender, None).unwrap_err();
        assert!(error.contains("one of View.Combined, View.Combined.A, View.Depth"), "{error}");

        let parts = file(&[("depth", &["Z"]), ("beauty", &["R", "G", "B", "A"]), ("left", &["R", "G", "B"])]);
        assert_eq!(read(&parts, None), Ok((LayerKind::Colour, [2.0, 3.0, 4.0])));
        assert_eq!(read(&parts, Some("left")), Ok((LayerKind::Colour, [6.0, 7.0, 8.0])));
        assert_eq!(read(&parts, Some("depth")), Ok((LayerKind::Value, [1.0; 3])));
        assert_eq!(read(&file(&[("", &["Y"])]), None), Ok((LayerKind::Value, [1.0; 3])));
    }

    #[test]
    fn a_crop_is_the_part_that_was_asked_for() {
        let pixels = (0..12_u8).map(|number| [f32::from(number); 3]).collect();
        let layer = Layer { kind: LayerKind::Colour, width: 4, height: 3, pixels };
        let cropped = layer.crop([2, 2], [1, 1]).unwrap();
        assert_eq!(cropped.pixels.iter().map(|pixel| pixel[0]).collect::<Vec<_>>(), [5.0, 6.0, 9.0, 10.0]);
        assert_eq!(layer.crop([4, 3], [0, 0]).unwrap(), layer);
        for (size, place) in [([0, 1], [0, 0]), ([4, 3], [1, 0]), ([1, 1], [0, 3]), ([1, 1], [u32::MAX, 0])] {
            assert_eq!(layer.crop(size, place), None);
        }
    }

    #[test]
    fn coordinates_are_shown_as_other_programs_show_them() {
        let pixels = [-1.0, 0.0, 0.5, 1.0, 2.0].map(|coordinate| [coordinate; 3]).to_vec();
        let mut layer = Layer { kind: LayerKind::Vector, width: 5, height: 1, pixels };
        layer.show_coordinates();
        let settings = PreviewSettings { exposure: Exposure::Stops(0.0), curve: ToneCurve::Srgb };
        let png = encode_pixels(5, 1, &layer.pixels, &settings).unwrap();
        let decoded = image::load_from_memory(&png).unwrap().into_rgb8();
        assert_eq!(decoded.pixels().map(|pixel| pixel[0]).collect::<Vec<_>>(), [0, 128, 191, 255, 255]);
    }

    #[test]
    fn values_that_are_no_numbers_are_counted_and_not_refused() {
        let pixels = vec![[1.0; 3], [f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, f32::NAN]];
        assert_eq!(Layer { kind: LayerKind::Colour, width: 3, height: 1, pixels }.not_finite(), 2);
    }
}
