//! Adaptive jobs: what is cut before and after their passes are shared out.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{ConvergencePoint, JobId, JobState, StopReason, WorkerId};
use clerestory_film::{Share, Targets};

use crate::model::{BlobRange, Ending, JobRecord, NewJob, NodeRow, Removed};
use crate::store::engine::error::StoreError;
use crate::store::tests::Farm;

/// Passes of a job; a block has 16.
const PASSES: u32 = 80;

impl Farm {
    /// The accepted nodes of the pilot of a job of one frame.
    pub(super) async fn pilot(&self, job: &JobRecord) -> Result<Vec<NodeRow>, StoreError> {
        self.store.pilot(job.id, 0, 0..job.grid.len()).await
    }

    pub(super) async fn adaptive_job(&self, targets: Targets) -> JobRecord {
        let job = self.job_like(|job| NewJob { passes: PASSES, adaptive: true, targets, ..job }).await;
        self.record(job).await
    }

    pub(super) async fn record(&self, job: JobId) -> JobRecord {
        self.store.job(job).await.unwrap().unwrap()
    }

    /// Delivers all work that there is.
    async fn work_off(&self) {
        self.deliver_all(self.worker().await).await;
    }

    /// Lets a worker deliver all work that there is for it.
    pub(super) async fn deliver_all(&self, worker: WorkerId) {
        while let Some(grant) = self.claim(worker, 256, 0).await {
            self.deliver(&grant, &grant.nodes, 0).await.unwrap();
        }
    }

    /// Discards the pilot of a job of one frame, two tiles at a time, if it is not needed.
    pub(super) async fn discard_pilot(&self, job: &JobRecord) -> Removed {
        let mut removed = Removed::default();
        for first in (0..job.grid.len()).step_by(2) {
            removed += self.store.discard_pilot(job.id, 0, first..first + 2).await.unwrap();
        }
        removed
    }

    /// Passes of each tile that have been accepted, without the pilot.
    pub(super) async fn accepted(&self, job: JobId) -> Vec<u32> {
        let grid = self.record(job).await.grid;
        let mut passes = vec![0; grid.len() as usize];
        for node in self.addresses(job).await {
            passes[node.tile as usize] += node.passes().count;
        }
        passes
    }

    pub(super) async fn record_rounds(&self, job: JobId, count: u32, error: f64) {
        for _ in 0..count {
            let record = self.record(job).await;
            assert!(self.next_complete_round(job).await.is_some(), "round {} is not complete", record.rounds);
            let point = ConvergencePoint {
                round: record.rounds,
                samples_per_pixel: 1 << 20,
                estimated_mse: Some(error),
                ..ConvergencePoint::default()
            };
            self.store.record_round(&record, vec![point], 0).await.unwrap().unwrap();
        }
    }
}

/// All for the first tile, and a part for each other tile.
pub(super) fn some_shares(record: &JobRecord) -> BTreeMap<u32, Vec<Share>> {
    let shares = (0..record.grid.len()).map(|tile| Share::new(Share::ALL / (tile % 8 + 1)).unwrap());
    BTreeMap::from([(0, shares.collect())])
}

fn expected(record: &JobRecord, round_passes: u32) -> Vec<u32> {
    let adaptation = record.adaptation().unwrap();
    some_shares(record)[&0].iter().map(|share| adaptation.passes(*share, round_passes)).collect()
}

pub(super) async fn passes_beyond_those_that_all_get_wait_until_they_are_shared_out(farm: Farm) {
    let job = farm.adaptive_job(Targets::default()).await;
    let tiles = job.grid.len();
    farm.work_off().await;
    assert_eq!(farm.accepted(job.id).await, vec![32; tiles as usize], "two blocks");
    let pilot = farm.pilot(&job).await.unwrap();
    let pilot_passes: Vec<u32> = job.adaptation().unwrap().pilot().collect();
    assert_eq!(pilot.len() as u32, tiles * pilot_passes.len() as u32);
    for (node, tile_and_pass) in
        pilot.iter().zip((0..tiles).flat_map(|tile| pilot_passes.iter().map(move |p| (tile, *p))))
    {
        assert_eq!((node.address.tile, node.address.passes().first), tile_and_pass);
    }
    let most = job.total_samples();
    assert!(farm.record(job.id).await.samples < most);

    farm.record_rounds(job.id, 1, 1.0).await;
    let job = farm.record(job.id).await;
    assert!(farm.store.share_out(&job, some_shares(&job)).await.unwrap());
    let removed = farm.discard_pilot(&job).await;
    let blob_ranges: BTreeSet<BlobRange> = pilot.into_iter().map(|node| node.blob_range).collect();
    assert_eq!(removed.blob_ranges.into_iter().collect::<BTreeSet<_>>(), blob_ranges);
    assert!(farm.pilot(&job).await.unwrap().is_empty());

    // What has been decided stays.
    let other = BTreeMap::from([(0, vec![Share::new(1).unwrap(); tiles as usize])]);
    assert!(!farm.store.share_out(&job, other).await.unwrap());
    let farm = farm.reopened().await;
    let job = farm.record(job.id).await;
    assert!(job.total_samples() < most);
    let tile_passes = farm.store.tile_passes(&job).await.unwrap();
    for passes in [1, 40, 64, PASSES] {
        let found: Vec<u32> = (0..tiles).map(|tile| tile_passes.at(0, tile, passes)).collect();
        assert_eq!(found, expected(&job, passes));
    }

    farm.work_off().await;
    assert_eq!(farm.accepted(job.id).await, expected(&job, PASSES));
    // Of 1, 2, 4, 8, 16, 32, 48, 64 and 80 passes.
    farm.record_rounds(job.id, 8, 1.0).await;
    let done = farm.record(job.id).await;
    assert_eq!((done.state, done.stopped_by), (JobState::Done, Some(StopReason::Samples)));
    assert_eq!(done.samples, done.total_samples());
}

