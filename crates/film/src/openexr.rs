//! Reads and writes OpenEXR files through the crate `exr`, keeping clear of its sharp edges.
//!
//! The crate's high-level reader allocates what the header claims before it checks anything, and an allocation that
//! fails ends the process. So a file is opened in two steps. The header comes first and is cheap. The blocks follow one
//! at a time, once their memory has been compared with a [`DecodeBudget`].
//!
//! The crate keeps custom attributes in a hash map, so that a file with two of them has different bytes each time it
//! is written. Each part therefore has exactly one, named `clerestory`, and it holds JSON.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::ops::Range;

use exr::block::chunk::Chunk;
use exr::block::reader::Reader;
use exr::block::writer::ChunksWriter;
use exr::block::{self, BlockIndex, UncompressedBlock};
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, Chromaticities, Compression, IntegerBounds, LineOrder, SampleType, Text,
};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use exr::meta::{BlockDescription, MetaData};
use exr::prelude::{Vec2, f16};
use rayon::prelude::*;

use super::address::Tile;
pub use super::openexr_error::OpenExrError;
use super::openexr_header;
use crate::file_format::FileFormat;

/// The name of the custom attribute.
const ATTRIBUTE: &str = "clerestory";

/// Bytes by which a file of another kind is known.
const BEGINNING: u64 = 4096;

/// How much memory a file may make the reader take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DecodeBudget {
    /// Bytes of decoded pixels, over all parts and channels that are read.
    pub pixel_bytes: u64,
}

/// The values of a channel that is written, one for each pixel in rows from the top left.
#[derive(Clone, Copy, Debug)]
pub(super) enum Samples<'a> {
    /// 32-bit floats.
    Float(&'a [f32]),
    /// One of three interleaved channels of 32-bit floats.
    FloatOfTriple(&'a [[f32; 3]], usize),
    /// 32-bit unsigned integers.
    Integer(&'a [u32]),
}

/// A part that is written.
#[derive(Clone, Debug)]
pub(super) struct OutputPart<'a> {
    /// Its name; parts of one file have different names.
    pub(super) name: String,
    /// The JSON of its attribute, of which all characters that are not ASCII are escaped.
    pub(super) json: String,
    /// Where its pixels lie in the image.
    pub(super) window: Tile,
    /// Channels by name.
    pub(super) channels: BTreeMap<String, Samples<'a>>,
}

impl<'a> OutputPart<'a> {
    /// Adds three interleaved channels.
    pub(super) fn add_triples(&mut self, names: [&str; 3], values: &'a [[f32; 3]]) {
        for (index, name) in names.into_iter().enumerate() {
            self.channels.insert(name.to_owned(), Samples::FloatOfTriple(values, index));
        }
    }
}

/// The header of a part that is read.
#[derive(Clone, Debug)]
pub struct InputPart {
    /// Its name, if it has one.
    pub(super) name: Option<String>,
    /// The JSON of its attribute, if it has one.
    pub(super) json: Option<String>,
    /// Column and row of its top left pixel in the image.
    pub(super) position: [i32; 2],
    /// Where the picture is of which it has pixels.
    display: IntegerBounds,
    /// The primaries of its colours, where it states them.
    chromaticities: Option<Chromaticities>,
    /// Pixels across and down.
    pub size: [u64; 2],
    /// The names of its channels and what they hold, in the order of the file.
    pub channels: Vec<(String, ChannelKind)>,
    /// How its blocks are compressed.
    pub(super) compression: Compression,
}

impl InputPart {
    /// Whether it has a channel of this name.
    pub fn has(&self, name: &str) -> bool {
        self.channels.iter().any(|(found, _)| found == name)
    }

    /// The names of its channels.
    pub fn channel_names(&self) -> impl Iterator<Item = &str> {
        self.channels.iter().map(|(name, _)| name.as_str())
    }

    /// Checks that its pixels are the whole picture. Where its windows lie does not matter, since programs count from
    /// different corners.
    pub fn check_windows(&self) -> Result<(), OpenExrError> {
        let [width, height] = [self.display.size.width() as u64, self.display.size.height() as u64];
        if self.size == [width, height] {
            return Ok(());
        }
        let window = |[width, height]: [u64; 2], x: i32, y: i32| format!("{width} x {height} from ({x}, {y}) on");
        Err(OpenExrError::OtherWindow {
            data: window(self.size, self.position[0], self.position[1]),
            display: window([width, height], self.display.position.x(), self.display.position.y()),
        })
    }

    /// Checks that its colours are those of Rec. 709, which a file that says nothing has.
    pub fn check_primaries(&self) -> Result<(), OpenExrError> {
        let Some(Chromaticities { red, green, blue, white }) = self.chromaticities else { return Ok(()) };
        let found = [red, green, blue, white].map(|Vec2(x, y)| [x, y]);
        let are = |known: &[[f32; 2]; 4]| {
            known.iter().flatten().zip(found.iter().flatten()).all(|(known, found)| (known - found).abs() < 0.002)
        };
        let name = PRIMARIES.iter().find(|(_, known)| are(known)).map(|(name, _)| *name);
        if name == Some(REC_709) {
            return Ok(());
        }
        let [red, green, blue, white] = found.map(|[x, y]| format!("({x:.4}, {y:.4})"));
        let numbers = format!("red {red}, green {green}, blue {blue}, white {white}");
        Err(OpenExrError::OtherPrimaries { found: name.map_or(numbers, str::to_owned) })
    }
}

const REC_709: &str = "Rec. 709";

/// Chromaticities of red, green, blue and white.
const PRIMARIES: [(&str, [[f32; 2]; 4]); 7] = [
    (REC_709, [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]]),
    ("ACEScg", [[0.713, 0.293], [0.165, 0.83], [0.128, 0.044], [0.321_68, 0.337_67]]),
    ("ACES2065-1", [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], [0.321_68, 0.337_67]]),
    ("Rec. 2020", [[0.708, 0.292], [0.17, 0.797], [0.131, 0.046], [0.3127, 0.329]]),
    ("Display P3", [[0.68, 0.32], [0.265, 0.69], [0.15, 0.06], [0.3127, 0.329]]),
    ("Adobe RGB", [[0.64, 0.33], [0.21, 0.71], [0.15, 0.06], [0.3127, 0.329]]),
    ("CIE XYZ", [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0 / 3.0, 1.0 / 3.0]]),
];

