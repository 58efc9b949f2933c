//! Pictures over a surface.

use glam::{DVec2, DVec3};
use image::DynamicImage;

use super::picture::{ExrPicture, Picture, PngPicture, decode_picture};
use super::png_colour;
use crate::settings::AssetProblem;

/// A picture in linear Rec.709, repeated over the plane and filtered bilinearly.
#[derive(Clone, Debug, PartialEq)]
pub struct Bitmap {
    width: usize,
    height: usize,
    /// Rows from the top.
    texels: Vec<[f32; 3]>,
}

impl Bitmap {
    /// Decodes an sRGB PNG or a linear EXR file.
    pub(crate) fn decode(bytes: &[u8]) -> Result<Self, AssetProblem> {
        match decode_picture(bytes)? {
            Picture::Png(PngPicture { image, profile }) => {
                png_colour::check(bytes, profile.as_deref(), !image.color().has_color())?;
                from_png(&image)
            }
            Picture::Exr(picture) => from_exr(&picture),
        }
    }

    /// The value at a texture coordinate: (0, 0) is the bottom left corner of the picture, (1, 1) the top right.
    pub fn lookup(&self, coordinate: DVec2) -> DVec3 {
        let x = coordinate.x * self.width as f64 - 0.5;
        let y = (1.0 - coordinate.y) * self.height as f64 - 0.5;
        let (left, top) = (x.floor(), y.floor());
        let (right_weight, bottom_weight) = (x - left, y - top);
        let columns = [left, left + 1.0].map(|column| wrap(column, self.width));
        let rows = [top, top + 1.0].map(|row| wrap(row, self.height));
        let [top, bottom] = rows.map(|row| {
            let [left, right] = columns.map(|column| self.texel(column, row));
            left * (1.0 - right_weight) + right * right_weight
        });
        top * (1.0 - bottom_weight) + bottom * bottom_weight
    }

    fn texel(&self, column: usize, row: usize) -> DVec3 {
        let [red, green, blue] = self.texels[row * self.width + column];
        DVec3::new(f64::from(red), f64::from(green), f64::from(blue))
    }
}

/// The texel that stands for `index` in a row of `count` that is repeated without end.
fn wrap(index: f64, count: usize) -> usize {
    (index as i64).rem_euclid(count as i64) as usize
}

fn from_png(image: &DynamicImage) -> Result<Bitmap, AssetProblem> {
    let channels = usize::from(image.color().channel_count());
    let texels = if let Some(samples) = image.as_flat_samples_u8() {
        let linear: Vec<f32> = (0..=255).map(|value| srgb_to_linear(f64::from(value) / 255.0)).collect();
        samples
            .as_slice()
            .chunks_exact(channels)
            .map(|texel| colour(texel, |value| linear[usize::from(value)]))
            .collect()
    } else if let Some(samples) = image.as_flat_samples_u16() {
        let linear: Vec<f32> = (0..=65_535).map(|value| srgb_to_linear(f64::from(value) / 65_535.0)).collect();
        samples
            .as_slice()
            .chunks_exact(channels)
            .map(|texel| colour(texel, |value| linear[usize::from(value)]))
            .collect()
    } else {
        return Err(AssetProblem::malformed("must have 8 or 16 bits for each channel"));
    };
    Ok(Bitmap { width: image.width() as usize, height: image.height() as usize, texels })
}

/// Red, green and blue of a texel that may also be grey or have an opacity, which is ignored.
fn colour<T: Copy>(texel: &[T], linear: impl Fn(T) -> f32) -> [f32; 3] {
    match *texel {
        [red, green, blue, ..] => [red, green, blue].map(linear),
        [grey, ..] => [linear(grey); 3],
        [] => [0.0; 3],
    }
}

/// The transfer function of IEC 61966-2-1.
fn srgb_to_linear(value: f64) -> f32 {
    let linear = if value <= 0.040_45 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) };
    linear as f32
}

