//! Data that older builds have left: today's build opens them, shows what is there, and finishes what was begun with
//! the same bits. Where it computes other bits, what was begun waits and says so.

use std::path::{Path, PathBuf};

use clerestory_api::{BuildWait, JobState, JobView};
use clerestory_test_servers::postgres;
use clerestory_tests::calls::Caller;
use clerestory_tests::farm::Farm;
use clerestory_tests::pixel_digests::{DigestTable, PixelDigest};
use clerestory_tests::stored_farm::{ALONE, DATABASE, JOBS, POSTGRES, SQLITE};

/// The leases that were held when the farm was killed have run out soon.
const OPTIONS: [&str; 2] = ["--lease-seconds", "2"];

/// The farms that have been written, with one kind of database.
fn stored_farms(kind: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/farms");
    let farms = std::fs::read_dir(folder).expect("the farms are there").map(|entry| entry.expect("a farm").path());
    let mut farms: Vec<PathBuf> = farms.filter(|farm| farm.is_dir()).map(|farm| farm.join(kind)).collect();
    farms.sort();
    assert!(!farms.is_empty());
    farms
}

#[test]
fn a_data_folder_of_an_older_build_goes_on_where_it_was() {
    for stored in stored_farms(SQLITE) {
        go_on(Farm::start_on(&stored, &OPTIONS), &stored);
    }
}

#[test]
fn a_postgres_database_of_an_older_build_goes_on_where_it_was() {
    for stored in stored_farms(POSTGRES) {
        let database = postgres().restored(&stored.join(DATABASE));
        go_on(Farm::start_on(&stored, &[&OPTIONS[..], &["--database", &database]].concat()), &stored);
    }
}

/// What the jobs of a farm are: their states, and the digests of their images.
fn looked_at(caller: &Caller) -> DigestTable {
    let mut table = DigestTable::default();
    for JobView { id, name, state, failure, .. } in caller.wait(caller.client().jobs()).expect("the jobs") {
        assert_eq!(failure.is_some(), state == JobState::Failed, "{name}: {failure:?}");
        match caller.wait(caller.client().image(id)) {
            Ok(image) => table.add(&name, state.name(), PixelDigest::of_image(&image)),
            Err(error) => assert_eq!(state, JobState::Queued, "{error}"),
        }
    }
    table
}

/// The jobs are what they were. Those that had not ended end with the pixels of one process. Where pixels have changed
/// since, those that had begun keep theirs and wait.
#[track_caller]
fn go_on(mut farm: Farm, stored: &Path) {
    let (mut before, mut after) = (DigestTable::default(), DigestTable::default());
    for (job, words, digest) in DigestTable::read(&stored.join(JOBS)).cases() {
        if words == ALONE {
            after.add(job, JobState::Done.name(), digest.clone());
        } else {
            before.add(job, words, digest.clone());
        }
        if [JobState::Failed, JobState::Cancelled].iter().any(|state| state.name() == words) {
            after.add(job, words, digest.clone());
        }
    }
    let caller = Caller::new(&farm);
    assert_eq!(before.differences(&looked_at(&caller)), [""; 0], "{}", stored.display());
    farm.start_worker("another");
    farm.wait_until_all_have_ended();
    let now = looked_at(&caller);
    let jobs = caller.wait(caller.client().jobs()).expect("the jobs");
    let mut waiting: Vec<&str> = Vec::new();
    for JobView { name, waits_for_build, .. } in &jobs {
        let Some(BuildWait { reason, .. }) = waits_for_build else { continue };
        assert!(reason.contains("compute other bits") && reason.contains("submit the job again"), "{name}: {reason}");
        waiting.push(name);
    }
    if waiting.is_empty() {
        assert_eq!(after.differences(&now), [""; 0], "{}", stored.display());
        return;
    }
    waiting.sort_unstable();
    let begun: Vec<&str> =
        before.cases().filter(|(_, state, _)| *state == JobState::Running.name()).map(|(job, ..)| job).collect();
    assert_eq!(waiting, begun, "{}", stored.display());
    let changed = before.differences(&now);
    assert_eq!(changed, ["queued, done: is rendered, and is not recorded"], "{}", stored.display());
}
