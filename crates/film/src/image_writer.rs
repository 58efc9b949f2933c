//! The OpenEXR file of an image, written a strip of rows at a time, so that no more of it has to be in memory.
//!
//! A file begins with its header and with the offset of each block of pixels. Both are known only when the last block
//! has been compressed. So the blocks go to a place of their own, and what precedes them in the file, its head, comes
//! last.

use std::collections::BTreeMap;
use std::io::{Cursor, Write};

use exr::block::{self, BlockIndex};
use exr::meta::attribute::{Compression, IntegerBounds};
use exr::meta::header::Header;
use rayon::prelude::*;

use super::address::Tile;
use super::image::ImageMetadata;
use super::image_layers::{ALBEDO, CAUSTIC, DEPTH, HALF_A, HALF_B, ImageLayers, NORMAL, RGB, SAMPLES, STANDARD_ERROR};
use super::openexr::{self, OutputPart, Samples};
use super::openexr_error::OpenExrError;

/// Rows of pixels that are compressed together. A strip begins at a multiple of it.
pub const ROWS_PER_BLOCK: u32 = 16;

const COMPRESSION: Compression = Compression::ZIP16;

/// Writes the file of an image in strips, from the top to the bottom.
#[derive(Debug)]
pub struct ImageWriter<W> {
    size: [u32; 2],
    /// The header without the metadata; set by the first strip.
    header: Option<Header>,
    blocks: W,
    /// Where each block begins, counted from the first.
    offsets: Vec<u64>,
    bytes: u64,
    next_row: u32,
}

impl<W: Write> ImageWriter<W> {
    /// A writer of an image of this width and height in pixels. Its blocks go to `blocks`.
    pub fn new(width: u32, height: u32, blocks: W) -> Self {
        Self { size: [width, height], header: None, blocks, offsets: Vec::new(), bytes: 0, next_row: 0 }
    }

    /// Writes the next rows: all pixels of the image's width, in as many rows as the layers have, a multiple of
    /// [`ROWS_PER_BLOCK`] but for the last. Every strip has the same layers. Blocks are compressed by the current rayon
    /// pool, one for each thread at a time; the bytes do not depend on it.
    ///
    /// # Errors
    ///
    /// [`OpenExrError`] when these cannot be the next rows, or cannot be written.
    pub fn write_rows(&mut self, layers: &ImageLayers) -> Result<(), OpenExrError> {
        let [width, height] = self.size;
        let rows = layers.mean.len() / (width as usize).max(1);
        let end = u32::try_from(rows).ok().and_then(|rows| self.next_row.checked_add(rows));
        let is_next = |end: &u32| *end == height || (*end < height && end.is_multiple_of(ROWS_PER_BLOCK));
        let Some(end) = end.filter(is_next) else {
            let message = format!("{rows} rows cannot follow the first {} of {height}", self.next_row);
            return Err(OpenExrError::Damaged(message));
        };
        let header = self.header.get_or_insert_with(|| header(self.size, layers));
        let headers = std::slice::from_ref(&*header);
        let part = output_part(Tile::new([0, 0], [width, end - self.next_row]), layers);
        let blocks: Vec<BlockIndex> = block::enumerate_ordered_header_block_indices(headers)
            .map(|(_, block)| block)
            .skip((self.next_row / ROWS_PER_BLOCK) as usize)
            .take_while(|block| block.pixel_position.y() < end as usize)
            .collect();
        for blocks in blocks.chunks(rayon::current_num_threads().max(1)) {
            let compressed = blocks.par_iter().map(|block| {
                let chunk = openexr::output_block(&part, self.next_row as usize, *block, headers)?;
                let mut bytes = Vec::new();
                chunk.write(&mut bytes, headers.len())?;
                Ok(bytes)
            });
            for bytes in compressed.collect::<Result<Vec<_>, exr::error::Error>>()? {
                self.blocks.write_all(&bytes).map_err(|error| OpenExrError::Write(error.kind()))?;
                self.offsets.push(self.bytes);
                self.bytes += bytes.len() as u64;
            }
        }
        self.next_row = end;
        Ok(())
    }

