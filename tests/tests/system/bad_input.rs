//! Bad input of every kind, sent to one farm of real processes: each gets a clear answer, and the farm goes on working.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use clerestory_api::{JobState, NodeVerdict, PartialUpload, ProblemCode};
use clerestory_tests::calls::{BadCall, Caller, MAX_BODY_BYTES, Refusal};
use clerestory_tests::exr_files::{HUGE_EDGE, edited};
use clerestory_tests::farm::{Farm, clerestory, succeeded};
use clerestory_tests::hand_worker::{Delivery, HandWorker};
use clerestory_tests::malformed_calls::bad_calls;
use clerestory_tests::malformed_partials::{BadDelivery, bad_deliveries};
use clerestory_tests::malformed_scenes::{
    BadScene, bad_descriptions, bad_files, sound_files, sound_scene, write_scene,
};
use clerestory_tests::waiting::until;
use serde_json::Value;

/// Memory for decoded nodes that the farm may keep.
const NODE_CACHE: u64 = 16 << 20;

/// Limit of the coordinator's memory. It has three parts: the cached nodes, the received bodies, and the process
/// itself. The bodies are a JSON document of 16 MiB with its parsed form, and eight partials. The process has threads,
/// the database and images of 48 x 32 pixels.
const MOST_MEMORY: u64 = NODE_CACHE + 2 * (16 << 20) + 8 * MAX_BODY_BYTES as u64 + (64 << 20);

/// What a single channel of the image takes that the huge headers claim.
const HUGE_CHANNEL: u64 = 4 * HUGE_EDGE * HUGE_EDGE;

/// Sixteen passes, in more nodes than there are bad deliveries of two nodes each.
const ORDER: [&str; 4] = ["--spp", "64", "--tile", "8"];

/// How long a lease lasts.
const LEASE: Duration = Duration::from_secs(20);

/// What was not answered as it should be.
#[derive(Default)]
struct Faults(Vec<String>);

impl Faults {
    fn note(&mut self, outcome: Result<(), String>) {
        self.0.extend(outcome.err());
    }

    #[track_caller]
    fn assert_none(&self) {
        assert!(self.0.is_empty(), "{}", self.0.join("\n"));
    }
}

/// A farm that gives out two nodes with each lease and takes no body of more than a megabyte.
fn start_farm(folder: &Path) -> Farm {
    let settings = format!(
        "max_asset_bytes = {MAX_BODY_BYTES}\nmax_partial_bytes = {MAX_BODY_BYTES}\nnode_cache_bytes = {NODE_CACHE}\n\
         lease_nodes = 2\nlease_seconds = {}\n",
        LEASE.as_secs()
    );
    let file = folder.join("coordinator.toml");
    std::fs::write(&file, settings).expect("a writable folder");
    Farm::start(None, &["--config", file.to_str().expect("a path of text")])
}

#[test]
fn bad_input_is_refused_clearly_and_the_farm_goes_on_working() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = write_scene(folder.path(), &sound_scene(), &sound_files());
    let alone = folder.path().join("alone.exr");
    succeeded(clerestory().arg("render").arg(&scene).args(["--spp", "64", "-o"]).arg(&alone));

    let mut farm = start_farm(folder.path());
    let process = farm.coordinator_process().expect("a coordinator");
    farm.submit(&scene, &ORDER);
    let job = farm.newest_job().id;
    let caller = Caller::new(&farm);
    let worker = HandWorker::register(&caller, job);
    let forgotten = worker.claim();
    let before = farm.coordinator_memory();

    let (scenes, calls, deliveries) = (bad_descriptions(), bad_calls(job), bad_deliveries());
    assert!(scenes.len() >= 15 && deliveries.len() >= 15 && calls.len() >= 10);
    let mut faults = Faults::default();
    scenes.iter().for_each(|scene| faults.note(caller.check(&scene.call())));
    calls.iter().for_each(|call| faults.note(caller.check(call)));
    deliver(&caller, &worker, &deliveries, &mut faults);
    faults.assert_none();

    let after = farm.coordinator_memory();
    assert!(after.resident < MOST_MEMORY, "{after:?}");
    assert!(after.address_space - before.address_space < HUGE_CHANNEL, "from {before:?} to {after:?}");
    let jobs = caller.wait(caller.client().jobs()).expect("a list");
    assert_eq!(jobs.len(), 1, "nothing that was refused is in the queue: {jobs:?}");
    let refused = deliveries.iter().filter(|delivery| delivery.refusal.code == ProblemCode::InvalidPartial).count();
    let workers = caller.wait(caller.client().workers()).expect("a list");
    let view = workers.iter().find(|view| view.id == worker.id()).expect("the worker");
    assert_eq!((view.refused_partials, view.accepted_nodes), (refused as u64, 2));

    // An idle worker would take over these nodes, so the lease has to expire first.
    let holds_nothing = || {
        let workers = caller.wait(caller.client().workers()).expect("a list");
        workers.iter().any(|view| view.id == worker.id() && view.leased_nodes == 0)
    };
    until("the lease expires", holds_nothing);
    farm.start_worker("real");
    let done = farm.wait_until("done", |job| job.state.is_final());
    assert_eq!(done.state, JobState::Done, "{:?}", done.failure);
    let expired =
        Refusal { status: 409, code: ProblemCode::LeaseExpired, field: None, says: &["has run out", "went back"] };
    let late = forgotten.of(forgotten.partial.clone());
    faults.note(caller.check(&BadCall::new("a lease that has run out", late, expired)));
    faults.assert_none();

    let image = folder.path().join("farm.exr");
    std::fs::write(&image, farm.image(job)).expect("a writable folder");
    let output = succeeded(clerestory().arg("compare").arg(&image).arg(&alone).arg("--json"));
    let comparison: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(comparison["bit_identical"], true, "{comparison}");
    assert_eq!(farm.coordinator_process(), Some(process));
}

