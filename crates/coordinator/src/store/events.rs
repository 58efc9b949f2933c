//! Stored events: changed jobs and completed rounds, in one sequence.
//!
//! A row only points at what changed. The event feed reads the current state when it sends the event. The transaction
//! of a change writes its row, so no change is without its event.

use clerestory_api::JobId;

use crate::model::{StoredEvent, StoredKind};
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;

/// Events that are kept for reconnecting listeners.
const KEPT: i64 = 100_000;

/// Stores an event.
pub(in crate::store) async fn record(
    connection: &mut Connection,
    kind: StoredKind,
    job: JobId,
    now_ms: i64,
) -> Result<(), StoreError> {
    let next = query("update sequences set value = value + 1 where name = 'event' returning value");
    let id = next.fetch_one(&mut *connection).await?.integer("value")?;
    let (kind, frame, round) = match kind {
        StoredKind::Job => ("job", None, None),
        StoredKind::Round { frame, round } => ("round", Some(i64::from(frame)), Some(i64::from(round))),
    };
    query("insert into events (id, kind, job, frame, round, created_ms) values ($1, $2, $3, $4, $5, $6)")
        .bind(id)
        .bind(kind)
        .bind(job.to_string())
        .bind(frame)
        .bind(round)
        .bind(now_ms)
        .execute(connection)
        .await?;
    Ok(())
}

fn stored(row: &Row) -> Result<StoredEvent, StoreError> {
    let kind = match row.text("kind")?.as_str() {
        "round" => StoredKind::Round { frame: row.number("frame")?, round: row.number("round")? },
        "job" => StoredKind::Job,
        other => return Err(StoreError::Corrupt { column: "kind", value: other.to_owned() }),
    };
    Ok(StoredEvent { id: row.integer("id")?, job: row.parsed("job")?, kind })
}

impl Store {
    /// Sequence number of the newest event; 0 before the first.
    pub(crate) async fn last_event_id(&self) -> Result<i64, StoreError> {
        let row = query("select value from sequences where name = 'event'").fetch_one(&self.readers).await?;
        row.integer("value")
    }

    /// Up to `limit` events after `id`, oldest first.
    pub(crate) async fn events_after(&self, id: i64, limit: u32) -> Result<Vec<StoredEvent>, StoreError> {
        let rows = query("select id, kind, job, frame, round from events where id > $1 order by id limit $2")
            .bind(id)
            .bind(i64::from(limit))
            .fetch_all(&self.readers)
            .await?;
        rows.iter().map(stored).collect()
    }

    /// The newest `limit` events after `id`, of one job or of all, oldest first.
    pub(crate) async fn missed_events(
        &self,
        job: Option<JobId>,
        id: i64,
        limit: u32,
    ) -> Result<Vec<StoredEvent>, StoreError> {
        let rows = match job {
            None => {
                query("select id, kind, job, frame, round from events where id > $1 order by id desc limit $2")
                    .bind(id)
                    .bind(i64::from(limit))
                    .fetch_all(&self.readers)
                    .await?
            }
            Some(job) => query(
                "select id, kind, job, frame, round from events where job = $1 and id > $2 order by id desc limit $3",
            )
            .bind(job.to_string())
            .bind(id)
            .bind(i64::from(limit))
            .fetch_all(&self.readers)
            .await?,
        };
        rows.iter().rev().map(stored).collect()
    }

    /// Deletes events that are too old for any listener.
    pub(crate) async fn prune_events(&self) -> Result<(), StoreError> {
        self.write(|connection| {
            Box::pin(async move {
                query("delete from events where id <= (select value from sequences where name = 'event') - $1")
                    .bind(KEPT)
                    .execute(connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }
}
