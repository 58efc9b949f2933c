//! Textures as files: PNG where they are exactly 8-bit sRGB, else OpenEXR.

use clerestory_film::{FrameImage, ImageLayers};
use clerestory_render_core::texture::Bitmap;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::error::ExportError;

/// The file of a texture, and the ending of its name.
pub(crate) fn encode(bitmap: &Bitmap) -> Result<(Vec<u8>, &'static str), ExportError> {
    let [width, height] = bitmap.size().map(|edge| edge as u32);
    let Some(codes) = bitmap.srgb_codes() else {
        let layers = ImageLayers { mean: bitmap.texels().to_vec(), ..ImageLayers::default() };
        let image = FrameImage::new(width, height, layers, None);
        let image = image.map_err(|error| ExportError::Texture(error.to_string()))?;
        return Ok((image.encode().map_err(|error| ExportError::Texture(error.to_string()))?, "exr"));
    };
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(codes.as_flattened(), width, height, ExtendedColorType::Rgb8)
        .map_err(|error| ExportError::Texture(error.to_string()))?;
    Ok((png, "png"))
}
