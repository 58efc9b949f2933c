//! Partials that come in pieces, and what workers say of themselves while they bring nothing.

use bytes::Bytes;
use clerestory_api::{
    ClientError, ContentHash, JobState, Lease, NodeVerdict, PartialPieces, Problem, ProblemCode, SceneBuilding,
    WorkerActivity,
};

use crate::support::*;

#[track_caller]
fn problem<T: std::fmt::Debug>(answer: Result<T, ClientError>) -> Problem {
    let failure = answer.unwrap_err();
    failure.problem().unwrap_or_else(|| panic!("{failure}")).clone()
}

/// A partial of all nodes of a lease, in pieces of at most `bytes` with their hashes.
fn pieces(lease: &Lease, bytes: usize) -> Vec<(ContentHash, Bytes)> {
    let file = noise_partial(lease, &addresses(lease));
    file.chunks(bytes).map(|piece| (hash(piece), Bytes::copy_from_slice(piece))).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_partial_in_pieces_makes_the_same_image_as_one_that_comes_whole() {
    let farm = TestFarm::start().await;
    let job = farm.submit(4).await;
    let worker = farm.worker().await;
    while let Some(lease) = worker.claim().await {
        let pieces = pieces(&lease, 300);
        assert!(pieces.len() > 2);
        for (hash, piece) in &pieces {
            farm.client.upload_piece(lease.id, lease.token, hash, piece.clone()).await.unwrap();
        }
        let named = pieces.iter().map(|(hash, _)| *hash).collect();
        let partial = PartialPieces { token: lease.token, core_ms: 50, pieces: named };
        let answer = farm.client.assemble_partial(lease.id, &partial).await.unwrap();
        assert!(answer.nodes.iter().all(|node| node.verdict == NodeVerdict::Accepted));
        assert_eq!((answer.nodes.len(), answer.outstanding), (lease.nodes.len(), 0));
        assert_eq!(farm.blobs_in("pieces"), 0, "pieces that have been put together are not kept");
    }
    assert_eq!(farm.finished(job.id).await.state, JobState::Done);
    assert_eq!(bits(&farm.image(job.id).await), expected_bits(4));
}

#[tokio::test(flavor = "multi_thread")]
async fn pieces_are_refused_that_are_missing_damaged_or_of_no_lease_and_left_over_ones_go() {
    let farm = TestFarm::start().await;
    farm.submit(4).await;
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    let pieces = pieces(&lease, 1000);
    let (first, piece) = pieces[0].clone();
    let client = &farm.client;
    let named: Vec<ContentHash> = pieces.iter().map(|(hash, _)| *hash).collect();
    let partial = PartialPieces { token: lease.token, core_ms: 50, pieces: named };

    let refused = problem(client.upload_piece(lease.id, lease.token, &first, pieces[1].1.clone()).await);
    assert_eq!((refused.code, refused.field.as_deref()), (ProblemCode::HashMismatch, Some("hash")));
    let refused = problem(client.upload_piece(lease.id, lease.token + 1, &first, piece.clone()).await);
    assert_eq!(refused.code, ProblemCode::StaleToken);
    assert_eq!(farm.blobs_in("pieces"), 0);

    client.upload_piece(lease.id, lease.token, &first, piece).await.unwrap();
    let refused = problem(client.assemble_partial(lease.id, &partial).await);
    assert_eq!(refused.code, ProblemCode::MissingPieces);
    assert_eq!(refused.missing.len(), pieces.len() - 1);
    let nothing = PartialPieces { pieces: Vec::new(), ..partial.clone() };
    let refused = problem(client.assemble_partial(lease.id, &nothing).await);
    assert_eq!((refused.code, refused.field.as_deref()), (ProblemCode::InvalidField, Some("pieces")));
    let stale = PartialPieces { token: lease.token + 1, ..partial.clone() };
    assert_eq!(problem(client.assemble_partial(lease.id, &stale).await).code, ProblemCode::StaleToken);

    // What a crash leaves is removed when the coordinator starts, and the worker is told to send it again.
    let farm = farm.restarted().await;
    let refused = problem(farm.client.assemble_partial(lease.id, &partial).await);
    assert_eq!((refused.code, refused.missing.len()), (ProblemCode::MissingPieces, pieces.len()));
    assert_eq!(farm.blobs_in("pieces"), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn all_pieces_together_are_no_larger_than_a_partial_may_be() {
    let farm = TestFarm::start_with(|config| config.max_partial_bytes = 1500).await;
    farm.submit(4).await;
    let lease = farm.worker().await.claim().await.unwrap();
    let pieces = pieces(&lease, 1000);
    for (hash, piece) in &pieces[..2] {
        farm.client.upload_piece(lease.id, lease.token, hash, piece.clone()).await.unwrap();
    }
    let named = pieces[..2].iter().map(|(hash, _)| *hash).collect();
    let partial = PartialPieces { token: lease.token, core_ms: 50, pieces: named };
    let refused = problem(farm.client.assemble_partial(lease.id, &partial).await);
    assert_eq!((refused.code, refused.expected.as_deref()), (ProblemCode::BodyTooLarge, Some("at most 1500 bytes")));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_builds_a_scene_is_shown_with_its_job_until_it_has_built_it() {
    let farm = TestFarm::start().await;
    let job = farm.submit(4).await;
    let worker = farm.worker().await;
    let shown = async || {
        let workers = farm.client.workers().await.unwrap();
        (workers[0].building, farm.client.job(job.id).await.unwrap().building_workers)
    };
    assert_eq!(shown().await, (None, 0));
    let building = SceneBuilding { job: job.id, for_ms: 41_000 };
    let activity = WorkerActivity { building: Some(building) };
    farm.client.heartbeat(worker.id, &activity).await.unwrap();
    assert_eq!(shown().await, (Some(building), 1));
    // A worker of an older build sends no body.
    let address = format!("{}/api/v1/workers/{}/heartbeat", farm.address, worker.id);
    assert_eq!(reqwest::Client::new().post(address).send().await.unwrap().status(), 204);
    assert_eq!(shown().await, (None, 0));
}
