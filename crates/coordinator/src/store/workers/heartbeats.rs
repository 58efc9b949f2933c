//! Heartbeats of workers, written in [batches](crate::store::engine::batch).

use std::collections::BTreeSet;

use clerestory_api::{Quarantine, WorkerActivity, WorkerId};

use crate::model::Heartbeat;
use crate::store::database::Store;
use crate::store::engine::batch::Outcomes;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, looked_up, to_json};
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::errors::WorkerError;

impl Store {
    /// Stores a heartbeat.
    pub(crate) async fn touch_worker(
        &self,
        worker: WorkerId,
        now_ms: i64,
        activity: WorkerActivity,
    ) -> Result<(), WorkerError> {
        self.heartbeats
            .write(&self.writer, Heartbeat { worker, now_ms, activity }, |connection, heartbeats| {
                Box::pin(note(connection, heartbeats))
            })
            .await
    }
}

/// Stores heartbeats, and answers each caller.
async fn note(connection: &mut Connection, heartbeats: Vec<Heartbeat>) -> Outcomes<(), WorkerError> {
    let Some(now_ms) = heartbeats.iter().map(|heartbeat| heartbeat.now_ms).max() else { return Ok(Vec::new()) };
    let workers: BTreeSet<[String; 1]> = heartbeats.iter().map(|heartbeat| [heartbeat.worker.to_string()]).collect();
    let statement = format!(
        "update workers set seen_ms = $1, building = null where {} and quarantine is null returning id, ended_ms",
        looked_up(connection.engine(), "workers", 2, &[Kind::Text], "id = c0")
    );
    let mut noted = BTreeSet::new();
    for row in query(statement).bind(now_ms).bind(to_json(&workers)?).fetch_all(&mut *connection).await? {
        // A worker that was given up registers again. Its heartbeat counts all the same.
        if row.optional_integer("ended_ms")?.is_none() {
            noted.insert(row.parsed::<WorkerId>("id")?);
        }
    }
    for Heartbeat { worker, activity, .. } in &heartbeats {
        if let Some(building) = activity.building.as_ref().filter(|_| noted.contains(worker)) {
            let statement = query("update workers set building = $2 where id = $1").bind(worker.to_string());
            statement.bind(to_json(building)?).execute(&mut *connection).await?;
        }
    }
    let mut notes = Vec::with_capacity(heartbeats.len());
    for Heartbeat { worker, .. } in heartbeats {
        notes.push(if noted.contains(&worker) { Ok(()) } else { Err(refusal(connection, worker).await?) });
    }
    Ok(notes)
}

/// Why a heartbeat is refused.
async fn refusal(connection: &mut Connection, worker: WorkerId) -> Result<WorkerError, StoreError> {
    let row = query("select quarantine from workers where id = $1").bind(worker.to_string());
    let row = row.fetch_optional(connection).await?;
    let quarantine: Option<Quarantine> = row.map(|row| row.optional_json("quarantine")).transpose()?.flatten();
    Ok(match quarantine {
        Some(Quarantine { reason, .. }) => WorkerError::Quarantined { worker, reason },
        None => WorkerError::Unknown(worker),
    })
}
