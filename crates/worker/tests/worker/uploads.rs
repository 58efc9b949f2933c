//! Uploads: repeated until they are answered, and cut smaller where a proxy refuses them.

use std::collections::VecDeque;

use axum::http::StatusCode;
use axum::response::IntoResponse;
use clerestory_api::{Lease, NodeAddress};

use crate::fake_coordinator::{
    Claim, all_tiles, coordinator, coordinator_of_image, lease, login_page, problem, uploaded,
};

#[tokio::test]
async fn a_result_is_kept_until_the_coordinator_can_take_it() {
    let coordinator = coordinator();
    let lease = lease(1, all_tiles(0, 0));
    coordinator.lock().claims.push_back(Claim::Lease(lease.clone()));
    coordinator.lock().failing_uploads = VecDeque::from([
        StatusCode::SERVICE_UNAVAILABLE.into_response(),
        StatusCode::REQUEST_TIMEOUT.into_response(),
        problem(408, "body_too_slow"),
        (StatusCode::TOO_MANY_REQUESTS, [("retry-after", "1")]).into_response(),
        login_page(),
    ]);
    let worker = coordinator.start().await;
    coordinator.until(|state| uploaded(state, &lease) == lease.nodes).await;
    worker.stop().await;
    assert_eq!(coordinator.lock().returns, []);
}

#[tokio::test]
async fn complete_nodes_wait_for_others_as_long_as_the_lease_says() {
    let coordinator = coordinator();
    // Nodes of many passes, so that they do not fill a partial.
    let nodes = (0..4096).map(|index| NodeAddress { frame: 0, tile: 0, level: 8, index }).collect();
    let lease = Lease { upload_linger_ms: 60_000, ..lease(1, nodes) };
    coordinator.lock().claims.push_back(Claim::Lease(lease.clone()));
    let worker = coordinator.start().await;
    // Renewals are 200 ms apart. A worker that ignored the lease would upload after a second.
    coordinator.until(|state| state.renewals >= 10).await;
    assert!(coordinator.lock().uploads.is_empty());
    worker.stop().await;
    let state = coordinator.lock();
    assert!(matches!(state.uploads.as_slice(), [all] if !all.nodes.is_empty()));
}

#[tokio::test]
async fn nodes_that_a_proxy_refuses_together_travel_in_smaller_partials_from_then_on() {
    let coordinator = coordinator();
    let (first, second) = (lease(1, all_tiles(0, 0)), lease(2, all_tiles(1, 1)));
    coordinator.lock().claims = VecDeque::from([Claim::Lease(first.clone())]);
    coordinator.lock().proxy_limit = Some(8 << 10);
    let worker = coordinator.start().await;
    coordinator.until(|state| uploaded(state, &first) == first.nodes).await;
    let refused = coordinator.lock().refused_bytes.len();
    assert!(refused > 0, "the proxy refuses a partial of several nodes");
    coordinator.lock().claims.push_back(Claim::Lease(second.clone()));
    coordinator.until(|state| uploaded(state, &second) == second.nodes).await;
    worker.stop().await;
    let state = coordinator.lock();
    assert_eq!((state.refused_bytes.len(), state.pieces.len()), (refused, 0));
    assert_eq!(state.returns, []);
}

#[tokio::test]
async fn a_node_that_a_proxy_refuses_travels_in_pieces_and_again_when_they_are_lost() {
    let coordinator = coordinator_of_image(64);
    let lease = lease(1, all_tiles(0, 0));
    coordinator.lock().claims.push_back(Claim::Lease(lease.clone()));
    coordinator.lock().proxy_limit = Some(10 << 10);
    coordinator.lock().loses_pieces = true;
    let worker = coordinator.start().await;
    coordinator.until(|state| uploaded(state, &lease) == lease.nodes).await;
    worker.stop().await;
    let state = coordinator.lock();
    assert!(state.pieces.values().all(|piece| piece.len() <= 10 << 10) && state.pieces.len() > 4);
    assert_eq!(state.returns, []);
}

#[tokio::test]
async fn nodes_that_the_coordinator_refuses_together_travel_one_by_one_and_one_that_is_too_large_is_named() {
    let coordinator = coordinator();
    let (small, large) = (lease(1, all_tiles(0, 0)), lease(2, all_tiles(0, 1)));
    coordinator.lock().claims = VecDeque::from([Claim::Lease(small.clone())]);
    coordinator.lock().partial_limit = Some(6 << 10);
    let worker = coordinator.start().await;
    coordinator.until(|state| uploaded(state, &small) == small.nodes).await;
    assert_eq!(coordinator.lock().returns, []);
    coordinator.lock().partial_limit = Some(100);
    coordinator.lock().claims.push_back(Claim::Lease(large.clone()));
    coordinator.until(|state| !state.returns.is_empty()).await;
    worker.stop().await;
    let state = coordinator.lock();
    let (id, returned) = &state.returns[0];
    assert_eq!(*id, large.id);
    let reason = returned.failure.as_deref().unwrap_or_default();
    assert!(reason.contains("the coordinator takes no partial of"), "{reason}");
}
