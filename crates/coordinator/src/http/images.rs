//! The present image of a job.

use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::extract::State;
use axum::http::header::{CACHE_CONTROL, CONTENT_LENGTH, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use clerestory_api::{ACCEPTED_NODES_HEADER, EXR_MEDIA_TYPE, JobId, PreviewExposure, PreviewQuery, ToneCurve};
use clerestory_film::{Exposure, PreviewSettings};
use futures::stream::{self, Stream, StreamExt};
use tokio_util::io::ReaderStream;

use super::extract::{PathParameter, StrictQuery};
use super::problem::ApiError;
use crate::films::FilmError;
use crate::films::images::{ImageFile, Images};
use crate::films::previews::Previews;
use crate::jobs::lifecycle::Jobs;

/// Largest exposure, up or down.
const MOST_STOPS: f64 = 32.0;

/// Longest silence while a file is being made: before the answer begins, and between two of its first bytes.
const SILENCE: Duration = Duration::from_secs(10);

/// Bytes of a file that are sent at a time.
const PIECE: usize = 256 << 10;

/// The image as OpenEXR: each tile as far as it is complete. Its metadata hold the pass count of every tile.
#[utoipa::path(
    get, path = "/jobs/{job}/image.exr", tag = "images", params(("job" = JobId, Path)),
    responses((status = 200, body = Vec<u8>, content_type = "image/x-exr"))
)]
pub(super) async fn exr(
    State(jobs): State<Arc<Jobs>>,
    State(images): State<Arc<Images>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Response, ApiError> {
    let job = jobs.find(job).await?;
    let choice = images.layers(&job).await?;
    let first = Bytes::from(Images::first_bytes(&job, choice)?);
    let mut making: Making = Box::pin(async move { images.make(&job, choice).await });
    let Ok(made) = tokio::time::timeout(SILENCE, &mut making).await else {
        return Ok(answer(EXR_MEDIA_TYPE, Body::from_stream(slow(making, first, SILENCE))));
    };
    let made = made?;
    let length = made.head.len() as u64 + made.blocks_bytes;
    let mut response = answer(EXR_MEDIA_TYPE, Body::from_stream(pieces(made, 0)));
    response.headers_mut().insert(CONTENT_LENGTH, length.into());
    Ok(response)
}

/// A file that is being made.
type Making = Pin<Box<dyn Future<Output = Result<ImageFile, FilmError>> + Send>>;

/// A file that takes long to make. One of its first bytes, which are known before, is sent from time to time, so that
/// no proxy takes the silence for the end. A failure cuts the answer off.
fn slow(making: Making, first: Bytes, silence: Duration) -> impl Stream<Item = io::Result<Bytes>> + Send {
    let waiting = stream::unfold(Some((making, first, 0)), move |state| async move {
        let (mut making, first, sent) = state?;
        let made = match tokio::time::timeout(silence, &mut making).await {
            Ok(made) => made,
            Err(_) if sent < first.len() => {
                let byte = stream::iter([Ok(first.slice(sent..=sent))]);
                return Some((byte.boxed(), Some((making, first, sent + 1))));
            }
            Err(_) => making.await,
        };
        let rest = match made {
            Ok(made) => pieces(made, sent).boxed(),
            Err(error) => {
                tracing::error!(error = &error as &dyn std::error::Error, "an image could not be made");
                stream::iter([Err(io::Error::other(error))]).boxed()
            }
        };
        Some((rest, None))
    });
    waiting.flatten()
}

/// The bytes of a file after the first `sent` ones.
fn pieces(file: ImageFile, sent: usize) -> impl Stream<Item = io::Result<Bytes>> + Send {
    let head = Bytes::from(file.head);
    let blocks = ReaderStream::with_capacity(tokio::fs::File::from_std(file.blocks), PIECE);
    stream::iter([Ok(head.slice(sent..))]).chain(blocks)
}

/// The image as PNG. A large one is shown smaller: each pixel as the mean of a square.
#[utoipa::path(
    get, path = "/jobs/{job}/preview.png", tag = "images", params(("job" = JobId, Path), PreviewQuery),
    responses((
        status = 200, body = Vec<u8>, content_type = "image/png",
        headers(("clerestory-accepted-nodes" = u64, description = "Accepted nodes of the job when the preview was \
            begun."))
    ))
)]
pub(super) async fn preview(
    State(jobs): State<Arc<Jobs>>,
    State(previews): State<Arc<Previews>>,
    PathParameter(job): PathParameter<JobId>,
    StrictQuery(query): StrictQuery<PreviewQuery>,
) -> Result<Response, ApiError> {
    let exposure = match query.exposure {
        PreviewExposure::Auto => Exposure::Automatic,
        PreviewExposure::Stops(stops) if (-MOST_STOPS..=MOST_STOPS).contains(&stops) => Exposure::Stops(stops),
        // Not a number is in no range.
        PreviewExposure::Stops(stops) => {
            let expected = format!("`auto` or a number of stops between -{MOST_STOPS} and {MOST_STOPS}");
            return Err(ApiError::invalid_field("exposure", stops, expected));
        }
    };
    let curve = match query.curve {
        ToneCurve::Srgb => clerestory_film::ToneCurve::Srgb,
        ToneCurve::Filmic => clerestory_film::ToneCurve::Filmic,
    };
    let preview = previews.current(jobs.find(job).await?, PreviewSettings { exposure, curve }).await?;
    let mut response = answer("image/png", Body::from(preview.png));
    response.headers_mut().insert(ACCEPTED_NODES_HEADER, preview.accepted_nodes.into());
    Ok(response)
}

