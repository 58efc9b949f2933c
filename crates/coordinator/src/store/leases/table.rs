//! Leases: valid, returned, extended. [Grants](super::grant) make them, [renewals](super::renewals) extend them, and
//! they [expire](super::expiry) or [fail](super::failures).
//!
//! A fencing token rises with every lease. A call with an older token is refused and changes nothing.

use std::collections::BTreeSet;

use clerestory_api::{JobId, LeaseId};
use clerestory_film::NodeAddress;

use crate::model::{JobRecord, LeaseRecord, LeaseState};
use crate::store::checks;
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, looked_up, to_json};
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::errors::LeaseError;
use crate::store::jobs;
use crate::store::workers::table as workers;

/// How long a late call is told the state of its lease.
const LEASES_KEPT_MS: i64 = 7 * 24 * 3600 * 1000;

/// Leases that one write deletes: all other writes wait meanwhile.
const PRUNED: usize = 1000;

impl LeaseRecord {
    /// Whether work may be brought under it: the token fits, and the lease is active or complete.
    pub(crate) fn check(&self, token: u64, now_ms: i64) -> Result<(), LeaseError> {
        let Self { token: stored, state, deadline_ms, .. } = *self;
        check([stored, token], state, deadline_ms, now_ms)
    }
}

/// Whether work may be brought under a lease: its token is the shown one, and it is active or complete.
pub(in crate::store) fn check(
    [stored, shown]: [u64; 2],
    state: LeaseState,
    deadline_ms: i64,
    now_ms: i64,
) -> Result<(), LeaseError> {
    if shown != stored {
        return Err(LeaseError::StaleToken(shown));
    }
    match state {
        LeaseState::Active if deadline_ms <= now_ms => Err(LeaseError::Expired),
        LeaseState::Active | LeaseState::Complete => Ok(()),
        LeaseState::Returned => Err(LeaseError::Returned),
        LeaseState::Expired => Err(LeaseError::Expired),
        LeaseState::Ended => Err(LeaseError::JobNotRunning),
    }
}

const LEASE: &str = "select leases.id as lease_id, token, job, worker, build, state as lease_state, deadline_ms, nodes \
     from leases join workers on workers.id = worker where leases.id = $1";

fn record(row: &Row) -> Result<LeaseRecord, StoreError> {
    Ok(LeaseRecord {
        id: row.parsed("lease_id")?,
        token: row.number("token")?,
        job: row.parsed("job")?,
        worker: row.parsed("worker")?,
        build: row.text("build")?,
        state: row.word("lease_state")?,
        deadline_ms: row.integer("deadline_ms")?,
        nodes: nodes_of(row)?,
    })
}

/// The nodes of a lease's row.
pub(in crate::store) fn nodes_of(row: &Row) -> Result<BTreeSet<NodeAddress>, StoreError> {
    let nodes: Vec<[u32; 4]> = row.json("nodes")?;
    Ok(nodes.into_iter().map(|[frame, tile, level, index]| NodeAddress { frame, tile, level, index }).collect())
}

/// The lease, if work may be brought under it now.
pub(in crate::store) async fn valid(
    connection: &mut Connection,
    lease: LeaseId,
    token: u64,
    now_ms: i64,
) -> Result<LeaseRecord, LeaseError> {
    let row = query(LEASE).bind(lease.to_string()).fetch_optional(connection).await?;
    let lease = record(&row.ok_or(LeaseError::Unknown(lease))?)?;
    lease.check(token, now_ms)?;
    Ok(lease)
}

/// The same, with its job.
pub(in crate::store) async fn valid_with_job(
    connection: &mut Connection,
    lease: LeaseId,
    token: u64,
    now_ms: i64,
) -> Result<(LeaseRecord, JobRecord), LeaseError> {
    let columns = jobs::COLUMNS;
    let row = query(format!(
        "select * from ({LEASE}) as leased join (select {columns} from jobs) as job_of_lease on id = job"
    ));
    let row = row.bind(lease.to_string()).fetch_optional(connection).await?.ok_or(LeaseError::Unknown(lease))?;
    let lease = record(&row)?;
    lease.check(token, now_ms)?;
    Ok((lease, jobs::record(&row)?))
}

/// SQL for what a lease still holds: work, and checks.
pub(in crate::store) const OUTSTANDING: &str = "((select count(*) from pending where lease = leases.id) + (select \
                                                count(*) from checks where lease = leases.id) \
     + (select count(*) from checks where second_lease = leases.id))";

/// Updates a lease after an upload, and answers what it still holds. A lease that holds nothing is complete. Accepted
/// nodes postpone the time at which it is overdue; renewals do not.
pub(in crate::store) async fn go_on(
    connection: &mut Connection,
    lease: LeaseId,
    accepted_ms: Option<i64>,
) -> Result<u32, StoreError> {
    let active = query(format!(
        "update leases set state = case when {OUTSTANDING} = 0 then 'complete' else state end, \
         due_ms = coalesce($2 + overdue_after_ms, due_ms) where id = $1 and state = 'active' returning {OUTSTANDING} \
         as outstanding"
    ))
    .bind(lease.to_string())
    .bind(accepted_ms)
    .fetch_optional(connection)
    .await?;
    active.map_or(Ok(0), |row| row.number("outstanding"))
}

