//! Jobs that end when their error is small enough.

use clerestory_api::{ContentHash, ConvergencePoint, JobState, JobSubmission, ProblemCode, StopReason};
use serde_json::json;

use crate::support::*;

/// A farm that leases all of a job at once, and the image of 16 passes in it, as a reference.
async fn farm_with_reference() -> (TestFarm, ContentHash) {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(200)).await;
    let job = farm.submit(16).await;
    farm.worker().await.drain().await;
    farm.finished(job.id).await;
    let reference = farm.client.image(job.id).await.unwrap();
    let hash = hash(&reference);
    farm.client.upload_asset(&hash, reference, |_| ()).await.unwrap();
    (farm, hash)
}

/// The rounds of a job that no target ends.
async fn rounds_of(farm: &TestFarm, submission: &JobSubmission) -> Vec<ConvergencePoint> {
    let submission = JobSubmission { target_mse: None, target_estimated_mse: None, ..submission.clone() };
    let job = farm.client.submit_job(&submission).await.unwrap();
    farm.worker().await.drain().await;
    assert_eq!(farm.finished(job.id).await.stopped_by, Some(StopReason::Samples));
    farm.client.convergence(job.id).await.unwrap().points
}

/// Submits, brings everything there is to render, newest passes first, and expects the end at a pass for a reason; then
/// the same of a coordinator that is stopped before it has looked at any round.
async fn ends_at(mut farm: TestFarm, submission: JobSubmission, passes: u32, reason: StopReason) {
    for is_restarted in [false, true] {
        let job = farm.client.submit_job(&submission).await.unwrap();
        let worker = farm.worker().await;
        let lease = worker.claim().await.unwrap();
        // Passes beyond the end are there before the first round is complete, but for one node, which comes late.
        let mut nodes = addresses(&lease);
        nodes.reverse();
        let late = nodes.remove(0);
        assert!(late.passes().first >= passes, "nothing is beyond {passes} passes: {nodes:?}");
        worker.upload(&lease, noise_partial(&lease, &nodes)).await.unwrap();
        if is_restarted {
            farm = farm.restarted().await;
        }
        let done = farm.finished(job.id).await;
        assert_eq!((done.state, done.stopped_by), (JobState::Done, Some(reason)));
        assert_eq!((done.complete_passes, done.progress), (passes, 1.0));
        let image = farm.image(job.id).await;
        assert!(bits(&image) == expected_bits(passes));
        let worker = TestWorker { client: farm.client.clone(), id: worker.id };
        let refused = worker.upload(&lease, noise_partial(&lease, &[late])).await.unwrap_err();
        assert_eq!(refused.problem().unwrap().code, ProblemCode::JobNotRunning);
        assert!(worker.claim().await.is_none());
        farm = farm.restarted().await;
        assert_eq!(farm.client.job(job.id).await.unwrap(), done);
        let image = farm.image(job.id).await;
        assert!(bits(&image) == expected_bits(passes));
        assert_eq!(image.metadata().unwrap().counters, expected_counters(passes));
        let series = farm.client.convergence(job.id).await.unwrap().points;
        assert_eq!(series.last().unwrap().passes, passes);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_ends_at_the_first_round_whose_error_against_the_reference_is_small_enough() {
    let (farm, reference) = farm_with_reference().await;
    let mut submission = submission(21);
    submission.reference = Some(reference);
    let rounds = rounds_of(&farm, &submission).await;
    let errors: Vec<f64> = rounds.iter().map(|point| point.corrected_mse.unwrap()).collect();
    assert!(errors[0] > errors[1] && errors[1] > errors[2], "{errors:?}");
    submission.target_mse = Some(errors[2]);
    ends_at(farm, submission, 4, StopReason::Mse).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_ends_by_its_own_noise_from_four_blocks_on() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(200)).await;
    let mut submission = submission(21);
    let rounds = rounds_of(&farm, &submission).await;
    // Blocks are 4 passes, so the error that 8 passes tell is there and does not count.
    submission.target_estimated_mse = Some(rounds[3].estimated_mse.unwrap().max(rounds[4].estimated_mse.unwrap()));
    ends_at(farm, submission, 16, StopReason::EstimatedMse).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_whose_target_is_far_ends_with_its_samples_and_says_how_far_it_is() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(grid().len())).await;
    let mut submission = submission(64);
    submission.target_estimated_mse = Some(1e-12);
    let job = farm.client.submit_job(&submission).await.unwrap();
    farm.worker().await.drain().await;
    let done = farm.finished(job.id).await;
    assert_eq!((done.stopped_by, done.complete_passes), (Some(StopReason::Samples), 64));
    assert_eq!(done.target_estimated_mse, Some(1e-12));
    assert!(bits(&farm.image(job.id).await) == expected_bits(64));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_target_within_the_noise_of_its_reference_is_refused() {
    let (farm, reference) = farm_with_reference().await;
    let mut submission = submission(4);
    (submission.reference, submission.target_mse) = (Some(reference), Some(1e-9));
    let refused = farm.client.submit_job(&submission).await.unwrap_err();
    let problem = refused.problem().unwrap();
    assert_eq!((problem.status, json!(problem.code)), (400, json!("invalid_field")));
    assert_eq!((problem.field.as_deref(), problem.value.as_deref()), (Some("target_mse"), Some("1e-9")));
    assert!(problem.expected.as_ref().unwrap().contains("standard error of the reference"), "{problem:?}");
}
