//! Failed leases: a partial could not be used, or the worker could not render.
//!
//! The failure counts on every node of the lease. A node on which [enough machines](super::attempts) failed ends its
//! job.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{FailedNode, JobId, LeaseId, WorkerId};
use clerestory_film::NodeAddress;

use crate::model::{Ending, LeaseState, WorkFailure, wire_address};
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{address, to_json};
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::errors::LeaseError;
use crate::store::jobs;
use crate::store::leases::attempts::{self, GivenUp};
use crate::store::leases::table as leases;

impl Store {
    /// Takes back a lease whose work failed, and counts the failure on the nodes and the worker. Answers the job if it
    /// has failed for good.
    pub(crate) async fn fail_lease(&self, failure: WorkFailure) -> Result<Option<JobId>, LeaseError> {
        self.write(move |connection| Box::pin(async move { fail(connection, &failure).await })).await
    }
}

/// Nodes of a lease on which the same machines have failed.
struct Group {
    /// The node with most failures, the first of them, and their number.
    node: NodeAddress,
    failures: u32,
}

/// Takes back a lease whose work failed, and answers its job if that has failed for good.
pub(in crate::store) async fn fail(
    connection: &mut Connection,
    failure: &WorkFailure,
) -> Result<Option<JobId>, LeaseError> {
    let lease = leases::valid(connection, failure.lease, failure.token, failure.now_ms).await?;
    let worker = query(
        "update workers set refused_partials = refused_partials + $2, failures_in_a_row = failures_in_a_row + 1, \
         failed_ms = $3, seen_ms = $3 where id = $1 returning name",
    );
    let worker = worker
        .bind(lease.worker.to_string())
        .bind(i64::from(failure.refused_partials))
        .bind(failure.now_ms)
        .fetch_one(&mut *connection)
        .await?;
    let is_active = lease.state == LeaseState::Active;
    if is_active {
        // Workers with another build fingerprint could try it too, once the job is unpinned.
        leases::close(connection, failure.lease).await?;
    }
    let groups = record_failures(connection, failure.lease, (lease.worker, worker.text("name")?)).await?;
    if is_active {
        leases::free(connection, failure.lease).await?;
    }
    for (tried, Group { node, failures }) in groups {
        let machines = attempts::machines(tried);
        let names: BTreeSet<&str> = machines.iter().map(|machine| machine.name.as_str()).collect();
        let most = attempts::MOST_FAILURES;
        let given_up = attempts::given_up(connection, lease.job, &names, failures, most, failure.alive_ms).await?;
        let Some(given_up) = given_up else { continue };
        let names = attempts::names_in_words(&machines);
        let (times, others) = match given_up {
            GivenUp::ByMachines => (format!("on {} machines, {names}", machines.len()), ""),
            GivenUp::ByAttempts => {
                (format!("{failures} times on {names}"), ", and no other machine was there that could render it")
            }
        };
        let message = failure.reason.clone();
        let why = format!("node ({node}) failed {times}{others}; the last failure: {message}");
        if jobs::end(connection, lease.job, &Ending::Failed(why), failure.now_ms).await? {
            let failed = FailedNode { node: wire_address(&node), workers: machines, message };
            query("update jobs set failed_node = $2 where id = $1")
                .bind(lease.job.to_string())
                .bind(to_json(&failed)?)
                .execute(&mut *connection)
                .await?;
        }
        return Ok(Some(lease.job));
    }
    Ok(None)
}

/// Counts the failure of a worker on the nodes of a lease. Answers the nodes by the workers that failed on them: one
/// of each machine, the last one last.
async fn record_failures(
    connection: &mut Connection,
    lease: LeaseId,
    failing: (WorkerId, String),
) -> Result<Vec<(Vec<(WorkerId, String)>, Group)>, StoreError> {
    let rows = query(
        "select frame, tile, level, idx, failures, coalesce(failed_on, '[]') as failed_on from pending where lease = \
         $1 \
         order by round, frame, tile, idx",
    );
    let mut groups: BTreeMap<String, Group> = BTreeMap::new();
    for row in rows.bind(lease.to_string()).fetch_all(&mut *connection).await? {
        let (node, failures) = (address(&row)?, row.number::<u32>("failures")?.saturating_add(1));
        let group = groups.entry(row.text("failed_on")?).or_insert(Group { node, failures });
        if failures > group.failures {
            *group = Group { node, failures };
        }
    }
    let mut noted = Vec::with_capacity(groups.len());
    for (failed_on, group) in groups {
        let mut tried: Vec<(WorkerId, String)> = serde_json::from_str(&failed_on)
            .map_err(|_| StoreError::Corrupt { column: "failed_on", value: failed_on.clone() })?;
        tried.retain(|(_, name)| *name != failing.1);
        tried.push(failing.clone());
        query(
            "update pending set failures = failures + 1, failed_on = $2 where lease = $1 and coalesce(failed_on, \
               '[]') = $3",
        )
        .bind(lease.to_string())
        .bind(to_json(&tried)?)
        .bind(failed_on)
        .execute(&mut *connection)
        .await?;
        noted.push((tried, group));
    }
    Ok(noted)
}
