//! Small pictures for the tests of whatever reads pictures.

use std::io::Cursor;

use exr::meta::header::ImageAttributes;
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage};
use image::{DynamicImage, ImageFormat};

/// The picture as a PNG file.
pub(crate) fn encode_png(picture: DynamicImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// A PNG file of these chunks, which are not compressed. The last holds the pixels, each row behind a zero.
pub(crate) fn png_of(
    size: [u32; 2],
    [depth, colour_type, interlaced]: [u8; 3],
    chunks: &[(&[u8; 4], Vec<u8>)],
) -> Vec<u8> {
    let header = [&size[0].to_be_bytes()[..], &size[1].to_be_bytes(), &[depth, colour_type, 0, 0, interlaced]].concat();
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut write = |name: &[u8; 4], content: &[u8]| {
        bytes.extend((content.len() as u32).to_be_bytes());
        let checked = [&name[..], content].concat();
        bytes.extend(&checked);
        bytes.extend(crc(&checked).to_be_bytes());
    };
    write(b"IHDR", &header);
    for (name, content) in chunks {
        let content = if *name == b"IDAT" { stored(content) } else { content.clone() };
        write(name, &content);
    }
    write(b"IEND", b"");
    bytes
}

/// A chunk of a colour profile.
pub(crate) fn profile_chunk(profile: &[u8]) -> Vec<u8> {
    [b"profile\0\0", &stored(profile)[..]].concat()
}

/// Bytes as zlib stores them.
fn stored(content: &[u8]) -> Vec<u8> {
    let length = content.len() as u16;
    let sum = content.iter().fold([1_u32, 0], |[a, b], byte| {
        let a = (a + u32::from(*byte)) % 65_521;
        [a, (b + a) % 65_521]
    });
    let head = [&[0x78, 1, 1][..], &length.to_le_bytes(), &(!length).to_le_bytes()].concat();
    [&head[..], content, &(sum[1] << 16 | sum[0]).to_be_bytes()].concat()
}

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

/// An EXR file of these channels.
pub(crate) fn encode_exr(width: usize, height: usize, channels: &[(&str, &[f32])]) -> Vec<u8> {
    encode_exr_with(width, height, channels, |_, _| {})
}

/// An EXR file of these channels, with other attributes.
pub(crate) fn encode_exr_with(
    width: usize,
    height: usize,
    channels: &[(&str, &[f32])],
    change: impl FnOnce(&mut ImageAttributes, &mut LayerAttributes),
) -> Vec<u8> {
    let channels = channels.iter().map(|(name, values)| AnyChannel::new(*name, FlatSamples::F32(values.to_vec())));
    encode_layer(width, height, AnyChannels::sort(channels.collect()), change)
}

/// An EXR file of a channel of whole numbers.
pub(crate) fn encode_whole_numbers(width: usize, height: usize, channel: &str, values: &[u32]) -> Vec<u8> {
    let channel = AnyChannel::new(channel, FlatSamples::U32(values.to_vec()));
    encode_layer(width, height, AnyChannels::sort([channel].into_iter().collect()), |_, _| {})
}

fn encode_layer(
    width: usize,
    height: usize,
    channels: AnyChannels<FlatSamples>,
    change: impl FnOnce(&mut ImageAttributes, &mut LayerAttributes),
) -> Vec<u8> {
    let layer = Layer::new((width, height), LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    let mut image = Image::from_layer(layer);
    change(&mut image.attributes, &mut image.layer_data.attributes);
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}
