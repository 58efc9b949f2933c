//! Pictures over a surface.

use glam::{DVec2, DVec3};
use image::DynamicImage;

use super::Encoding;
use super::picture::{CodedPicture, ExrPicture, Picture, decode_picture};
use super::png_colour;
use super::wrap::{Filter, Wrap};
use crate::settings::AssetProblem;

/// The texels of a picture: linear Rec.709, or other numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Bitmap {
    width: usize,
    height: usize,
    /// Rows from the top.
    texels: Vec<[f32; 3]>,
}

impl Bitmap {
    /// Decodes a picture of 8 or 16 bits, or an EXR file.
    ///
    /// # Errors
    ///
    /// When it is not readable, or its colours are other than sRGB or linear Rec. 709.
    pub(crate) fn decode(bytes: &[u8], encoding: Encoding) -> Result<Self, AssetProblem> {
        Self::decode_as(bytes, encoding, true)
    }

    /// The same of a picture in a glTF file. Its colours are sRGB whatever it states, as glTF demands.
    ///
    /// # Errors
    ///
    /// When it is not readable.
    pub(crate) fn decode_in_gltf(bytes: &[u8], encoding: Encoding) -> Result<Self, AssetProblem> {
        Self::decode_as(bytes, encoding, false)
    }

    fn decode_as(bytes: &[u8], encoding: Encoding, states_colours: bool) -> Result<Self, AssetProblem> {
        match decode_picture(bytes)? {
            Picture::Coded(CodedPicture { image, profile }) => {
                if encoding == Encoding::Colour && states_colours {
                    png_colour::check(bytes, profile.as_deref(), !image.color().has_color())?;
                }
                from_coded(&image, encoding)
            }
            Picture::Exr(picture) => from_exr(&picture, encoding),
        }
    }

    /// Texels across and down.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Its texels in linear Rec. 709, in rows from the top left.
    pub fn texels(&self) -> &[[f32; 3]] {
        &self.texels
    }

    /// Its texels as 8-bit sRGB; `None` where that is not exactly what they are.
    pub fn srgb_codes(&self) -> Option<Vec<[u8; 3]>> {
        let linear: Vec<f32> = (0..=255).map(|code| srgb_to_linear(f64::from(code) / 255.0)).collect();
        let code = |value: f32| {
            let code = linear.partition_point(|other| *other < value);
            (linear.get(code) == Some(&value)).then_some(code as u8)
        };
        self.texels.iter().map(|[red, green, blue]| Some([code(*red)?, code(*green)?, code(*blue)?])).collect()
    }

