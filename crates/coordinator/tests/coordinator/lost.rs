//! Stored bytes that are lost or damaged: what was rendered once can be rendered again.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bytes::Bytes;
use clerestory_api::{ClientError, ContentHash, JobId, JobState, JobSubmission, JobView, ProblemCode};
use clerestory_coordinator::Config;

use crate::support::*;

/// Passes of the jobs here; rounds end at 1, 2, 4 and 8.
pub(crate) const PASSES: u32 = 8;

/// What happens to a file.
type Harm = fn(&Path) -> io::Result<()>;

/// Keeps nothing in memory, so that every read is one of the disk, and cuts work finely.
pub(crate) fn forgetful(config: &mut Config) {
    config.node_cache_bytes = 0;
    config.lease_nodes = Some(1);
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

fn node_files(farm: &TestFarm) -> Vec<PathBuf> {
    files(&farm.directory.path().join("blobs/nodes"))
}

/// Renders whatever is asked for until a job is as it should be.
pub(crate) async fn render_until(farm: &TestFarm, job: JobId, is_right: impl Fn(&JobView) -> bool) -> JobView {
    let worker = farm.worker().await;
    let deadline = Instant::now() + Duration::from_secs(60);
    loop {
        let view = farm.client.job(job).await.unwrap();
        if is_right(&view) {
            return view;
        }
        assert!(Instant::now() < deadline, "{view:?}");
        match worker.claim().await {
            None => tokio::time::sleep(Duration::from_millis(5)).await,
            Some(lease) => {
                // A job of which nothing is left begins again, and takes its leases back.
                let answer = worker.upload(&lease, noise_partial(&lease, &addresses(&lease))).await;
                let problem = answer.as_ref().err().map(|error| error.problem().unwrap().code);
                assert!(matches!(problem, None | Some(ProblemCode::LeaseReturned)), "{answer:?}");
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_whose_nodes_are_lost_or_damaged_renders_them_again_and_has_the_same_bits() {
    let harms: [(&str, Harm); 3] = [
        ("lost", |file| fs::remove_file(file)),
        ("cut off", |file| fs::File::options().write(true).open(file)?.set_len(fs::metadata(file)?.len() / 2)),
        ("changed", |file| {
            let mut bytes = fs::read(file)?;
            let middle = bytes.len() / 2;
            bytes[middle] ^= 4;
            fs::write(file, bytes)
        }),
    ];
    for (harm, harmed) in harms {
        let farm = TestFarm::start_with(forgetful).await;
        let job = farm.submit(PASSES).await;
        render_until(&farm, job.id, |view| view.rounds == 2).await;
        let mut harmed_files = BTreeSet::new();
        while farm.client.job(job.id).await.unwrap().redone_nodes == 0 {
            for file in node_files(&farm).into_iter().filter(|file| harmed_files.insert(file.clone())) {
                // Some are merged away meanwhile, into a node that is not harmed.
                harmed(&file).unwrap_or_else(|error| assert_eq!(error.kind(), ErrorKind::NotFound));
            }
            drop(farm.client.image(job.id).await);
        }
        let done = render_until(&farm, job.id, |view| view.state.is_final()).await;
        assert_eq!(done.state, JobState::Done, "{harm}: {:?}", done.failure);
        assert!(done.redone_nodes > 0, "{harm}");
        assert!(bits(&farm.image(job.id).await) == expected_bits(PASSES), "{harm}");
        farm.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_is_done_gets_back_what_is_lost_and_nobody_is_given_half_of_its_image() {
    let farm = TestFarm::start_with(forgetful).await;
    let job = farm.submit(PASSES).await;
    let done = render_until(&farm, job.id, |view| view.state == JobState::Done).await;
    let series = farm.client.convergence(job.id).await.unwrap();
    let refused = loop {
        // Some may be merged away meanwhile, into a node that is not lost: then the image is whole.
        node_files(&farm).iter().for_each(|file| drop(fs::remove_file(file)));
        match farm.client.image(job.id).await {
            Ok(image) => assert!(bits(&decoded(&image)) == expected_bits(PASSES)),
            Err(refused) => break refused,
        }
    };
    for refused in [refused, farm.client.image(job.id).await.unwrap_err()] {
        let ClientError::Problem { problem, .. } = &refused else { panic!("{refused}") };
        assert_eq!(problem.code, ProblemCode::Unavailable);
        assert!(problem.detail.contains("rendered again"), "{}", problem.detail);
    }
    let open = farm.client.job(job.id).await.unwrap();
    assert_eq!((open.state, open.stopped_by, open.finished_ms), (JobState::Running, None, None));
    // A node that was being merged when its file went is found lost only now.
    let image = loop {
        let again = render_until(&farm, job.id, |view| view.state == JobState::Done).await;
        assert!(again.redone_nodes > 0);
        assert_eq!((again.stopped_by, again.finished_ms), (done.stopped_by, done.finished_ms));
        if let Ok(image) = farm.client.image(job.id).await {
            break image;
        }
    };
    assert!(bits(&decoded(&image)) == expected_bits(PASSES));
    assert_eq!(farm.client.convergence(job.id).await.unwrap(), series);
    farm.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_coordinator_that_starts_looks_for_what_a_backup_lacks() {
    let farm = TestFarm::start_with(forgetful).await;
    let [done, open] = [farm.submit(PASSES).await, farm.submit(PASSES).await];
    render_until(&farm, done.id, |view| view.state == JobState::Done).await;
    render_until(&farm, open.id, |view| view.rounds == 2).await;
    let (directory, config) = farm.stop().await;
    for file in files(&directory.path().join("blobs/nodes")) {
        fs::remove_file(file).unwrap();
    }
    let farm = TestFarm::serve(directory, config).await;
    for job in [done.id, open.id] {
        let view = render_until(&farm, job, |view| view.redone_nodes > 0 && view.state.is_final()).await;
        assert_eq!(view.state, JobState::Done, "{:?}", view.failure);
        assert!(bits(&farm.image(job).await) == expected_bits(PASSES));
    }
    farm.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_asset_that_is_lost_is_asked_for_again() {
    let farm = TestFarm::start().await;
    let content = Bytes::from_static(b"glass");
    let asset = hash(&content);
    farm.client.upload_asset(&asset, content.clone(), |_| ()).await.unwrap();
    let stored = files(&farm.directory.path().join("blobs/assets"));
    fs::remove_file(&stored[0]).unwrap();
    let submission = JobSubmission { reference: Some(asset), ..submission(1) };
    let refused = farm.client.submit_job(&submission).await.unwrap_err();
    let ClientError::Problem { problem, .. } = &refused else { panic!("{refused}") };
    assert_eq!((problem.code, problem.missing.as_slice()), (ProblemCode::MissingAssets, &[asset][..]));
    farm.client.upload_asset(&asset, content, |_| ()).await.unwrap();
    assert!(stored[0].is_file());
    farm.stop().await;
}

/// A rendered image of the scene, uploaded.
async fn reference(farm: &TestFarm) -> (ContentHash, Bytes) {
    let job = farm.submit(1).await;
    render_until(farm, job.id, |view| view.state == JobState::Done).await;
    let image = farm.client.image(job.id).await.unwrap();
    farm.client.upload_asset(&hash(&image), image.clone(), |_| ()).await.unwrap();
    (hash(&image), image)
}

/// A submission whose mesh comes from a file, and the content of that file.
pub(crate) fn with_a_file() -> (JobSubmission, Bytes) {
    let mut scene = scene();
    scene["meshes"][0]["source"] = serde_json::json!({"obj": {"file": "floor.obj"}});
    let content = Bytes::from_static(b"v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 4 3 2 1\n");
    let assets = [("floor.obj".to_owned(), hash(&content))].into();
    (JobSubmission { scene, assets, ..submission(1) }, content)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_whose_file_is_lost_or_damaged_is_held_until_the_file_is_uploaded_again() {
    let farm = TestFarm::start().await;
    let (submission, content) = with_a_file();
    let asset = hash(&content);
    farm.client.upload_asset(&asset, content.clone(), |_| ()).await.unwrap();
    let file = files(&farm.directory.path().join("blobs/assets")).remove(0);
    let job = farm.client.submit_job(&submission).await.unwrap().id;
    let worker = farm.worker().await;
    let harms: [Harm; 3] = [|file| fs::remove_file(file), |file| fs::write(file, "v 1 2"), |file| fs::write(file, "")];
    for harmed in harms {
        harmed(&file).unwrap();
        farm.client.asset(&asset).await.unwrap_err();
        let hold = farm.client.job(job).await.unwrap().hold.expect("nobody can render it");
        assert_eq!((hold.asset, hold.node, hold.workers.len()), (Some(asset), None, 0));
        assert!(hold.reason.contains("the file `floor.obj` of its scene is lost or damaged"), "{}", hold.reason);
        assert!(worker.claim().await.is_none());
        // Whoever submits the scene again is asked for the file.
        let refused = farm.client.submit_job(&submission).await.unwrap_err();
        let ClientError::Problem { problem, .. } = &refused else { panic!("{refused}") };
        assert_eq!((problem.code, problem.missing.as_slice()), (ProblemCode::MissingAssets, &[asset][..]));
        farm.client.upload_asset(&asset, content.clone(), |_| ()).await.unwrap();
        assert_eq!(farm.client.job(job).await.unwrap().hold, None);
        assert_eq!(farm.client.asset(&asset).await.unwrap(), content);
    }
    // Somebody puts it back, and whoever uploads it finds it there.
    fs::remove_file(&file).unwrap();
    farm.client.asset(&asset).await.unwrap_err();
    assert!(farm.client.job(job).await.unwrap().hold.is_some());
    fs::write(&file, &content).unwrap();
    farm.client.upload_asset(&asset, content, |_| ()).await.unwrap();
    assert_eq!(farm.client.job(job).await.unwrap().hold, None);
    render_until(&farm, job, |view| view.state == JobState::Done).await;
    farm.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_submission_whose_file_or_reference_is_damaged_is_asked_for_it_again() {
    let farm = TestFarm::start().await;
    let (reference, image) = reference(&farm).await;
    let (with_file, content) = with_a_file();
    let file = hash(&content);
    farm.client.upload_asset(&file, content.clone(), |_| ()).await.unwrap();
    for stored in files(&farm.directory.path().join("blobs/assets")) {
        fs::write(stored, "neither image nor mesh").unwrap();
    }
    let with_reference = JobSubmission { reference: Some(reference), ..submission(1) };
    for (submission, asset, content) in [(with_file, file, content), (with_reference, reference, image)] {
        let refused = farm.client.submit_job(&submission).await.unwrap_err();
        assert_eq!(refused.problem().map(|problem| problem.missing.clone()), Some(vec![asset]), "{refused}");
        farm.client.upload_asset(&asset, content, |_| ()).await.unwrap();
        farm.client.submit_job(&submission).await.unwrap();
    }
    farm.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_coordinator_that_starts_holds_the_jobs_whose_files_a_backup_lacks() {
    let farm = TestFarm::start().await;
    let (with_file, content) = with_a_file();
    farm.client.upload_asset(&hash(&content), content.clone(), |_| ()).await.unwrap();
    let (reference, image) = reference(&farm).await;
    let jobs = [
        farm.client.submit_job(&with_file).await.unwrap().id,
        farm.client.submit_job(&JobSubmission { reference: Some(reference), ..submission(1) }).await.unwrap().id,
    ];
    let (directory, config) = farm.stop().await;
    for file in files(&directory.path().join("blobs/assets")) {
        fs::remove_file(file).unwrap();
    }
    let farm = TestFarm::serve(directory, config).await;
    let lost = [(jobs[0], hash(&content), content), (jobs[1], reference, image)];
    for (job, asset, content) in lost {
        let hold = async {
            loop {
                if let Some(hold) = farm.client.job(job).await.unwrap().hold {
                    break hold;
                }
                tokio::task::yield_now().await;
            }
        };
        assert_eq!(tokio::time::timeout(Duration::from_secs(30), hold).await.unwrap().asset, Some(asset));
        farm.client.upload_asset(&asset, content, |_| ()).await.unwrap();
        render_until(&farm, job, |view| view.state == JobState::Done).await;
    }
    farm.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_whose_reference_is_lost_on_the_way_ends_when_it_is_uploaded_again() {
    let farm = TestFarm::start().await;
    let (reference, content) = reference(&farm).await;
    let job = farm.client.submit_job(&JobSubmission { reference: Some(reference), ..submission(1) }).await.unwrap().id;
    for file in files(&farm.directory.path().join("blobs/assets")) {
        fs::remove_file(file).unwrap();
    }
    render_until(&farm, job, |view| view.hold.is_some()).await;
    farm.client.upload_asset(&reference, content, |_| ()).await.unwrap();
    let done = render_until(&farm, job, |view| view.state == JobState::Done).await;
    assert_eq!(done.hold, None);
    farm.stop().await;
}
