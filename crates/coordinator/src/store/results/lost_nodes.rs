//! Lost nodes: nodes whose stored bytes are lost or damaged are removed from the film and rendered again.
//!
//! Workers render them to the same bits, so the points that were measured with them stay. A job that is done is
//! reopened: it gets what it lacks, and is done as before. A job that was cancelled or has failed keeps the rest of
//! its image.

use std::collections::BTreeSet;

use clerestory_api::{JobId, JobState};
use clerestory_film::NodeAddress;

use crate::model::{JobRecord, Removed, StoredKind, StoredNode};
use crate::store::checks;
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::films::nodes;
use crate::store::results::redo::{count_taken, requeue, restart};
use crate::store::{events, jobs};

/// Level of the nodes in which lost ones are queued: some seconds of work each, and not too many rows.
const LEVEL: u32 = 2;

/// What has become of lost nodes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Replaced {
    /// Nodes that were removed from the film.
    pub(crate) nodes: usize,
    /// Whether they are rendered again.
    pub(crate) is_queued: bool,
    /// What their blobs held.
    pub(crate) removed: Removed,
}

impl Store {
    /// Removes those lost nodes from the film of a job that are still in the same blob, and has them rendered again.
    pub(crate) async fn replace_lost(
        &self,
        job: JobId,
        lost: BTreeSet<StoredNode>,
        now_ms: i64,
    ) -> Result<Replaced, StoreError> {
        self.write(move |connection| Box::pin(async move { replace_lost(connection, job, &lost, now_ms).await })).await
    }

    /// Ends a reopened job as it had ended before, if its lost nodes are back. Answers whether it did.
    pub(crate) async fn close_reopened(&self, job: JobId, now_ms: i64) -> Result<bool, StoreError> {
        self.write(move |connection| {
            Box::pin(async move {
                let closed = query(
                    "update jobs set state = 'done', finished_ms = reopened_ms, reopened_ms = null \
                     where id = $1 and reopened_ms is not null and state = 'running' \
                     and not exists (select 1 from pending where job = $1) and not exists (select 1 from checks \
                     where job = $1)",
                )
                .bind(job.to_string())
                .execute(&mut *connection)
                .await?;
                if closed > 0 {
                    events::record(connection, StoredKind::Job, job, now_ms).await?;
                }
                Ok(closed > 0)
            })
        })
        .await
    }
}

async fn replace_lost(
    connection: &mut Connection,
    job: JobId,
    lost: &BTreeSet<StoredNode>,
    now_ms: i64,
) -> Result<Replaced, StoreError> {
    let Some(job) = jobs::job_in(connection, job).await? else { return Ok(Replaced::default()) };
    let lost = nodes::still_stored(connection, job.id, lost).await?;
    if lost.is_empty() {
        return Ok(Replaced::default());
    }
    let (taken, removed) = nodes::take_out(connection, job.id, &lost).await?;
    checks::forget(connection, job.id, &taken).await?;
    let mut replaced = Replaced { nodes: taken.len(), is_queued: true, removed };
    match job.state {
        JobState::Cancelled | JobState::Failed => {
            count_taken(connection, &job, &taken).await?;
            replaced.is_queued = false;
        }
        JobState::Done => {
            reopen(connection, &job, &taken).await?;
        }
        JobState::Queued | JobState::Running
            if nodes::has_any(connection, job.id).await? || job.reopened_ms.is_some() =>
        {
            requeue(connection, &job, &taken, LEVEL).await?;
        }
        JobState::Queued | JobState::Running => {
            replaced.removed = restart(connection, &job, replaced.removed).await?;
        }
    }
    events::record(connection, StoredKind::Job, job.id, now_ms).await?;
    Ok(replaced)
}

async fn reopen(connection: &mut Connection, job: &JobRecord, taken: &[NodeAddress]) -> Result<(), StoreError> {
    query(
        "update jobs set state = 'running', reopened_ms = coalesce(finished_ms, 0), finished_ms = null where id = $1",
    )
    .bind(job.id.to_string())
    .execute(&mut *connection)
    .await?;
    requeue(connection, job, taken, LEVEL).await
}
