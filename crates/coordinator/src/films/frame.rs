//! The image of a frame, a strip of rows at a time.
//!
//! A frame may be far larger than the coordinator's memory, so its image is never whole. Nodes are read tile by tile
//! and summed into strips of rows over the frame's whole width. Strips go on to a measurement, a file or a preview.

use std::ops::Range;
use std::sync::Arc;

use clerestory_api::BuiltScene;
use clerestory_film::{ImageMetadata, ImageRows, LayerChoice, Node, ROWS_PER_BLOCK, SumError, Tile, TileGrid, TileSum};
use clerestory_render_core::document::SceneHeader;
use serde_json::Value;

use super::batches::{batches, film_tile, runs};
use super::error::FilmError;
use super::reader::FilmReader;
use crate::model::{JobRecord, NodeRow, TilePasses, Work};

/// The passes of an image.
#[derive(Clone, Debug)]
pub(crate) enum Extent {
    /// Those of a round, up to which all tiles must be complete.
    Round(u32, TilePasses),
    /// Those of each tile from its first pass on without a gap. Such an image can be rendered again from its pass
    /// counts.
    Complete,
}

impl Extent {
    /// The passes that a tile must have, or `None` when every tile shows what it has.
    fn passes(&self, frame: u32, tile: u32) -> Option<u32> {
        match self {
            Self::Round(passes, tiles) => Some(tiles.at(frame, tile, *passes)),
            Self::Complete => None,
        }
    }
}

/// The rows of an image in strips of at most `most_bytes`, but at least a block of rows. Strips are whole tiles and
/// whole blocks where those fit.
pub(crate) fn strips(grid: TileGrid, bytes_per_pixel: u64, most_bytes: u64) -> impl Iterator<Item = Range<u32>> {
    let row_bytes = (u64::from(grid.width) * bytes_per_pixel).max(1);
    let fitting = u32::try_from(most_bytes / row_bytes).unwrap_or(u32::MAX);
    // The least common multiple of two numbers, one of which is a power of two.
    let whole = grid.tile_size * (ROWS_PER_BLOCK >> grid.tile_size.trailing_zeros().min(ROWS_PER_BLOCK.ilog2()));
    let rows = if fitting >= grid.height {
        grid.height.max(1)
    } else if fitting >= whole {
        fitting / whole * whole
    } else {
        (fitting / ROWS_PER_BLOCK * ROWS_PER_BLOCK).max(ROWS_PER_BLOCK)
    };
    (0..grid.height).step_by(rows as usize).map(move |first| first..grid.height.min(first + rows))
}

/// A frame of a job, up to some passes.
#[derive(Clone, Debug)]
pub(crate) struct Frame<'a> {
    /// Reads its nodes.
    pub(crate) reader: &'a FilmReader,
    /// The job.
    pub(crate) job: &'a JobRecord,
    /// The frame.
    pub(crate) frame: u32,
    /// Its passes.
    pub(crate) extent: Extent,
}

/// The part of a frame that was read so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reading {
    /// Passes of each tile, in the order of the tiles.
    tile_passes: Vec<u32>,
    /// The work that they took.
    work: Work,
}

