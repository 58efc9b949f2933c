//! Timeouts of a database.
//!
//! A server that loses power or its network sends nothing, not even an end of the connection. The system would wait
//! for a quarter of an hour.

use std::time::Duration;

use crate::store::engine::error::StoreError;

/// Timeouts, by what the database is asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timeouts {
    /// Until it is reached.
    pub(crate) connection: Duration,
    /// Until an idle connection answers. After that another one is opened.
    pub(crate) idle: Duration,
    /// Until a writer has its turn.
    pub(crate) turn: Duration,
    /// Statements of a transaction and its commit, together.
    pub(crate) transaction: Duration,
    /// Time without an answer to a writer's statement. After that, the server is asked over another connection whether
    /// it still works on it.
    pub(crate) doubt: Duration,
    /// A read: less than callers wait.
    pub(crate) read: Duration,
    /// Time without notifications of other coordinators. After that, the connection is checked.
    pub(crate) silence: Duration,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self {
            connection: Duration::from_secs(10),
            idle: Duration::from_secs(2),
            turn: Duration::from_secs(60),
            transaction: Duration::from_secs(60),
            doubt: Duration::from_secs(3),
            read: Duration::from_secs(10),
            silence: Duration::from_secs(20),
        }
    }
}

/// The answer, or an error after a timeout. The connection is then in the middle of a statement.
pub(in crate::store) async fn in_time<T>(
    longest: Duration,
    answer: impl Future<Output = Result<T, StoreError>>,
) -> Result<T, StoreError> {
    let slow = |_| StoreError::Database(format!("no answer in {} s", longest.as_secs()));
    tokio::time::timeout(longest, answer).await.map_err(slow)?
}