    /// The value at a texture coordinate: (0, 0) is the bottom left corner of the picture, (1, 1) the top right.
    pub fn lookup(&self, coordinate: DVec2, [wrap_u, wrap_v]: [Wrap; 2], filter: Filter) -> DVec3 {
        let x = coordinate.x * self.width as f64 - 0.5;
        let y = (1.0 - coordinate.y) * self.height as f64 - 0.5;
        if filter == Filter::Nearest {
            return self
                .texel(wrap_u.texel((x + 0.5).floor(), self.width), wrap_v.texel((y + 0.5).floor(), self.height));
        }
        let (left, top) = (x.floor(), y.floor());
        let (right_weight, bottom_weight) = (x - left, y - top);
        let columns = [left, left + 1.0].map(|column| wrap_u.texel(column, self.width));
        let rows = [top, top + 1.0].map(|row| wrap_v.texel(row, self.height));
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

impl Wrap {
    /// The texel that stands for `index` in a row of `count`.
    fn texel(self, index: f64, count: usize) -> usize {
        let (index, count) = (index as i64, count as i64);
        let texel = match self {
            Self::Repeat => index.rem_euclid(count),
            Self::Mirror => {
                let place = index.rem_euclid(2 * count);
                place.min(2 * count - 1 - place)
            }
            Self::Clamp => index.clamp(0, count - 1),
        };
        texel as usize
    }
}

fn from_coded(image: &DynamicImage, encoding: Encoding) -> Result<Bitmap, AssetProblem> {
    let channels = usize::from(image.color().channel_count());
    let decoded = |value: f64| match encoding {
        Encoding::Colour => srgb_to_linear(value),
        Encoding::Data | Encoding::Opacity => value as f32,
    };
    let texels = if let Some(samples) = image.as_flat_samples_u8() {
        let linear: Vec<f32> = (0..=255).map(|value| decoded(f64::from(value) / 255.0)).collect();
        let texel = |texel: &[u8]| channels_of(texel, encoding, |value| linear[usize::from(value)]);
        samples.as_slice().chunks_exact(channels).map(texel).collect()
    } else if let Some(samples) = image.as_flat_samples_u16() {
        let linear: Vec<f32> = (0..=65_535).map(|value| decoded(f64::from(value) / 65_535.0)).collect();
        let texel = |texel: &[u16]| channels_of(texel, encoding, |value| linear[usize::from(value)]);
        samples.as_slice().chunks_exact(channels).map(texel).collect()
    } else {
        return Err(AssetProblem::malformed("must have 8 or 16 bits for each channel"));
    };
    Ok(Bitmap { width: image.width() as usize, height: image.height() as usize, texels })
}

/// Red, green and blue of a texel that may also be grey or have an opacity; or its opacity alone.
fn channels_of<T: Copy>(texel: &[T], encoding: Encoding, linear: impl Fn(T) -> f32) -> [f32; 3] {
    match *texel {
        [_, opacity] | [_, _, _, opacity] if encoding == Encoding::Opacity => [linear(opacity); 3],
        _ if encoding == Encoding::Opacity => [1.0; 3],
        [red, green, blue, ..] => [red, green, blue].map(linear),
        [grey, ..] => [linear(grey); 3],
        [] => [0.0; 3],
    }
}

/// The transfer function of IEC 61966-2-1: from a value of sRGB, 0 to 1, to a linear one.
pub fn srgb_to_linear(value: f64) -> f32 {
    let linear = if value <= 0.040_45 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) };
    linear as f32
}

fn from_exr(picture: &ExrPicture, encoding: Encoding) -> Result<Bitmap, AssetProblem> {
    let (width, height) = (picture.width, picture.height);
    if encoding == Encoding::Opacity {
        let opaque = vec![[1.0; 3]; width * height];
        let texels = picture.channel("A").map_or(opaque, |alpha| alpha.iter().map(|&alpha| [alpha; 3]).collect());
        return bounded(Bitmap { width, height, texels }, "opacity");
    }
    let texels = picture.channels(encoding == Encoding::Colour)?;
    bounded(Bitmap { width, height, texels }, if encoding == Encoding::Colour { "reflectance" } else { "value" })
}

/// Refuses numbers that are not between 0 and 1. `name` says what they are.
fn bounded(bitmap: Bitmap, name: &str) -> Result<Bitmap, AssetProblem> {
    let is_bounded = |value: &f32| (0.0..=1.0).contains(value);
    if let Some(index) = bitmap.texels.iter().position(|texel| !texel.iter().all(is_bounded)) {
        let (column, row) = (index % bitmap.width, index / bitmap.width);
        let found = bitmap.texels[index];
        return Err(AssetProblem::malformed(format_args!(
            "has the {name} {found:?} in column {column} of row {row}, must be 0 to 1"
        )));
    }
    Ok(bitmap)
}

#[cfg(test)]
mod tests {
    use image::{ImageBuffer, Rgb};

    use super::super::picture_samples::{encode_exr, encode_png};
    use super::*;

    fn look_up(texture: &Bitmap, coordinate: DVec2) -> DVec3 {
        texture.lookup(coordinate, [Wrap::Repeat; 2], Filter::Linear)
    }