/// Completes a lease whose nodes were all taken over, as its renewal would.
pub(in crate::store) async fn end_if_empty(connection: &mut Connection, lease: LeaseId) -> Result<(), StoreError> {
    query(format!("update leases set state = 'complete' where id = $1 and state = 'active' and {OUTSTANDING} = 0"))
        .bind(lease.to_string())
        .execute(connection)
        .await?;
    Ok(())
}

impl Store {
    /// A lease as it stands now.
    pub(crate) async fn lease(&self, lease: LeaseId) -> Result<LeaseRecord, LeaseError> {
        let row = query(LEASE).bind(lease.to_string()).fetch_optional(&self.readers).await?;
        Ok(record(&row.ok_or(LeaseError::Unknown(lease))?)?)
    }

    /// Returns the rest of a lease to the queue. A lease that is complete or was returned before stays as it is.
    pub(crate) async fn return_lease(&self, lease: LeaseId, token: u64, now_ms: i64) -> Result<(), LeaseError> {
        self.write(move |connection| {
            Box::pin(async move {
                let record = match valid(connection, lease, token, now_ms).await {
                    Err(LeaseError::Returned) => return Ok(()),
                    record => record?,
                };
                workers::mark_seen(connection, record.worker, now_ms).await?;
                if record.state == LeaseState::Active {
                    release(connection, lease).await?;
                }
                Ok(())
            })
        })
        .await
    }

    /// How many leases are active.
    pub(crate) async fn active_leases(&self) -> Result<u32, StoreError> {
        let counted = query("select count(*) as active from leases where state = 'active'");
        counted.fetch_one(&self.readers).await?.number("active")
    }

    /// Extends every active lease to `deadline_ms`, unless a worker was heard of after `heard_ms`. Workers need time
    /// to come back when no coordinator was running.
    pub(crate) async fn extend_leases(&self, deadline_ms: i64, heard_ms: i64) -> Result<(), StoreError> {
        self.write(move |connection| {
            Box::pin(async move {
                query(
                    "update leases set deadline_ms = $1 where state = 'active' \
                     and not exists (select 1 from workers where seen_ms > $2)",
                )
                .bind(deadline_ms)
                .bind(heard_ms)
                .execute(connection)
                .await?;
                Ok(())
            })
        })
        .await
    }

    /// Deletes leases that ended long ago, in batches. The leases of an open job stay, because they tell who may have
    /// rendered what. The newest lease stays for its token.
    pub(crate) async fn prune_leases(&self, now_ms: i64) -> Result<(), StoreError> {
        loop {
            let old = query(
                "select id from leases where state <> 'active' and deadline_ms < $1 \
                 and token < (select max(token) from leases) \
                 and job not in (select id from jobs where state in ('queued', 'running')) order by deadline_ms \
                 limit $2",
            );
            let rows = old.bind(now_ms - LEASES_KEPT_MS).bind(PRUNED as i64).fetch_all(&self.readers).await?;
            let old: Vec<[String; 1]> =
                rows.iter().map(|row| Ok([row.text("id")?])).collect::<Result<_, StoreError>>()?;
            let count = old.len();
            let listed = to_json(&old)?;
            self.write(move |connection| {
                Box::pin(async move {
                    // What has ended stays so.
                    let is_old = looked_up(connection.engine(), "leases", 1, &[Kind::Text], "id = c0");
                    query(format!("delete from leases where {is_old}")).bind(listed).execute(connection).await?;
                    Ok::<_, StoreError>(())
                })
            })
            .await?;
            if count < PRUNED {
                return Ok(());
            }
        }
    }
}

/// Frees the work and the checks of a lease.
pub(in crate::store) async fn free(connection: &mut Connection, lease: LeaseId) -> Result<(), StoreError> {
    query("update pending set lease = null where lease = $1").bind(lease.to_string()).execute(&mut *connection).await?;
    checks::release(connection, lease).await
}

/// Frees the work and the checks of a lease, and closes it.
pub(in crate::store) async fn release(connection: &mut Connection, lease: LeaseId) -> Result<(), StoreError> {
    close(connection, lease).await?;
    free(connection, lease).await
}

/// Closes a lease: nothing more can be brought under it.
pub(in crate::store) async fn close(connection: &mut Connection, lease: LeaseId) -> Result<(), StoreError> {
    let closed = query("update leases set state = 'returned' where id = $1 returning job").bind(lease.to_string());
    match closed.fetch_optional(&mut *connection).await? {
        Some(row) => unpin(connection, row.parsed("job")?).await,
        None => Ok(()),
    }
}

/// [Unpins](crate::store::workers::pins) a job when a lease has ended, nothing was accepted and nothing is leased. The
/// worker of that lease may never come back, and no other may have the same build fingerprint. The build that renders
/// the job reports on its scene.
pub(in crate::store) async fn unpin(connection: &mut Connection, job: JobId) -> Result<(), StoreError> {
    let opened = query(
        "update jobs set probe_digest = null, scene_is_built = 0, left_to_chance = '[]', chosen_methods = '[]', \
         import_notes = '[]' where id = $1 and probe_digest is not null and shared_samples is null \
         and (select 1 from nodes where job = jobs.id limit 1) is null \
         and (select 1 from leases where job = jobs.id and state = 'active' limit 1) is null",
    );
    if opened.bind(job.to_string()).execute(&mut *connection).await? > 0 {
        // A worker whose nodes were taken over may still bring them, with the old fingerprint.
        query("update leases set state = 'returned' where job = $1 and state = 'complete'")
            .bind(job.to_string())
            .execute(connection)
            .await?;
    }
    Ok(())
}
