//! Renewals of leases, which are [gathered](super::gathered).

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{LeaseId, WorkerId};

use super::gathered::Outcomes;
use super::leases::{LeaseError, OUTSTANDING, valid};
use super::row::to_json;
use super::sql::{Kind, looked_up, query};
use super::{Connection, Store, workers};

/// A renewal of a lease.
#[derive(Clone, Copy, Debug)]
pub(super) struct Renewal {
    lease: LeaseId,
    token: u64,
    now_ms: i64,
    deadline_ms: i64,
}

impl Store {
    /// Keeps a lease until `deadline_ms`, or a moment longer, and answers how many of its nodes are still wanted under it. One of which none is is
    /// complete: they are accepted, or others have them.
    pub(crate) async fn renew(
        &self,
        lease: LeaseId,
        token: u64,
        now_ms: i64,
        deadline_ms: i64,
    ) -> Result<u32, LeaseError> {
        let renewal = Renewal { lease, token, now_ms, deadline_ms };
        self.renewals.write(self, renewal, |connection, renewals| Box::pin(renew(connection, renewals))).await
    }
}

/// Renews all of them, and answers what each caller is told.
async fn renew(connection: &mut Connection, renewals: Vec<Renewal>) -> Outcomes<u32, LeaseError> {
    let Some(deadline_ms) = renewals.iter().map(|renewal| renewal.deadline_ms).max() else { return Ok(Vec::new()) };
    // A token beyond what can be stored is no lease's.
    let listed =
        |renewal: &Renewal| Some((renewal.lease.to_string(), i64::try_from(renewal.token).ok()?, renewal.now_ms));
    let listed: Vec<(String, i64, i64)> = renewals.iter().filter_map(listed).collect();
    let columns = [Kind::Text, Kind::Integer, Kind::Integer];
    let found = "id = c0 and token = c1 and state = 'active' and deadline_ms > c2";
    let statement = format!(
        "update leases set state = case when {OUTSTANDING} = 0 then 'complete' else state end, deadline_ms = $1 where {} \
         returning id, token, worker, {OUTSTANDING} as outstanding",
        looked_up(connection.engine(), "leases", 2, &columns, found)
    );
    let (mut renewed, mut heard) = (BTreeMap::new(), BTreeSet::new());
    for row in query(statement).bind(deadline_ms).bind(to_json(&listed)?).fetch_all(&mut *connection).await? {
        renewed.insert((row.parsed::<LeaseId>("id")?, row.number::<u64>("token")?), row.number("outstanding")?);
        heard.insert(row.parsed::<WorkerId>("worker")?);
    }
    let mut outcomes = Vec::with_capacity(renewals.len());
    for Renewal { lease, token, now_ms, .. } in &renewals {
        outcomes.push(match renewed.get(&(*lease, *token)) {
            Some(outstanding) => Ok(*outstanding),
            None => match valid(connection, *lease, *token, *now_ms).await {
                Ok(complete) => {
                    heard.insert(complete.worker);
                    Ok(0)
                }
                Err(LeaseError::Store(error)) => return Err(error),
                Err(refused) => Err(refused),
            },
        });
    }
    if let Some(now_ms) = renewals.iter().map(|renewal| renewal.now_ms).max() {
        workers::hear_all(connection, &heard, now_ms).await?;
    }
    Ok(outcomes)
}
