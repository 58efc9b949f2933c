//! A whole coordinator, over HTTP, with workers that upload noise: what comes out must be what went in.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use crate::support::*;
use clerestory_api::{
    EventBody, JobState, LeaseRequest, LeaseReturn, NodeVerdict, PreviewExposure, PreviewQuery, ProblemCode, ToneCurve,
};
use clerestory_coordinator::{Clock, Config, RunError, run};
use clerestory_film::{Exposure, PreviewSettings, Rendered, encode_png};
use futures::{StreamExt, stream};
use serde_json::json;
use tokio::io::AsyncWriteExt;
use tokio::net::{TcpListener, TcpStream};

#[tokio::test(flavor = "multi_thread")]
async fn the_image_has_the_bits_of_a_single_process_however_the_work_is_cut() {
    // 21 passes are no power of two; rounds end at 1, 2, 4, 8, 16 and 21.
    let expected = expected_bits(21);
    for lease_nodes in [None, Some(1), Some(7), Some(200)] {
        let farm = TestFarm::start_with(|config| config.lease_nodes = lease_nodes).await;
        let job = farm.submit(21).await;
        let (first, second) = (farm.worker().await, farm.worker().await);
        tokio::join!(first.drain(), second.drain());
        let done = farm.finished(job.id).await;
        assert_eq!((done.state, done.rounds, done.complete_passes), (JobState::Done, 6, 21));
        assert_eq!(done.progress, 1.0);
        let image = farm.image(job.id).await;
        assert!(bits(&image) == expected, "leases of {lease_nodes:?} nodes changed the image");
        let metadata = image.metadata().unwrap();
        assert_eq!(metadata.tile_passes, vec![21; grid().len() as usize]);
        assert_eq!(metadata.scene_hash, job.scene_hash);
        assert_eq!(metadata.counters, expected_counters(21));
        assert_eq!(json!(done.counters), json!(metadata.counters));
        assert_eq!(metadata.worker_builds, ["test"]);
        farm.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn who_watches_many_workers_is_sent_each_and_not_everything_again() {
    const WORKERS: usize = 1000;
    let farm = TestFarm::start().await;
    let names: Vec<String> = (0..WORKERS).map(|worker| format!("worker {worker}")).collect();
    stream::iter(&names).for_each_concurrent(50, async |name| drop(farm.worker_named(name).await)).await;
    let mut events = farm.client.events(None, None).await.unwrap();
    let EventBody::Snapshot { workers, .. } = events.next().await.unwrap().unwrap().body else { panic!("a snapshot") };
    assert_eq!(workers.len(), WORKERS);
    let last = farm.worker_named("last").await;
    let mut told = BTreeSet::new();
    loop {
        match events.next().await.unwrap().unwrap().body {
            EventBody::Worker { worker } => told.insert(worker.id),
            other => panic!("nothing else has changed: {other:?}"),
        };
        if told.contains(&last.id) && told.len() == WORKERS + 1 {
            break;
        }
    }
    farm.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn merged_children_are_removed() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(3)).await;
    let job = farm.submit(21).await;
    farm.worker().await.drain().await;
    farm.finished(job.id).await;
    // The merge of the last round may still run: a stopped coordinator has finished it.
    let farm = farm.restarted().await;
    // 21 passes are the nodes 16 + 4 + 1 in each tile. Nodes that were merged together share a blob.
    let blobs = farm.node_blobs();
    assert!(blobs <= 3 * grid().len() as usize, "{blobs} blobs of nodes");
    assert!(bits(&farm.image(job.id).await) == expected_bits(21));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restart_in_the_middle_of_a_job_loses_nothing() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(5)).await;
    let job = farm.submit(9).await;
    let worker = farm.worker().await;
    for _ in 0..4 {
        let lease = worker.claim().await.unwrap();
        worker.upload(&lease, noise_partial(&lease, &addresses(&lease))).await.unwrap();
    }
    let held = worker.claim().await.unwrap();
    let nodes = addresses(&held);
    worker.upload(&held, noise_partial(&held, &nodes[..2])).await.unwrap();
    let before = farm.client.job(job.id).await.unwrap();

    let farm = farm.restarted().await;
    let after = farm.client.job(job.id).await.unwrap();
    assert_eq!((after.samples, after.state), (before.samples, JobState::Running));
    // The worker had not heard the answer to its last upload: it brings everything again, under its old lease.
    let worker = TestWorker { client: farm.client.clone(), id: worker.id };
    let answer = worker.upload(&held, noise_partial(&held, &nodes)).await.unwrap();
    let verdicts: Vec<NodeVerdict> = answer.nodes.iter().map(|node| node.verdict).collect();
    let (accepted, duplicate) = (NodeVerdict::Accepted, NodeVerdict::Duplicate);
    assert_eq!(verdicts, [duplicate, duplicate, accepted, accepted, accepted]);
    worker.drain().await;
    assert_eq!(farm.finished(job.id).await.state, JobState::Done);
    let image = farm.image(job.id).await;
    assert!(bits(&image) == expected_bits(9));
    assert_eq!(image.metadata().unwrap().counters, expected_counters(9));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_error_against_the_reference_falls_to_zero_when_the_image_is_the_reference() {
    let farm = TestFarm::start().await;
    let [_, done] = farm.against_a_reference(16, 16).await;
    let series = farm.client.convergence(done.id).await.unwrap();
    assert!(series.has_reference);
    let passes: Vec<u32> = series.points.iter().map(|point| point.passes).collect();
    assert_eq!(passes, [1, 2, 4, 8, 16]);
    let errors: Vec<f64> = series.points.iter().map(|point| point.mse.unwrap()).collect();
    assert!(errors.is_sorted_by(|a, b| a > b), "{errors:?}");
    let last = series.points.last().unwrap();
    assert_eq!((last.mse, last.psnr, last.rel_mse), (Some(0.0), None, Some(0.0)));
    assert!(last.corrected_mse.unwrap() < 0.0, "the reference has noise of its own");
    assert_eq!(done.latest.as_ref(), Some(last));
    // Blocks are 4 passes, and an error is estimated from two blocks on.
    let estimated: Vec<bool> = series.points.iter().map(|point| point.estimated_mse.is_some()).collect();
    assert_eq!(estimated, [false, false, false, true, true]);
    assert!(series.points.iter().all(|point| point.core_ms > 0));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_partial_that_is_cut_off_sends_its_nodes_back_to_the_queue() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(2)).await;
    let job = farm.submit(1).await;
    let (broken, sound) = (farm.worker().await, farm.worker().await);
    let lease = broken.claim().await.unwrap();
    let mut body = noise_partial(&lease, &addresses(&lease));
    body.truncate(body.len() - 7);
    let refused = broken.upload(&lease, body).await.unwrap_err();
    assert_eq!(refused.problem().unwrap().code, ProblemCode::InvalidPartial);
    assert_eq!(refused.problem().unwrap().status, 422);
    let again = sound.claim().await.unwrap();
    assert_eq!(again.nodes, lease.nodes);
    let workers = farm.client.workers().await.unwrap();
    let refused: Vec<u64> = workers.iter().map(|worker| worker.refused_partials).collect();
    assert_eq!(refused, [1, 0]);
    sound.upload(&again, noise_partial(&again, &addresses(&again))).await.unwrap();
    sound.drain().await;
    assert_eq!(farm.finished(job.id).await.state, JobState::Done);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_hangs_up_before_the_answer_does_not_hold_up_its_job() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(200)).await;
    let address = farm.address.trim_start_matches("http://");
    for _ in 0..20 {
        let job = farm.submit(1).await;
        let worker = farm.worker().await;
        let lease = worker.claim().await.unwrap();
        let body = noise_partial(&lease, &addresses(&lease));
        let head = format!(
            "PUT /api/v1/leases/{}/partial HTTP/1.1\r\nhost: localhost\r\ncontent-type: image/x-exr\r\n\
             clerestory-fencing-token: {}\r\nclerestory-core-ms: 1\r\ncontent-length: {}\r\n\r\n",
            lease.id,
            lease.token,
            body.len()
        );
        let mut connection = TcpStream::connect(address).await.unwrap();
        connection.write_all(head.as_bytes()).await.unwrap();
        connection.write_all(&body).await.unwrap();
        drop(connection);
        // Whatever became of it: it brings all of it once more, and hears of what is there.
        match worker.upload(&lease, body).await {
            Ok(answer) => assert!(answer.nodes.iter().all(|node| node.verdict != NodeVerdict::Refused)),
            Err(error) => assert_eq!(error.problem().unwrap().code, ProblemCode::JobNotRunning),
        }
        assert_eq!(farm.finished(job.id).await.state, JobState::Done);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn partials_of_another_scene_or_with_nodes_that_were_not_leased_are_refused() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(2)).await;
    farm.submit(4).await;
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    let nodes = addresses(&lease);
    let mut other = lease.clone();
    other.scene_hash = "0".repeat(64);
    let refused = worker.upload(&lease, noise_partial(&other, &nodes)).await.unwrap_err();
    let problem = refused.problem().unwrap();
    assert_eq!(problem.code, ProblemCode::InvalidPartial);
    assert!(problem.detail.contains(&lease.scene_hash), "{}", problem.detail);

    let second = farm.worker().await;
    let lease = second.claim().await.unwrap();
    let parent = addresses(&lease)[0].parent();
    let parent = Rendered { node: noise_node(parent), counters: noise_counters(parent) };
    let refused = second.upload(&lease, partial_of(&lease, &[parent])).await.unwrap_err();
    assert!(refused.problem().unwrap().detail.contains("was not leased"));
}