impl Frame<'_> {
    /// Whether the standard error of any pixel is known.
    ///
    /// # Errors
    ///
    /// [`FilmError::Empty`] when no tile has a pass.
    pub(crate) async fn has_standard_error(&self) -> Result<bool, FilmError> {
        let mut most = 0;
        for tiles in runs(0..self.job.grid.len()) {
            let wanted: Option<Vec<u32>> = tiles.clone().map(|tile| self.extent.passes(self.frame, tile)).collect();
            let passes = match wanted {
                Some(passes) => passes,
                None => self.reader.store.complete_passes(self.job.id, self.frame, tiles).await?,
            };
            most = passes.into_iter().fold(most, u32::max);
        }
        if most == 0 {
            return Err(FilmError::Empty);
        }
        let light = self.job.grid.light_tiles();
        if !light.is_empty() {
            let complete = self.reader.store.complete_passes(self.job.id, self.frame, light.clone()).await?;
            let of_strips = light.zip(complete);
            let passes = of_strips.map(|(strip, complete)| self.extent.passes(self.frame, strip).unwrap_or(complete));
            most = most.min(passes.min().unwrap_or(0));
        }
        Ok(self.job.sampling()?.complete_blocks(most) >= 2)
    }

    /// Rows of the image. The caller reads strips in order, with the same `reading`.
    ///
    /// # Errors
    ///
    /// When the film cannot be read or the passes are not there.
    pub(crate) async fn rows(
        &self,
        rows: Range<u32>,
        choice: LayerChoice,
        reading: &mut Reading,
    ) -> Result<ImageRows, FilmError> {
        let grid = self.job.grid;
        reading.tile_passes.resize(grid.len() as usize, 0);
        let mut image = ImageRows::new(grid, rows.clone(), choice);
        let first_tile = rows.start / grid.tile_size * grid.columns();
        let end_tile = rows.end.div_ceil(grid.tile_size) * grid.columns();
        let is_in_rows = |tile: Tile| tile.y < rows.end && rows.start < tile.y + tile.height;
        let of_light = grid.light_tiles().filter(|strip| grid.tile(*strip).is_some_and(is_in_rows));
        let of_light = of_light.map(|strip| strip..strip + 1);
        for Range { start: mut next, end } in runs(first_tile..end_tile).chain(of_light) {
            while next < end {
                let nodes = self.reader.store.nodes(self.job.id, self.frame, next..end, self.end_pass()).await?;
                self.check_present(&nodes, next..end)?;
                let tiles = nodes.chunk_by(|a, b| a.address.tile == b.address.tile).collect();
                for tiles in batches(tiles) {
                    let Some(last) = tiles.last().and_then(|rows| rows.first()).map(|row| row.address.tile) else {
                        continue;
                    };
                    let loaded = match load(self.reader, tiles).await {
                        Ok(loaded) => loaded,
                        Err(failure) => {
                            self.reader.unless_merged(self.job.id, failure).await?;
                            break;
                        }
                    };
                    image = self.fill(image, loaded, reading).await?;
                    next = last + 1;
                }
                let is_read = nodes.last().is_none_or(|row| row.address.tile < next);
                if is_read {
                    break;
                }
            }
        }
        Ok(image)
    }

    /// The metadata of the image, once all of it has been read.
    pub(crate) async fn metadata(&self, reading: Reading, build: &str) -> Result<ImageMetadata, FilmError> {
        let job = self.job;
        let header = match self.reader.store.job_scene(job.id).await? {
            Some((scene, _)) => Some(SceneHeader::read(&scene)?),
            None => None,
        };
        let BuiltScene { left_to_chance, chosen_methods, import_notes } = job.built_scene.clone().unwrap_or_default();
        let elapsed_ms = job.started_ms.zip(job.finished_ms).map(|(started_ms, finished_ms)| finished_ms - started_ms);
        let mut metadata = ImageMetadata {
            scene_hash: job.scene_hash.clone(),
            frame: self.frame,
            seed: header.as_ref().map_or(0, |header| header.seed),
            integrator: header.map_or(Ok(Value::Null), |header| serde_json::to_value(header.integrator))?,
            sampling: job.sampling()?,
            tile_size: job.grid.tile_size,
            tile_passes: Vec::new(),
            standard_error_tiles: None,
            build: build.to_owned(),
            worker_builds: Vec::new(),
            missing_light: job.missing_light.clone(),
            left_to_chance,
            chosen_methods,
            import_notes,
            assumptions: job.assumptions.clone(),
            counters: reading.work.counters,
            elapsed_seconds: elapsed_ms.map(|elapsed_ms| elapsed_ms as f64 / 1000.0),
        };
        metadata.set_tile_passes(reading.tile_passes);
        if !reading.work.builds.iter().eq([&metadata.build]) {
            metadata.worker_builds = reading.work.builds.into_iter().collect();
        }
        Ok(metadata)
    }

    /// The end of the passes that the image may hold: workers render beyond a round before it is measured.
    fn end_pass(&self) -> u32 {
        match &self.extent {
            Extent::Round(passes, _) => *passes,
            Extent::Complete => self.job.passes,
        }
    }

    /// Fails when a tile that must have passes has no node.
    fn check_present(&self, nodes: &[NodeRow], mut tiles: Range<u32>) -> Result<(), FilmError> {
        let is_missing = |tile: &u32| nodes.binary_search_by_key(tile, |row| row.address.tile).is_err();
        match tiles.find(|tile| self.extent.passes(self.frame, *tile).is_some() && is_missing(tile)) {
            Some(tile) => {
                let wanted = self.extent.passes(self.frame, tile).unwrap_or(0);
                Err(SumError::Incomplete { wanted, complete: 0 }.into())
            }
            None => Ok(()),
        }
    }

    /// Writes the sums of tiles into rows of an image.
    async fn fill(
        &self,
        mut image: ImageRows,
        tiles: Vec<LoadedTile>,
        reading: &mut Reading,
    ) -> Result<ImageRows, FilmError> {
        let (job, first_row) = (self.job.clone(), image.rows().start);
        let wanted = tiles.iter().map(|tile| {
            // A tile that began in an earlier strip keeps the passes that it had there.
            let is_begun = job.grid.tile(tile.index).is_some_and(|tile| tile.y < first_row);
            let begun = reading.tile_passes.get(tile.index as usize).copied().filter(|_| is_begun);
            (is_begun, begun.or_else(|| self.extent.passes(self.frame, tile.index)))
        });
        let wanted: Vec<(bool, Option<u32>)> = wanted.collect();
        let filled = tokio::task::spawn_blocking(move || {
            let mut read = Vec::with_capacity(tiles.len());
            for (tile, (is_begun, passes)) in tiles.iter().zip(wanted) {
                let Some(sum) = tile.sum(&job, passes)? else { continue };
                image.fill(&sum)?;
                if !is_begun {
                    read.push((tile.index, sum.passes, tile.work(sum.passes)));
                }
            }
            Ok::<_, FilmError>((image, read))
        });
        let (image, read) = filled.await??;
        for (index, passes, work) in read {
            reading.tile_passes[index as usize] = passes;
            reading.work += &work;
        }
        Ok(image)
    }
}

