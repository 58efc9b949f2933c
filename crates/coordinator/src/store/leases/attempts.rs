//! Attempts: machines that tried a node in vain, and when a node is given up. Workers of one name are one machine.

use std::collections::BTreeSet;

use clerestory_api::{JobId, NamedWorker, WorkerId};

use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, rows_of, to_json};
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::workers::pins::MATCHES_PIN;

/// Machines that try a node in vain before it is given up, when no other could try.
const ENOUGH_MACHINES: usize = 3;

/// Machines that die with a node before it is given up, in any case: each death costs a machine.
pub(in crate::store) const MOST_DEATHS: usize = ENOUGH_MACHINES;

/// Machines that fail on a node before it is given up, in any case: a larger machine may have the memory that others
/// lack.
pub(in crate::store) const MOST_FAILURES: usize = 10;

/// Attempts in vain after which a node is given up, when fewer machines could render it.
pub(in crate::store) const ENOUGH_ATTEMPTS: u32 = 5;

/// Attempts in vain after which a node is given up, in any case: other machines may have other work for ever.
const MOST_ATTEMPTS: u32 = 50;

/// Why a node is given up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) enum GivenUp {
    /// Enough machines have tried.
    ByMachines,
    /// There were enough attempts, and no other machine is alive.
    ByAttempts,
}

/// Whether a node is given up after attempts by workers of these names: at the latest after `most_machines`. A machine
/// is alive when one of its workers was heard of since `alive_ms`.
pub(in crate::store) async fn given_up(
    connection: &mut Connection,
    job: JobId,
    names: &BTreeSet<&str>,
    attempts: u32,
    most_machines: usize,
    alive_ms: i64,
) -> Result<Option<GivenUp>, StoreError> {
    let are_enough = names.len() >= ENOUGH_MACHINES;
    if names.len() < most_machines && attempts < MOST_ATTEMPTS {
        let may_be = are_enough || attempts >= ENOUGH_ATTEMPTS;
        if !may_be || others_could_try(connection, job, names, alive_ms).await? {
            return Ok(None);
        }
    }
    Ok(Some(if are_enough { GivenUp::ByMachines } else { GivenUp::ByAttempts }))
}

/// Whether another machine could render nodes of a job, and was heard of since `alive_ms`.
pub(in crate::store) async fn others_could_try(
    connection: &mut Connection,
    job: JobId,
    names: &BTreeSet<&str>,
    alive_ms: i64,
) -> Result<bool, StoreError> {
    let listed: Vec<[&str; 1]> = names.iter().map(|name| [*name]).collect();
    let others = query(format!(
        "select 1 from workers join jobs on jobs.id = $1 where workers.seen_ms >= $2 and workers.ended_ms is null \
         and workers.quarantine is null and {MATCHES_PIN} \
         and workers.name not in (select c0 from {} as listed_names) limit 1",
        rows_of(connection.engine(), 3, &[Kind::Text])
    ));
    let others = others.bind(job.to_string()).bind(alive_ms).bind(to_json(&listed)?);
    Ok(others.fetch_optional(connection).await?.is_some())
}

/// Whether another machine is alive that could build a job's scene, and has not failed on the job.
pub(in crate::store) async fn others_could_build(
    connection: &mut Connection,
    job: JobId,
    name: &str,
    alive_ms: i64,
) -> Result<bool, StoreError> {
    let rows = query("select distinct failed_on from pending where job = $1 and failed_on is not null");
    let mut failing: Vec<(WorkerId, String)> = Vec::new();
    for row in rows.bind(job.to_string()).fetch_all(&mut *connection).await? {
        failing.extend(row.json::<Vec<(WorkerId, String)>>("failed_on")?);
    }
    let mut names: BTreeSet<&str> = failing.iter().map(|(_, name)| name.as_str()).collect();
    names.insert(name);
    others_could_try(connection, job, &names, alive_ms).await
}

/// One worker of each machine, in the order of their last attempts.
pub(in crate::store) fn machines(attempts: impl IntoIterator<Item = (WorkerId, String)>) -> Vec<NamedWorker> {
    let mut machines: Vec<NamedWorker> = Vec::new();
    for (id, name) in attempts {
        machines.retain(|machine| machine.name != name);
        machines.push(NamedWorker { id, name });
    }
    machines
}

/// Their names, in words.
pub(in crate::store) fn names_in_words(machines: &[NamedWorker]) -> String {
    let names: Vec<String> = machines.iter().map(|machine| format!("`{}`", machine.name)).collect();
    match names.split_last() {
        None => String::new(),
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} and {last}", others.join(", ")),
    }
}
