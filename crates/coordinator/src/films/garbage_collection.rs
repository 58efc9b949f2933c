//! Garbage collection: old rows, and blobs that no row names.
//!
//! A blob is stored before the row that names it. A blob without a row may therefore hold nodes that are being
//! accepted, here or by another coordinator. No clock tells these from garbage, because the clocks of machines and
//! stores differ. A blob is removed when no row has named it at two collections, an hour apart. A coordinator without
//! peers accepts nothing before it serves, and needs one.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use tokio::time::MissedTickBehavior;
use tokio_util::sync::CancellationToken;

use super::assets::Assets;
use super::error::FilmError;
use super::repair::Repair;
use crate::blobs::Blobs;
use crate::clock::Clock;
use crate::store::{Store, StoreError};

/// Time between two removals of old rows.
const INTERVAL: Duration = Duration::from_mins(10);

/// Removals of old rows to one collection of blobs.
const ROUNDS_PER_COLLECTION: u32 = 6;

/// Collects garbage, and has missing nodes and assets looked for.
#[derive(Debug)]
pub(crate) struct GarbageCollector {
    store: Store,
    blobs: Blobs,
    repair: Arc<Repair>,
    assets: Arc<Assets>,
    clock: Clock,
    stopping: CancellationToken,
}

impl GarbageCollector {
    /// A collector of a farm.
    pub(crate) fn new(
        store: Store,
        blobs: Blobs,
        repair: Arc<Repair>,
        assets: Arc<Assets>,
        clock: Clock,
        stopping: CancellationToken,
    ) -> Self {
        Self { store, blobs, repair, assets, clock, stopping }
    }

    /// Collects until the coordinator stops.
    pub(crate) async fn run(self) {
        let mut interval = tokio::time::interval(INTERVAL);
        interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut suspects = Suspects::default();
        let mut ticks = 0_u32;
        while self.stopping.run_until_cancelled(interval.tick()).await.is_some() {
            if let Err(error) = self.prune().await {
                tracing::error!(%error, "old rows could not be removed");
            }
            if ticks % ROUNDS_PER_COLLECTION == ROUNDS_PER_COLLECTION - 1
                && let Err(error) = collect(&self.store, &self.blobs, &mut suspects).await
            {
                tracing::error!(%error, "nodes that nobody needs could not be removed");
            }
            if ticks.is_multiple_of(ROUNDS_PER_COLLECTION)
                && let Err(error) = self.repair.replace_all_missing().await
            {
                tracing::error!(%error, "lost nodes could not be looked for");
            }
            if ticks.is_multiple_of(ROUNDS_PER_COLLECTION)
                && let Err(error) = self.assets.check_all().await
            {
                tracing::error!(%error, "lost assets could not be looked for");
            }
            ticks = ticks.wrapping_add(1);
        }
    }

    async fn prune(&self) -> Result<(), StoreError> {
        self.store.prune_events().await?;
        let now_ms = self.clock.now_ms();
        self.store.prune_leases(now_ms).await?;
        self.store.prune_workers(now_ms).await
    }
}

/// Removes the blobs that no row has named at this collection and at the last one.
async fn collect(store: &Store, blobs: &Blobs, suspects: &mut Suspects) -> Result<(), FilmError> {
    let unreferenced = unreferenced(store, blobs).await?;
    remove(blobs, suspects.confirmed_by(unreferenced)).await;
    Ok(())
}

/// Removes all blobs that no row names, of a farm that has no other coordinator and accepts nothing yet.
pub(crate) async fn collect_alone(store: &Store, blobs: &Blobs) -> Result<(), FilmError> {
    remove(blobs, unreferenced(store, blobs).await?).await;
    Ok(())
}

/// Blobs of nodes that no row names, and pieces of partials, which rows never name. Blobs are listed before rows are
/// read, so that a blob stored in between is not listed.
async fn unreferenced(store: &Store, blobs: &Blobs) -> Result<BTreeSet<String>, FilmError> {
    let found = blobs.node_blobs().await?;
    let known = store.node_blobs().await?;
    let pieces = blobs.pieces().await?;
    Ok(&(&found - &known) | &pieces)
}

async fn remove(blobs: &Blobs, names: BTreeSet<String>) {
    let removed = blobs.remove(names.into_iter().collect()).await;
    if removed > 0 {
        tracing::info!(
            removed,
            "removed blobs of nodes that were never accepted or have been merged, and pieces of partials"
        );
    }
}

/// Blobs that no row named at the last collection.
#[derive(Debug, Default)]
struct Suspects(BTreeSet<String>);

impl Suspects {
    /// Those of them that no row names now either. The other blobs are the suspects of the next collection.
    fn confirmed_by(&mut self, unreferenced: BTreeSet<String>) -> BTreeSet<String> {
        let confirmed = &self.0 & &unreferenced;
        self.0 = &unreferenced - &confirmed;
        confirmed
    }
}

#[cfg(test)]
mod tests {
    use clerestory_api::JobId;
    use uuid::Uuid;

    use super::*;
    use crate::store::Source;

    fn names<const N: usize>(names: [&str; N]) -> BTreeSet<String> {
        names.map(str::to_owned).into()
    }

    #[test]
    fn a_blob_that_a_row_names_at_the_second_collection_stays() {
        let mut suspects = Suspects::default();
        assert!(suspects.confirmed_by(names(["accepted since", "left over"])).is_empty());
        assert_eq!(suspects.confirmed_by(names(["left over", "new"])), names(["left over"]));
        assert_eq!(suspects.confirmed_by(names(["new"])), names(["new"]));
        assert!(
            suspects.confirmed_by(names(["left over"])).is_empty(),
            "it could not be removed, and is a suspect again"
        );
    }

    #[tokio::test]
    async fn blobs_that_no_row_names_go_at_the_second_collection_or_at_once_where_there_is_no_peer() {
        let directory = tempfile::tempdir().unwrap();
        let store = Store::open(Source::file(&directory.path().join("farm.sqlite"))).await.unwrap();
        let blobs = Blobs::in_directory(directory.path().join("blobs")).unwrap();
        let put = || blobs.put_nodes(JobId::from(Uuid::now_v7()), vec![b"node".to_vec()]);
        let first = put().await.unwrap();
        let mut suspects = Suspects::default();
        collect(&store, &blobs, &mut suspects).await.unwrap();
        let second = put().await.unwrap();
        assert_eq!(blobs.node_blobs().await.unwrap(), names([&*first[0].blob, &*second[0].blob]));
        collect(&store, &blobs, &mut suspects).await.unwrap();
        assert_eq!(blobs.node_blobs().await.unwrap(), names([&*second[0].blob]));
        collect_alone(&store, &blobs).await.unwrap();
        assert!(blobs.node_blobs().await.unwrap().is_empty());
        store.close().await;
    }
}
