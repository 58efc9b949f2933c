//! Downloads: the image of a job.

use std::path::Path;

use clerestory_api::{ClientError, JobId, JobView, PreviewQuery};
use clerestory_film::ImageMetadata;

use crate::connection::Connection;
use crate::failure::Failure;
use crate::image_file::metadata;
use crate::outage::until_answered;
use crate::output_file::{OutputFile, write};
use crate::progress::Progress;

/// Most bytes of an image's header: a few for each of at most 65536 tiles.
const MOST_HEADER_BYTES: usize = 4 << 20;

/// Fetches the image of a job into files. Returns its metadata. Waits for a coordinator that does not answer.
pub(crate) async fn download(
    connection: &Connection,
    job: &JobView,
    exr: Option<&Path>,
    png: Option<&Path>,
    progress: &Progress,
) -> Result<Option<ImageMetadata>, Failure> {
    let mut metadata = None;
    if let Some(file) = exr {
        // A failure of the disk repeats no call.
        metadata = until_answered(connection, progress, || fetch_image(connection, job.id, file)).await??;
    }
    if let Some(file) = png {
        let query = PreviewQuery::default();
        let preview = until_answered(connection, progress, || connection.client.preview(job.id, &query)).await?;
        write(file, &preview.png)?;
    }
    Ok(metadata)
}

/// Fetches an image into a file, piece by piece, and returns its metadata. The file may be a pipe, so the header is
/// read from the passing pieces.
async fn fetch_image(
    connection: &Connection,
    job: JobId,
    file: &Path,
) -> Result<Result<Option<ImageMetadata>, Failure>, ClientError> {
    let mut download = connection.client.image_download(job).await?;
    let mut output = match OutputFile::create(file) {
        Ok(output) => output,
        Err(failure) => return Ok(Err(failure)),
    };
    let mut head = Vec::new();
    while let Some(piece) = download.piece().await? {
        let rest = MOST_HEADER_BYTES - head.len();
        head.extend_from_slice(&piece[..piece.len().min(rest)]);
        if let Err(failure) = output.write(&piece) {
            return Ok(Err(failure));
        }
    }
    Ok(output.finish().map(|()| metadata(&head)))
}
