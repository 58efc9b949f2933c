//! Outages: a coordinator that does not answer is called again, and the user is told once.

use std::time::Duration;

use clerestory_api::{ClientError, ProblemCode};

use crate::connection::Connection;
use crate::error_text::root_cause;
use crate::failure::Failure;
use crate::progress::Progress;
use crate::text::printable;

/// Pause before a call is repeated or an event stream is opened again.
pub(crate) const RECONNECT_PAUSE: Duration = Duration::from_millis(500);

/// Most faults of the coordinator in a row for one call. An outage passes, but a fault may not.
const MOST_FAULTS: u32 = 10;

/// Repeats a call that changes nothing until the coordinator answers. The user is told of an outage.
pub(crate) async fn until_answered<T, Answer>(
    connection: &Connection,
    progress: &Progress,
    mut call: impl FnMut() -> Answer,
) -> Result<T, Failure>
where
    Answer: Future<Output = Result<T, ClientError>>,
{
    let mut outage = Outage::default();
    let mut faults = 0;
    loop {
        match call().await {
            Ok(answer) => {
                outage.end(connection, progress);
                return Ok(answer);
            }
            Err(error) if error.is_transient() && faults < MOST_FAULTS => {
                let is_fault = error.problem().is_some_and(|problem| problem.code == ProblemCode::Internal);
                faults = if is_fault { faults + 1 } else { 0 };
                outage.note(connection, progress, &error);
                tokio::time::sleep(error.pause(RECONNECT_PAUSE)).await;
            }
            Err(error) => return Err(connection.failure(error)),
        }
    }
}

/// Whether the user knows that the coordinator does not answer.
#[derive(Default)]
pub(crate) struct Outage {
    is_known: bool,
}

impl Outage {
    /// Tells the user, once in an outage, that the coordinator does not answer.
    pub(crate) fn note(&mut self, connection: &Connection, progress: &Progress, error: &ClientError) {
        if !std::mem::replace(&mut self.is_known, true) {
            let (address, reason) = (connection.address(), printable(&root_cause(error).to_string()).into_owned());
            let way = error.silent_proxy().map(|proxy| format!(" through the proxy {proxy}")).unwrap_or_default();
            progress.note(&format!("The coordinator at {address} does not answer{way}, trying again: {reason}"));
        }
    }

    /// Tells the user that an outage is over.
    pub(crate) fn end(&mut self, connection: &Connection, progress: &Progress) {
        if std::mem::replace(&mut self.is_known, false) {
            progress.note(&format!("The coordinator at {} answers again", connection.address()));
        }
    }
}
