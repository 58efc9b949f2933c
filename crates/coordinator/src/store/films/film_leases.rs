//! Film leases: one coordinator at a time finalizes the rounds of a job, for a term that it renews.
//!
//! Two coordinators that work on the same film for a while change no bit: rounds are recorded once, and every merge
//! has the same sum. When rows do not fit together, the reader reads them again, because the other coordinator may
//! have changed the film. So a lease need not be exact, and clocks may differ.

use clerestory_api::JobId;
use uuid::Uuid;

use crate::model::FilmLease;
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::sql::query;
use crate::store::engine::writer::Turn;

impl Store {
    /// Leases the film of a job to a coordinator, or renews its lease.
    pub(crate) async fn acquire_film_lease(
        &self,
        job: JobId,
        coordinator: Uuid,
        now_ms: i64,
        until_ms: i64,
    ) -> Result<FilmLease, StoreError> {
        // Uploads may wait for longer than a term.
        self.write_in(Turn::First, move |connection| {
            Box::pin(async move {
                let claimed = query(
                    "insert into film_leases (job, coordinator, until_ms) select id, $2, $4 from jobs where id = $1 \
                     on conflict (job) do update set coordinator = excluded.coordinator, until_ms = excluded.until_ms \
                     where film_leases.coordinator = excluded.coordinator or film_leases.until_ms <= $3",
                )
                .bind(job.to_string())
                .bind(coordinator.to_string())
                .bind(now_ms)
                .bind(until_ms)
                .execute(&mut *connection)
                .await?;
                if claimed > 0 {
                    return Ok(FilmLease::Held);
                }
                let held = query("select until_ms from film_leases where job = $1").bind(job.to_string());
                match held.fetch_optional(connection).await? {
                    Some(row) => Ok(FilmLease::HeldElsewhere { until_ms: row.integer("until_ms")? }),
                    // There is no such job, so no other coordinator holds it.
                    None => Ok(FilmLease::Held),
                }
            })
        })
        .await
    }

    /// Ends all film leases of a coordinator.
    pub(crate) async fn release_film_leases(&self, coordinator: Uuid) -> Result<(), StoreError> {
        self.write(move |connection| {
            Box::pin(async move {
                query("delete from film_leases where coordinator = $1")
                    .bind(coordinator.to_string())
                    .execute(connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }
}
