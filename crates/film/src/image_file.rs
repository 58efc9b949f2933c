//! The OpenEXR file of an image.
//!
//! It has one part. The picture is in the channels `R`, `G` and `B`, which every viewer shows. The other layers are
//! channels with a prefix: `stderr.R`, `samples`, `caustic.R`, `albedo.R`, `normal.X`, `depth.Z`. Viewers list them as
//! layers. What made it is JSON in the attribute `clerestory`.
//!
//! Any OpenEXR file with channels `R`, `G` and `B` can be read, whoever wrote it. References may have a standard error
//! (`stderr.*`) and two halves of independent samples, of which the picture is the mean (`half_a.*`, `half_b.*`).

use std::collections::BTreeMap;

use super::image::{FrameImage, ImageMetadata};
use super::image_error::ImageError;
use super::image_layers::{ALBEDO, CAUSTIC, DEPTH, HALF_A, HALF_B, ImageLayers, NORMAL, RGB, SAMPLES, STANDARD_ERROR};
use super::image_writer::ImageWriter;
use super::openexr::{self, DecodeBudget, InputPart, OpenExr, Plane};
use super::openexr_error::OpenExrError;

impl FrameImage {
    /// The OpenEXR file of the image. The same image gives the same bytes.
    ///
    /// # Errors
    ///
    /// [`OpenExrError`] when `exr` cannot write it.
    pub fn encode(&self) -> Result<Vec<u8>, OpenExrError> {
        let mut writer = ImageWriter::new(self.width(), self.height(), Vec::new());
        writer.write_rows(self.layers())?;
        let (mut bytes, blocks) = writer.finish(self.metadata())?;
        bytes.extend(blocks);
        Ok(bytes)
    }

    /// Reads the first part that has the channels `R`, `G` and `B`, of a file that may come from anyone. Layers other
    /// than the picture, its standard error and its halves are read from images of this program only, since others mean
    /// other things by the same names.
    ///
    /// # Errors
    ///
    /// [`ImageError`] when there is no such part, it is not the whole picture, its colours are not Rec. 709, it exceeds
    /// the budget, or its data are damaged or not finite.
    pub fn decode(bytes: &[u8], budget: DecodeBudget) -> Result<Self, ImageError> {
        let file = OpenExr::open(bytes)?;
        let picture = find_picture(file.parts())?;
        let part = &file.parts()[picture];
        part.check_windows()?;
        part.check_primaries()?;
        let [width, height] = size(part)?;
        let metadata: Option<ImageMetadata> = match &part.json {
            None => None,
            Some(json) => {
                serde_json::from_str(json).map_err(|error| ImageError::BadMetadata { message: error.to_string() })?
            }
        };
        let ours: [&[&str]; 5] = [&CAUSTIC, &[SAMPLES], &ALBEDO, &NORMAL, &[DEPTH]];
        let wanted = channels(part, &[&RGB, &STANDARD_ERROR, &HALF_A, &HALF_B], &ours);
        let is_wanted = |index: usize, name: &str| index == picture && wanted.contains(&name);
        let planes = file.decode(budget, is_wanted)?.swap_remove(picture);
        Self::new(width, height, layers(planes, &wanted)?, metadata)
    }
}

/// The part of a file that is the picture.
pub(super) fn find_picture(parts: &[InputPart]) -> Result<usize, ImageError> {
    let picture = parts.iter().position(|part| RGB.iter().all(|name| part.has(name)));
    picture.ok_or_else(|| {
        let names = parts.iter().flat_map(|part| &part.channels).map(|(name, _)| name.as_str());
        ImageError::NoPicture { found: names.take(32).collect::<Vec<_>>().join(", ") }
    })
}

/// Pixels of a part across and down.
pub(super) fn size(part: &InputPart) -> Result<[u32; 2], ImageError> {
    let [width, height] = part.size;
    match (u32::try_from(width), u32::try_from(height)) {
        (Ok(width), Ok(height)) => Ok([width, height]),
        _ => Err(ImageError::BadSize { width, height }),
    }
}

