//! Server-sent events.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::State;
use axum::http::header::CACHE_CONTROL;
use axum::http::{HeaderMap, HeaderName, HeaderValue};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use clerestory_api::{EventBody, JobId};
use futures::StreamExt;

use super::extract::PathParameter;
use super::problem::ApiError;
use crate::jobs::lifecycle::Jobs;
use crate::watch::events::EventFeed;

/// Longest silence of a stream. Then a comment is sent, so that the client knows that no proxy holds the stream back.
const SILENCE: Duration = Duration::from_secs(5);

/// What happens on the farm: first a snapshot, then every change. A listener that comes back with `Last-Event-ID` gets
/// the stored events that it missed before the snapshot, the newest 500 at most.
#[utoipa::path(
    get, path = "/events", tag = "events",
    params(("last-event-id" = Option<i64>, Header, description = "The last event that was seen.")),
    responses((status = 200, body = EventBody, content_type = "text/event-stream"))
)]
pub(super) async fn all(State(feed): State<Arc<EventFeed>>, headers: HeaderMap) -> Result<Response, ApiError> {
    listen(feed, None, last_id(&headers)).await
}

/// What happens to one job, and to the workers.
#[utoipa::path(
    get, path = "/jobs/{job}/events", tag = "events",
    params(
        ("job" = JobId, Path),
        ("last-event-id" = Option<i64>, Header, description = "The last event that was seen."),
    ),
    responses((status = 200, body = EventBody, content_type = "text/event-stream"))
)]
pub(super) async fn of_job(
    State(jobs): State<Arc<Jobs>>,
    State(feed): State<Arc<EventFeed>>,
    PathParameter(job): PathParameter<JobId>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    jobs.find(job).await?;
    listen(feed, Some(job), last_id(&headers)).await
}

async fn listen(feed: Arc<EventFeed>, job: Option<JobId>, last_id: Option<i64>) -> Result<Response, ApiError> {
    let stream = feed.listen(job, last_id).await?.map(|event| message(&event));
    let mut response =
        Sse::new(stream.map(Ok::<_, Infallible>)).keep_alive(KeepAlive::new().interval(SILENCE)).into_response();
    // These ask proxies to pass events on at once: the first one nginx, the second one those that compress.
    let headers = response.headers_mut();
    headers.insert(HeaderName::from_static("x-accel-buffering"), HeaderValue::from_static("no"));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-cache, no-transform"));
    Ok(response)
}

/// A browser sends back an id that it was sent. Any other value is ignored.
fn last_id(headers: &HeaderMap) -> Option<i64> {
    headers.get("last-event-id").and_then(|value| value.to_str().ok()?.parse().ok())
}

fn message(event: &clerestory_api::Event) -> Event {
    let message = Event::default().event(event.body.name());
    let message = match event.id {
        Some(id) => message.id(id.to_string()),
        None => message,
    };
    let data = serde_json::to_string(&event.body).unwrap_or_default();
    message.data(data)
}