    /// The head of the file, with what made the image, and where the blocks went that follow it.
    ///
    /// # Errors
    ///
    /// [`OpenExrError`] when rows are missing, or the rest cannot be written.
    pub fn finish(mut self, metadata: Option<&ImageMetadata>) -> Result<(Vec<u8>, W), OpenExrError> {
        let Some(mut header) = self.header.filter(|_| self.next_row == self.size[1]) else {
            let message = format!("{} of {} rows were written", self.next_row, self.size[1]);
            return Err(OpenExrError::Damaged(message));
        };
        self.blocks.flush().map_err(|error| OpenExrError::Write(error.kind()))?;
        let json = metadata.map_or_else(|| Ok("null".to_owned()), openexr::ascii_json);
        let json = json.map_err(|error| OpenExrError::Damaged(error.to_string()))?;
        header.own_attributes.other = [openexr::json_attribute(&json)].into_iter().collect();
        let mut head = head_without_places(header)?;
        let blocks_begin = (head.len() + self.offsets.len() * size_of::<u64>()) as u64;
        head.extend(self.offsets.iter().flat_map(|offset| (blocks_begin + offset).to_le_bytes()));
        Ok((head, self.blocks))
    }
}

/// The first bytes of the file of an image of this size with such layers, as far as they do not depend on its pixels or
/// metadata.
///
/// # Errors
///
/// [`OpenExrError`] when `exr` cannot write them.
pub fn first_bytes(width: u32, height: u32, layers: &ImageLayers) -> Result<Vec<u8>, OpenExrError> {
    let mut header = header([width, height], layers);
    let (name, _) = openexr::json_attribute("");
    header.own_attributes.other.clear();
    let without = head_without_places(header.clone())?;
    header.own_attributes.other = [(name, openexr::json_attribute("null").1)].into_iter().collect();
    let with = head_without_places(header)?;
    let same = with.iter().zip(&without).take_while(|(with, without)| with == without).count();
    Ok(with[..same].to_vec())
}

fn header(size: [u32; 2], layers: &ImageLayers) -> Header {
    let [width, height] = size;
    let display_window = IntegerBounds::new((0, 0), (width as usize, height as usize));
    openexr::output_header(&output_part(Tile::new([0, 0], [width, height]), layers), display_window, COMPRESSION)
}

/// The bytes of a file up to where it says where its blocks are.
fn head_without_places(header: Header) -> Result<Vec<u8>, OpenExrError> {
    let places = header.chunk_count * size_of::<u64>();
    let mut bytes = Cursor::new(Vec::new());
    // `exr` writes the header and room for the places, and then asks for blocks.
    match block::write(&mut bytes, [header].into_iter().collect(), true, |_, _| Err(exr::error::Error::Aborted)) {
        Err(exr::error::Error::Aborted) => {}
        Err(error) => return Err(error.into()),
        Ok(()) => return Err(OpenExrError::Damaged("a file without blocks was written".to_owned())),
    }
    let mut bytes = bytes.into_inner();
    bytes.truncate(bytes.len().saturating_sub(places));
    Ok(bytes)
}