/// The channels of those layers that a part has: of `ours` only if this program wrote it. Of a layer that is there in
/// part, all.
pub(super) fn channels(part: &InputPart, anybodys: &[&[&'static str]], ours: &[&[&'static str]]) -> Vec<&'static str> {
    let is_ours = part.json.is_some();
    let read = anybodys.iter().chain(ours.iter().filter(|_| is_ours));
    read.filter(|layer| layer.iter().any(|name| part.has(name))).copied().flatten().copied().collect()
}

/// The layers that these channels make.
pub(super) fn layers(mut planes: BTreeMap<String, Plane>, wanted: &[&str]) -> Result<ImageLayers, ImageError> {
    let samples = match planes.remove(SAMPLES) {
        Some(Plane::Integer(samples)) => Some(samples),
        Some(Plane::Float(_)) | None => None,
    };
    let mut plane = |name: &'static str| match planes.remove(name) {
        Some(Plane::Float(values)) => Ok(values),
        Some(Plane::Integer(_)) | None => Err(ImageError::MissingChannel { channel: name }),
    };
    let mut layer = |names: [&'static str; 3]| -> Result<Option<Vec<[f32; 3]>>, ImageError> {
        if wanted.contains(&names[0]) { Ok(Some(openexr::interleave(names, &mut plane)?)) } else { Ok(None) }
    };
    let mean = layer(RGB)?.unwrap_or_default();
    let standard_error = layer(STANDARD_ERROR)?;
    let caustic = layer(CAUSTIC)?;
    let albedo = layer(ALBEDO)?;
    let normal = layer(NORMAL)?;
    let halves = match (layer(HALF_A)?, layer(HALF_B)?) {
        (None, None) => None,
        (Some(half_a), Some(half_b)) => Some([half_a, half_b]),
        (None, Some(_)) => return Err(ImageError::MissingChannel { channel: HALF_A[0] }),
        (Some(_), None) => return Err(ImageError::MissingChannel { channel: HALF_B[0] }),
    };
    let depth = if wanted.contains(&DEPTH) { Some(plane(DEPTH)?) } else { None };
    Ok(ImageLayers { mean, standard_error, caustic, samples, albedo, normal, depth, halves })
}

#[cfg(test)]
mod tests {
    use exr::meta::attribute::Compression;
    use exr::prelude::{WritableImage, f16};
    use proptest::prelude::*;

    use super::*;
    use crate::address::Tile;
    use crate::image::tests::image;
    use crate::openexr::tests::{TESTS_BESIDE, address_space_bytes, attribute, patch};
    use crate::openexr::{OutputPart, Samples};
    use crate::{picture_rows, picture_size};

    const BUDGET: DecodeBudget = DecodeBudget { pixel_bytes: 1 << 20 };

    #[test]
    fn an_image_comes_back_from_its_file_unchanged() {
        let image = image();
        let found = FrameImage::decode(&image.encode().unwrap(), BUDGET).unwrap();
        assert_eq!(found, image);
        assert_eq!(found.metadata().unwrap().tile_passes, [13, 3, 0, 8]);
        assert_eq!(found.metadata().unwrap().tile_size, 4);

        let mean = image.layers().mean.clone();
        let layers = ImageLayers { halves: Some([mean.clone(), mean.clone()]), mean, ..ImageLayers::default() };
        let reference = FrameImage::new(image.width(), image.height(), layers, None).unwrap();
        assert_eq!(FrameImage::decode(&reference.encode().unwrap(), BUDGET).unwrap(), reference);
    }

    #[test]
    fn the_same_image_gives_the_same_bytes() {
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let bytes = image().encode().unwrap();
        assert_eq!(one_thread.install(|| image().encode().unwrap()), bytes);
        assert_eq!(image().encode().unwrap(), bytes);
    }

    #[test]
    fn a_viewer_finds_one_part_with_the_picture_unprefixed() {
        let bytes = image().encode().unwrap();
        let meta = exr::meta::MetaData::read_from_buffered(&bytes[..], true).unwrap();
        exr::meta::MetaData::validate(&meta.headers, true).unwrap();
        assert!(!meta.requirements.has_multiple_layers);
        let names: Vec<String> = meta.headers[0].channels.list.iter().map(|channel| channel.name.to_string()).collect();
        assert_eq!(names[..3], ["B", "G", "R"]);
        assert!(
            ["stderr.R", "samples", "albedo.G", "normal.X", "depth.Z"]
                .iter()
                .all(|name| names.contains(&name.to_string()))
        );
    }

