//! How long a database is waited for.
//!
//! One that is gone without a word, as when its machine or the network between loses power, answers nothing, not even that it is gone;
//! the system would wait for a quarter of an hour before it gave a connection up.

use std::time::Duration;

use crate::store::engine::error::StoreError;

/// How long a database is waited for, by what it is asked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timeouts {
    /// Until it is reached.
    pub(crate) connection: Duration,
    /// Until an idle connection says that it is still there, before another is made.
    pub(crate) idle: Duration,
    /// Until a writer has its turn.
    pub(crate) turn: Duration,
    /// For the statements of a transaction and its commit together.
    pub(crate) transaction: Duration,
    /// Without an answer to a statement of a writer, before the server is asked over another connection whether it is still at it.
    pub(crate) doubt: Duration,
    /// For a read: less than callers wait.
    pub(crate) read: Duration,
    /// Without news of other coordinators, before it is asked whether it is still there.
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

/// What a database answers, or that it takes too long: its connection is in the middle of something then.
pub(in crate::store) async fn in_time<T>(
    longest: Duration,
    answer: impl Future<Output = Result<T, StoreError>>,
) -> Result<T, StoreError> {
    let slow = |_| StoreError::Database(format!("no answer in {} s", longest.as_secs()));
    tokio::time::timeout(longest, answer).await.map_err(slow)?
}
