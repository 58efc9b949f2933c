//! Textures as files: PNG where they are exactly 8-bit numbers, else OpenEXR.

use std::sync::Arc;

use clerestory_film::{FrameImage, ImageLayers};
use clerestory_render_core::exchange::{Texels, TextureModel};
use clerestory_render_core::texture::RadiancePicture;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::error::ExportError;

/// Pictures that are written, each once.
#[derive(Debug, Default)]
pub(crate) struct Pictures {
    known: Vec<(Texels, String)>,
    /// Names and bytes of files.
    pub(crate) files: Vec<(String, Vec<u8>)>,
}

impl Pictures {
    /// A texture of the scene as one of a file. In a file v is counted from the top of the picture.
    pub(crate) fn texture(&mut self, texture: TextureModel) -> Result<TextureModel<String>, ExportError> {
        let TextureModel { file: texels, coordinates, wrap, filter, transform } = texture;
        let is_same = |other: &Texels| {
            Arc::ptr_eq(&other.bitmap, &texels.bitmap)
                && (other.factor, other.channel, other.threshold) == (texels.factor, texels.channel, texels.threshold)
        };
        let file = match self.known.iter().find(|(other, _)| is_same(other)) {
            Some((_, file)) => file.clone(),
            None => {
                let (bytes, ending) = encode(&texels)?;
                let file = self.add(bytes, ending);
                self.known.push((texels, file.clone()));
                file
            }
        };
        Ok(TextureModel { file, coordinates, wrap, filter, transform: flipped(transform) })
    }

    /// A picture of radiance.
    pub(crate) fn radiance(&mut self, picture: &RadiancePicture) -> Result<String, ExportError> {
        self.colours(picture.size(), picture.texels().to_vec())
    }

    /// A picture of linear colours.
    pub(crate) fn colours(&mut self, size: [usize; 2], texels: Vec<[f32; 3]>) -> Result<String, ExportError> {
        let bytes = encode_exr(size, texels)?;
        Ok(self.add(bytes, "exr"))
    }

    fn add(&mut self, bytes: Vec<u8>, ending: &str) -> String {
        let file = format!("textures/{:04}.{ending}", self.files.len());
        self.files.push((file.clone(), bytes));
        file
    }
}

/// A transformation of (u, v) where v is counted from the other end, before and after.
fn flipped([[a, b, c], [d, e, f]]: [[f64; 3]; 2]) -> [[f64; 3]; 2] {
    // Negative zero looks odd in a file.
    let [a, b, c, d, e, f] = [a, -b, b + c, -d, e, 1.0 - e - f].map(|number| number + 0.0);
    [[a, b, c], [d, e, f]]
}

/// The file of a texture, and the ending of its name.
fn encode(texels: &Texels) -> Result<(Vec<u8>, &'static str), ExportError> {
    let Texels { bitmap, factor, channel, threshold } = texels;
    let size = bitmap.size();
    let of_channel = |texel: &[f32; 3], channel: usize| (f64::from(texel[channel]) * factor[channel]) as f32;
    let Some(channel) = channel.map(|channel| channel as usize) else {
        if *factor == [1.0; 3]
            && let Some(codes) = bitmap.srgb_codes()
        {
            return Ok((encode_png(size, codes.as_flattened(), ExtendedColorType::Rgb8)?, "png"));
        }
        let texels = bitmap.texels().iter().map(|texel| [0, 1, 2].map(|channel| of_channel(texel, channel)));
        return Ok((encode_exr(size, texels.collect())?, "exr"));
    };
    let cut = |value: f32| match threshold {
        Some(threshold) => f32::from(u8::from(f64::from(value) >= *threshold)),
        None => value,
    };
    let values = || bitmap.texels().iter().map(|texel| cut(of_channel(texel, channel)));
    let code = |value: f32| {
        let code = (value * 255.0).round();
        (code / 255.0 == value).then_some(code as u8)
    };
    match values().map(code).collect::<Option<Vec<u8>>>() {
        Some(codes) => Ok((encode_png(size, &codes, ExtendedColorType::L8)?, "png")),
        None => Ok((encode_exr(size, values().map(|value| [value; 3]).collect())?, "exr")),
    }
}

fn encode_png([width, height]: [usize; 2], bytes: &[u8], colour: ExtendedColorType) -> Result<Vec<u8>, ExportError> {
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(bytes, width as u32, height as u32, colour)
        .map_err(|error| ExportError::Texture(error.to_string()))?;
    Ok(png)
}

/// The file of a picture of linear colours.
fn encode_exr([width, height]: [usize; 2], texels: Vec<[f32; 3]>) -> Result<Vec<u8>, ExportError> {
    let failed = |error: String| ExportError::Texture(error);
    let layers = ImageLayers { mean: texels, ..ImageLayers::default() };
    let image = FrameImage::new(width as u32, height as u32, layers, None);
    image.map_err(|error| failed(error.to_string()))?.encode().map_err(|error| failed(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transformation_means_the_same_with_v_from_the_top() {
        let (transform, u, v) = ([[0.5, 0.25, 0.125], [-1.0, 2.0, 0.75]], 0.3, 0.6);
        let apply = |[[a, b, c], [d, e, f]]: [[f64; 3]; 2], u: f64, v: f64| (a * u + b * v + c, d * u + e * v + f);
        let (x, y) = apply(transform, u, v);
        let (flipped_x, flipped_y) = apply(flipped(transform), u, 1.0 - v);
        assert!((x - flipped_x).abs() < 1e-15 && (1.0 - y - flipped_y).abs() < 1e-15);
        let unchanged = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(flipped(unchanged), unchanged);
    }
}
