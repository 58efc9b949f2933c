//! Rows of the picture in an OpenEXR file: its means and their standard error, as much at a time as fits into memory.
//!
//! A reference may be as large as the image that is measured against it. It is read wherever it lies, in strips, and
//! each time only the blocks of the file are decoded that have pixels of the strip.

use std::io::{Read, Seek};
use std::ops::Range;

use super::image::check_layers;
use super::image_error::ImageError;
use super::image_file;
use super::image_layers::{ImageLayers, RGB, STANDARD_ERROR};
use super::openexr::{DecodeBudget, OpenExr};

/// Pixels across and down the picture in a file. Only the header is read.
///
/// # Errors
///
/// [`ImageError`] when there is none, it is not whole, its colours are not Rec. 709, or the file cannot be read.
pub fn picture_size<R: Read + Seek>(file: R) -> Result<[u32; 2], ImageError> {
    let file = OpenExr::read(file)?;
    let part = &file.parts()[image_file::find_picture(file.parts())?];
    part.check_windows()?;
    part.check_primaries()?;
    image_file::size(part)
}

/// The mean and, where the file has one, the standard error of the picture's pixels in some rows, which it must have.
///
/// # Errors
///
/// [`ImageError`] when there is no picture with such rows, they exceed the budget, or are damaged or not finite.
pub fn picture_rows<R: Read + Seek>(
    file: R,
    rows: Range<u32>,
    budget: DecodeBudget,
) -> Result<ImageLayers, ImageError> {
    let file = OpenExr::read(file)?;
    let picture = image_file::find_picture(file.parts())?;
    let part = &file.parts()[picture];
    let [width, height] = image_file::size(part)?;
    if rows.is_empty() || rows.end > height {
        return Err(ImageError::BadSize { width: width.into(), height: height.into() });
    }
    let wanted = image_file::channels(part, &[&RGB, &STANDARD_ERROR], &[]);
    let planes = file.decode_rows(picture, rows.clone(), budget, |name| wanted.contains(&name))?;
    let layers = image_file::layers(planes, &wanted)?;
    check_layers(width, rows, &layers)?;
    Ok(layers)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use exr::prelude::{
        Blocks, Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, Vec2,
    };
    use exr::prelude::{WritableImage, f16};

    use super::*;
    use crate::image::tests::image;
    use crate::openexr::OpenExrError;

    const BUDGET: DecodeBudget = DecodeBudget { pixel_bytes: 1 << 20 };

    fn picture(x: usize, y: usize) -> [f32; 3] {
        [x as f32 * 0.5, y as f32 * 0.25, 1.0]
    }

    /// A picture of 35 x 70 pixels by another program.
    fn file(compression: Compression, blocks: Blocks, line_order: LineOrder) -> Vec<u8> {
        let channels = SpecificChannels::rgb(|position: Vec2<usize>| {
            let [red, green, blue] = picture(position.x(), position.y()).map(f16::from_f32);
            (red, green, blue)
        });
        let encoding = Encoding { compression, blocks, line_order };
        let layer = Layer::new((35, 70), LayerAttributes::named("any"), encoding, channels);
        let mut bytes = Cursor::new(Vec::new());
        Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn rows_are_those_of_the_picture_however_the_file_is_cut() {
        let cut = [
            (Blocks::ScanLines, LineOrder::Increasing),
            (Blocks::ScanLines, LineOrder::Decreasing),
            (Blocks::Tiles(Vec2(16, 24)), LineOrder::Unspecified),
        ];
        for (blocks, line_order) in cut {
            for compression in [Compression::Uncompressed, Compression::ZIP16, Compression::PIZ] {
                let file = file(compression, blocks, line_order);
                assert_eq!(picture_size(Cursor::new(&file)).unwrap(), [35, 70]);
                for rows in [0..70, 0..1, 15..17, 16..32, 33..70, 69..70] {
                    let layers = picture_rows(Cursor::new(&file), rows.clone(), BUDGET).unwrap();
                    let expected: Vec<[f32; 3]> =
                        rows.flat_map(|y| (0..35).map(move |x| picture(x, y as usize))).collect();
                    assert_eq!(layers.mean, expected, "{blocks:?} {line_order:?} {compression:?}");
                    assert!(layers.standard_error.is_none());
                }
            }
        }
    }

    #[test]
    fn the_standard_error_of_a_reference_comes_with_its_rows() {
        let image = image();
        let file = image.encode().unwrap();
        let layers = picture_rows(Cursor::new(&file), 2..4, BUDGET).unwrap();
        assert_eq!(layers.mean, image.layers().mean[14..28]);
        assert_eq!(layers.standard_error.unwrap(), image.layers().standard_error.as_ref().unwrap()[14..28]);
        assert!(layers.albedo.is_none() && layers.samples.is_none());
    }

    #[test]
    fn rows_that_are_not_there_too_large_or_damaged_are_refused() {
        let file = file(Compression::ZIP16, Blocks::ScanLines, LineOrder::Increasing);
        let rows = |file: &[u8], rows, pixel_bytes| picture_rows(Cursor::new(file), rows, DecodeBudget { pixel_bytes });
        assert!(matches!(rows(&file, 60..71, 1 << 20), Err(ImageError::BadSize { .. })));
        let error = rows(&file, 0..16, 1000).unwrap_err();
        assert!(matches!(error, ImageError::OpenExr(OpenExrError::TooLarge { allowed: 1000, .. })), "{error}");
        // The last block holds the last six rows.
        let cut_off = &file[..file.len() - 10];
        assert!(rows(cut_off, 0..64, 1 << 20).is_ok());
        let error = rows(cut_off, 48..70, 1 << 20).unwrap_err();
        assert!(matches!(error, ImageError::OpenExr(OpenExrError::Damaged(_))), "{error}");
        assert!(matches!(rows(b"PNG", 0..1, 1), Err(ImageError::OpenExr(OpenExrError::NotOpenExr(_)))));
    }

    #[test]
    fn a_value_that_is_no_number_is_named_by_its_place_in_the_picture() {
        let mut image = image().layers().clone();
        image.mean[3 * 7 + 5][1] = f32::NAN;
        let mut writer = crate::ImageWriter::new(7, 5, Vec::new());
        writer.write_rows(&image).unwrap();
        let (head, blocks) = writer.finish(None).unwrap();
        let file = [head, blocks].concat();
        assert!(picture_rows(Cursor::new(&file), 0..3, BUDGET).is_ok());
        let error = picture_rows(Cursor::new(&file), 2..5, BUDGET).unwrap_err();
        assert_eq!(error.to_string(), "layer RGB is not finite at pixel (5, 3)");
    }
}