/// The layers as channels.
fn output_part(window: Tile, layers: &ImageLayers) -> OutputPart<'_> {
    let mut part = OutputPart { name: "image".to_owned(), json: String::new(), window, channels: BTreeMap::new() };
    part.add_triples(RGB, &layers.mean);
    if let Some(standard_error) = &layers.standard_error {
        part.add_triples(STANDARD_ERROR, standard_error);
    }
    if let Some(caustic) = &layers.caustic {
        part.add_triples(CAUSTIC, caustic);
    }
    if let Some(samples) = &layers.samples {
        part.channels.insert(SAMPLES.to_owned(), Samples::Integer(samples));
    }
    if let Some(albedo) = &layers.albedo {
        part.add_triples(ALBEDO, albedo);
    }
    if let Some(normal) = &layers.normal {
        part.add_triples(NORMAL, normal);
    }
    if let Some(depth) = &layers.depth {
        part.channels.insert(DEPTH.to_owned(), Samples::Float(depth));
    }
    if let Some([half_a, half_b]) = &layers.halves {
        part.add_triples(HALF_A, half_a);
        part.add_triples(HALF_B, half_b);
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::address::TileGrid;
    use crate::image::FrameImage;
    use crate::rows::{ImageRows, LayerChoice};
    use crate::test_nodes::noise_node;
    use crate::{FilmTile, NodeAddress, Sampling, TileSum};

    const GRID: TileGrid = TileGrid::new(21, 53, 12);

    fn sums() -> Vec<TileSum> {
        let sampling = Sampling::new(4, 16).unwrap();
        let sum = |index| {
            let tile = GRID.tile(index).unwrap();
            let mut film = FilmTile::new(0, index, tile, sampling);
            film.insert(noise_node(NodeAddress { frame: 0, tile: index, level: 3, index: 0 }, tile, sampling)).unwrap();
            film.sum(8).unwrap()
        };
        // One tile is not there yet.
        (0..GRID.len()).filter(|index| *index != 3).map(sum).collect()
    }

    fn metadata() -> ImageMetadata {
        ImageMetadata { tile_size: 0, ..crate::image::tests::image().metadata().unwrap().clone() }
    }

    #[test]
    fn a_file_has_the_same_bytes_whole_and_in_strips_and_by_the_general_writer() {
        let image = FrameImage::assemble(&GRID, &sums(), metadata()).unwrap();
        let whole = image.encode().unwrap();
        for rows in [16, 32, 48, 53] {
            let mut writer = ImageWriter::new(GRID.width, GRID.height, Vec::new());
            for first in (0..GRID.height).step_by(rows as usize) {
                let choice = LayerChoice::all(true);
                let mut strip = ImageRows::new(GRID, first..GRID.height.min(first + rows), choice);
                sums().iter().for_each(|sum| strip.fill(sum).unwrap());
                writer.write_rows(strip.layers()).unwrap();
            }
            let (head, blocks) = writer.finish(image.metadata()).unwrap();
            assert!([head, blocks].concat() == whole, "strips of {rows} rows");
        }
        let window = Tile::new([0, 0], [GRID.width, GRID.height]);
        let mut part = output_part(window, image.layers());
        part.json = openexr::ascii_json(image.metadata().unwrap()).unwrap();
        assert!(openexr::write([GRID.width, GRID.height], &[part], COMPRESSION).unwrap() == whole);
    }

    #[test]
    fn the_first_bytes_are_known_before_anything_else() {
        let image = FrameImage::assemble(&GRID, &sums(), metadata()).unwrap();
        let nothing = ImageRows::new(GRID, 0..0, LayerChoice::all(true));
        let first = first_bytes(GRID.width, GRID.height, nothing.layers()).unwrap();
        assert!(first.len() > 100 && image.encode().unwrap().starts_with(&first));
    }

    #[test]
    fn rows_that_cannot_be_next_and_rows_that_are_missing_are_refused() {
        let rows = |rows: std::ops::Range<u32>| ImageRows::new(GRID, rows, LayerChoice::MEAN);
        let mut writer = ImageWriter::new(GRID.width, GRID.height, Vec::new());
        let error = writer.write_rows(rows(0..17).layers()).unwrap_err().to_string();
        assert!(error.contains("17 rows cannot follow the first 0 of 53"), "{error}");
        writer.write_rows(rows(0..32).layers()).unwrap();
        assert!(writer.write_rows(rows(0..32).layers()).is_err());
        let error = writer.finish(None).unwrap_err().to_string();
        assert!(error.contains("32 of 53 rows were written"), "{error}");
    }

    #[test]
    fn a_full_disk_is_named() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(std::io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let mut writer = ImageWriter::new(GRID.width, GRID.height, Full);
        let rows = ImageRows::new(GRID, 0..16, LayerChoice::MEAN);
        let error = writer.write_rows(rows.layers()).unwrap_err();
        assert_eq!(error, OpenExrError::Write(std::io::ErrorKind::StorageFull));
    }
}
