//! Scenes: built, kept as long as memory allows, or reported as a failure.

use std::collections::VecDeque;

use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use clerestory_api::{BuildOutcome, BuiltScene, JobId, Lease};
use serde_json::json;

use crate::fake_coordinator::{Claim, all_tiles, coordinator, lease, problem, uploaded};

#[tokio::test]
async fn a_scene_that_this_build_cannot_read_is_given_back_and_the_worker_goes_on() {
    let coordinator = coordinator();
    coordinator.lock().wants_report = true;
    let (broken, next) = (lease(1, all_tiles(0, 0)), lease(2, all_tiles(0, 0)));
    coordinator.lock().claims = VecDeque::from([Claim::Lease(broken.clone()), Claim::Lease(next.clone())]);
    let good = std::mem::replace(&mut coordinator.lock().scene["meshes"][0]["material"], json!("gold"));
    let worker = coordinator.start().await;
    coordinator.until(|state| !state.returns.is_empty()).await;
    coordinator.lock().scene["meshes"][0]["material"] = good;
    coordinator.until(|state| uploaded(state, &next) == next.nodes).await;
    worker.stop().await;
    let state = coordinator.lock();
    let (id, returned) = &state.returns[0];
    assert_eq!(*id, broken.id);
    assert!(returned.failure.as_ref().is_some_and(|failure| failure.contains("gold")), "{returned:?}");
    assert!(state.reports.iter().all(|(lease, ..)| *lease == next.id), "another build may read it");
}

#[tokio::test]
async fn a_built_scene_is_reported_once_before_its_nodes_until_the_coordinator_answers() {
    for wants_report in [true, false] {
        let coordinator = coordinator();
        let (first, second) = (lease(1, all_tiles(0, 0)), lease(2, all_tiles(0, 1)));
        coordinator.lock().claims = VecDeque::from([Claim::Lease(first.clone()), Claim::Lease(second.clone())]);
        coordinator.lock().wants_report = wants_report;
        coordinator.lock().failing_reports = VecDeque::from([StatusCode::SERVICE_UNAVAILABLE.into_response()]);
        let worker = coordinator.start().await;
        coordinator
            .until(|state| uploaded(state, &first) == first.nodes && uploaded(state, &second) == second.nodes)
            .await;
        worker.stop().await;
        let state = coordinator.lock();
        if !wants_report {
            assert_eq!(state.reports, []);
            continue;
        }
        let [(id, report, uploaded)] = state.reports.as_slice() else { panic!("{:?}", state.reports) };
        assert_eq!((*id, report.token, *uploaded), (first.id, first.token, 0));
        assert_eq!(report.outcome, BuildOutcome::Built(BuiltScene::default()), "nothing is chosen or left to chance");
    }
}

#[tokio::test]
async fn a_scene_that_no_machine_can_build_is_reported_with_its_place_and_value() {
    let coordinator = coordinator();
    let broken = lease(1, all_tiles(0, 0));
    coordinator.lock().claims.push_back(Claim::Lease(broken.clone()));
    coordinator.lock().wants_report = true;
    coordinator.set_scene(|scene| {
        scene["panes"] = json!([{"name": "pane", "centre": [0, 0, 1], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
            "width": 0.5, "height": 0.5, "thickness": 0.004}]);
        scene["materials"]["silver"] = json!({"mirror": {}});
        scene["meshes"] = json!([{"name": "mirror", "material": "silver", "source": {"inline": {
            "positions": [[0, 0, 0], [0.1, 0, 2], [0, 0.1, 2]], "triangles": [[0, 1, 2]]}}}]);
    });
    let worker = coordinator.start().await;
    coordinator.until(|state| !state.reports.is_empty() && !state.returns.is_empty()).await;
    worker.stop().await;
    let state = coordinator.lock();
    let (id, report, _) = &state.reports[0];
    assert_eq!((*id, report.token), (broken.id, broken.token));
    let BuildOutcome::Refused { reason } = &report.outcome else { panic!("{report:?}") };
    assert!(reason.starts_with("meshes[0].source: found mesh "), "{reason}");
}

#[tokio::test]
async fn a_report_under_a_lease_that_is_over_is_made_under_the_next() {
    let coordinator = coordinator();
    let (over, next) = (lease(1, all_tiles(0, 0)), lease(2, all_tiles(0, 0)));
    coordinator.lock().claims = VecDeque::from([Claim::Lease(over.clone()), Claim::Lease(next.clone())]);
    coordinator.lock().wants_report = true;
    coordinator.lock().failing_reports = VecDeque::from([problem(409, "lease_expired")]);
    let worker = coordinator.start().await;
    coordinator.until(|state| uploaded(state, &next) == next.nodes).await;
    worker.stop().await;
    let state = coordinator.lock();
    assert_eq!(state.reports.iter().map(|(lease, ..)| *lease).collect::<Vec<_>>(), [next.id]);
    assert_eq!((uploaded(&state, &over), state.scenes), (Vec::new(), 1));
}

