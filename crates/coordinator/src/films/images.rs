//! Images as files, for downloads.
//!
//! A file is made in strips. Its blocks go to an unnamed file in the data directory, which ends with the coordinator.
//! The download begins when the file is complete, because its head holds the metadata, which are known last.

use std::fs::File;
use std::io::{Seek, SeekFrom};
use std::path::PathBuf;
use std::sync::Arc;

use clerestory_api::JobState;
use clerestory_film::{ImageWriter, LayerChoice};

use super::error::FilmError;
use super::frame::{Extent, Frame, Reading, strips};
use super::reader::FilmReader;
use super::repair::Repair;
use crate::memory::MemoryBudget;
use crate::model::JobRecord;
use crate::store::StoreError;

/// Reads of a film that grows meanwhile.
const READS: u32 = 3;

/// Attempts to make an image whose nodes are merged meanwhile.
const ATTEMPTS: u32 = 3;

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

/// Makes images.
#[derive(Debug)]
pub(crate) struct Images {
    reader: Arc<FilmReader>,
    repair: Arc<Repair>,
    /// Directory of unnamed files.
    directory: PathBuf,
    /// Build of the coordinator, for the metadata.
    build: String,
    /// Strips of images that are made at the same time.
    strips: MemoryBudget,
}

impl Images {
    /// Images whose strips take half of these bytes together.
    pub(crate) fn new(
        reader: Arc<FilmReader>,
        repair: Arc<Repair>,
        directory: PathBuf,
        build: String,
        image_bytes: u64,
    ) -> Self {
        Self { reader, repair, directory, build, strips: MemoryBudget::new(image_bytes / 2) }
    }

    /// Layers of the image of a job's first frame now.
    ///
    /// # Errors
    ///
    /// [`FilmError::Empty`] when no tile has a pass, and [`FilmError::RenderedAgain`] when nodes of a complete image
    /// are lost.
    pub(crate) async fn layers(&self, job: &JobRecord) -> Result<LayerChoice, FilmError> {
        if job.reopened_ms.is_some() {
            return Err(FilmError::RenderedAgain);
        }
        match self.frame(job).has_standard_error().await {
            Err(_) if self.has_lost_nodes_since(job).await? => Err(FilmError::RenderedAgain),
            has_standard_error => Ok(LayerChoice::all(has_standard_error?)),
        }
    }

    /// The first bytes of the file of an image with these layers, before anything is read of it.
    pub(crate) fn first_bytes(job: &JobRecord, choice: LayerChoice) -> Result<Vec<u8>, FilmError> {
        let nothing = clerestory_film::ImageRows::new(job.grid, 0..0, choice);
        Ok(clerestory_film::first_bytes(job.grid.width, job.grid.height, nothing.layers())?)
    }

    /// Makes the image of a job's first frame, in which every tile shows its complete passes. The image of a job that
    /// is done has all passes. Few large images are made at the same time.
    pub(crate) async fn make(&self, job: &JobRecord, choice: LayerChoice) -> Result<ImageFile, FilmError> {
        let mut attempts = 1;
        loop {
            let made = self.make_once(job, choice).await;
            let has_changed = match &made {
                Ok(_) => false,
                Err(error) => self.repair.repair(job.id, error).await?,
            };
            if self.has_lost_nodes_since(job).await? {
                return Err(FilmError::RenderedAgain);
            }
            if !has_changed || attempts == ATTEMPTS {
                return made;
            }
            // Nodes were merged meanwhile.
            attempts += 1;
        }
    }

    async fn make_once(&self, job: &JobRecord, choice: LayerChoice) -> Result<ImageFile, FilmError> {
        let first_strip = strips(job.grid, choice.bytes_per_pixel(&job.grid), self.strips.bytes()).next();
        let rows = first_strip.map_or(0, |rows| rows.len() as u64);
        let _reserved = self.strips.reserve(rows * u64::from(job.grid.width) * choice.bytes_per_pixel(&job.grid)).await;
        let mut reads = 1;
        loop {
            match self.write(job, choice).await {
                // The film grew while it was read, and tiles of it were read twice.
                Err(error) if error.is_damage() && reads < READS => reads += 1,
                written => return written,
            }
        }
    }

    async fn write(&self, job: &JobRecord, choice: LayerChoice) -> Result<ImageFile, FilmError> {
        let frame = self.frame(job);
        let directory = self.directory.clone();
        let file = tokio::task::spawn_blocking(move || tempfile::tempfile_in(directory)).await??;
        let mut writer = ImageWriter::new(job.grid.width, job.grid.height, file);
        let mut reading = Reading::default();
        for strip in strips(job.grid, choice.bytes_per_pixel(&job.grid), self.strips.bytes()) {
            let rows = frame.rows(strip, choice, &mut reading).await?;
            let written = tokio::task::spawn_blocking(move || writer.write_rows(rows.layers()).map(|()| writer));
            writer = written.await??;
        }
        let metadata = frame.metadata(reading, &self.build).await?;
        let finished = tokio::task::spawn_blocking(move || {
            let (head, mut blocks) = writer.finish(Some(&metadata))?;
            let blocks_bytes = blocks.stream_position()?;
            blocks.seek(SeekFrom::Start(0))?;
            Ok(ImageFile { head, blocks, blocks_bytes })
        });
        finished.await?
    }

    fn frame<'a>(&'a self, job: &'a JobRecord) -> Frame<'a> {
        Frame { reader: &self.reader, job, frame: 0, extent: Extent::Complete }
    }

    /// Whether nodes of a job that is done were removed from its film since its record was read: another reader found
    /// them lost.
    async fn has_lost_nodes_since(&self, job: &JobRecord) -> Result<bool, StoreError> {
        if job.state != JobState::Done {
            return Ok(false);
        }
        let now = self.reader.store.job(job.id).await?;
        Ok(now.is_some_and(|now| now.redone_nodes != job.redone_nodes))
    }
}
