//! OpenEXR files with faults: valid files that are read, changed and written again, or of which bytes are changed.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Cursor};
use std::ops::Range;
use std::path::Path;

use clerestory_film::ImageMetadata;
use exr::block::UncompressedBlock;
use exr::image::write::layers::WritableLayers;
use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatImage, FlatSamples, Image, Layer, LayerAttributes, ReadChannels, ReadLayers,
    WritableImage,
};

/// Edge of the image that the headers of [`with_huge_claim`] claim.
pub const HUGE_EDGE: u64 = 60_001;

/// A picture of these channels of 32-bit floats, all of one value; uncompressed, so that each row is a block.
///
/// # Panics
///
/// When it cannot be written.
pub fn picture(width: usize, height: usize, channels: &[&str], value: f32) -> Vec<u8> {
    let samples = FlatSamples::F32(vec![value; width * height]);
    let channels = channels.iter().map(|name| AnyChannel::new(*name, samples.clone())).collect();
    let layer =
        Layer::new((width, height), LayerAttributes::default(), Encoding::UNCOMPRESSED, AnyChannels::sort(channels));
    written(&Image::from_layer(layer))
}

/// A valid file after a change to its contents.
///
/// # Panics
///
/// When the file is not valid, or cannot be written after the change.
pub fn edited(file: &[u8], edit: impl FnOnce(&mut FlatImage)) -> Vec<u8> {
    let mut image = parsed(file);
    edit(&mut image);
    written(&image)
}

/// Whether two files have the same layers, of the same channels, with the same bits in every pixel.
///
/// # Errors
///
/// The first difference.
///
/// # Panics
///
/// When a file is not valid.
pub fn same_samples(first: &[u8], second: &[u8]) -> Result<(), String> {
    let [first, second] = [first, second].map(|file| parsed(file).layer_data);
    let layers = |file: &[Layer<AnyChannels<FlatSamples>>]| -> Vec<String> {
        file.iter().map(|layer| format!("{:?} {:?}", layer.attributes.layer_name, layer.size)).collect()
    };
    if layers(&first) != layers(&second) {
        return Err(format!("layers {:?} and {:?}", layers(&first), layers(&second)));
    }
    for (layer, other) in first.iter().zip(&second) {
        let names = |layer: &Layer<AnyChannels<FlatSamples>>| -> Vec<String> {
            layer.channel_data.list.iter().map(|channel| channel.name.to_string()).collect()
        };
        if names(layer) != names(other) {
            return Err(format!("channels {:?} and {:?}", names(layer), names(other)));
        }
        for (channel, other) in layer.channel_data.list.iter().zip(&other.channel_data.list) {
            let (samples, others) = (bits(&channel.sample_data), bits(&other.sample_data));
            let different = samples.iter().zip(&others).filter(|(a, b)| a != b).count();
            if samples.len() != others.len() || different > 0 {
                let layer = &layer.attributes.layer_name;
                return Err(format!(
                    "layer {layer:?}, channel {}: {different} of {} samples differ",
                    channel.name,
                    samples.len()
                ));
            }
        }
    }
    Ok(())
}

/// The bits of some rows of a file of one part with channels of 32 bits, by channel. No more of the file is read.
///
/// # Panics
///
/// When the file is not such a one.
pub fn rows(file: &Path, rows: Range<usize>) -> BTreeMap<String, Vec<u32>> {
    let reader = exr::block::read(BufReader::new(File::open(file).expect("the file is there")), true);
    let reader = reader.expect("an OpenEXR file");
    let header = reader.headers()[0].clone();
    let width = header.layer_size.width();
    let mut planes = vec![vec![0; width * rows.len()]; header.channels.list.len()];
    let meta = reader.meta_data().clone();
    let chunks = reader.filter_chunks(true, |_, _, block| {
        let first = block.pixel_position.y();
        first < rows.end && first + block.pixel_size.height() > rows.start
    });
    for chunk in chunks.expect("the file says where its blocks are") {
        let block = UncompressedBlock::decompress_chunk(chunk.expect("a block"), &meta, true).expect("a whole block");
        for line in block.lines(&header.channels) {
            let (x, y) = (line.location.position.x(), line.location.position.y());
            if !rows.contains(&y) {
                continue;
            }
            let first = (y - rows.start) * width + x;
            let plane = &mut planes[line.location.channel][first..first + line.location.sample_count];
            for (value, bytes) in plane.iter_mut().zip(line.value.chunks_exact(4)) {
                *value = u32::from_ne_bytes(bytes.try_into().expect("four bytes"));
            }
        }
    }
    header.channels.list.iter().map(|channel| channel.name.to_string()).zip(planes).collect()
}

/// What a file of this program says of how it was made; only its header is read.
///
/// # Panics
///
/// When the file is not one of this program.
pub fn metadata(file: &Path) -> ImageMetadata {
    let meta = exr::meta::MetaData::read_from_file(file, true).expect("an OpenEXR file");
    let attribute = meta.headers[0].own_attributes.other.get(&Text::from("clerestory"));
    let Some(AttributeValue::Text(json)) = attribute else { panic!("the file has no metadata: {attribute:?}") };
    serde_json::from_str(&json.to_string()).expect("metadata of an image")
}

fn bits(samples: &FlatSamples) -> Vec<u32> {
    match samples {
        FlatSamples::F32(samples) => samples.iter().map(|sample| sample.to_bits()).collect(),
        FlatSamples::F16(samples) => samples.iter().map(|sample| sample.to_bits().into()).collect(),
        FlatSamples::U32(samples) => samples.clone(),
    }
}

fn parsed(file: &[u8]) -> FlatImage {
    exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(file))
        .expect("a valid file")
}

fn written<'a>(image: &'a Image<impl WritableLayers<'a>>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).expect("a file that can be written");
    bytes.into_inner()
}

/// The file, of which every part claims [`HUGE_EDGE`] pixels each way, in blocks of one row.
pub fn with_huge_claim(file: &[u8]) -> Vec<u8> {
    let last = HUGE_EDGE as i32 - 1;
    let file = with_attribute(file, "dataWindow", &[0, 0, last, last]);
    let file = with_attribute(&file, "displayWindow", &[0, 0, last, last]);
    with_attribute(&file, "chunkCount", &[last + 1])
}

/// The file with other values for an attribute of integers, in every part.
///
/// # Panics
///
/// When there is no such attribute of that many integers.
pub fn with_attribute(file: &[u8], name: &str, values: &[i32]) -> Vec<u8> {
    let name = [name.as_bytes(), &[0]].concat();
    let value: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let mut changed = file.to_vec();
    let starts: Vec<usize> = (0..file.len()).filter(|start| file[*start..].starts_with(&name)).collect();
    assert!(!starts.is_empty(), "the file has the attribute");
    for start in starts {
        let kind = start + name.len();
        let kind_length = file[kind..].iter().position(|byte| *byte == 0).expect("the name of the type ends");
        let size = kind + kind_length + 1;
        assert_eq!(file[size..size + 4], (value.len() as u32).to_le_bytes(), "the attribute has that many integers");
        changed[size + 4..size + 4 + value.len()].copy_from_slice(&value);
    }
    changed
}