    #[test]
    fn pictures_of_other_programs_load() {
        let picture = |x: usize, y: usize| [x as f32 * 0.5, y as f32 * 0.25, 1.0];
        let expected: Vec<[f32; 3]> = (0..35 * 33).map(|index| picture(index % 35, index / 35)).collect();
        use exr::prelude::{Blocks, Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels};
        for compression in [
            Compression::Uncompressed,
            Compression::RLE,
            Compression::ZIP1,
            Compression::ZIP16,
            Compression::PIZ,
            Compression::PXR24,
            Compression::B44,
        ] {
            for blocks in [Blocks::ScanLines, Blocks::Tiles(exr::prelude::Vec2(16, 8))] {
                let channels = SpecificChannels::rgba(|position: exr::prelude::Vec2<usize>| {
                    let [red, green, blue] = picture(position.x(), position.y()).map(f16::from_f32);
                    (red, green, blue, f16::ONE)
                });
                let encoding = Encoding { compression, blocks, line_order: LineOrder::Unspecified };
                let encoding = match blocks {
                    Blocks::ScanLines => Encoding { line_order: LineOrder::Increasing, ..encoding },
                    Blocks::Tiles(_) => encoding,
                };
                let layer = Layer::new((35, 33), LayerAttributes::named("any"), encoding, channels);
                let mut bytes = std::io::Cursor::new(Vec::new());
                Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
                let image = FrameImage::decode(&bytes.into_inner(), BUDGET).unwrap();
                assert_eq!((image.width(), image.height()), (35, 33));
                let lossy = matches!(compression, Compression::B44);
                if !lossy {
                    assert_eq!(image.layers().mean, expected, "{compression:?} {blocks:?}");
                }
                assert!(image.metadata().is_none() && image.layers().standard_error.is_none());
            }
        }
    }

    #[test]
    fn dwa_compression_is_refused_because_its_decoder_trusts_the_data() {
        let window = Tile::new([0, 0], [2, 1]);
        let mut part =
            OutputPart { name: "part".to_owned(), json: "null".to_owned(), window, channels: BTreeMap::new() };
        part.add_triples(RGB, &[[1.0; 3]; 2]);
        let bytes = openexr::write([2, 1], &[part], Compression::DWAA(None)).unwrap();
        let error = FrameImage::decode(&bytes, BUDGET).unwrap_err().to_string();
        assert!(error.starts_with("DWAA compression is not supported: save the image"), "{error}");
    }

    #[test]
    fn pictures_that_are_cropped_or_of_other_colours_are_refused() {
        use exr::meta::attribute::Chromaticities;
        use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, Vec2};
        let mut cropped = image().encode().unwrap();
        patch(&mut cropped, "displayWindow", &attribute(&[-1, 0, 9, 9]));
        let check = |bytes: &[u8], fragment: &str| {
            let error = FrameImage::decode(bytes, BUDGET).unwrap_err().to_string();
            assert!(error.contains(fragment), "{error:?} does not say {fragment:?}");
            assert_eq!(picture_size(std::io::Cursor::new(bytes)).unwrap_err().to_string(), error);
            // A job that has such a reference already goes on.
            assert!(picture_rows(std::io::Cursor::new(bytes), 0..1, BUDGET).is_ok());
        };
        check(&cropped, "are 7 x 5 from (0, 0) on, its picture (display window) is 11 x 10 from (-1, 0) on");

