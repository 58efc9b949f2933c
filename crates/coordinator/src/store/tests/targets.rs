//! Errors as they are stored, and jobs that they end.

use std::collections::BTreeSet;

use clerestory_api::{ConvergencePoint, JobId, JobState, StopReason};
use clerestory_film::Targets;

use crate::model::{BlobRange, Ending, Grant, NewJob, RecordedRound, Removed};
use crate::store::errors::LeaseError;
use crate::store::tests::Farm;

impl Farm {
    /// A job of 3 passes that a measured error of 1e-3 ends, all of which is delivered but for the last tile of the
    /// last pass.
    async fn job_with_target(&self) -> (JobId, Grant) {
        let targets = Targets { mse: Some(1e-3), estimated_mse: None };
        let job = self.job_like(|job| NewJob { passes: 3, targets, ..job }).await;
        let grant = self.claim(self.worker().await, 256, 0).await.unwrap();
        self.deliver(&grant, &grant.nodes[..grant.nodes.len() - 1], 100).await.unwrap();
        (job, grant)
    }

    /// Records the next round with an error of the only frame.
    async fn record_error(&self, job: JobId, mse: f64) -> Option<RecordedRound> {
        let record = self.store.job(job).await.unwrap().unwrap();
        let round = record.rounds;
        let point = ConvergencePoint { round, passes: round + 1, mse: Some(mse), ..ConvergencePoint::default() };
        self.store.record_round(&record, vec![point], 200).await.unwrap()
    }
}

pub(super) async fn errors_and_targets_that_were_absent_at_first_are_stored_later(farm: Farm) {
    farm.job(1).await;
    let (job, _) = farm.job_with_target().await;
    let exact = 0.1 + 0.2;
    let known = ConvergencePoint {
        mse: Some(exact),
        corrected_mse: Some(-exact),
        rel_mse: Some(1e-300),
        psnr: Some(exact),
        flip: Some(exact),
        estimated_mse: Some(1e300),
        ..ConvergencePoint::default()
    };
    for (round, point) in (0..).zip([ConvergencePoint::default(), known]) {
        let point = ConvergencePoint { round, ..point };
        let record = farm.store.job(job).await.unwrap().unwrap();
        farm.store.record_round(&record, vec![point.clone()], 0).await.unwrap().unwrap();
        assert_eq!(farm.store.convergence_point(job, 0, round).await.unwrap(), Some(point));
    }
    assert_eq!(farm.store.job(job).await.unwrap().unwrap().targets.mse, Some(1e-3));
}

pub(super) async fn a_round_that_reaches_a_target_ends_the_job_and_what_lies_beyond_it_goes(farm: Farm) {
    let (job, grant) = farm.job_with_target().await;
    assert_eq!(farm.record_error(job, 2e-3).await, Some(RecordedRound::default()));
    assert_eq!(farm.state(job).await, JobState::Running);
    let beyond: BTreeSet<BlobRange> = farm
        .store
        .nodes(job, 0, 0..u32::MAX, u32::MAX)
        .await
        .unwrap()
        .into_iter()
        .filter(|node| node.address.index >= 2)
        .map(|node| node.blob_range)
        .collect();
    let recorded = farm.record_error(job, 1e-3).await.unwrap();
    assert_eq!(recorded.stopped_by, Some(StopReason::Mse));
    assert!(!beyond.is_empty());
    assert_eq!(recorded.discarded.blob_ranges.into_iter().collect::<BTreeSet<_>>(), beyond);
    assert_eq!(recorded.discarded.blobs.len(), beyond.len());

    let farm = farm.reopened().await;
    let record = farm.store.job(job).await.unwrap().unwrap();
    assert_eq!((record.state, record.stopped_by, record.complete_passes), (JobState::Done, Some(StopReason::Mse), 2));
    assert_eq!(record.targets, Targets { mse: Some(1e-3), estimated_mse: None });
    assert!(farm.addresses(job).await.iter().all(|node| node.passes().first < 2));
    let late = farm.deliver(&grant, &grant.nodes, 300).await;
    assert!(matches!(late, Err(LeaseError::JobNotRunning)), "{late:?}");
    assert_eq!(farm.addresses(job).await.len() as u32, 2 * record.grid.len());
    assert_eq!(farm.next_complete_round(job).await, None, "no round follows");
    assert!(farm.claim(farm.worker().await, 1, 300).await.is_none());
}

pub(super) async fn a_target_that_is_not_reached_leaves_the_last_round_to_end_the_job(farm: Farm) {
    let (job, grant) = farm.job_with_target().await;
    farm.deliver(&grant, &grant.nodes[grant.nodes.len() - 1..], 100).await.unwrap();
    for _ in 0..2 {
        assert_eq!(farm.record_error(job, 2e-3).await, Some(RecordedRound::default()));
    }
    let last = RecordedRound { stopped_by: Some(StopReason::Samples), discarded: Removed::default() };
    assert_eq!(farm.record_error(job, 2e-3).await, Some(last));
    assert_eq!(farm.store.job(job).await.unwrap().unwrap().stopped_by, Some(StopReason::Samples));
}

pub(super) async fn a_target_that_is_reached_after_the_end_changes_nothing(farm: Farm) {
    let (job, _) = farm.job_with_target().await;
    farm.store.end_job(job, Ending::Cancelled, 150).await.unwrap();
    let before = farm.addresses(job).await;
    assert_eq!(farm.record_error(job, 1e-4).await, Some(RecordedRound::default()));
    let record = farm.store.job(job).await.unwrap().unwrap();
    assert_eq!((record.state, record.stopped_by, record.rounds), (JobState::Cancelled, None, 1));
    assert_eq!(farm.addresses(job).await, before);
}

pub(super) async fn the_time_of_earlier_rounds_counts_in_later_ones(farm: Farm) {
    let job = farm.job(3).await;
    let grant = farm.claim(farm.worker().await, 256, 0).await.unwrap();
    for (round, now_ms, completed_ms) in [(0, 100, 100), (1, 200, 200), (2, 150, 200)] {
        assert_eq!(farm.next_complete_round(job).await, None, "round {round} is missing");
        let nodes: Vec<_> = grant.nodes.iter().filter(|node| node.passes().first == round).copied().collect();
        farm.deliver(&grant, &nodes, now_ms).await.unwrap();
        let (complete, record) = (farm.next_complete_round(job).await.unwrap(), farm.record(job).await);
        assert_eq!((complete.round, complete.core_ms, complete.completed_ms), (round, record.core_ms, completed_ms));
        let (core_ms, wall_ms) = (complete.core_ms, complete.completed_ms);
        let point = ConvergencePoint { round, core_ms, wall_ms, ..ConvergencePoint::default() };
        farm.store.record_round(&record, vec![point], now_ms).await.unwrap().unwrap();
    }
}