fn from_exr(picture: &ExrPicture) -> Result<Bitmap, AssetProblem> {
    let is_colour = ["R", "G", "B"].map(|name| picture.has(name)) != [false; 3];
    // Y beside these is a part of a colour.
    let is_grey = !is_colour && !["X", "Z", "RY", "BY"].into_iter().any(|name| picture.has(name));
    let channel = |name: &str| picture.channel(if is_grey { "Y" } else { name });
    let (Some(red), Some(green), Some(blue)) = (channel("R"), channel("G"), channel("B")) else {
        return Err(picture.other_channels("the channels R, G and B, or Y"));
    };
    if is_colour {
        picture.check_primaries()?;
    }
    let texels: Vec<[f32; 3]> =
        red.iter().zip(green).zip(blue).map(|((&red, &green), &blue)| [red, green, blue]).collect();
    let is_reflectance = |value: &f32| (0.0..=1.0).contains(value);
    if let Some(index) = texels.iter().position(|texel| !texel.iter().all(is_reflectance)) {
        let (column, row) = (index % picture.width, index / picture.width);
        let found = texels[index];
        return Err(AssetProblem::malformed(format_args!(
            "has the reflectance {found:?} in column {column} of row {row}, must be 0 to 1"
        )));
    }
    Ok(Bitmap { width: picture.width, height: picture.height, texels })
}

#[cfg(test)]
mod tests {
    use image::{ImageBuffer, Rgb};

    use super::super::picture_samples::{encode_exr, encode_png};
    use super::*;

    #[test]
    fn the_bottom_left_corner_of_the_picture_is_the_origin() {
        let picture = ImageBuffer::from_fn(2, 2, |x, y| Rgb([if (x, y) == (0, 1) { 255_u8 } else { 0 }, 0, 0]));
        let texture = Bitmap::decode(&encode_png(picture.into())).unwrap();
        assert_eq!(texture.lookup(DVec2::new(0.25, 0.25)), DVec3::X);
        assert_eq!(texture.lookup(DVec2::new(0.25, 0.75)), DVec3::ZERO);
        assert_eq!(texture.lookup(DVec2::new(0.75, 0.25)), DVec3::ZERO);
        assert_eq!(texture.lookup(DVec2::new(-3.75, 5.25)), DVec3::X);
    }

    #[test]
    fn texels_are_blended_across_the_border_where_the_picture_repeats() {
        let picture = ImageBuffer::from_fn(4, 1, |x, _| Rgb([if x == 0 { 65_535_u16 } else { 0 }, 0, 0]));
        let texture = Bitmap::decode(&encode_png(picture.into())).unwrap();
        assert_eq!(texture.lookup(DVec2::new(1.0, 0.5)), DVec3::new(0.5, 0.0, 0.0));
        assert_eq!(texture.lookup(DVec2::new(0.25, 0.0)), DVec3::new(0.5, 0.0, 0.0));
    }

    #[test]
    fn png_is_srgb_and_exr_is_linear() {
        let grey = ImageBuffer::from_pixel(1, 1, image::Luma([188_u8]));
        let texture = Bitmap::decode(&encode_png(grey.into())).unwrap();
        // 188 is what an sRGB picture stores for half the light.
        assert!((texture.lookup(DVec2::ZERO) - DVec3::splat(0.5)).abs().max_element() < 0.003);
        let texture = Bitmap::decode(&encode_exr(1, 1, &[("Y", &[0.5])])).unwrap();
        assert_eq!(texture.lookup(DVec2::ZERO), DVec3::splat(0.5));
    }

    #[test]
    fn reflectance_above_one_is_refused_with_its_place() {
        let values = [0.5, 0.5, 0.5, 1.5];
        let bytes = encode_exr(2, 2, &[("B", &values), ("G", &values), ("R", &values)]);
        let problem = Bitmap::decode(&bytes).unwrap_err().to_string();
        assert!(problem.contains("column 1 of row 1, must be 0 to 1"), "{problem}");
        let problem = Bitmap::decode(&encode_exr(1, 1, &[("Z", &[0.5])])).unwrap_err().to_string();
        assert!(problem.contains("must have the channels R, G and B, or Y"), "{problem}");
    }
}