/// What a channel holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelKind {
    /// 32-bit floats.
    Float,
    /// 16-bit floats.
    Half,
    /// 32-bit unsigned integers.
    Integer,
}

/// The values of a channel that was read.
#[derive(Clone, Debug)]
pub enum Plane {
    /// Floats of 32 bits, or of 16 bits widened.
    Float(Vec<f32>),
    /// 32-bit unsigned integers.
    Integer(Vec<u32>),
}

/// Writes a file of scan lines, with as many threads as there are; its bytes depend on the arguments only.
///
/// # Errors
///
/// [`OpenExrError`] when there is no part, a part has no pixels or two parts have the same name.
pub(super) fn write(
    image_size: [u32; 2],
    parts: &[OutputPart<'_>],
    compression: Compression,
) -> Result<Vec<u8>, OpenExrError> {
    let display_window = IntegerBounds::new((0, 0), (image_size[0] as usize, image_size[1] as usize));
    let header = |part| output_header(part, display_window, compression);
    let headers = parts.iter().map(header).collect();
    let mut bytes = Cursor::new(Vec::new());
    block::write(&mut bytes, headers, true, |meta, writer| {
        let indices: Vec<_> = meta.enumerate_ordered_header_block_indices().collect();
        let chunks: Vec<_> = indices
            .into_par_iter()
            .map(|(index_in_header, block)| {
                Ok((index_in_header, output_block(&parts[block.layer], 0, block, &meta.headers)?))
            })
            .collect::<Result<_, exr::error::Error>>()?;
        chunks.into_iter().try_for_each(|(index_in_header, chunk)| writer.write_chunk(index_in_header, chunk))
    })?;
    Ok(bytes.into_inner())
}

/// Compresses a block of the pixels of a part, whose values begin `skipped_rows` below the top of the part's window in
/// the header.
pub(super) fn output_block(
    part: &OutputPart<'_>,
    skipped_rows: usize,
    block: BlockIndex,
    headers: &[Header],
) -> Result<Chunk, exr::error::Error> {
    let samples: Vec<Samples<'_>> = part.channels.values().copied().collect();
    let block = UncompressedBlock::from_lines(&headers[block.layer].channels, block, |line| {
        let location = line.location;
        let row = location.position.y() - skipped_rows;
        let first = row * part.window.width as usize + location.position.x();
        let pixels = first..first + location.sample_count;
        // The buffer of a line has a fixed size, which is that of the values.
        match samples[location.channel] {
            Samples::Float(values) => fill(line.value, values[pixels].iter().copied()),
            Samples::FloatOfTriple(values, index) => {
                fill(line.value, values[pixels].iter().map(|triple| triple[index]));
            }
            Samples::Integer(values) => fill(line.value, values[pixels].iter().copied()),
        }
    });
    block.compress_to_chunk(headers)
}

/// Fills the bytes of a line with its values in the machine's own byte order, as `exr` wants them.
fn fill<T: bytemuck::Pod>(bytes: &mut [u8], values: impl Iterator<Item = T>) {
    for (bytes, value) in bytes.chunks_exact_mut(size_of::<T>()).zip(values) {
        bytes.copy_from_slice(bytemuck::bytes_of(&value));
    }
}

/// The header of a part of a file of scan lines.
pub(super) fn output_header(part: &OutputPart<'_>, display_window: IntegerBounds, compression: Compression) -> Header {
    let channels = part.channels.iter().map(|(name, samples)| ChannelDescription {
        name: Text::from(name.as_str()),
        sample_type: match samples {
            Samples::Float(_) | Samples::FloatOfTriple(..) => SampleType::F32,
            Samples::Integer(_) => SampleType::U32,
        },
        quantize_linearly: false,
        sampling: Vec2(1, 1),
    });
    let name = Text::from(part.name.as_str());
    let size = (part.window.width as usize, part.window.height as usize);
    let (attribute, json) = json_attribute(&part.json);
    Header::new(name.clone(), size, channels.collect())
        .with_encoding(compression, BlockDescription::ScanLines, LineOrder::Increasing)
        .with_shared_attributes(ImageAttributes::new(display_window))
        .with_attributes(LayerAttributes {
            layer_position: Vec2(part.window.x as i32, part.window.y as i32),
            other: [(attribute, json)].into_iter().collect(),
            ..LayerAttributes::named(name)
        })
}

/// The attribute that holds a JSON text.
pub(super) fn json_attribute(json: &str) -> (Text, AttributeValue) {
    (Text::from(ATTRIBUTE), AttributeValue::Text(Text::from(json)))
}

/// JSON with every character that is not ASCII escaped, as a text attribute needs it.
pub(super) fn ascii_json<T: serde::Serialize>(value: &T) -> Result<String, serde_json::Error> {
    let json = serde_json::to_string(value)?;
    let mut ascii = String::with_capacity(json.len());
    for character in json.chars() {
        if character.is_ascii() {
            ascii.push(character);
        } else {
            for unit in character.encode_utf16(&mut [0; 2]) {
                ascii.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    Ok(ascii)
}

/// A file of which only the header has been read.
#[derive(Debug)]
pub struct OpenExr<R> {
    reader: Reader<R>,
    parts: Vec<InputPart>,
}

impl<'a> OpenExr<Cursor<&'a [u8]>> {
    /// Reads the header of a file in memory.
    ///
    /// # Errors
    ///
    /// [`OpenExrError`] when it is not one.
    pub fn open(bytes: &'a [u8]) -> Result<Self, OpenExrError> {
        Self::read(Cursor::new(bytes))
    }
}

impl<R: Read + Seek> OpenExr<R> {
    /// Reads the header of a file, from its beginning.
    ///
    /// # Errors
    ///
    /// [`OpenExrError`] when it is not one.
    pub fn read(mut file: R) -> Result<Self, OpenExrError> {
        let io = |error: std::io::Error| OpenExrError::Read(error.kind());
        file.seek(SeekFrom::Start(0)).map_err(io)?;
        let mut beginning = Vec::new();
        file.by_ref().take(BEGINNING).read_to_end(&mut beginning).map_err(io)?;
        if !beginning.starts_with(&exr::meta::magic_number::BYTES) {
            let unknown = || "it does not begin with 76 2f 31 01".to_owned();
            let found = FileFormat::of(&beginning).map_or_else(unknown, FileFormat::instead_of_image);
            return Err(OpenExrError::NotOpenExr(found));
        }
        file.seek(SeekFrom::Start(exr::meta::magic_number::BYTES.len() as u64)).map_err(io)?;
        openexr_header::check(&mut file)?;
        file.seek(SeekFrom::Start(0)).map_err(io)?;
        let reader = block::read(file, false)?;
        let parts = reader.headers().iter().map(input_part).collect();
        Ok(Self { reader, parts })
    }

    /// The headers of the parts.
    pub fn parts(&self) -> &[InputPart] {
        &self.parts
    }

    /// Decodes the channels that `is_wanted` names (by number of the part and name), for each part by name.
    ///
    /// # Errors
    ///
    /// [`OpenExrError`] when they need more than the budget or the data are damaged or incomplete.
    pub fn decode(
        self,
        budget: DecodeBudget,
        is_wanted: impl Fn(usize, &str) -> bool,
    ) -> Result<Vec<BTreeMap<String, Plane>>, OpenExrError> {
        let headers = self.reader.headers();
        let mut needed = 0u64;
        for (index, (part, header)) in self.parts.iter().zip(headers).enumerate() {
            needed = needed.saturating_add(needed_bytes(index, part, header, part.size[1], &is_wanted));
            check_budget(part, needed, budget)?;
        }
        let rows = |part: &InputPart| 0..part.size[1] as usize;
        let whole = |(index, part)| Window::new(index, part, rows(part), &is_wanted);
        let mut windows: Vec<Window> = self.parts.iter().enumerate().map(whole).collect();
        let meta = self.reader.meta_data().clone();
        for chunk in self.reader.all_chunks(false)? {
            let chunk = chunk?;
            let window = windows.get_mut(chunk.layer_index);
            let window = window.ok_or_else(|| OpenExrError::Damaged("a block is of no part".to_owned()))?;
            window.add(chunk, &meta)?;
        }
        windows.into_iter().zip(&self.parts).map(|(window, part)| window.planes(part)).collect()
    }

    /// Decodes rows of one part: the channels that `is_wanted` names, by name. No other blocks are read than those with
    /// pixels of these rows.
    ///
    /// # Errors
    ///
    /// [`OpenExrError`] when they need more than the budget or the data are damaged or incomplete.
    pub fn decode_rows(
        self,
        part: usize,
        rows: Range<u32>,
        budget: DecodeBudget,
        is_wanted: impl Fn(&str) -> bool,
    ) -> Result<BTreeMap<String, Plane>, OpenExrError> {
        let is_wanted = |index: usize, name: &str| index == part && is_wanted(name);
        let (header, input) = (&self.reader.headers()[part], &self.parts[part]);
        check_budget(input, needed_bytes(part, input, header, rows.len() as u64, &is_wanted), budget)?;
        let rows = rows.start as usize..rows.end as usize;
        let mut window = Window::new(part, input, rows.clone(), &is_wanted);
        let meta = self.reader.meta_data().clone();
        let chunks = self.reader.filter_chunks(false, |_, tile, block| {
            let [first, height] = [block.pixel_position.y(), block.pixel_size.height()];
            block.layer == part && tile.level_index == Vec2(0, 0) && first < rows.end && first + height > rows.start
        })?;
        for chunk in chunks {
            let chunk = chunk?;
            if chunk.layer_index != part {
                return Err(OpenExrError::Damaged("a block is of another part than its place says".to_owned()));
            }
            window.add(chunk, &meta)?;
        }
        window.planes(&self.parts[part])
    }
}

/// Most bytes that decoding `rows` rows of a part takes: their pixels, and its largest block.
fn needed_bytes(
    index: usize,
    part: &InputPart,
    header: &Header,
    rows: u64,
    is_wanted: &impl Fn(usize, &str) -> bool,
) -> u64 {
    let wanted = part.channels.iter().filter(|(name, _)| is_wanted(index, name)).count() as u64;
    let planes = part.size[0].saturating_mul(rows).saturating_mul(4 * wanted);
    planes.saturating_add(largest_block_bytes(header))
}

fn check_budget(part: &InputPart, needed: u64, budget: DecodeBudget) -> Result<(), OpenExrError> {
    let [width, height] = part.size;
    if needed > budget.pixel_bytes {
        return Err(OpenExrError::TooLarge { width, height, needed, allowed: budget.pixel_bytes });
    }
    Ok(())
}

/// Rows of a part that are being decoded, in the order in which blocks come.
struct Window {
    width: usize,
    rows: Range<usize>,
    /// In the order of the part's channels; `None` for a channel that is not wanted.
    planes: Vec<Option<Plane>>,
    /// Blocks that have come, by row and column.
    seen: BTreeSet<(usize, usize)>,
    missing_pixels: u64,
}

impl Window {
    fn new(index: usize, part: &InputPart, rows: Range<usize>, is_wanted: &impl Fn(usize, &str) -> bool) -> Self {
        let width = part.size[0] as usize;
        let pixels = width * rows.len();
        let plane = |(name, kind): &(String, ChannelKind)| {
            is_wanted(index, name).then(|| match kind {
                ChannelKind::Float | ChannelKind::Half => Plane::Float(vec![0.0; pixels]),
                ChannelKind::Integer => Plane::Integer(vec![0; pixels]),
            })
        };
        let planes: Vec<Option<Plane>> = part.channels.iter().map(plane).collect();
        let is_empty = planes.iter().all(Option::is_none);
        Self { width, rows, planes, seen: BTreeSet::new(), missing_pixels: if is_empty { 0 } else { pixels as u64 } }
    }

    /// Takes what a block has of the rows.
    fn add(&mut self, chunk: Chunk, meta: &MetaData) -> Result<(), OpenExrError> {
        if self.planes.iter().all(Option::is_none) {
            return Ok(());
        }
        let header = &meta.headers[chunk.layer_index];
        let block = UncompressedBlock::decompress_chunk(chunk, meta, false)?;
        let index = block.index;
        if index.level != Vec2(0, 0) {
            return Ok(());
        }
        let (first, end) = (index.pixel_position.y(), index.pixel_position.y() + index.pixel_size.height());
        if !self.seen.insert((first, index.pixel_position.x())) {
            return Err(OpenExrError::Damaged(format!("block at {:?} is there twice", index.pixel_position)));
        }
        let inside = end.min(self.rows.end).saturating_sub(first.max(self.rows.start));
        self.missing_pixels = self.missing_pixels.saturating_sub((inside * index.pixel_size.width()) as u64);
        for line in block.lines(&header.channels) {
            let location = line.location;
            let Some(row) = location.position.y().checked_sub(self.rows.start).filter(|row| *row < self.rows.len())
            else {
                continue;
            };
            let first = row * self.width + location.position.x();
            let pixels = first..first + location.sample_count;
            let kind = header.channels.list[location.channel].sample_type;
            match (&mut self.planes[location.channel], kind) {
                (None, _) => {}
                (Some(Plane::Float(plane)), SampleType::F16) => {
                    read(line.value, &mut plane[pixels], |bits: u16| f16::from_bits(bits).to_f32());
                }
                (Some(Plane::Float(plane)), _) => read(line.value, &mut plane[pixels], |value: f32| value),
                (Some(Plane::Integer(plane)), _) => read(line.value, &mut plane[pixels], |value: u32| value),
            }
        }
        Ok(())
    }

    /// The channels by name, once all blocks have come.
    fn planes(self, part: &InputPart) -> Result<BTreeMap<String, Plane>, OpenExrError> {
        if self.missing_pixels > 0 {
            return Err(OpenExrError::Damaged("some blocks of pixels are missing".to_owned()));
        }
        let names = part.channels.iter().map(|(name, _)| name.clone());
        Ok(names.zip(self.planes).filter_map(|(name, plane)| Some((name, plane?))).collect())
    }
}

/// Reads the bytes of a line, which are in the machine's own byte order.
fn read<T: bytemuck::AnyBitPattern, V>(bytes: &[u8], values: &mut [V], convert: impl Fn(T) -> V) {
    for (bytes, value) in bytes.chunks_exact(size_of::<T>()).zip(values) {
        *value = convert(bytemuck::pod_read_unaligned(bytes));
    }
}

fn input_part(header: &Header) -> InputPart {
    let mut channels = Vec::new();
    for channel in &header.channels.list {
        let kind = match channel.sample_type {
            SampleType::F32 => ChannelKind::Float,
            SampleType::F16 => ChannelKind::Half,
            SampleType::U32 => ChannelKind::Integer,
        };
        channels.push((channel.name.to_string(), kind));
    }
    let json = match header.own_attributes.other.get(&Text::from(ATTRIBUTE)) {
        Some(AttributeValue::Text(text)) => Some(text.to_string()),
        _ => None,
    };
    InputPart {
        name: header.own_attributes.layer_name.as_ref().map(Text::to_string),
        json,
        position: [header.own_attributes.layer_position.x(), header.own_attributes.layer_position.y()],
        display: header.shared_attributes.display_window,
        chromaticities: header.shared_attributes.chromaticities,
        size: [header.layer_size.width() as u64, header.layer_size.height() as u64],
        channels,
        compression: header.compression,
    }
}

/// Bytes of the largest block that the header allows, which `exr` may allocate at once.
fn largest_block_bytes(header: &Header) -> u64 {
    let size = header.max_block_pixel_size();
    (size.width() as u64).saturating_mul(size.height() as u64).saturating_mul(header.channels.bytes_per_pixel as u64)
}

/// Three channels side by side, each got by its name.
pub(super) fn interleave<E>(
    names: [&'static str; 3],
    mut plane: impl FnMut(&'static str) -> Result<Vec<f32>, E>,
) -> Result<Vec<[f32; 3]>, E> {
    let [first, second, third] = names;
    let (first, second, third) = (plane(first)?, plane(second)?, plane(third)?);
    Ok(first.into_iter().zip(second).zip(third).map(|((first, second), third)| [first, second, third]).collect())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Little-endian bytes of the integers of an attribute.
    pub(crate) fn attribute(values: &[i32]) -> Vec<u8> {
        values.iter().flat_map(|value| value.to_le_bytes()).collect()
    }

    /// Replaces the value of the first attribute of this name by one of the same size.
    pub(crate) fn patch(bytes: &mut [u8], name: &str, value: &[u8]) {
        let name = [name.as_bytes(), &[0]].concat();
        let start = bytes.windows(name.len()).position(|window| window == name).expect("the attribute is there");
        let kind = start + name.len();
        let kind_length = bytes[kind..].iter().position(|&byte| byte == 0).expect("the name of the type ends");
        let size = kind + kind_length + 1;
        assert_eq!(bytes[size..size + 4], (value.len() as u32).to_le_bytes());
        bytes[size + 4..size + 4 + value.len()].copy_from_slice(value);
    }

    /// What tests that run beside one may ask for meanwhile: far less than the 14 GB of a channel of 60001 x 60001.
    pub(crate) const TESTS_BESIDE: u64 = 1 << 30;

    /// The most address space that this process has had, to see that nothing large was asked for.
    pub(crate) fn address_space_bytes() -> u64 {
        if !cfg!(target_os = "linux") {
            return 0;
        }
        let status = std::fs::read_to_string("/proc/self/status").expect("the system describes the process");
        let peak = status.lines().find_map(|line| line.strip_prefix("VmPeak:")).expect("it says the peak");
        let kibibytes: u64 = peak.trim().trim_end_matches(" kB").parse().expect("the peak is a number");
        kibibytes * 1024
    }

    #[test]
    fn json_for_an_attribute_is_ascii_and_reads_back() {
        let text = "verre antique: \u{e9}t\u{e9}, \u{1F6E0}, \"quoted\"\n";
        let json = ascii_json(&text).unwrap();
        assert!(json.is_ascii());
        assert_eq!(serde_json::from_str::<String>(&json).unwrap(), text);
    }
}
