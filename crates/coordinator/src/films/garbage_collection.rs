//! What nobody needs any more is removed: old rows, and blobs of nodes that no row names.
//!
//! A blob is stored before the row that names it, so one without a row may belong to a node that is being accepted, here or by another
//! coordinator. Which are left over is told by no clock, those of machines and stores being what they are: a blob goes that no row has
//! named at two looks, an hour apart. A coordinator that has the farm to itself accepts nothing before it serves, and needs one look.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use tokio::time::MissedTickBehavior;

use crate::blobs::Blobs;
use crate::farm::Farm;
use crate::films::repair;
use crate::server::RunError;
use crate::store::{Store, StoreError};

/// Time between two removals of old rows.
const TIDYING: Duration = Duration::from_mins(10);

/// Removals of old rows for each look for blobs.
const SWEEPING: u32 = 6;

/// Removes what is not needed, time and again.
pub(crate) async fn run(farm: Arc<Farm>) {
    let mut interval = tokio::time::interval(TIDYING);
    interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut suspects = Suspects::default();
    let mut ticks = 0_u32;
    while farm.stopping.run_until_cancelled(interval.tick()).await.is_some() {
        if let Err(error) = tidy(&farm).await {
            tracing::error!(%error, "old rows could not be removed");
        }
        if ticks % SWEEPING == SWEEPING - 1
            && let Err(error) = sweep(&farm, &mut suspects).await
        {
            tracing::error!(%error, "nodes that nobody needs could not be removed");
        }
        if ticks.is_multiple_of(SWEEPING)
            && let Err(error) = repair::replace_all_missing(&farm).await
        {
            tracing::error!(%error, "lost nodes could not be looked for");
        }
        if ticks.is_multiple_of(SWEEPING)
            && let Err(error) = repair::look_for_assets(&farm).await
        {
            tracing::error!(%error, "lost assets could not be looked for");
        }
        ticks = ticks.wrapping_add(1);
    }
}

async fn tidy(farm: &Farm) -> Result<(), StoreError> {
    farm.store.prune_events().await?;
    let now_ms = farm.config.clock.now_ms();
    farm.store.prune_leases(now_ms).await?;
    farm.store.prune_workers(now_ms).await
}

async fn sweep(farm: &Farm, suspects: &mut Suspects) -> Result<(), RunError> {
    let orphans = orphans(&farm.store, &farm.blobs).await?;
    remove(&farm.blobs, suspects.confirmed_by(orphans)).await;
    Ok(())
}

/// Blobs of nodes that no row names, and pieces of partials, which no row ever names. They are listed before rows are read: one that is stored
/// between is not on the list.
pub(crate) async fn orphans(store: &Store, blobs: &Blobs) -> Result<BTreeSet<String>, RunError> {
    let found = blobs.node_blobs().await?;
    let known = store.node_blobs().await?;
    let pieces = blobs.pieces().await?;
    Ok(&(&found - &known) | &pieces)
}

/// Removes blobs that are left over.
pub(crate) async fn remove(blobs: &Blobs, orphans: BTreeSet<String>) {
    let swept = blobs.remove(orphans.into_iter().collect()).await;
    if swept > 0 {
        tracing::info!(
            swept,
            "removed blobs of nodes that were never accepted or have been merged, and pieces of partials"
        );
    }
}

/// Blobs that no row named at the last look.
#[derive(Debug, Default)]
struct Suspects(BTreeSet<String>);

impl Suspects {
    /// Those of them that no row names now either; the others of now are the suspects of the next look.
    fn confirmed_by(&mut self, orphans: BTreeSet<String>) -> BTreeSet<String> {
        let confirmed = &self.0 & &orphans;
        self.0 = &orphans - &confirmed;
        confirmed
    }
}

#[cfg(test)]
mod tests {
    use clerestory_api::JobId;
    use uuid::Uuid;

    use super::*;
    use crate::config::Config;
    use crate::server::open;

    fn names<const N: usize>(names: [&str; N]) -> BTreeSet<String> {
        names.map(str::to_owned).into()
    }

    #[test]
    fn what_a_row_names_at_the_second_look_stays() {
        let mut suspects = Suspects::default();
        assert!(suspects.confirmed_by(names(["accepted since", "left over"])).is_empty());
        assert_eq!(suspects.confirmed_by(names(["left over", "new"])), names(["left over"]));
        assert_eq!(suspects.confirmed_by(names(["new"])), names(["new"]));
        assert!(
            suspects.confirmed_by(names(["left over"])).is_empty(),
            "it could not be removed, and is looked at anew"
        );
    }

    #[tokio::test]
    async fn blobs_that_no_row_names_go_at_the_second_look_and_when_the_farm_is_opened() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, bells) = open(Config::new(directory.path())).await.unwrap();
        let put = || farm.blobs.put_nodes(JobId::from(Uuid::now_v7()), vec![b"node".to_vec()]);
        let first = put().await.unwrap();
        let mut suspects = Suspects::default();
        sweep(&farm, &mut suspects).await.unwrap();
        let second = put().await.unwrap();
        assert_eq!(farm.blobs.node_blobs().await.unwrap(), names([&*first[0].blob, &*second[0].blob]));
        sweep(&farm, &mut suspects).await.unwrap();
        assert_eq!(farm.blobs.node_blobs().await.unwrap(), names([&*second[0].blob]));
        farm.store.close().await;
        drop((farm, bells));
        let (farm, _bells) = open(Config::new(directory.path())).await.unwrap();
        assert!(farm.blobs.node_blobs().await.unwrap().is_empty());
    }
}
