//! What a coordinator acknowledges is on disk before the answer, and what it removes is no longer needed. Its system
//! calls show it, and so do its answers while the disk fails.

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::fs;
use std::path::{Path, PathBuf};

use clerestory_api::{
    ClientError, JobId, JobScene, JobState, JobSubmission, LeaseRequest, LeaseReturn, NodeVerdict, PartialAnswer,
    PartialUpload, ProblemCode, WorkerActivity, WorkerRegistration,
};
use clerestory_test_servers::Faults;
use clerestory_tests::calls::{Caller, content_hash};
use clerestory_tests::farm::{Farm, clerestory, succeeded};
use clerestory_tests::hand_worker::{Delivery, HandWorker};
use clerestory_tests::malformed_scenes::{sound_files, sound_scene, write_scene};
use clerestory_tests::system_calls::{Acknowledgement, Roles, is_sync, replayed, traced, without};
use clerestory_tests::waiting::until;

/// A coordinator that gives out four nodes with each lease, and has no second worker check them.
const OPTIONS: [&str; 4] = ["--lease-nodes", "4", "--checked-fraction", "0"];

/// Sixteen passes of six tiles, in five rounds.
const ORDER: [&str; 4] = ["--spp", "64", "--tile", "16"];

/// What the files of a coordinator are.
const ROLES: Roles = Roles { is_ignored: is_index, is_log, is_blob };

/// The index of SQLite's log, which is made anew from the log when it is lost.
fn is_index(path: &str) -> bool {
    path.ends_with("-shm")
}

fn is_log(path: &str) -> bool {
    path.ends_with("-wal")
}

/// A blob of nodes that has been written to its end.
fn is_blob(path: &str) -> bool {
    depth(path) == Some(2) && !path.contains('#')
}

/// How deep a path lies below the blobs of nodes, which are `nodes/JOB/NAME`.
fn depth(path: &str) -> Option<usize> {
    path.split("/nodes/").nth(1).map(|below| below.split('/').count())
}

/// The upload of a delivery.
fn upload_of(delivery: &Delivery) -> PartialUpload {
    let (lease, token) = (delivery.lease.id, delivery.lease.token);
    PartialUpload { lease, token, core_ms: 1, body: delivery.partial.clone().into() }
}

#[track_caller]
fn assert_all(answer: &PartialAnswer, verdict: NodeVerdict) {
    assert!(answer.nodes.iter().all(|node| node.verdict == verdict), "{answer:?}");
}

/// Has a farm under `strace` answer all calls that change something, and finish a job. Answers where its data were, and
/// how many partials of the job it was brought.
fn traced_work(folder: &Path, trace: &Path) -> (PathBuf, usize) {
    let scene = write_scene(folder, &sound_scene(), &sound_files());
    let farm = Farm::start_traced(trace, &OPTIONS);
    let data = farm.data(0).to_owned();
    let caller = Caller::new(&farm);
    let client = caller.client();
    farm.submit(&scene, &ORDER);
    let unwanted = farm.newest_job().id;
    assert_eq!(caller.wait(client.cancel_job(unwanted)).expect("an answer").state, JobState::Cancelled);
    farm.submit(&scene, &ORDER);
    let job = farm.newest_job().id;

    let failing = HandWorker::register(&caller, job);
    caller.wait(client.heartbeat(failing.id(), &WorkerActivity::default())).expect("a worker that is known");
    let lease = failing.claim().lease;
    let failure = LeaseReturn { token: lease.token, failure: Some("its glass is cracked".to_owned()) };
    caller.wait(client.return_lease(lease.id, &failure)).expect("a lease that is given back");
    caller.wait(client.release_worker(failing.id())).expect("a worker that is known");

    let worker = HandWorker::register(&caller, job);
    let lease = worker.claim().lease;
    worker.renew(&lease);
    worker.give_back(&lease);
    let mut deliveries = Vec::new();
    while let Some(delivery) = worker.try_claim().expect("an answer") {
        deliveries.push(delivery);
    }
    // The first round comes last. Until it is complete the round finalizer is idle, and all writes belong to calls.
    for delivery in deliveries.iter().rev() {
        let answer = caller.wait(client.upload_partial(upload_of(delivery))).expect("an acknowledgement");
        assert_all(&answer, NodeVerdict::Accepted);
    }
    let ended = farm.wait_until("done", |job| job.state.is_final());
    assert_eq!((ended.id, ended.state), (job, JobState::Done), "{:?}", ended.failure);
    let nodes = data.join("blobs/nodes").join(job.to_string());
    until("the nodes are merged into one blob", || fs::read_dir(&nodes).expect("the nodes of the job").count() == 1);
    (data, deliveries.len())
}

