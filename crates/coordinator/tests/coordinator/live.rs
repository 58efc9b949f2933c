//! The error between rounds: of what is there now, and of how much.

use std::sync::Arc;

use clerestory_api::JobSubmission;
use clerestory_coordinator::Clock;
use clerestory_film::FrameImage;

use crate::support::*;

#[tokio::test(flavor = "multi_thread")]
async fn where_all_tiles_are_at_a_round_it_is_the_error_of_the_round() {
    // In one piece, and with memory for no node.
    for node_cache_bytes in [64 << 20, 0] {
        let farm = TestFarm::start_with(|config| config.node_cache_bytes = node_cache_bytes).await;
        let [first, second] = farm.against_a_reference(5, 13).await;
        let live = farm.client.live(second.id).await.unwrap();
        let last = farm.client.convergence(second.id).await.unwrap().points.pop().unwrap();
        assert!(last.mse.is_some() && last.estimated_mse.is_some());
        // To the last bit.
        assert_eq!((live.mse, live.estimated_mse), (last.mse, last.estimated_mse));
        assert_eq!((live.job, live.covered, live.samples_per_pixel), (second.id, 1.0, 52.0));
        let live = farm.client.live(first.id).await.unwrap();
        assert_eq!((live.mse, live.estimated_mse), (None, None), "no reference, and one block");
        assert_eq!((live.covered, live.samples_per_pixel), (1.0, 20.0));
        let error = farm.client.live(uuid::Uuid::now_v7().into()).await.unwrap_err();
        assert_eq!(error.problem().unwrap().code, clerestory_api::ProblemCode::UnknownJob);
    }
}

/// Pixels of an image that have passes, and their mean squared error.
fn expected(image: &FrameImage, reference: &FrameImage) -> (usize, f64) {
    let (mut pixels, mut squares) = (0, 0.0);
    for (index, passes) in (0..).zip(&image.metadata().unwrap().tile_passes) {
        let tile = grid().tile(index).unwrap();
        for pixel in (0..tile.pixels()).filter(|_| *passes > 0) {
            let (x, y) = tile.pixel(pixel);
            let at = (y * WIDTH + x) as usize;
            for (x, r) in image.layers().mean[at].iter().zip(reference.layers().mean[at]) {
                squares += (f64::from(*x) - f64::from(r)).powi(2);
            }
            pixels += 1;
        }
    }
    (pixels, squares / (3 * pixels) as f64)
}

#[tokio::test(flavor = "multi_thread")]
async fn between_rounds_it_is_over_the_pixels_that_have_samples_and_stays_for_a_second() {
    let clock = Clock::Manual(Arc::default());
    let farm = TestFarm::start_with(|config| {
        config.clock = clock.clone();
        config.lease_nodes = Some(grid().len());
    })
    .await;
    let [first, _] = farm.against_a_reference(5, 1).await;
    let reference = farm.image(first.id).await;
    let hash = hash(&farm.client.image(first.id).await.unwrap());
    let job = farm.client.submit_job(&JobSubmission { reference: Some(hash), ..submission(2) }).await.unwrap();
    let live = farm.client.live(job.id).await.unwrap();
    assert_eq!((live.covered, live.samples_per_pixel, live.mse, live.estimated_mse), (0.0, 0.0, None, None));

    let all = f64::from(WIDTH * HEIGHT);
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    let nodes = addresses(&lease);
    worker.upload(&lease, noise_partial(&lease, &nodes[..2])).await.unwrap();
    clock.advance(999);
    assert_eq!(farm.client.live(job.id).await.unwrap(), live, "it is measured once a second");
    clock.advance(1);
    let live = farm.client.live(job.id).await.unwrap();
    let (pixels, mse) = expected(&farm.image(job.id).await, &reference);
    assert_eq!((live.covered, live.samples_per_pixel), (pixels as f64 / all, f64::from(SAMPLES_PER_PASS)));
    assert!((live.mse.unwrap() / mse - 1.0).abs() < 1e-12, "{live:?} is not {mse}");

    worker.upload(&lease, noise_partial(&lease, &nodes[2..])).await.unwrap();
    let lease = worker.claim().await.unwrap();
    let node = addresses(&lease)[0];
    assert_eq!(node.passes().first, 1);
    worker.upload(&lease, noise_partial(&lease, &[node])).await.unwrap();
    clock.advance(1000);
    let live = farm.client.live(job.id).await.unwrap();
    let twice = grid().tile(node.tile).unwrap().pixels() as f64;
    let (_, mse) = expected(&farm.image(job.id).await, &reference);
    assert_eq!((live.covered, live.estimated_mse), (1.0, None));
    let samples = f64::from(SAMPLES_PER_PASS) * (all + twice) / all;
    assert!((live.samples_per_pixel / samples - 1.0).abs() < 1e-12, "{live:?} is not of {samples} samples");
    assert!((live.mse.unwrap() / mse - 1.0).abs() < 1e-12, "{live:?} is not {mse}");
    let points = farm.client.convergence(job.id).await.unwrap().points;
    assert!(points.iter().all(|point| point.passes == 1 && point.mse != live.mse), "it is in no series: {points:?}");
}
