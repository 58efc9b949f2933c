//! Images as files, for whoever downloads them.
//!
//! A file is made in strips: its blocks go to a file without a name in the data directory, which is gone with whatever happens to the
//! coordinator. It is sent when it is complete, since it begins with what is known last.

use std::fs::File;
use std::io::{Seek, SeekFrom};

use clerestory_film::{ImageWriter, LayerChoice};

use crate::farm::Farm;
use crate::films::FilmError;
use crate::films::frame::{Extent, Frame, Reading, strips};
use crate::memory::permits;
use crate::model::JobRecord;

/// Tries to read a film that grows meanwhile.
const TRIES: u32 = 3;

/// An image as a file: its head, and the blocks that follow it.
#[derive(Debug)]
pub(crate) struct ImageFile {
    /// The first bytes of the file.
    pub(crate) head: Vec<u8>,
    /// The rest, from its beginning.
    pub(crate) blocks: File,
    /// Bytes of the rest.
    pub(crate) blocks_bytes: u64,
}

/// Which layers the image of a job's first frame has now.
///
/// # Errors
///
/// [`FilmError::Empty`] when no tile has a pass.
pub(crate) async fn layers(farm: &Farm, job: &JobRecord) -> Result<LayerChoice, FilmError> {
    let frame = Frame { farm, job, frame: 0, extent: Extent::Complete };
    Ok(LayerChoice::all(frame.has_standard_error().await?))
}

/// The first bytes of the file of an image with these layers, before anything is read of it.
pub(crate) fn first_bytes(job: &JobRecord, choice: LayerChoice) -> Result<Vec<u8>, FilmError> {
    let nothing = clerestory_film::ImageRows::new(job.grid, 0..0, choice);
    Ok(clerestory_film::first_bytes(job.grid.width, job.grid.height, nothing.layers())?)
}

/// Makes the image of a job's first frame: every tile as far as it is complete. Few large images are made at the same time.
pub(crate) async fn make(farm: &Farm, job: &JobRecord, choice: LayerChoice) -> Result<ImageFile, FilmError> {
    let most = farm.strip_bytes();
    let rows = strips(job.grid, choice.bytes_per_pixel(), most).next().map_or(0, |rows| rows.len() as u64);
    let bytes = rows * u64::from(job.grid.width) * choice.bytes_per_pixel();
    // The semaphore is never closed.
    let _permits = farm.images.acquire_many(permits(bytes.min(most))).await.ok();
    let mut tries = 1;
    loop {
        match write(farm, job, choice).await {
            // The film was read while it grew, and tiles of it twice.
            Err(error) if error.is_damage() && tries < TRIES => tries += 1,
            written => return written,
        }
    }
}

async fn write(farm: &Farm, job: &JobRecord, choice: LayerChoice) -> Result<ImageFile, FilmError> {
    let frame = Frame { farm, job, frame: 0, extent: Extent::Complete };
    let directory = farm.config.data_directory.clone();
    let file = tokio::task::spawn_blocking(move || tempfile::tempfile_in(directory)).await??;
    let mut writer = ImageWriter::new(job.grid.width, job.grid.height, file);
    let mut reading = Reading::default();
    for strip in strips(job.grid, choice.bytes_per_pixel(), farm.strip_bytes()) {
        let rows = frame.rows(strip, choice, &mut reading).await?;
        let written = tokio::task::spawn_blocking(move || writer.write_rows(rows.layers()).map(|()| writer));
        writer = written.await??;
    }
    let metadata = frame.metadata(reading).await?;
    let finished = tokio::task::spawn_blocking(move || {
        let (head, mut blocks) = writer.finish(Some(&metadata))?;
        let blocks_bytes = blocks.stream_position()?;
        blocks.seek(SeekFrom::Start(0))?;
        Ok(ImageFile { head, blocks, blocks_bytes })
    });
    finished.await?
}