/// Sends all bad deliveries, each under a lease of its own, and then the sound one that they are made of.
fn deliver(caller: &Caller, worker: &HandWorker<'_>, deliveries: &[BadDelivery], faults: &mut Faults) {
    // A node fails once at most: the leases are all claimed before the first is taken back.
    let leases: Vec<Delivery> = deliveries.iter().map(|_| worker.claim()).collect();
    let sound = worker.claim();
    for (index, (BadDelivery { what, call, refusal }, delivery)) in deliveries.iter().zip(&leases).enumerate() {
        // However slow the machine is, no lease runs out while it waits for its turn.
        leases[index..].iter().chain([&sound]).for_each(|waiting| worker.renew(&waiting.lease));
        let bad = BadCall::new(what, call(delivery), refusal.clone());
        faults.note(caller.check(&bad));
        if refusal.code == ProblemCode::InvalidPartial {
            let says: &[&str] = &["given back", "went back to the queue"];
            let over = Refusal { status: 409, code: ProblemCode::LeaseReturned, field: None, says };
            faults.note(caller.check(&BadCall::new(what, bad.call, over)));
        }
        worker.give_back(&delivery.lease);
    }
    let upload = PartialUpload {
        lease: sound.lease.id,
        token: sound.lease.token,
        core_ms: 5,
        body: edited(&sound.partial, |_| {}).into(),
    };
    let answer = caller.wait(caller.client().upload_partial(upload)).expect("a sound partial");
    assert!(answer.nodes.iter().all(|node| node.verdict == NodeVerdict::Accepted), "{answer:?}");
}

#[test]
fn a_scene_whose_files_are_bad_fails_its_job_on_the_first_worker_with_the_place_and_the_value() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut farm = start_farm(folder.path());
    let caller = Caller::new(&farm);
    let bad = bad_files();
    assert!(bad.len() >= 10);
    for scene in &bad {
        scene.files.values().for_each(|content| _ = caller.upload(content));
        let submission = serde_json::from_value(scene.submission()).expect("a submission");
        caller.wait(caller.client().submit_job(&submission)).expect("a document without a fault");
    }
    farm.start_worker("judge");
    let mut faults = Faults::default();
    farm.wait_until_all_have_ended();
    let jobs = caller.wait(caller.client().jobs()).expect("a list");
    for BadScene { what, path, says, .. } in bad {
        let job = jobs.iter().find(|job| job.name == what).expect("a job of each scene");
        let failure = job.failure.clone().unwrap_or_default();
        let place = format!("worker `judge` cannot build the scene: {path}: ");
        let missing = [place.as_str()].into_iter().chain(says.iter().copied()).find(|part| !failure.contains(part));
        faults.note(missing.map_or(Ok(()), |part| Err(format!("{what}: no {part:?} in: {failure}"))));
        assert_eq!((job.state, &job.failed_node), (JobState::Failed, &None), "{what}");
    }
    faults.assert_none();
}

#[test]
fn render_and_submit_name_what_is_wrong_with_a_scene_alike() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let farm = start_farm(folder.path());
    let mut faults = Faults::default();
    for bad in [bad_descriptions(), bad_files()].concat() {
        let file = write_scene(folder.path(), &bad.scene, &bad.files);
        let mut render = clerestory();
        render.args(["render", "-o"]).arg(folder.path().join("image.exr"));
        for command in [&mut render, &mut farm.command(&["submit"])] {
            let message = failure(command.arg(&file));
            let place = format!("{}: ", bad.path);
            let missing =
                [place.as_str()].into_iter().chain(bad.says.iter().copied()).find(|part| !message.contains(part));
            faults.note(missing.map_or(Ok(()), |part| Err(format!("{}: no {part:?} in: {message}", bad.what))));
        }
    }
    faults.assert_none();
    let output = succeeded(&mut farm.command(&["jobs", "--json"]));
    assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), "[]");
}

/// What a command that must fail says.
fn failure(command: &mut Command) -> String {
    let output = command.output().expect("the command starts");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{command:?}: {message}");
    assert!(output.stdout.is_empty(), "{command:?}: {}", String::from_utf8_lossy(&output.stdout));
    message
}