        let channels = SpecificChannels::rgb(|_: Vec2<usize>| (0.5_f32, 0.5_f32, 0.5_f32));
        let layer = Layer::new((2, 1), LayerAttributes::named("any"), Encoding::UNCOMPRESSED, channels);
        let mut picture = Image::from_layer(layer);
        let white = Vec2(0.3127, 0.329);
        let wide =
            Chromaticities { red: Vec2(0.708, 0.292), green: Vec2(0.17, 0.797), blue: Vec2(0.131, 0.046), white };
        picture.attributes.chromaticities = Some(wide);
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write().to_buffered(&mut bytes).unwrap();
        check(&bytes.into_inner(), "(attribute chromaticities) are Rec. 2020; convert it to linear Rec. 709");
    }

    /// A file of one part with these float channels of one pixel.
    fn file_of(channels: &[(&str, &[f32])], json: &str) -> Vec<u8> {
        let window = Tile::new([0, 0], [1, 1]);
        let channels = channels.iter().map(|(name, values)| (name.to_string(), Samples::Float(values))).collect();
        let part = OutputPart { name: "part".to_owned(), json: json.to_owned(), window, channels };
        openexr::write([1, 1], &[part], Compression::Uncompressed).unwrap()
    }

    #[test]
    fn files_that_are_no_image_are_refused_by_name() {
        let check = |bytes: &[u8], message: &str| {
            let error = FrameImage::decode(bytes, BUDGET).unwrap_err().to_string();
            assert!(error.contains(message), "{error:?} does not say {message:?}");
        };
        check(b"\x89PNG", "not an OpenEXR file: it looks like a PNG picture; rendered images are OpenEXR files");
        check(b"\xff\xd8\xff\xe0", "it looks like a JPEG picture");
        check(b"", "not an OpenEXR file: it is an empty file");
        check(b"\x76\x2f", "not an OpenEXR file: it does not begin with");
        check(&file_of(&[("B", &[1.0]), ("G", &[1.0]), ("Y", &[1.0])], "null"), "the channels are B, G, Y");
        let rgb: [(&str, &[f32]); 3] = [("R", &[1.0]), ("G", &[1.0]), ("B", &[1.0])];
        check(&file_of(&[rgb[0], rgb[1], ("B", &[f32::NAN])], "null"), "layer RGB is not finite at pixel (0, 0)");
        check(&file_of(&[rgb[0], rgb[1], ("B", &[f32::INFINITY])], "null"), "layer RGB is not finite at pixel (0, 0)");
        check(&file_of(&[rgb[0], rgb[1], rgb[2], ("stderr.R", &[1.0])], "null"), "channel stderr.G is missing");
        let errors: [(&str, &[f32]); 3] = [("stderr.R", &[1.0]), ("stderr.G", &[-1.0]), ("stderr.B", &[1.0])];
        check(&file_of(&[&rgb[..], &errors].concat(), "null"), "layer stderr is negative at pixel (0, 0)");
        let half: [(&str, &[f32]); 3] = [("half_a.R", &[1.0]), ("half_a.G", &[1.0]), ("half_a.B", &[1.0])];
        check(&file_of(&[&rgb[..], &half].concat(), "null"), "channel half_b.R is missing");
        check(&file_of(&rgb, "{\"seed\":1}"), "not the metadata of an image: missing field `scene_hash`");
    }

    #[test]
    fn a_header_that_claims_sixty_thousand_pixels_each_way_is_refused_without_allocating() {
        let mut bytes = image().encode().unwrap();
        let window = attribute(&[0, 0, 60_000, 60_000]);
        patch(&mut bytes, "dataWindow", &window);
        patch(&mut bytes, "displayWindow", &window);
        patch(&mut bytes, "chunkCount", &attribute(&[60_001_i32.div_euclid(16) + 1]));
        let before = address_space_bytes();
        let error = FrameImage::decode(&bytes, DecodeBudget { pixel_bytes: 1 << 30 }).unwrap_err();
        assert!(error.to_string().starts_with("the image is too large: 60001 x 60001 pixels need"), "{error}");
        assert!(address_space_bytes() - before < TESTS_BESIDE, "memory was allocated");
    }

    proptest! {
        #![proptest_config(crate::test_nodes::fixed_seed(1000))]

        #[test]
        fn a_changed_image_is_an_error_or_an_image_never_a_crash(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        ) {
            let mut bytes = image().encode().unwrap();
            for (position, value) in changes {
                let position = position.index(bytes.len());
                bytes[position] = value;
            }
            let before = address_space_bytes();
            let decoded = FrameImage::decode(&bytes, BUDGET);
            prop_assert!(decoded.is_err() || decoded.is_ok_and(|image| image.width() < 1 << 20));
            prop_assert!(address_space_bytes() - before < TESTS_BESIDE);
        }
    }
}