#[test]
fn an_image_is_on_disk_before_it_takes_its_name_and_its_name_before_the_end() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [scene, image, file] = ["scene", "image.exr", "trace"].map(|name| folder.path().join(name));
    fs::create_dir(&scene).expect("a folder");
    let scene = write_scene(&scene, &sound_scene(), &sound_files());
    let mut render = clerestory();
    render.arg("render").arg(scene).args(["--size", "8x8", "--spp", "4", "-o"]).arg(&image);
    succeeded(&mut traced(&render, &file));
    assert!(image.is_file());
    let trace = fs::read_to_string(&file).expect("a trace: is `strace` installed?");
    let calls: Vec<&str> = trace.lines().collect();
    let named =
        calls.iter().position(|call| call.contains("rename") && call.contains("image.exr\"")).expect("its name");
    let synced = |calls: &[&str], what: &str| calls.iter().any(|call| call.contains("sync(") && call.contains(what));
    let folder = folder.path().display().to_string();
    assert!(synced(&calls[..named], &format!("<{folder}/")), "{}", calls[..named].join("\n"));
    assert!(synced(&calls[named..], &format!("<{folder}>")), "{}", calls[named..].join("\n"));
}

#[test]
fn what_is_acknowledged_and_what_a_removal_relies_on_is_on_disk() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("trace");
    let (data, brought) = traced_work(folder.path(), &file);
    let trace = fs::read_to_string(&file).expect("a trace: is `strace` installed?");
    let replay = replayed(&trace, &data, ROLES);
    let acknowledged = &replay.acknowledgements;
    for (start, end, expected) in [
        ("PUT /api/v1/assets/", "", 3),
        ("POST ", "/jobs", 2),
        ("POST ", "/cancel", 1),
        ("POST ", "/workers", 2),
        ("POST ", "/heartbeat", 1),
        ("POST ", "/release", 1),
        // One is given back, one fails, and in the end there is no work.
        ("POST ", "/leases", brought + 3),
        ("POST ", "/return", 2),
        ("POST ", "/renew", 1),
        ("PUT ", "/partial", brought),
    ] {
        let seen = acknowledged.iter().filter(|seen| seen.call.starts_with(start) && seen.call.ends_with(end)).count();
        assert_eq!(seen, expected, "{start}...{end}: {acknowledged:?}");
    }
    // With the last partial the first round is complete. The round finalizer may begin to write before the answer.
    let last = acknowledged.iter().rposition(is_partial).expect("partials");
    for (number, acknowledgement) in acknowledged.iter().enumerate() {
        assert!(number == last || acknowledgement.unsynced.is_empty(), "{acknowledgement:?}");
    }
    // The film is so small that one merge is done after the other, and nothing else is written meanwhile.
    assert!(replay.removals.len() > brought, "all partials, and parents too: {:?}", replay.removals);
    for removal in &replay.removals {
        assert!(removal.unsynced.is_empty() && removal.unnamed.is_empty(), "{removal:?}");
    }

    // The same trace without some of its syncs is that of a coordinator which forgets them, and is seen through.
    type Missing<'a> = &'a dyn Fn(&str, &str) -> bool;
    let log = |call: &str, path: &str| is_sync(call) && is_log(path);
    let blobs = |call: &str, path: &str| is_sync(call) && depth(path) == Some(2);
    let folders = |call: &str, path: &str| is_sync(call) && depth(path) == Some(1);
    let syncs: [(&str, Missing<'_>); 3] = [("the log", &log), ("blobs", &blobs), ("their names", &folders)];
    for (what, missing) in syncs {
        let replay = replayed(&without(&trace, 0, missing), &data, ROLES);
        let partials: Vec<&Acknowledgement> = replay.acknowledgements.iter().filter(|seen| is_partial(seen)).collect();
        assert_eq!(partials.len(), brought);
        assert!(partials.iter().all(|partial| !partial.unsynced.is_empty()), "{what}: {partials:?}");
    }

    // So is one that has synced all partials but the last and is careless when it merges, or that removes before it
    // writes a row.
    let rows = |_: &str, path: &str| is_log(path);
    let received = acknowledged[last].received;
    for (what, missing) in syncs.into_iter().chain([("rows", &rows as Missing<'_>)]) {
        let replay = replayed(&without(&trace, received, missing), &data, ROLES);
        assert!(replay.removals.len() > brought, "{what}");
        for removal in &replay.removals {
            assert!(!removal.unsynced.is_empty() || !removal.unnamed.is_empty(), "{what}: {removal:?}");
        }
    }
}

fn is_partial(acknowledgement: &Acknowledgement) -> bool {
    acknowledgement.call.starts_with("PUT ") && acknowledgement.call.ends_with("/partial")
}

#[test]
fn nothing_is_acknowledged_while_syncs_fail() {
    nothing_is_acknowledged_while(Faults::fail_syncs);
}

#[test]
fn nothing_is_acknowledged_while_the_disk_is_full() {
    nothing_is_acknowledged_while(Faults::fill_disk);
}

/// Makes calls that write while a disk fails, and once more when it does not: what is acknowledged then is there after
/// a crash.
fn nothing_is_acknowledged_while(fails: fn(&Faults, bool)) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = write_scene(folder.path(), &sound_scene(), &sound_files());
    // It would log every failure.
    let environment = [("CLERESTORY_LOG".to_owned(), "off".to_owned())];
    let mut farm = Farm::start_with_faults(1, &environment, &OPTIONS);
    let [job, unwanted] = [(); 2].map(|()| farm.submit(&scene, &ORDER).parse::<JobId>().expect("a job"));
    let caller = Caller::new(&farm);
    let client = caller.client();
    let worker = HandWorker::register(&caller, job);
    let [kept, returned, failed] = [(); 3].map(|()| worker.claim());

    let content = b"a pane of crown glass".to_vec();
    let hash = content_hash(&content);
    let JobScene { scene, assets, .. } = caller.wait(client.job_scene(job)).expect("the scene of the job");
    let submission = JobSubmission {
        name: Some("late".to_owned()),
        scene,
        assets,
        samples_per_pixel: 4,
        tile_size: 16,
        priority: 0,
        reference: None,
        time_limit_ms: None,
        target_mse: None,
        target_estimated_mse: None,
        adaptive: false,
        assumptions: Vec::new(),
    };
    let registration = WorkerRegistration {
        name: "late".to_owned(),
        cores: 1,
        build: "by hand".to_owned(),
        ..WorkerRegistration::default()
    };
    let request = LeaseRequest { worker: worker.id(), max_nodes: None, wanted_ms: None, wait_ms: 0, built: Vec::new() };
    let rest = LeaseReturn { token: returned.lease.token, failure: None };
    let failure = LeaseReturn { token: failed.lease.token, failure: Some("its glass is cracked".to_owned()) };

    let store = || caller.wait(client.upload_asset(&hash, content.clone().into(), |_| ()));
    let submit = || caller.wait(client.submit_job(&submission));
    let register = || caller.wait(client.register_worker(&registration));
    let live = || caller.wait(client.heartbeat(worker.id(), &WorkerActivity::default()));
    let claim = || caller.wait(client.claim_lease(&request));
    let renew = || caller.wait(client.renew_lease(kept.lease.id, kept.lease.token));
    let upload = || caller.wait(client.upload_partial(upload_of(&kept)));
    let give_back = || caller.wait(client.return_lease(returned.lease.id, &rest));
    let fail = || caller.wait(client.return_lease(failed.lease.id, &failure));
    let cancel = || caller.wait(client.cancel_job(unwanted));

    let faults = farm.faults(0).expect("a disk that can fail");
    fails(faults, true);
    assert_refused("an asset", faults, store);
    assert_refused("a job", faults, submit);
    assert_refused("a worker", faults, register);
    assert_refused("a heartbeat", faults, live);
    assert_refused("a lease", faults, claim);
    assert_refused("a renewal", faults, renew);
    assert_refused("a partial", faults, upload);
    assert_refused("the rest of a lease", faults, give_back);
    assert_refused("a failure", faults, fail);
    assert_refused("a cancellation", faults, cancel);
    fails(faults, false);

    store().expect("an asset that is stored");
    let submitted = submit().expect("a job").id;
    let registered = register().expect("a worker").id;
    live().expect("a worker that is known");
    let claimed = claim().expect("an answer").expect("work");
    renew().expect("a lease that goes on");
    assert_all(&upload().expect("an acknowledgement"), NodeVerdict::Accepted);
    give_back().expect("a lease that is given back");
    fail().expect("a lease that is given back");
    assert_eq!(cancel().expect("an answer").state, JobState::Cancelled);

    farm.kill_coordinator(0);
    farm.restart_coordinator(0);
    let caller = Caller::new(&farm);
    let client = caller.client();
    assert_eq!(caller.wait(client.asset(&hash)).expect("the asset"), content);
    let jobs = caller.wait(client.jobs()).expect("a list");
    let states: BTreeMap<JobId, JobState> = jobs.iter().map(|job| (job.id, job.state)).collect();
    assert_eq!(states.get(&submitted), Some(&JobState::Queued));
    assert_eq!(states.get(&unwanted), Some(&JobState::Cancelled));
    let workers = caller.wait(client.workers()).expect("a list");
    assert!(workers.iter().any(|view| view.id == registered), "{workers:?}");
    caller.wait(client.renew_lease(claimed.id, claimed.token)).expect("the lease that was claimed");
    let again = caller.wait(client.upload_partial(upload_of(&kept))).expect("an answer");
    assert_all(&again, NodeVerdict::Duplicate);
    for lease in [&returned.lease, &failed.lease] {
        let error = caller.wait(client.renew_lease(lease.id, lease.token)).expect_err("a lease that is over");
        assert_eq!(error.problem().map(|problem| problem.code), Some(ProblemCode::LeaseReturned), "{error}");
    }
}

/// Makes a call that cannot be carried out while the disk fails.
#[track_caller]
fn assert_refused<T: Debug>(what: &str, faults: &Faults, call: impl Fn() -> Result<T, ClientError>) {
    // Once more, since the writer has given its connection to the database up after the first time.
    for _ in 0..2 {
        let failures = faults.failures();
        let error = call().expect_err(what);
        let problem = error.problem().unwrap_or_else(|| panic!("{what}: {error}"));
        assert!(problem.status >= 500, "{what}: {error}");
        assert!(faults.failures() > failures, "{what} is refused, and not because of the disk: {error}");
    }
}
