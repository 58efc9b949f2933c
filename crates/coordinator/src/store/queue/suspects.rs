//! Nodes with which workers died.

use std::collections::BTreeSet;

use clerestory_film::NodeAddress;

use crate::model::{ClaimTerms, JobRecord};
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::address;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::leases::attempts;
use crate::store::leases::expiry::Holder;
use crate::store::workers::table::Claimant;

/// Nodes of a job with which workers died. Each is leased alone, and to a machine that has not tried it, if one is
/// alive.
pub(in crate::store) struct Suspects {
    /// All of them.
    nodes: BTreeSet<NodeAddress>,
    /// Those that are withheld from the asking worker.
    not_for_it: BTreeSet<NodeAddress>,
}

/// The suspects of a job, for a worker.
pub(in crate::store) async fn suspects(
    connection: &mut Connection,
    job: &JobRecord,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Suspects, StoreError> {
    let rows = query("select frame, tile, level, idx, died_on from pending where job = $1 and died_on is not null");
    let rows = rows.bind(job.id.to_string()).fetch_all(&mut *connection).await?;
    let mut suspects = Suspects { nodes: BTreeSet::new(), not_for_it: BTreeSet::new() };
    for row in &rows {
        let node = address(row)?;
        let deaths: Vec<Holder> = row.json("died_on")?;
        let names: BTreeSet<&str> = deaths.iter().map(|Holder(_, name, _)| name.as_str()).collect();
        if names.contains(claimant.name.as_str())
            && attempts::others_could_try(connection, job.id, &names, terms.alive_ms).await?
        {
            suspects.not_for_it.insert(node);
        }
        suspects.nodes.insert(node);
    }
    Ok(suspects)
}

impl Suspects {
    /// The number of withheld nodes.
    pub(in crate::store) fn withheld(&self) -> u32 {
        u32::try_from(self.not_for_it.len()).unwrap_or(u32::MAX)
    }

    /// Removes the withheld nodes from some nodes.
    pub(in crate::store) fn withhold(&self, nodes: &mut Vec<NodeAddress>) {
        nodes.retain(|node| !self.not_for_it.contains(node));
    }

    /// Cuts some nodes before the first suspect, or after it when it comes first.
    pub(in crate::store) fn set_apart(&self, nodes: &mut Vec<NodeAddress>) {
        if let Some(place) = nodes.iter().position(|node| self.nodes.contains(node)) {
            nodes.truncate(place.max(1));
        }
    }
}
