//! Height maps: measured profiles from EXR and 16-bit PNG files.

use super::picture::{CodedPicture, Picture, decode_picture};
use crate::settings::AssetProblem;

/// Spline coefficients of a face, in metres.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CoefficientGrid {
    /// Coefficients along x.
    pub(crate) columns: usize,
    /// Coefficients along y.
    pub(crate) rows: usize,
    /// Rows in the order of y; the first row of a file is the one with the smallest y.
    pub(crate) coefficients: Vec<f32>,
}

/// Values of a file before they are scaled to metres.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HeightMap {
    columns: usize,
    rows: usize,
    values: Vec<f32>,
    /// What a value is divided by: the largest value of a picture of integers.
    divisor: f64,
}

/// The largest height in a map, metres. Panes are a few millimetres thick.
const MAX_HEIGHT: f64 = 1.0;

impl HeightMap {
    /// Decodes an EXR file with a channel Y or R, or a 16-bit grey PNG, whose values become 0 to 1.
    pub(crate) fn decode(bytes: &[u8]) -> Result<Self, AssetProblem> {
        match decode_picture(bytes)? {
            Picture::Exr(picture) => {
                let Some(values) = picture.channel("Y").or(picture.channel("R")) else {
                    return Err(picture.other_channels("a channel Y or R"));
                };
                Ok(Self { columns: picture.width, rows: picture.height, values: values.to_vec(), divisor: 1.0 })
            }
            Picture::Coded(CodedPicture { image, .. }) => {
                let Some(grey) = image.as_luma16() else {
                    let found = image.color();
                    return Err(AssetProblem::malformed(format_args!(
                        "is a picture of the kind {found:?}, must be 16-bit grey in a PNG file"
                    )));
                };
                let values = grey.as_raw().iter().map(|&value| f32::from(value)).collect();
                let [columns, rows] = [grey.width(), grey.height()].map(|edge| edge as usize);
                Ok(Self { columns, rows, values, divisor: f64::from(u16::MAX) })
            }
        }
    }

    /// The heights `value * scale + offset`, metres.
    pub(crate) fn coefficients(&self, scale: f64, offset: f64) -> Result<CoefficientGrid, AssetProblem> {
        let height = |value: f32| (f64::from(value) / self.divisor * scale + offset) as f32;
        let coefficients: Vec<f32> = self.values.iter().copied().map(height).collect();
        // A comparison that NaN fails.
        let is_height = |height: &f32| f64::from(height.abs()) <= MAX_HEIGHT;
        if let Some(index) = coefficients.iter().position(|height| !is_height(height)) {
            let (column, row) = (index % self.columns, index / self.columns);
            let found = coefficients[index];
            return Err(AssetProblem::malformed(format_args!(
                "has the height {found:?} m in column {column} of row {row}, must be -{MAX_HEIGHT} to {MAX_HEIGHT} m"
            )));
        }
        Ok(CoefficientGrid { columns: self.columns, rows: self.rows, coefficients })
    }
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, ImageBuffer, Luma};

    use super::super::picture_samples::{encode_exr, encode_png};
    use super::*;

    #[test]
    fn exr_heights_are_taken_bit_by_bit() {
        let heights = [1.25e-5, -3.0e-6, 0.0, f32::MIN_POSITIVE, 2e-4, -1e-4];
        for channel in ["Y", "R"] {
            let map = HeightMap::decode(&encode_exr(3, 2, &[(channel, &heights)])).unwrap();
            let grid = map.coefficients(1.0, 0.0).unwrap();
            assert_eq!((grid.columns, grid.rows), (3, 2));
            assert_eq!(grid.coefficients, heights);
        }
    }

    #[test]
    fn png_heights_run_from_the_offset_to_offset_plus_scale() {
        let picture = ImageBuffer::<Luma<u16>, _>::from_vec(3, 1, vec![0, 65_535, 13_107]).unwrap();
        let grid = HeightMap::decode(&encode_png(picture.into())).unwrap().coefficients(1e-3, -5e-4).unwrap();
        assert_eq!(grid.coefficients, [-5e-4, 5e-4, -3e-4]);
    }

    #[test]
    fn other_pictures_are_refused_with_what_would_be_right() {
        let message = |bytes: &[u8]| HeightMap::decode(bytes).unwrap_err().to_string();
        let coarse = encode_png(DynamicImage::new_luma8(2, 2));
        assert!(message(&coarse).contains("must be 16-bit grey"), "{}", message(&coarse));
        assert!(message(b"P6 2 2 255").contains("no PNG, JPEG, WebP or OpenEXR file"));
        assert!(message(&encode_exr(1, 1, &[("Z", &[0.0])])).contains("must have a channel Y or R"));
    }

    #[test]
    fn heights_that_are_not_finite_are_refused_with_their_place() {
        let map = HeightMap::decode(&encode_exr(2, 2, &[("Y", &[0.0, 0.0, f32::NAN, 0.0])])).unwrap();
        let message = map.coefficients(1.0, 0.0).unwrap_err().to_string();
        assert!(message.contains("NaN m in column 0 of row 1"), "{message}");
    }

    #[test]
    fn a_header_that_claims_a_huge_picture_is_refused_before_decoding() {
        let mut bytes = encode_exr(2, 2, &[("Y", &[0.0; 4])]);
        let mut patch = |attribute: &[u8], offset: usize, value: i32| {
            let place = bytes.windows(attribute.len()).position(|part| part == attribute).unwrap();
            let start = place + attribute.len() + offset;
            bytes[start..start + 4].copy_from_slice(&value.to_le_bytes());
        };
        patch(b"dataWindow\0box2i\0\x10\0\0\0", 8, 60_000);
        patch(b"dataWindow\0box2i\0\x10\0\0\0", 12, 60_000);
        // Blocks of 16 lines.
        patch(b"chunkCount\0int\0\x04\0\0\0", 0, 3751);
        let message = HeightMap::decode(&bytes).unwrap_err().to_string();
        assert!(message.contains("60001 x 60001 pixels"), "{message}");
    }
}
