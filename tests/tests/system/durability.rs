//! What a coordinator acknowledges is on disk before it says so, shown by its system calls.

use std::fs;

use clerestory_api::PartialUpload;
use clerestory_tests::calls::Caller;
use clerestory_tests::farm::Farm;
use clerestory_tests::hand_worker::HandWorker;
use clerestory_tests::malformed_scenes::{sound_files, sound_scene, write_scene};
use clerestory_tests::system_calls::{Acknowledgement, acknowledgements};

/// The index of SQLite's log, which is made anew from the log when it is lost.
fn is_index(path: &str) -> bool {
    path.ends_with("-shm")
}

#[test]
fn whatever_is_acknowledged_is_on_disk() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = write_scene(folder.path(), &sound_scene(), &sound_files());
    let file = folder.path().join("trace");
    let farm = Farm::start_traced(&file, &["--lease-nodes", "4"]);
    let data = farm.data(0).to_owned();
    farm.submit(&scene, &["--spp", "64", "--tile", "8"]);
    let caller = Caller::new(&farm);
    let worker = HandWorker::register(&caller, farm.newest_job().id);
    for _ in 0..2 {
        let delivery = worker.claim();
        worker.renew(&delivery.lease);
        let (lease, token, body) = (delivery.lease.id, delivery.lease.token, delivery.partial.into());
        let upload = PartialUpload { lease, token, core_ms: 1, body };
        caller.wait(caller.client().upload_partial(upload)).expect("an acknowledgement");
    }
    worker.give_back(&worker.claim().lease);
    drop(farm);

    let trace = fs::read_to_string(&file).expect("a trace: is `strace` installed?");
    let seen = acknowledgements(&trace, &data, is_index, |_| true);
    let count = |of: &dyn Fn(&Acknowledgement) -> bool| seen.iter().filter(|seen| of(seen)).count();
    assert_eq!(count(&is_partial), 2, "{seen:?}");
    assert_eq!(count(&|seen| seen.call.ends_with("/jobs")), 1, "{seen:?}");
    assert!(seen.len() >= 12, "files, a job, a worker, leases, renewals and partials: {seen:?}");
    for acknowledgement in &seen {
        assert!(acknowledgement.unsynced.is_empty(), "{acknowledgement:?}");
    }

    // The same trace without some of its syncs is that of a coordinator which forgets them, and is seen through.
    let log = |path: &str| path.ends_with("-wal");
    // Blobs are `nodes/JOB/NAME`.
    let depth = |path: &str| path.split("/nodes/").nth(1).map(|below| below.split('/').count());
    let blobs = |path: &str| depth(path) == Some(2);
    let folders = |path: &str| depth(path) == Some(1);
    type Forgotten<'a> = &'a dyn Fn(&str) -> bool;
    let faults: [(&str, Forgotten<'_>); 3] = [("the log", &log), ("blobs", &blobs), ("their names", &folders)];
    for (what, forgotten) in faults {
        let seen = acknowledgements(&trace, &data, is_index, |path| !forgotten(path));
        let partials: Vec<&Acknowledgement> = seen.iter().filter(|seen| is_partial(seen)).collect();
        assert!(partials.iter().all(|partial| !partial.unsynced.is_empty()), "{what}: {partials:?}");
    }
}

fn is_partial(acknowledgement: &Acknowledgement) -> bool {
    acknowledgement.call.starts_with("PUT ") && acknowledgement.call.contains("/leases/")
}
