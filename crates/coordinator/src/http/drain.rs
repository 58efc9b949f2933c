//! Draining: the rest of a request's body is received after its answer.
//!
//! An answer may come before the end of the body: the lease has ended, the file is there already, the body is too
//! large. The connection would then be closed under a client that is still sending, or that sends its next request on
//! it. So the rest is received and dropped. When it is too much, the answer announces the end of the connection, and a
//! [lingering close](super::lingering) follows.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use axum::body::{Body, BodyDataStream, HttpBody};
use axum::extract::Request;
use axum::http::HeaderValue;
use axum::http::header::{CONNECTION, EXPECT};
use axum::middleware::Next;
use axum::response::Response;
use futures::stream::{Stream, StreamExt, poll_fn};

/// Most bytes that are received and dropped.
const MOST_BYTES: usize = 16 << 20;

/// Longest time for that.
const LONGEST_TIME: Duration = Duration::from_secs(5);

/// The layer.
pub(super) async fn drop_leftover(request: Request, next: Next) -> Response {
    // A client that expects `100-continue` has not sent anything yet.
    if request.body().is_end_stream() || request.headers().contains_key(EXPECT) {
        return next.run(request).await;
    }
    let (parts, body) = request.into_parts();
    let body = Arc::new(Mutex::new(body.into_data_stream()));
    let read = Body::from_stream(shared(Arc::clone(&body)));
    let mut response = next.run(Request::from_parts(parts, read)).await;
    if !tokio::time::timeout(LONGEST_TIME, is_received(shared(body))).await.unwrap_or(false) {
        response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

/// Reads a body that a handler may have begun to read.
fn shared(body: Arc<Mutex<BodyDataStream>>) -> impl Stream<Item = <BodyDataStream as Stream>::Item> + Send + 'static {
    fn locked(body: &Mutex<BodyDataStream>) -> MutexGuard<'_, BodyDataStream> {
        body.lock().unwrap_or_else(PoisonError::into_inner)
    }
    poll_fn(move |context| locked(&body).poll_next_unpin(context))
}

/// Receives a body, and answers whether it ended well.
async fn is_received(mut body: impl Stream<Item = <BodyDataStream as Stream>::Item> + Unpin) -> bool {
    let mut left = MOST_BYTES;
    while let Some(chunk) = body.next().await {
        match chunk.ok().and_then(|chunk| left.checked_sub(chunk.len())) {
            Some(rest) => left = rest,
            None => return false,
        }
    }
    true
}
