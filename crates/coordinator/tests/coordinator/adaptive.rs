//! Jobs whose passes are shared out among the tiles by their noise.

use clerestory_api::{JobId, JobState, JobSubmission, LeaseRequest, NodeVerdict, ProblemCode, StopReason};
use clerestory_film::adaptive::{noise, shares};
use clerestory_film::counters::Counters;
use clerestory_film::{
    Adaptation, FilmTile, FrameImage, Node, NodeAddress, NodeLayers, Rendered, TileSum, mean_squared_standard_error,
};

use crate::support::*;

const PASSES: u32 = 64;

/// Noise that is fainter in later tiles.
fn uneven_node(address: NodeAddress) -> Node {
    if let Some([left, right]) = address.children() {
        return Node::merge(uneven_node(left), &uneven_node(right)).unwrap();
    }
    let node = noise_node(address);
    let (tile, sampling) = (node.tile(), node.sampling());
    let NodeLayers { mut beauty, moment, caustic, first_hit } = node.into_layers();
    for value in beauty.as_flattened_mut() {
        *value /= (1 << address.tile.min(4)) as f32;
    }
    Node::from_layers(address, tile, sampling, NodeLayers { beauty, moment, caustic, first_hit }).unwrap()
}

fn adaptation(fewest_blocks: u32) -> Adaptation {
    Adaptation::new(sampling(), PASSES, fewest_blocks).unwrap()
}

/// Passes of each tile at a round, as the pilot decides.
fn expected_passes(adaptation: &Adaptation, round_passes: u32) -> Vec<u32> {
    let of_tile = |tile| {
        let pilot = adaptation.pilot().map(|index| uneven_node(NodeAddress { frame: 0, tile, level: 0, index }));
        noise(&pilot.collect::<Vec<_>>())
    };
    let noise: Vec<f64> = (0..grid().len()).map(of_tile).collect();
    shares(&grid(), &noise).into_iter().map(|share| adaptation.passes(share, round_passes)).collect()
}

/// The sums that one process makes of these passes of each tile.
fn expected_sums(tile_passes: &[u32]) -> Vec<TileSum> {
    let of_tile = |(tile, &passes): (u32, &u32)| {
        let mut film = FilmTile::new(0, tile, grid().tile(tile).unwrap(), sampling());
        for index in 0..passes {
            film.insert(uneven_node(NodeAddress { frame: 0, tile, level: 0, index })).unwrap();
        }
        film.sum(passes).unwrap()
    };
    (0..).zip(tile_passes).map(of_tile).collect()
}

fn counters_of(tile_passes: &[u32]) -> Counters {
    let mut counters = Counters::default();
    for (tile, passes) in (0..).zip(tile_passes) {
        (0..*passes).for_each(|index| counters += noise_counters(NodeAddress { frame: 0, tile, level: 0, index }));
    }
    counters
}

fn is_image_of(image: &FrameImage, tile_passes: &[u32]) {
    let metadata = image.metadata().unwrap();
    assert_eq!(metadata.tile_passes, tile_passes);
    assert_eq!(metadata.counters, counters_of(tile_passes));
    let expected = FrameImage::assemble(&grid(), &expected_sums(tile_passes), metadata.clone()).unwrap();
    assert!(bits(image) == bits(&expected));
    assert_eq!(image.layers(), expected.layers());
}

fn adaptive(passes: u32) -> JobSubmission {
    JobSubmission { adaptive: true, ..submission(passes) }
}

/// Brings what there is to render until the job has ended, newest nodes first; with a coordinator that is stopped after
/// each upload, before it has looked at any round, or not.
async fn work_off(mut farm: TestFarm, job: JobId, is_restarted: bool) -> TestFarm {
    let worker = farm.worker().await.id;
    while !farm.client.job(job).await.unwrap().state.is_final() {
        let worker = TestWorker { client: farm.client.clone(), id: worker };
        let request = LeaseRequest { wait_ms: 200, ..worker.request() };
        let Some(lease) = farm.client.claim_lease(&request).await.unwrap() else { continue };
        let rendered = |node: &NodeAddress| Rendered { node: uneven_node(*node), counters: noise_counters(*node) };
        let nodes: Vec<Rendered> = addresses(&lease).iter().rev().map(rendered).collect();
        let answer = worker.upload(&lease, partial_of(&lease, &nodes)).await.unwrap();
        assert!(answer.nodes.iter().all(|node| node.verdict == NodeVerdict::Accepted));
        if is_restarted {
            farm = farm.restarted().await;
        }
    }
    farm
}