#[tokio::test]
async fn a_worker_whose_report_is_refused_renders_on_and_reports_with_the_next_lease() {
    let not_found = || StatusCode::NOT_FOUND.into_response();
    let refusals: [Vec<Response>; 2] =
        [std::iter::repeat_with(not_found).take(5).collect(), vec![problem(422, "invalid_field")]];
    for refusal in refusals {
        let coordinator = coordinator();
        let (first, second) = (lease(1, all_tiles(0, 0)), lease(2, all_tiles(0, 1)));
        coordinator.lock().claims = VecDeque::from([Claim::Lease(first.clone()), Claim::Lease(second.clone())]);
        coordinator.lock().wants_report = true;
        coordinator.lock().failing_reports = refusal.into();
        let worker = coordinator.start().await;
        coordinator
            .until(|state| uploaded(state, &first) == first.nodes && uploaded(state, &second) == second.nodes)
            .await;
        worker.stop().await;
        let state = coordinator.lock();
        assert_eq!(state.reports.iter().map(|(lease, ..)| *lease).collect::<Vec<_>>(), [second.id]);
    }
}

#[tokio::test]
async fn a_scene_with_more_than_any_scene_may_have_is_reported_by_a_small_worker_too() {
    let coordinator = coordinator();
    coordinator.lock().claims.push_back(Claim::Lease(lease(1, all_tiles(0, 0))));
    coordinator.lock().wants_report = true;
    coordinator.set_scene(|scene| {
        let face = json!({"hammered": {"wavelength": 0.012, "amplitude": 1e-7}});
        let pane = |number: u32| {
            json!({"name": format!("pane {number}"), "centre": [0, 0, number], "x_axis": [1, 0, 0],
                "y_axis": [0, 1, 0], "width": 0.5, "height": 0.5, "thickness": 0.004, "front": face, "back": face})
        };
        scene["panes"] = (1..20).map(pane).collect();
    });
    let worker = coordinator.start_with(Some(10 << 10)).await;
    coordinator.until(|state| !state.reports.is_empty()).await;
    worker.stop().await;
    let state = coordinator.lock();
    let BuildOutcome::Refused { reason } = &state.reports[0].1.outcome else { panic!("{:?}", state.reports) };
    assert!(reason.contains("spline coefficients in all panes"), "{reason}");
}

#[tokio::test]
async fn a_scene_that_takes_more_than_the_worker_may_have_is_given_back_with_a_way_out() {
    let coordinator = coordinator();
    coordinator.lock().claims.push_back(Claim::Lease(lease(1, all_tiles(0, 0))));
    coordinator.lock().wants_report = true;
    let worker = coordinator.start_with(Some(10 << 10)).await;
    coordinator.until(|state| !state.returns.is_empty()).await;
    worker.stop().await;
    let state = coordinator.lock();
    let reason = state.returns[0].1.failure.as_deref().unwrap_or_default();
    assert!(reason.contains("to build") && reason.contains("a worker that may take more memory"), "{reason}");
    assert_eq!(state.reports, [], "a larger machine may build it");
}

#[tokio::test]
async fn a_scene_is_kept_unless_the_next_does_not_fit_beside_it() {
    // A small scene counts for a little more than 64 KiB.
    for (memory, keeps_first) in [(200 << 10, true), (100 << 10, false)] {
        let coordinator = coordinator();
        let first = lease(1, all_tiles(0, 0));
        let other: JobId = "00000000-0000-7000-8000-00000000000b".parse().unwrap();
        let second = Lease { job: other, ..lease(2, all_tiles(0, 0)) };
        coordinator.lock().claims = VecDeque::from([Claim::Lease(first.clone()), Claim::Lease(second.clone())]);
        let worker = coordinator.start_with(Some(memory)).await;
        coordinator
            .until(|state| uploaded(state, &first) == first.nodes && uploaded(state, &second) == second.nodes)
            .await;
        let expected = if keeps_first { vec![other, first.job] } else { vec![other] };
        coordinator.until(|state| state.built == expected).await;
        worker.stop().await;
        assert_eq!(coordinator.lock().returns, [], "both are rendered with {memory} bytes");
    }
}

#[tokio::test]
async fn a_scene_that_is_built_for_longer_than_its_lease_lasts_serves_the_next_lease() {
    let coordinator = coordinator();
    let (lost, next) = (lease(1, all_tiles(0, 0)), lease(2, all_tiles(0, 0)));
    coordinator.lock().claims = VecDeque::from([Claim::Lease(lost.clone()), Claim::Lease(next.clone())]);
    coordinator.lock().holds_scene = true;
    coordinator.lock().nothing_is_wanted = true;
    let worker = coordinator.start().await;
    // The second lease is claimed while the scene is under way.
    coordinator.until(|state| state.scenes > 0 && state.leases.contains_key(&next.id)).await;
    coordinator.until(|state| state.heartbeats.iter().any(|activity| activity.building.is_some())).await;
    coordinator.lock().holds_scene = false;
    coordinator.changed.notify_waiters();
    coordinator.until(|state| uploaded(state, &next) == next.nodes).await;
    worker.stop().await;
    let state = coordinator.lock();
    assert_eq!(state.scenes, 1, "it is fetched and built once");
    assert_eq!((uploaded(&state, &lost), state.returns.len()), (Vec::new(), 0));
    assert!(state.heartbeats.iter().flat_map(|activity| activity.building).all(|building| building.job == next.job));
}