pub(super) async fn a_pilot_that_is_not_whole_decides_nothing(farm: Farm) {
    let job = farm.adaptive_job(Targets::default()).await;
    farm.work_off().await;
    let too_few = BTreeMap::from([(0, vec![Share::new(1).unwrap(); job.grid.len() as usize - 1])]);
    farm.store.share_out(&job, too_few).await.unwrap_err();
    assert_eq!(farm.record(job.id).await.shared_samples, None);
    assert!(!farm.pilot(&job).await.unwrap().is_empty());
    assert!(farm.claim(farm.worker().await, 1, 0).await.is_none());
}

pub(super) async fn a_target_leaves_each_tile_what_it_has_at_its_round(farm: Farm) {
    let targets = Targets { mse: None, estimated_mse: Some(0.5) };
    let job = farm.adaptive_job(targets).await;
    farm.work_off().await;
    assert_eq!(farm.accepted(job.id).await, vec![64; job.grid.len() as usize], "four blocks, which an estimate needs");
    farm.record_rounds(job.id, 1, 1.0).await;
    farm.store.share_out(&job, some_shares(&job)).await.unwrap();
    farm.work_off().await;
    let all = farm.accepted(job.id).await;
    assert_eq!((all[0], all[1]), (PASSES, 64));
    farm.record_rounds(job.id, 6, 1.0).await;
    farm.record_rounds(job.id, 1, 0.1).await;
    let done = farm.record(job.id).await;
    assert_eq!((done.stopped_by, done.complete_passes), (Some(StopReason::EstimatedMse), 64));
    assert_eq!(farm.accepted(job.id).await, vec![64; job.grid.len() as usize]);
}

pub(super) async fn nodes_beyond_the_share_of_a_round_go_when_a_target_ends_the_job(farm: Farm) {
    let targets = Targets { mse: Some(0.5), estimated_mse: None };
    let job = farm.adaptive_job(targets).await;
    farm.work_off().await;
    farm.record_rounds(job.id, 1, 1.0).await;
    farm.store.share_out(&job, some_shares(&job)).await.unwrap();
    farm.work_off().await;
    farm.record_rounds(job.id, 5, 1.0).await;
    let record = farm.record(job.id).await;
    let point = ConvergencePoint { round: record.rounds, mse: Some(0.1), ..ConvergencePoint::default() };
    farm.store.record_round(&record, vec![point], 0).await.unwrap().unwrap();
    let done = farm.record(job.id).await;
    assert_eq!((done.stopped_by, done.complete_passes), (Some(StopReason::Mse), 48));
    let kept = farm.accepted(job.id).await;
    assert_eq!(kept, expected(&job, 48));
    assert!(kept.contains(&48) && kept.contains(&32), "{kept:?}");
}

pub(super) async fn a_job_that_ends_before_its_pilot_leaves_none_of_it(farm: Farm) {
    let job = farm.adaptive_job(Targets::default()).await;
    farm.work_off().await;
    assert_eq!(farm.discard_pilot(&job).await, Removed::default(), "it is needed");
    // Of 1, 2, 4, 8, 16 and 32 passes: nothing else is left to do.
    farm.record_rounds(job.id, 6, 1.0).await;
    farm.store.end_job(job.id, Ending::Cancelled, 0).await.unwrap();
    let kept = farm.addresses(job.id).await;
    assert_eq!(farm.store.unsettled_jobs().await.unwrap(), [job.id]);
    let removed = farm.discard_pilot(&job).await;
    assert_eq!(removed.blob_ranges.len() as u32, job.grid.len() * job.adaptation().unwrap().pilot_passes());
    assert_eq!(farm.addresses(job.id).await, kept);
    assert!(farm.pilot(&job).await.unwrap().is_empty());
    assert_eq!(farm.store.unsettled_jobs().await.unwrap(), []);
}

pub(super) async fn a_pilot_that_was_not_thrown_away_goes_when_the_job_has_ended(farm: Farm) {
    let job = farm.adaptive_job(Targets::default()).await;
    farm.work_off().await;
    farm.record_rounds(job.id, 1, 1.0).await;
    let job = farm.record(job.id).await;
    let pilot = farm.pilot(&job).await.unwrap().len();
    farm.store.share_out(&job, some_shares(&job)).await.unwrap();
    // A coordinator dies after the first portion.
    let removed = farm.store.discard_pilot(job.id, 0, 0..2).await.unwrap();
    let left = farm.pilot(&job).await.unwrap();
    assert_eq!(left.len() + removed.blob_ranges.len(), pilot);
    assert!(!removed.blob_ranges.is_empty() && left.iter().all(|node| node.address.tile >= 2));
    let farm = farm.reopened().await;
    farm.work_off().await;
    assert_eq!(farm.accepted(job.id).await, expected(&job, PASSES), "what is left is no part of the image");
    let tiles = 0..job.grid.len();
    assert_eq!(farm.store.complete_passes(job.id, 0, tiles).await.unwrap(), expected(&job, PASSES));
    farm.store.end_job(job.id, Ending::Cancelled, 0).await.unwrap();
    assert_eq!(farm.store.unsettled_jobs().await.unwrap(), [job.id]);
    assert_eq!(farm.discard_pilot(&job).await.blob_ranges.len(), left.len());
    assert_eq!(farm.accepted(job.id).await, expected(&job, PASSES));
}