/// Reads the nodes of tiles, several at the same time.
pub(crate) async fn load(reader: &FilmReader, tiles: Vec<&[NodeRow]>) -> Result<Vec<LoadedTile>, FilmError> {
    let rows = tiles.concat();
    let mut nodes = reader.load(&rows).await?.into_iter();
    let loaded = rows.chunk_by(|a, b| a.address.tile == b.address.tile).filter_map(|rows| {
        let index = rows.first()?.address.tile;
        Some(LoadedTile { index, rows: rows.to_vec(), nodes: nodes.by_ref().take(rows.len()).collect() })
    });
    Ok(loaded.collect())
}

/// The nodes of a tile, in the order of their rows.
pub(crate) struct LoadedTile {
    /// Its number.
    pub(crate) index: u32,
    rows: Vec<NodeRow>,
    nodes: Vec<Arc<Node>>,
}

impl LoadedTile {
    /// The sums over `passes`, or over the complete ones. `None` when there is no pass.
    pub(crate) fn sum(&self, job: &JobRecord, passes: Option<u32>) -> Result<Option<TileSum>, FilmError> {
        let Some(tile) = film_tile(job, &self.nodes, passes)? else { return Ok(None) };
        match passes.unwrap_or_else(|| tile.complete_passes()) {
            0 => Ok(None),
            passes => Ok(Some(tile.sum(passes)?)),
        }
    }

    /// The work of the first passes. Nodes beyond them are not in the image.
    fn work(&self, passes: u32) -> Work {
        let mut work = Work::default();
        for row in &self.rows {
            let of_node = row.address.passes();
            if of_node.first + of_node.count <= passes {
                work += &row.work;
            }
        }
        work
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heights(width: u32, height: u32, tile_size: u32, most_bytes: u64) -> Vec<u32> {
        let strips: Vec<_> = strips(TileGrid::new(width, height, tile_size), 56, most_bytes).collect();
        assert_eq!((strips[0].start, strips.last().unwrap().end), (0, height));
        assert!(strips.windows(2).all(|pair| pair[0].end == pair[1].start && pair[0].end % 16 == 0));
        strips.iter().map(ExactSizeIterator::len).map(|rows| rows as u32).collect()
    }

    #[test]
    fn strips_are_whole_tiles_where_they_fit_and_whole_blocks_in_any_case() {
        assert_eq!(heights(16384, 16384, 64, 64 << 20), vec![64; 256]);
        assert_eq!(heights(1920, 1080, 64, 64 << 20), [576, 504]);
        assert_eq!(heights(100, 70, 64, 64 << 20), [70]);
        assert_eq!(heights(100, 70, 64, 100 * 56 * 63), [48, 22]);
        assert_eq!(heights(100, 70, 64, 1), [16, 16, 16, 16, 6]);
        assert_eq!(heights(100, 200, 12, 100 * 56 * 100), [96, 96, 8]);
        assert_eq!(heights(100, 200, 7, 100 * 56 * 111), [96, 96, 8]);
        assert_eq!(heights(100, 200, 7, 100 * 56 * 112), [112, 88]);
        assert_eq!(heights(3, 3, 1, 64 << 20), [3]);
    }
}