#[tokio::test(flavor = "multi_thread")]
async fn events_come_in_order_and_the_missed_ones_after_coming_back() {
    let farm = TestFarm::start().await;
    let mut events = farm.client.events(None, None).await.unwrap();
    let first = events.next().await.unwrap().unwrap();
    assert!(matches!(&first.body, EventBody::Snapshot { jobs, .. } if jobs.is_empty()));
    let before = first.id.unwrap();
    let job = farm.submit(4).await;
    farm.worker().await.drain().await;
    farm.finished(job.id).await;

    // The end of the job is the last that is stored of it, so this listener finds all events there will be.
    let mut again = farm.client.events(Some(job.id), Some(before + 1)).await.unwrap();
    let mut missed = Vec::new();
    let newest = loop {
        let event = again.next().await.unwrap().unwrap();
        if matches!(event.body, EventBody::Snapshot { .. }) {
            break event.id.unwrap();
        }
        missed.extend(event.id);
    };

    let (mut states, mut rounds, mut ids) = (Vec::new(), Vec::new(), Vec::new());
    while ids.last() != Some(&newest) {
        let event = events.next().await.unwrap().unwrap();
        states.extend(state_of(&event));
        if let EventBody::Round { job: of, point } = &event.body {
            assert_eq!(*of, job.id);
            rounds.push(point.round);
        }
        ids.extend(event.id);
    }
    assert_eq!(states.last(), Some(&JobState::Done));
    assert_eq!(rounds, [0, 1, 2]);
    assert!(ids.iter().copied().eq(before + 1..=newest), "{ids:?} after {before}");
    assert_eq!(missed, ids[1..]);
}

