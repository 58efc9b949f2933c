//! Small pictures for the tests of whatever reads pictures.

use std::io::Cursor;

use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage};
use image::{DynamicImage, ImageFormat};

/// The picture as a PNG file.
pub(super) fn encode_png(picture: DynamicImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// An EXR file of these channels, in alphabetical order.
pub(super) fn encode_exr(width: usize, height: usize, channels: &[(&str, &[f32])]) -> Vec<u8> {
    let channels = channels.iter().map(|(name, values)| AnyChannel::new(*name, FlatSamples::F32(values.to_vec())));
    let layer = Layer::new(
        (width, height),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.collect()),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}