fn answer(media_type: &'static str, body: Body) -> Response {
    ([(CONTENT_TYPE, media_type), (CACHE_CONTROL, "no-store")], body).into_response()
}

#[cfg(test)]
mod tests {
    use std::io::{Seek, Write};

    use tokio::sync::oneshot;

    use super::*;

    const SILENCE: Duration = Duration::from_millis(20);

    /// A file that is made when the sender says how that ends.
    fn making() -> (oneshot::Sender<Result<(), FilmError>>, Making) {
        let (end, ended) = oneshot::channel();
        let making = async move {
            ended.await.expect("an end")?;
            let mut blocks = tempfile::tempfile()?;
            blocks.write_all(b"blocks")?;
            blocks.rewind()?;
            Ok(ImageFile { head: b"head ".to_vec(), blocks, blocks_bytes: 6 })
        };
        (end, Box::pin(making))
    }

    #[tokio::test]
    async fn a_file_that_takes_long_begins_to_come_before_it_is_made_and_has_its_bytes() {
        for first in [&b"head"[..], b"h", b""] {
            let (end, making) = making();
            let mut stream = Box::pin(slow(making, Bytes::from_static(first), SILENCE));
            let mut file = Vec::new();
            for _ in 0..first.len().min(3) {
                let piece = stream.next().await.unwrap().unwrap();
                assert_eq!(piece.len(), 1, "{piece:?}");
                file.extend(piece);
            }
            end.send(Ok(())).unwrap();
            let rest: Vec<Bytes> = stream.map(Result::unwrap).collect().await;
            file.extend(rest.concat());
            assert_eq!(file, b"head blocks");
        }
    }

    #[tokio::test]
    async fn a_file_that_cannot_be_made_is_cut_off() {
        let (end, making) = making();
        let mut stream = Box::pin(slow(making, Bytes::from_static(b"head"), SILENCE));
        assert_eq!(stream.next().await.unwrap().unwrap(), "h");
        end.send(Err(FilmError::Empty)).unwrap();
        let pieces: Vec<io::Result<Bytes>> = stream.collect().await;
        assert!(pieces.last().unwrap().is_err(), "{pieces:?}");
    }
}