#[tokio::test(flavor = "multi_thread")]
async fn tiles_get_passes_in_proportion_to_their_noise() {
    let tile_passes = expected_passes(&adaptation(2), PASSES);
    assert!(tile_passes[0] == PASSES && tile_passes.iter().any(|passes| *passes < PASSES / 2), "{tile_passes:?}");
    for is_restarted in [false, true] {
        let farm = TestFarm::start_with(|config| config.lease_nodes = Some(20)).await;
        let job = farm.client.submit_job(&adaptive(PASSES)).await.unwrap();
        assert!(job.adaptive);
        let farm = work_off(farm, job.id, is_restarted).await;
        let done = farm.client.job(job.id).await.unwrap();
        assert_eq!((done.state, done.stopped_by, done.progress), (JobState::Done, Some(StopReason::Samples), 1.0));
        is_image_of(&farm.image(job.id).await, &tile_passes);
        // The work on the pilot is done, and is in no image.
        let pilot = u64::from(adaptation(2).pilot_passes() * SAMPLES_PER_PASS * WIDTH * HEIGHT);
        assert_eq!(done.samples, counters_of(&tile_passes).samples + pilot);
        assert_eq!(done.counters.samples, done.samples);
        let points = farm.client.convergence(job.id).await.unwrap().points;
        assert_eq!(points.iter().map(|point| point.passes).collect::<Vec<_>>(), [1, 2, 4, 8, 16, 32, 48, 64]);
        let estimated = mean_squared_standard_error(&farm.image(job.id).await);
        assert_eq!(points.last().unwrap().estimated_mse, estimated);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_target_ends_an_adaptive_job_at_a_round_of_its_shares() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(200)).await;
    let job = farm.client.submit_job(&adaptive(PASSES)).await.unwrap();
    let farm = work_off(farm, job.id, false).await;
    // With a target, every pixel gets the four blocks from which an estimate counts.
    let expected = expected_passes(&adaptation(4), 32);
    assert!(expected.contains(&32) && expected.contains(&16), "{expected:?}");
    let metadata = farm.image(job.id).await.metadata().unwrap().clone();
    let image = FrameImage::assemble(&grid(), &expected_sums(&expected), metadata).unwrap();
    let target_estimated_mse = mean_squared_standard_error(&image);
    let job = farm.client.submit_job(&JobSubmission { target_estimated_mse, ..adaptive(PASSES) }).await.unwrap();
    let farm = work_off(farm, job.id, true).await;
    let done = farm.client.job(job.id).await.unwrap();
    assert_eq!((done.stopped_by, done.complete_passes), (Some(StopReason::EstimatedMse), 32));
    is_image_of(&farm.image(job.id).await, &expected);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_adaptive_job_that_is_cancelled_early_keeps_its_image_and_nothing_of_its_pilot() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(200)).await;
    let job = farm.client.submit_job(&adaptive(PASSES)).await.unwrap();
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    let pilot: Vec<u32> = adaptation(2).pilot().collect();
    let (pilot, image): (Vec<NodeAddress>, Vec<NodeAddress>) =
        addresses(&lease).iter().partition(|node| pilot.contains(&node.passes().first));
    let first: Vec<NodeAddress> = image.into_iter().filter(|node| node.passes().first == 0).collect();
    // A pass of the pilot is missing.
    for nodes in [&pilot[1..], &first] {
        let rendered = |node: &NodeAddress| Rendered { node: uneven_node(*node), counters: noise_counters(*node) };
        let nodes: Vec<Rendered> = nodes.iter().map(rendered).collect();
        worker.upload(&lease, partial_of(&lease, &nodes)).await.unwrap();
    }
    let blobs = farm.node_blobs();
    farm.client.cancel_job(job.id).await.unwrap();
    assert_eq!(farm.finished(job.id).await.state, JobState::Cancelled);
    is_image_of(&farm.image(job.id).await, &vec![1; grid().len() as usize]);
    while farm.node_blobs() >= blobs {
        tokio::task::yield_now().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn samples_that_leave_nothing_to_share_out_are_refused() {
    let farm = TestFarm::start().await;
    for (passes, target, fewest) in [(8, None, "at least 33"), (16, Some(1e-9), "at least 65")] {
        let submission = JobSubmission { target_estimated_mse: target, ..adaptive(passes) };
        let refused = farm.client.submit_job(&submission).await.unwrap_err();
        let problem = refused.problem().unwrap();
        assert_eq!(problem.code, ProblemCode::InvalidField);
        assert_eq!(problem.field.as_deref(), Some("samples_per_pixel"));
        assert_eq!(problem.value, Some((passes * SAMPLES_PER_PASS).to_string()));
        assert!(problem.expected.as_ref().unwrap().contains(fewest), "{problem:?}");
        farm.client
            .submit_job(&JobSubmission { samples_per_pixel: passes * SAMPLES_PER_PASS + 1, ..submission })
            .await
            .unwrap();
    }
}
