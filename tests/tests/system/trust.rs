//! Machines that compute other bits: found, kept from work, and without a trace in the image.

use std::time::{Duration, Instant};

use clerestory_api::{ClientError, JobState, PartialUpload, ProblemCode, WorkerActivity, WorkerState};
use clerestory_tests::calls::Caller;
use clerestory_tests::farm::{Farm, clerestory, succeeded};
use clerestory_tests::hand_worker::{Delivery, HandWorker};
use clerestory_tests::malformed_scenes::{sound_files, sound_scene, write_scene};
use clerestory_tests::waiting::until;
use serde_json::Value;

/// Longest time until a wrong worker is found.
const TIMEOUT: Duration = Duration::from_secs(120);

#[test]
fn a_worker_that_flips_a_bit_is_found_and_its_nodes_are_rendered_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = write_scene(folder.path(), &sound_scene(), &sound_files());
    let alone = folder.path().join("alone.exr");
    succeeded(clerestory().arg("render").arg(&scene).args(["--spp", "64", "-o"]).arg(&alone));

    let mut farm = Farm::start(None, &["--checked-fraction", "1", "--lease-nodes", "2"]);
    farm.submit(&scene, &["--spp", "64", "--tile", "8"]);
    let job = farm.newest_job().id;
    let caller = Caller::new(&farm);
    let wrong = HandWorker::register(&caller, job).that_flips_bits();
    let delivery = wrong.claim();
    farm.start_worker("right");
    farm.start_worker("third");
    let start = Instant::now();
    until("the workers come", || caller.wait(caller.client().workers()).expect("a list").len() == 3);

    let refusal = refused_in_the_end(&caller, &wrong, delivery, start);
    let problem = refusal.problem().unwrap_or_else(|| panic!("{refusal}"));
    assert_eq!((problem.code, problem.status), (ProblemCode::WorkerQuarantined, 403));

    let done = farm.wait_until("done", |job| job.state.is_final());
    assert_eq!(done.state, JobState::Done, "{:?}", done.failure);
    assert!(done.redone_nodes > 0);
    let image = folder.path().join("farm.exr");
    std::fs::write(&image, farm.image(job)).expect("a writable folder");
    let output = succeeded(clerestory().arg("compare").arg(&image).arg(&alone).arg("--json"));
    let comparison: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(comparison["bit_identical"], true, "{comparison}");

    let workers = caller.wait(caller.client().workers()).expect("a list");
    let states: Vec<WorkerState> = workers.iter().map(|worker| worker.state).collect();
    assert_eq!(states.iter().filter(|state| **state == WorkerState::Quarantined).count(), 1, "{states:?}");
    let view = workers.iter().find(|view| view.id == wrong.id()).expect("the worker");
    let quarantine = view.quarantine.as_ref().expect("the reason");
    assert!(quarantine.reason.contains(&job.to_string()) && quarantine.ended_jobs.is_empty(), "{quarantine:?}");

    // Started again, it is not let in, and says why.
    let output = farm.command(&["worker", "--name", &view.name, "--threads", "1"]).output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains("quarantined"), "{said}");
    caller.wait(caller.client().release_worker(wrong.id())).expect("a worker that is free");
    assert_eq!(
        caller
            .wait(caller.client().heartbeat(wrong.id(), &WorkerActivity::default()))
            .map_err(|error| error.to_string()),
        Ok(())
    );
}

/// Brings nodes with flipped bits until the farm wants no more, and answers what it says then.
fn refused_in_the_end(caller: &Caller, wrong: &HandWorker<'_>, first: Delivery, start: Instant) -> ClientError {
    let mut delivery = Some(first);
    loop {
        assert!(start.elapsed() < TIMEOUT, "it is not found");
        match &delivery {
            Some(delivery) => {
                let (lease, token) = (delivery.lease.id, delivery.lease.token);
                let upload = PartialUpload { lease, token, core_ms: 5, body: delivery.partial.clone().into() };
                // An error is that its lease was taken from it meanwhile; the next claim tells why.
                let _ = caller.wait(caller.client().upload_partial(upload));
            }
            None => std::thread::sleep(Duration::from_millis(20)),
        }
        delivery = match wrong.try_claim() {
            Ok(delivery) => delivery,
            Err(refusal) => return refusal,
        };
    }
}