    #[test]
    fn the_bottom_left_corner_of_the_picture_is_the_origin() {
        let picture = ImageBuffer::from_fn(2, 2, |x, y| Rgb([if (x, y) == (0, 1) { 255_u8 } else { 0 }, 0, 0]));
        let texture = Bitmap::decode(&encode_png(picture.into()), Encoding::Colour).unwrap();
        assert_eq!(look_up(&texture, DVec2::new(0.25, 0.25)), DVec3::X);
        assert_eq!(look_up(&texture, DVec2::new(0.25, 0.75)), DVec3::ZERO);
        assert_eq!(look_up(&texture, DVec2::new(0.75, 0.25)), DVec3::ZERO);
        assert_eq!(look_up(&texture, DVec2::new(-3.75, 5.25)), DVec3::X);
    }

    #[test]
    fn texels_are_blended_across_the_border_where_the_picture_repeats() {
        let picture = ImageBuffer::from_fn(4, 1, |x, _| Rgb([if x == 0 { 65_535_u16 } else { 0 }, 0, 0]));
        let texture = Bitmap::decode(&encode_png(picture.into()), Encoding::Colour).unwrap();
        assert_eq!(look_up(&texture, DVec2::new(1.0, 0.5)), DVec3::new(0.5, 0.0, 0.0));
        assert_eq!(look_up(&texture, DVec2::new(0.25, 0.0)), DVec3::new(0.5, 0.0, 0.0));
    }

    #[test]
    fn png_is_srgb_and_exr_is_linear() {
        let grey = ImageBuffer::from_pixel(1, 1, image::Luma([188_u8]));
        let texture = Bitmap::decode(&encode_png(grey.into()), Encoding::Colour).unwrap();
        // 188 is what an sRGB picture stores for half the light.
        assert!((look_up(&texture, DVec2::ZERO) - DVec3::splat(0.5)).abs().max_element() < 0.003);
        let texture = Bitmap::decode(&encode_exr(1, 1, &[("Y", &[0.5])]), Encoding::Colour).unwrap();
        assert_eq!(look_up(&texture, DVec2::ZERO), DVec3::splat(0.5));
    }

    #[test]
    fn beyond_its_border_a_picture_begins_again_is_mirrored_or_goes_on() {
        let picture = ImageBuffer::from_fn(4, 1, |x, _| image::Luma([u8::try_from(x).unwrap() * 51]));
        let texture = Bitmap::decode(&encode_png(picture.into()), Encoding::Data).unwrap();
        let along = |wrap: Wrap| {
            [-0.375, -0.125, 0.125, 0.875, 1.125, 1.375]
                .map(|u| (texture.lookup(DVec2::new(u, 0.5), [wrap; 2], Filter::Nearest).x * 5.0).round() as i32)
        };
        assert_eq!(along(Wrap::Repeat), [2, 3, 0, 3, 0, 1]);
        assert_eq!(along(Wrap::Mirror), [1, 0, 0, 3, 3, 2]);
        assert_eq!(along(Wrap::Clamp), [0, 0, 0, 3, 3, 3]);
    }

    #[test]
    fn opacity_is_the_last_channel_and_one_without_it() {
        let picture = ImageBuffer::from_pixel(1, 1, image::Rgba([255_u8, 0, 0, 51]));
        let opacity = |picture: DynamicImage| {
            look_up(&Bitmap::decode(&encode_png(picture), Encoding::Opacity).unwrap(), DVec2::ZERO).x
        };
        assert!((opacity(picture.into()) - 0.2).abs() < 1e-6);
        assert_eq!(opacity(ImageBuffer::from_pixel(1, 1, Rgb([0_u8; 3])).into()), 1.0);
    }

    #[test]
    fn reflectance_above_one_is_refused_with_its_place() {
        let values = [0.5, 0.5, 0.5, 1.5];
        let bytes = encode_exr(2, 2, &[("B", &values), ("G", &values), ("R", &values)]);
        let problem = Bitmap::decode(&bytes, Encoding::Colour).unwrap_err().to_string();
        assert!(problem.contains("column 1 of row 1, must be 0 to 1"), "{problem}");
        let problem = Bitmap::decode(&encode_exr(1, 1, &[("Z", &[0.5])]), Encoding::Colour).unwrap_err().to_string();
        assert!(problem.contains("must have the channels R, G and B, or Y"), "{problem}");
    }
}
