//! Leases: claimed, rendered, abandoned and returned.

use std::collections::VecDeque;

use axum::Router;
use clerestory_api::{LeaseReturn, NodeAddress};
use clerestory_worker::WorkerError;

use crate::fake_coordinator::{Claim, all_tiles, coordinator, endless, lease, login_page, uploaded};
use crate::running_worker::{RunningWorker, TIMEOUT};

#[tokio::test]
async fn the_nodes_of_each_lease_arrive_under_its_token_and_nothing_is_given_back() {
    let coordinator = coordinator();
    let (first, second) = (lease(1, all_tiles(0, 0)), lease(2, all_tiles(2, 1)));
    coordinator.lock().claims = VecDeque::from([Claim::Lease(first.clone()), Claim::Lease(second.clone())]);
    let worker = coordinator.start().await;
    coordinator.until(|state| uploaded(state, &first) == first.nodes && uploaded(state, &second) == second.nodes).await;
    worker.stop().await;
    let state = coordinator.lock();
    assert!(state.uploads.iter().all(|upload| upload.token == if upload.lease == first.id { "1" } else { "2" }));
    assert_eq!(state.returns, []);
    assert_eq!((state.registrations[0].cores, state.registrations[0].build.as_str()), (2, "test build"));
}

#[tokio::test]
async fn a_worker_whose_address_is_not_that_of_a_coordinator_ends_and_says_what_answered() {
    let worker = RunningWorker::at(Router::new().fallback(async || login_page()), None).await;
    let ended = tokio::time::timeout(TIMEOUT, worker.ended).await.expect("the worker does not end").unwrap();
    let WorkerError::Connection(answer) = ended.unwrap_err() else { panic!("the coordinator has refused nothing") };
    assert!(answer.to_string().contains("text/html, `<html>Please sign in"), "{answer}");
}

#[tokio::test]
async fn a_worker_that_has_been_forgotten_registers_again_and_goes_on() {
    let coordinator = coordinator();
    let lease = lease(1, all_tiles(0, 0));
    coordinator.lock().claims = VecDeque::from([Claim::ForgetWorker, Claim::Lease(lease.clone())]);
    let worker = coordinator.start().await;
    coordinator.until(|state| uploaded(state, &lease) == lease.nodes).await;
    worker.stop().await;
    assert_eq!(coordinator.lock().registrations.len(), 2);
}

#[tokio::test]
async fn a_lease_that_is_over_is_abandoned_for_the_next() {
    let coordinator = coordinator();
    let (lost, next) = (lease(1, endless()), lease(2, all_tiles(0, 0)));
    coordinator.lock().claims = VecDeque::from([Claim::Lease(lost.clone()), Claim::Lease(next.clone())]);
    coordinator.lock().lease_is_over = true;
    let worker = coordinator.start().await;
    coordinator.until(|state| uploaded(state, &next) == next.nodes).await;
    worker.stop().await;
    assert!(uploaded(&coordinator.lock(), &lost).len() < lost.nodes.len());
}

#[tokio::test]
async fn a_lease_of_which_nothing_is_wanted_any_more_is_left_for_the_next() {
    let coordinator = coordinator();
    let (lost, next) = (lease(1, endless()), lease(2, all_tiles(0, 0)));
    coordinator.lock().claims = VecDeque::from([Claim::Lease(lost.clone()), Claim::Lease(next.clone())]);
    let worker = coordinator.start().await;
    coordinator.until(|state| !state.uploads.is_empty()).await;
    coordinator.lock().nothing_is_wanted = true;
    coordinator.until(|state| uploaded(state, &next) == next.nodes).await;
    worker.stop().await;
    let state = coordinator.lock();
    assert!(uploaded(&state, &lost).len() < lost.nodes.len());
    assert_eq!(state.returns, [], "there is nothing to give back");
}

#[tokio::test]
async fn told_to_stop_it_uploads_what_is_complete_and_returns_the_rest() {
    let coordinator = coordinator();
    let lease = lease(1, endless());
    coordinator.lock().claims.push_back(Claim::Lease(lease.clone()));
    let worker = coordinator.start().await;
    coordinator.until(|state| !state.uploads.is_empty()).await;
    worker.stop().await;
    let state = coordinator.lock();
    let done = uploaded(&state, &lease);
    // The worker renders two nodes at a time, and the first may be the one that is left.
    let begun = &lease.nodes[..=done.len()];
    assert!(done.iter().all(|node| begun.contains(node)), "a complete node was not uploaded: {done:?}");
    assert_eq!(state.returns, [(lease.id, LeaseReturn { token: 1, failure: None })]);
    // The worker ends after it has returned its leases.
    assert_eq!(state.ended, [(state.known[0].to_string(), 1)]);
}

#[tokio::test]
async fn answers_that_are_no_leases_do_not_end_the_worker() {
    a_worker_goes_on_after([Claim::Garbage("{\"id\": 5"), Claim::Lease(lease(1, Vec::new()))], 0).await;
}

#[tokio::test]
async fn nodes_of_no_tile_and_no_frame_are_refused_and_the_worker_goes_on() {
    let outside = NodeAddress { frame: 0, tile: 4, level: 0, index: 0 };
    let strange = [(1, outside), (2, NodeAddress { frame: 1, tile: 0, ..outside })];
    a_worker_goes_on_after(strange.map(|(number, node)| Claim::Lease(lease(number, vec![node]))), 2).await;
}

#[tokio::test]
async fn nodes_above_all_levels_are_refused_and_the_worker_goes_on() {
    let high = NodeAddress { frame: 0, tile: 0, level: 77, index: 1 };
    let strange = [(1, high), (2, NodeAddress { tile: u32::MAX, level: 31, index: u32::MAX, ..high })];
    a_worker_goes_on_after(strange.map(|(number, node)| Claim::Lease(lease(number, vec![node]))), 2).await;
}

/// A worker that gets these answers gives work back so many times, with a reason, and renders the lease that follows.
async fn a_worker_goes_on_after<const N: usize>(nonsense: [Claim; N], failures: usize) {
    let coordinator = coordinator();
    let last = lease(9, all_tiles(0, 0));
    coordinator.lock().claims = nonsense.into_iter().chain([Claim::Lease(last.clone())]).collect();
    let worker = coordinator.start().await;
    coordinator.until(|state| uploaded(state, &last) == last.nodes).await;
    worker.stop().await;
    let reasons = coordinator.lock().returns.iter().filter(|(_, body)| body.failure.is_some()).count();
    assert_eq!(reasons, failures);
}
