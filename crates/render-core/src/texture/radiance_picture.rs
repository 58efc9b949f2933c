//! Pictures of radiance: linear colours without an upper limit, from OpenEXR and Radiance files.

use glam::DVec3;

use super::picture::decode_exr;
use super::radiance_file;
use crate::settings::AssetProblem;
use crate::settings::limits::MAX_PICTURE_RADIANCE;
use clerestory_film::file_format::FileFormat;

/// A picture in linear Rec. 709.
#[derive(Clone, Debug, PartialEq)]
pub struct RadiancePicture {
    width: usize,
    height: usize,
    /// Rows from the top.
    texels: Vec<[f32; 3]>,
}

impl RadiancePicture {
    /// Decodes an OpenEXR file with the channels R, G and B or Y, or a Radiance file.
    pub(crate) fn decode(bytes: &[u8]) -> Result<Self, AssetProblem> {
        let (width, height, texels) = match bytes {
            [0x76, 0x2f, 0x31, 0x01, ..] => {
                let picture = decode_exr(bytes)?;
                (picture.width, picture.height, picture.colours()?)
            }
            _ if radiance_file::is_radiance(bytes) => {
                let ([width, height], texels) = radiance_file::decode(bytes)?;
                (width, height, texels)
            }
            _ => {
                let found =
                    FileFormat::of(bytes).map_or_else(|| "something else".to_owned(), |format| format.to_string());
                return Err(AssetProblem::malformed(format_args!(
                    "is {found}, must be an OpenEXR or a Radiance picture (.hdr): others hold no light above white"
                )));
            }
        };
        let is_radiance = |value: &f32| (0.0..=MAX_PICTURE_RADIANCE).contains(&f64::from(*value));
        if let Some(index) = texels.iter().position(|texel| !texel.iter().all(is_radiance)) {
            let (column, row, found) = (index % width, index / width, texels[index]);
            return Err(AssetProblem::malformed(format_args!(
                "has the radiance {found:?} in column {column} of row {row}, must be 0 to {MAX_PICTURE_RADIANCE:e}"
            )));
        }
        Ok(Self { width, height, texels })
    }

    /// Pixels across and down.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The texels, row by row from the top.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// The value between texels, `x` from the left and `y` from the top in texels, whose middles are at halves. What is
    /// left of the picture is at its right end, and the top and the bottom row go on.
    pub fn between(&self, x: f64, y: f64) -> DVec3 {
        let (x, y) = (x - 0.5, (y - 0.5).clamp(0.0, (self.height - 1) as f64));
        let (left, top) = (x.floor(), y.floor());
        let (right_weight, bottom_weight) = (x - left, y - top);
        let columns = [left, left + 1.0].map(|column| (column as i64).rem_euclid(self.width as i64) as usize);
        let rows = [top as usize, (top as usize + 1).min(self.height - 1)];
        let [top, bottom] = rows.map(|row| {
            let [left, right] = columns.map(|column| self.texel(column, row));
            left * (1.0 - right_weight) + right * right_weight
        });
        top * (1.0 - bottom_weight) + bottom * bottom_weight
    }

    fn texel(&self, column: usize, row: usize) -> DVec3 {
        DVec3::from(self.texels[row * self.width + column].map(f64::from))
    }
}

#[cfg(test)]
mod tests {
    use super::super::picture_samples::{encode_exr, encode_png};
    use super::*;

    fn row(values: &[f32]) -> RadiancePicture {
        RadiancePicture::decode(&encode_exr(values.len(), 1, &[("Y", values)])).unwrap()
    }

    #[test]
    fn the_left_and_the_right_end_meet_and_the_top_row_goes_on() {
        let picture = row(&[8.0, 0.0, 0.0, 4.0]);
        for (x, expected) in [(0.5, 8.0), (1.0, 4.0), (0.0, 6.0), (4.0, 6.0), (3.5, 4.0), (-0.5, 4.0), (4.25, 7.0)] {
            for y in [-3.0, 0.0, 0.5, 1.0, 7.0] {
                assert_eq!(picture.between(x, y), DVec3::splat(expected), "{x} {y}");
            }
        }
        let picture = RadiancePicture::decode(&encode_exr(1, 2, &[("Y", &[2.0, 6.0])])).unwrap();
        assert_eq!([0.2, 0.5, 1.0, 1.5, 1.9].map(|y| picture.between(0.3, y).x), [2.0, 2.0, 4.0, 6.0, 6.0]);
    }

    #[test]
    fn radiance_that_is_no_radiance_is_refused_with_its_place() {
        for (value, found) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (-0.5, "-0.5"), (3e38, "3e38")] {
            let bytes = encode_exr(2, 2, &[("Y", &[0.5, 0.5, 0.5, value])]);
            let problem = RadiancePicture::decode(&bytes).unwrap_err().to_string();
            assert!(problem.contains(found) && problem.contains("column 1 of row 1, must be 0 to 1e24"), "{problem}");
        }
    }

    #[test]
    fn other_pictures_are_refused_with_what_would_be_right() {
        let problem = |bytes: &[u8]| RadiancePicture::decode(bytes).unwrap_err().to_string();
        let png = problem(&encode_png(image::DynamicImage::new_rgb8(1, 1)));
        assert!(png.contains("a PNG picture, must be an OpenEXR or a Radiance picture"), "{png}");
        assert!(problem(b"").contains("an empty file"), "{}", problem(b""));
        assert!(problem(&encode_exr(1, 1, &[("Z", &[0.0])])).contains("must have the channels R, G and B, or Y"));
    }

    #[test]
    fn a_radiance_file_is_read() {
        let bytes = b"#?RGBE\n\n-Y 1 +X 1\n\x80\x40\0\x81";
        let picture = RadiancePicture::decode(bytes).unwrap();
        assert_eq!((picture.size(), picture.texels()), ([1, 1], &[[1.0, 0.5, 0.0]][..]));
    }
}
