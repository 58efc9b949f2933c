//! Renewals of leases, written in [batches](crate::store::engine::batch).

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{LeaseId, WorkerId};

use crate::model::{LeaseState, Renewal};
use crate::store::database::Store;
use crate::store::engine::batch::Outcomes;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, looked_up, looked_up_if, to_json};
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::errors::LeaseError;
use crate::store::leases::table::{OUTSTANDING, check};
use crate::store::workers::table as workers;

impl Store {
    /// Extends a lease to `deadline_ms` or slightly longer, and answers how many of its nodes are still wanted. A
    /// lease without wanted nodes is complete: they were accepted, or other workers have them.
    pub(crate) async fn renew(
        &self,
        lease: LeaseId,
        token: u64,
        now_ms: i64,
        deadline_ms: i64,
    ) -> Result<u32, LeaseError> {
        let renewal = Renewal { lease, token, now_ms, deadline_ms };
        self.renewals.write(&self.writer, renewal, |connection, renewals| Box::pin(renew(connection, renewals))).await
    }
}

/// Renews leases, and answers each caller.
async fn renew(connection: &mut Connection, renewals: Vec<Renewal>) -> Outcomes<u32, LeaseError> {
    let Some(deadline_ms) = renewals.iter().map(|renewal| renewal.deadline_ms).max() else { return Ok(Vec::new()) };
    // No lease has a token beyond what can be stored.
    let listed =
        |renewal: &Renewal| Some((renewal.lease.to_string(), i64::try_from(renewal.token).ok()?, renewal.now_ms));
    let listed: Vec<(String, i64, i64)> = renewals.iter().filter_map(listed).collect();
    let columns = [Kind::Text, Kind::Integer, Kind::Integer];
    // Looked up by its identity alone. Few leases are active when a server plans this statement, and it would later
    // scan all active ones.
    let wanted = "token = c1 and state = 'active' and deadline_ms > c2";
    let statement = format!(
        "update leases set state = case when {OUTSTANDING} = 0 then 'complete' else state end, deadline_ms = $1 \
         where {} \
         returning id, token, worker, {OUTSTANDING} as outstanding",
        looked_up_if(connection.engine(), "leases", 2, &columns, "id = c0", wanted)
    );
    let (mut renewed, mut heard) = (BTreeMap::new(), BTreeSet::new());
    for row in query(statement).bind(deadline_ms).bind(to_json(&listed)?).fetch_all(&mut *connection).await? {
        let key: (LeaseId, u64) = (row.parsed("id")?, row.number("token")?);
        renewed.insert(key, row.number("outstanding")?);
        heard.insert(row.parsed::<WorkerId>("worker")?);
    }
    let is_renewed = |renewal: &&Renewal| renewed.contains_key(&(renewal.lease, renewal.token));
    let others: BTreeSet<LeaseId> =
        renewals.iter().filter(|renewal| !is_renewed(renewal)).map(|renewal| renewal.lease).collect();
    let stored = stored(connection, &others).await?;
    let mut outcomes = Vec::with_capacity(renewals.len());
    for Renewal { lease, token, now_ms, .. } in &renewals {
        let outcome = match (renewed.get(&(*lease, *token)), stored.get(lease)) {
            (Some(outstanding), _) => Ok(*outstanding),
            (None, None) => Err(LeaseError::Unknown(*lease)),
            (None, Some(stored)) => {
                // A lease that is neither renewed nor refused is complete.
                let checked = check([stored.token, *token], stored.state, stored.deadline_ms, *now_ms).map(|()| 0);
                heard.extend(checked.is_ok().then_some(stored.worker));
                checked
            }
        };
        outcomes.push(outcome);
    }
    if let Some(now_ms) = renewals.iter().map(|renewal| renewal.now_ms).max().filter(|_| !heard.is_empty()) {
        workers::mark_all_seen(connection, &heard, now_ms).await?;
    }
    Ok(outcomes)
}

/// The row of a lease that is not renewed.
struct Stored {
    token: u64,
    worker: WorkerId,
    state: LeaseState,
    deadline_ms: i64,
}

/// The rows of those leases that exist.
async fn stored(
    connection: &mut Connection,
    leases: &BTreeSet<LeaseId>,
) -> Result<BTreeMap<LeaseId, Stored>, StoreError> {
    if leases.is_empty() {
        return Ok(BTreeMap::new());
    }
    let listed: Vec<[String; 1]> = leases.iter().map(|lease| [lease.to_string()]).collect();
    let found = looked_up(connection.engine(), "leases", 1, &[Kind::Text], "id = c0");
    let rows = query(format!("select id, token, worker, state, deadline_ms from leases where {found}"));
    let rows = rows.bind(to_json(&listed)?).fetch_all(connection).await?;
    let stored = |row: &Row| {
        let stored = Stored {
            token: row.number("token")?,
            worker: row.parsed("worker")?,
            state: row.word("state")?,
            deadline_ms: row.integer("deadline_ms")?,
        };
        Ok((row.parsed("id")?, stored))
    };
    rows.iter().map(stored).collect()
}
