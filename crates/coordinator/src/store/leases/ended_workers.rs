//! Workers that end: their leases go back to the queue.

use clerestory_api::WorkerId;

use crate::store::database::Store;
use crate::store::engine::sql::query;
use crate::store::errors::WorkerError;
use crate::store::leases::table as leases;

impl Store {
    /// Ends a worker, and takes its leases back. Answers whether it had not ended. A later call does not revive it.
    pub(crate) async fn end_worker(&self, worker: WorkerId, now_ms: i64) -> Result<bool, WorkerError> {
        self.write(move |connection| {
            Box::pin(async move {
                let ended = query("update workers set ended_ms = $2 where id = $1 and ended_ms is null")
                    .bind(worker.to_string())
                    .bind(now_ms)
                    .execute(&mut *connection)
                    .await?;
                if ended == 0 {
                    let known = query("select 1 from workers where id = $1").bind(worker.to_string());
                    let is_known = known.fetch_optional(connection).await?.is_some();
                    return if is_known { Ok(false) } else { Err(WorkerError::Unknown(worker)) };
                }
                let held = query("select id from leases where worker = $1 and state = 'active'")
                    .bind(worker.to_string())
                    .fetch_all(&mut *connection)
                    .await?;
                for lease in held {
                    leases::release(connection, lease.parsed("id")?).await?;
                }
                Ok(true)
            })
        })
        .await
    }
}
