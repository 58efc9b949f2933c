//! Images that are never whole in memory: in strips of a few rows, with no node kept, they are the same as ever.

use std::sync::Arc;
use std::time::Duration;

use clerestory_api::{JobId, JobSubmission, PreviewQuery, ProblemCode};
use clerestory_coordinator::{Clock, Config};
use clerestory_film::{
    Exposure, FrameImage, Node, NodeAddress, NodeLayers, PreviewSettings, Rendered, ToneCurve, compare, encode_png,
    mean_flip, mean_squared_standard_error,
};

use crate::support::{
    HEIGHT, TestFarm, WIDTH, addresses, bits, expected_bits, expected_counters, grid, hash, noise_counters, noise_node,
    noise_partial, partial_of, submission,
};

/// Memory for the fewest rows at a time, 16 of 20, and for no node.
fn no_memory(config: &mut Config) {
    (config.image_bytes, config.node_cache_bytes) = (64 << 10, 0);
}

fn expected_preview(image: &FrameImage) -> Vec<u8> {
    encode_png(image, &PreviewSettings { exposure: Exposure::Automatic, curve: ToneCurve::Filmic }).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frame_in_strips_has_the_bits_and_the_errors_of_a_whole_one() {
    let farm = TestFarm::start_with(no_memory).await;
    let [first, second] = farm.against_a_reference(5, 13).await;

    let (image, reference) = (farm.image(second.id).await, farm.image(first.id).await);
    assert!(bits(&image) == expected_bits(13));
    assert_eq!(image.metadata().unwrap().counters, expected_counters(13));
    assert_eq!(image.metadata().unwrap().tile_passes, vec![13; grid().len() as usize]);
    let series = farm.client.convergence(second.id).await.unwrap();
    let last = series.points.last().unwrap();
    // To the last bit: both sum in the order of the tiles.
    let metrics = compare(&image, &reference).unwrap();
    assert_eq!(
        (last.mse, last.corrected_mse, last.rel_mse, last.psnr),
        (Some(metrics.mse), metrics.corrected_mse, metrics.rel_mse, metrics.psnr)
    );
    assert_eq!(last.flip, Some(mean_flip(&image, &reference, ToneCurve::Filmic).unwrap()));
    assert_eq!(last.estimated_mse, mean_squared_standard_error(&image));
}

async fn preview(farm: &TestFarm, job: JobId) -> (Vec<u8>, u64) {
    let preview = farm.client.preview(job, &PreviewQuery::default()).await.unwrap();
    (preview.png.to_vec(), preview.accepted_nodes)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_preview_follows_the_film_and_says_how_far() {
    let clock = Clock::Manual(Arc::default());
    let farm = TestFarm::start_with(|config| {
        config.clock = clock.clone();
        config.lease_nodes = Some(grid().len());
    })
    .await;
    let job = farm.submit(3).await;
    let worker = farm.worker().await;
    let mut accepted = 0;
    while let Some(lease) = worker.claim().await {
        for node in addresses(&lease) {
            worker.upload(&lease, noise_partial(&lease, &[node])).await.unwrap();
            accepted += 1;
            clock.advance(250);
            let (png, shown) = preview(&farm, job.id).await;
            assert_eq!(shown, accepted);
            assert!(png == expected_preview(&farm.image(job.id).await), "after {accepted} nodes");
        }
    }
    let done = farm.finished(job.id).await;
    let (png, shown) = preview(&farm, job.id).await;
    assert!(png == expected_preview(&farm.image(job.id).await));
    assert_eq!(shown, accepted, "{done:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_preview_stays_for_a_quarter_of_a_second_however_many_look() {
    let clock = Clock::Manual(Arc::default());
    let farm = TestFarm::start_with(|config| {
        config.clock = clock.clone();
        config.lease_nodes = Some(grid().len());
    })
    .await;
    let job = farm.submit(2).await;
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    let nodes = addresses(&lease);
    worker.upload(&lease, noise_partial(&lease, &nodes[..1])).await.unwrap();
    let first = preview(&farm, job.id).await;
    worker.upload(&lease, noise_partial(&lease, &nodes[1..2])).await.unwrap();
    clock.advance(249);
    assert!(preview(&farm, job.id).await == first);
    clock.advance(1);
    let second = preview(&farm, job.id).await;
    assert!(second.0 != first.0 && (first.1, second.1) == (1, 2));
}

/// Noise, some of which is four times as bright.
fn wrong_node(address: &NodeAddress) -> Rendered {
    let node = noise_node(*address);
    let (tile, sampling) = (node.tile(), node.sampling());
    let NodeLayers { mut beauty, moment, caustic, first_hit } = node.into_layers();
    for value in beauty.as_flattened_mut().iter_mut().step_by(7) {
        *value *= 4.0;
    }
    let node = Node::from_layers(*address, tile, sampling, NodeLayers { beauty, moment, caustic, first_hit }).unwrap();
    Rendered { node, counters: noise_counters(*address) }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_shown_of_wrong_nodes_is_not_shown_of_those_that_took_their_place() {
    let clock = Clock::Manual(Arc::default());
    let farm = TestFarm::start_with(|config| {
        config.clock = clock.clone();
        config.lease_nodes = Some(grid().len());
        config.checked_fraction = 1.0;
    })
    .await;
    let [reference, _] = farm.against_a_reference(2, 1).await;
    let reference = Some(hash(&farm.client.image(reference.id).await.unwrap()));
    let job = farm.client.submit_job(&JobSubmission { reference, ..submission(1) }).await.unwrap();
    let (wrong, right) = (farm.worker_named("wrong").await, farm.worker_named("right").await);
    let third = farm.worker_named("third").await;
    let lease = wrong.claim().await.unwrap();
    let nodes: Vec<Rendered> = addresses(&lease).iter().map(wrong_node).collect();
    wrong.upload(&lease, partial_of(&lease, &nodes)).await.unwrap();
    let shown = preview(&farm, job.id).await;
    assert!(shown.0 == expected_preview(&farm.image(job.id).await));
    let live = farm.client.live(job.id).await.unwrap();

    for worker in [&right, &third] {
        let lease = worker.claim().await.unwrap();
        worker.upload(&lease, noise_partial(&lease, &addresses(&lease))).await.unwrap();
    }
    assert!(farm.client.job(job.id).await.unwrap().redone_nodes > 0);
    // Nobody looks before all tiles have as many passes as before.
    right.drain().await;
    third.drain().await;
    farm.finished(job.id).await;
    clock.advance(1000);
    let image = farm.image(job.id).await;
    assert!(bits(&image) == expected_bits(1));
    let now = preview(&farm, job.id).await;
    assert!(now.0 == expected_preview(&image) && now.0 != shown.0);
    let last = farm.client.convergence(job.id).await.unwrap().points.pop().unwrap();
    let live_now = farm.client.live(job.id).await.unwrap();
    assert!(live_now.mse == last.mse && live_now.mse != live.mse, "{live_now:?} after {live:?}, {last:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_node_that_is_lost_is_shown_no_more() {
    let farm = TestFarm::start_with(|config| {
        config.lease_nodes = Some(grid().len());
        config.node_cache_bytes = 0;
    })
    .await;
    let job = farm.submit(2).await;
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    worker.upload(&lease, noise_partial(&lease, &addresses(&lease)[..1])).await.unwrap();
    std::fs::remove_dir_all(farm.directory.path().join("blobs/nodes")).unwrap();
    let of_preview = farm.client.preview(job.id, &PreviewQuery::default()).await.unwrap_err();
    let of_image = farm.client.image(job.id).await.unwrap_err();
    for failure in [of_preview, of_image] {
        assert_eq!(failure.problem().unwrap().code, ProblemCode::NoImageYet, "{failure:?}");
    }
    assert_eq!(farm.client.live(job.id).await.unwrap().covered, 0.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frame_that_is_too_large_for_its_preview_is_shown_smaller() {
    // 12 bytes for each pixel: half of the pixels each way.
    let pixels = u64::from(WIDTH.div_ceil(2) * HEIGHT.div_ceil(2));
    let farm = TestFarm::start_with(|config| config.preview_bytes = pixels * 12).await;
    let (first, second) = (farm.submit(1).await, farm.submit(1).await);
    farm.worker().await.drain().await;
    for job in [first, second] {
        farm.finished(job.id).await;
        let (png, _) = preview(&farm, job.id).await;
        // Width and height are the first numbers of a PNG.
        let number = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
        assert_eq!((number(16), number(20)), (WIDTH.div_ceil(2), HEIGHT.div_ceil(2)));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn previews_of_two_jobs_come_although_there_is_memory_for_one() {
    let farm = TestFarm::start_with(|config| config.preview_bytes = u64::from(WIDTH * HEIGHT) * 12).await;
    let (first, second) = (farm.submit(3).await, farm.submit(3).await);
    farm.worker().await.drain().await;
    farm.finished(first.id).await;
    farm.finished(second.id).await;
    let looks = async {
        for _ in 0..50 {
            tokio::join!(preview(&farm, first.id), preview(&farm, second.id));
        }
    };
    tokio::time::timeout(Duration::from_secs(60), looks).await.expect("nobody waits for ever");
}
