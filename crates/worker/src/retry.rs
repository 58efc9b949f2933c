//! Calls that are repeated while the coordinator is away.

use std::time::Duration;

use backon::{ExponentialBuilder, Retryable};
use clerestory_api::ClientError;
use tracing::warn;

use crate::error::with_causes;

/// First pause between attempts.
const SHORTEST_PAUSE: Duration = Duration::from_millis(100);

/// Longest pause between attempts, before jitter adds up to as much again.
const LONGEST_PAUSE: Duration = Duration::from_secs(3);

/// Exponential backoff with jitter, so that the workers of a farm do not all retry at once.
pub(crate) fn pauses() -> ExponentialBuilder {
    ExponentialBuilder::default()
        .with_min_delay(SHORTEST_PAUSE)
        .with_max_delay(LONGEST_PAUSE)
        .with_jitter()
        .without_max_times()
}

/// Repeats `call` until it succeeds or fails with an error that is not transient.
pub(crate) async fn until_answered<T, Answer>(
    what: &'static str,
    call: impl FnMut() -> Answer,
) -> Result<T, ClientError>
where
    Answer: Future<Output = Result<T, ClientError>>,
{
    repeat_while(what, ClientError::is_transient, call).await
}

/// Repeats `call` until it succeeds or fails with an error for which `may_pass` is false.
pub(crate) async fn repeat_while<T, Answer>(
    what: &'static str,
    may_pass: impl FnMut(&ClientError) -> bool,
    call: impl FnMut() -> Answer,
) -> Result<T, ClientError>
where
    Answer: Future<Output = Result<T, ClientError>>,
{
    call.retry(pauses())
        .when(may_pass)
        .adjust(|error, pause| pause.map(|pause| error.pause(pause)))
        .notify(|error, pause| {
            warn!(what, ?pause, reason = with_causes(error), "the coordinator does not answer, trying again");
        })
        .await
}