#[tokio::test(flavor = "multi_thread")]
async fn event_streams_ask_proxies_to_pass_them_on_as_they_come() {
    let farm = TestFarm::start().await;
    let job = farm.submit(1).await;
    let http = reqwest::Client::builder().no_proxy().build().unwrap();
    for path in ["events".to_owned(), format!("jobs/{}/events", job.id)] {
        let stream = http.get(format!("{}/api/v1/{path}", farm.address)).send().await.unwrap();
        assert_eq!(stream.headers()["x-accel-buffering"], "no", "{path}");
        assert_eq!(stream.headers()["cache-control"], "no-cache, no-transform", "{path}");
        assert_eq!(stream.headers()["content-type"], "text/event-stream", "{path}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_waits_gets_work_as_soon_as_there_is_some() {
    let farm = TestFarm::start().await;
    let worker = farm.worker().await;
    let request = LeaseRequest { wait_ms: 20_000, ..worker.request() };
    let waiting = tokio::spawn({
        let client = worker.client.clone();
        async move { client.claim_lease(&request).await.unwrap() }
    });
    // Whichever of the two arrives first.
    let job = farm.submit(1).await;
    let lease = tokio::time::timeout(Duration::from_secs(10), waiting).await.unwrap().unwrap().unwrap();
    assert_eq!(lease.job, job.id);
}

#[tokio::test(flavor = "multi_thread")]
async fn all_waiting_workers_get_work_as_soon_as_there_is_enough() {
    // Of the six tiles each gets one.
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(1)).await;
    let mut waiting = tokio::task::JoinSet::new();
    for _ in 0..6 {
        let worker = farm.worker().await;
        let request = LeaseRequest { wait_ms: 20_000, ..worker.request() };
        waiting.spawn(async move { worker.client.claim_lease(&request).await.unwrap() });
    }
    farm.submit(1).await;
    let leases = tokio::time::timeout(Duration::from_secs(10), waiting.join_all()).await.unwrap();
    assert!(leases.iter().all(Option::is_some), "{leases:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn returned_work_wakes_a_waiting_worker() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(200)).await;
    farm.submit(1).await;
    let (holder, waiter) = (farm.worker().await, farm.worker().await);
    let lease = holder.claim().await.unwrap();
    assert!(waiter.claim().await.is_none());
    let request = LeaseRequest { wait_ms: 20_000, ..waiter.request() };
    let client = waiter.client.clone();
    let waiting = tokio::spawn(async move { client.claim_lease(&request).await.unwrap() });
    let body = LeaseReturn { token: lease.token, failure: None };
    holder.client.return_lease(lease.id, &body).await.unwrap();
    let again = tokio::time::timeout(Duration::from_secs(10), waiting).await.unwrap().unwrap().unwrap();
    assert_eq!(again.nodes, lease.nodes);
    assert!(again.token > lease.token);
    let late = holder.upload(&lease, noise_partial(&lease, &addresses(&lease))).await.unwrap_err();
    assert_eq!(late.problem().unwrap().code, ProblemCode::LeaseReturned);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lease_that_runs_out_is_given_to_somebody_else() {
    let farm = TestFarm::start_with(|config| {
        config.lease_ttl = Duration::from_millis(200);
        config.lease_nodes = Some(200);
    })
    .await;
    farm.submit(1).await;
    let (lost, next) = (farm.worker().await, farm.worker().await);
    let lease = lost.claim().await.unwrap();
    let request = LeaseRequest { wait_ms: 20_000, ..next.request() };
    let again = next.client.claim_lease(&request).await.unwrap().unwrap();
    assert_eq!(again.nodes, lease.nodes[..1], "the one that its worker may have died with comes alone");
    let late = lost.upload(&lease, noise_partial(&lease, &addresses(&lease))).await.unwrap_err();
    assert_eq!(late.problem().unwrap().code, ProblemCode::LeaseExpired);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancelled_job_keeps_its_image() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(1)).await;
    let job = farm.submit(4).await;
    let error = farm.client.image(job.id).await.unwrap_err();
    assert_eq!(error.problem().unwrap().code, ProblemCode::NoImageYet);
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    worker.upload(&lease, noise_partial(&lease, &addresses(&lease))).await.unwrap();
    let held = worker.claim().await.unwrap();
    let cancelled = farm.client.cancel_job(job.id).await.unwrap();
    assert_eq!(cancelled.state, JobState::Cancelled);
    assert_eq!(farm.client.cancel_job(job.id).await.unwrap(), cancelled);
    let late = worker.upload(&held, noise_partial(&held, &addresses(&held))).await.unwrap_err();
    assert_eq!(late.problem().unwrap().code, ProblemCode::JobNotRunning);
    let image = farm.image(job.id).await;
    let mut passes = vec![0; grid().len() as usize];
    passes[lease.nodes[0].tile as usize] = 1;
    assert_eq!(image.metadata().unwrap().tile_passes, passes);
    assert_eq!(image.metadata().unwrap().counters, noise_counters(addresses(&lease)[0]));
    let (automatic, filmic) = (PreviewQuery::default(), clerestory_film::ToneCurve::Filmic);
    let darker = PreviewQuery { exposure: PreviewExposure::Stops(-1.5), curve: ToneCurve::Srgb };
    for (query, exposure, curve) in
        [(automatic, Exposure::Automatic, filmic), (darker, Exposure::Stops(-1.5), clerestory_film::ToneCurve::Srgb)]
    {
        let expected = encode_png(&image, &PreviewSettings { exposure, curve }).unwrap();
        assert!(farm.client.preview(job.id, &query).await.unwrap().png == expected, "{query:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_time_limit_ends_the_job_with_what_is_complete() {
    let farm = TestFarm::start_with(|config| {
        config.lease_ttl = Duration::from_secs(2);
        config.lease_nodes = Some(7);
    })
    .await;
    let mut submission = submission(1000);
    submission.time_limit_ms = Some(1000);
    let job = farm.client.submit_job(&submission).await.unwrap();
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    worker.upload(&lease, noise_partial(&lease, &addresses(&lease))).await.unwrap();
    let done = farm.finished(job.id).await;
    assert_eq!((done.state, done.rounds, done.progress), (JobState::Done, 1, 1.0));
    assert!(worker.claim().await.is_none());
    let image = farm.image(job.id).await;
    let counts = &image.metadata().unwrap().tile_passes;
    assert!(counts.iter().all(|count| *count >= 1) && counts.contains(&2), "{counts:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_is_as_far_as_its_samples_or_its_time_whichever_is_further() {
    let clock = Clock::Manual(Arc::default());
    let farm = TestFarm::start_with(|config| {
        config.clock = clock.clone();
        config.lease_nodes = Some(grid().len());
    })
    .await;
    let mut submission = submission(10);
    submission.time_limit_ms = Some(1000);
    let job = farm.client.submit_job(&submission).await.unwrap();
    assert_eq!(job.progress, 0.0);
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    worker.upload(&lease, noise_partial(&lease, &addresses(&lease))).await.unwrap();
    assert_eq!(farm.client.job(job.id).await.unwrap().progress, 0.1);
    clock.advance(250);
    assert_eq!(farm.client.job(job.id).await.unwrap().progress, 0.25);
    farm.client.cancel_job(job.id).await.unwrap();
    clock.advance(250);
    assert_eq!(farm.client.job(job.id).await.unwrap().progress, 0.25);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_cannot_build_the_scene_fails_the_job_with_its_reason() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(200)).await;
    let job = farm.submit(1).await;
    for _ in 0..5 {
        let worker = farm.worker().await;
        let lease = worker.claim().await.unwrap();
        let body = LeaseReturn { token: lease.token, failure: Some("the pane is inside out".to_owned()) };
        worker.client.return_lease(lease.id, &body).await.unwrap();
    }
    let failed = farm.finished(job.id).await;
    assert_eq!(failed.state, JobState::Failed);
    assert!(failed.failure.unwrap().contains("the pane is inside out"));
}

#[tokio::test(flavor = "multi_thread")]
async fn two_coordinators_never_share_a_directory() {
    let farm = TestFarm::start().await;
    assert!(farm.client.is_ready().await);
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let error = run(listener, Config::new(farm.directory.path()), std::future::pending()).await.unwrap_err();
    assert!(matches!(error, RunError::InUse { .. }), "{error}");
}
