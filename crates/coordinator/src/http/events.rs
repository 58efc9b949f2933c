//! Server-sent events.

use std::convert::Infallible;
use std::sync::Arc;

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::sse::{Event, KeepAlive, Sse};
use clerestory_api::{EventBody, JobId};
use futures::StreamExt;
use futures::stream::Stream;

use super::extract::PathParameter;
use super::jobs::find;
use super::problem::ApiError;
use crate::events;
use crate::farm::Farm;

/// What happens on the farm: first a snapshot, then every change. A listener who comes back with `Last-Event-ID` gets the
/// stored events that it missed before the snapshot.
#[utoipa::path(
    get, path = "/events", tag = "events",
    params(("last-event-id" = Option<i64>, Header, description = "The last event that was seen.")),
    responses((status = 200, body = EventBody, content_type = "text/event-stream"))
)]
pub(super) async fn all(
    State(farm): State<Arc<Farm>>,
    headers: HeaderMap,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiError> {
    listen(farm, None, last_id(&headers)).await
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
    State(farm): State<Arc<Farm>>,
    PathParameter(job): PathParameter<JobId>,
    headers: HeaderMap,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiError> {
    find(&farm, job).await?;
    listen(farm, Some(job), last_id(&headers)).await
}

async fn listen(
    farm: Arc<Farm>,
    job: Option<JobId>,
    last_id: Option<i64>,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiError> {
    let stream = events::listen(farm, job, last_id).await?.map(|event| Ok(message(&event)));
    Ok(Sse::new(stream).keep_alive(KeepAlive::default()))
}

/// A browser sends back what it was sent; anything else is as good as nothing.
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
