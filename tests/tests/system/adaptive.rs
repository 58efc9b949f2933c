//! Adaptive jobs: the same image on any farm as in one process, made again from its own file, whatever dies meanwhile.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::fs;
use std::path::{Path, PathBuf};

use clerestory_api::{JobState, JobView, StopReason};
use clerestory_film::ImageMetadata;
use clerestory_test_servers::{postgres, s3};
use clerestory_tests::farm::{Farm, clerestory, succeeded};
use clerestory_tests::made_images::{assert_made_alike, assert_same_bits, metadata, rendered_alone};
use clerestory_tests::small_blocks::crown_sphere;
use serde_json::{Value, json};
use tempfile::TempDir;

/// 40 passes of 4 samples; two blocks are 8 passes. Tiles do not divide the image.
const OPTIONS: [&str; 7] = ["--size", "44x44", "--tile", "8", "--spp", "160", "--adaptive"];

/// Passes of the noisiest tile.
const PASSES: u32 = 40;

struct Order {
    folder: TempDir,
    scene: PathBuf,
    options: Vec<&'static str>,
    alone: PathBuf,
}

impl Order {
    fn new(more: &[&'static str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let scene = crown_sphere(folder.path());
        let options = [&OPTIONS[..], more].concat();
        let alone = rendered_alone(&scene, folder.path(), "alone.exr", &options);
        Self { folder, scene, options, alone }
    }

    fn submit(&self, farm: &Farm) {
        farm.submit(&self.scene, &self.options);
    }

    /// The newest job ends with the image that one process makes.
    #[track_caller]
    fn is_fulfilled_by(&self, farm: &Farm) -> JobView {
        let job = farm.wait_until("ended", |job| job.state.is_final());
        assert_eq!(job.state, JobState::Done, "{job:?}");
        let image = self.folder.path().join(format!("{}.exr", job.id));
        fs::write(&image, farm.image(job.id)).unwrap();
        assert_made_alike(&image, &self.alone);
        assert_eq!(metadata(&image).tile_passes, metadata(&self.alone).tile_passes);
        job
    }
}

fn farm(options: &[&str]) -> Farm {
    let mut farm = Farm::start(None, &[&["--lease-nodes", "30", "--lease-seconds", "2"], options].concat());
    farm.start_worker("north");
    farm.start_worker("south");
    farm
}

#[test]
fn an_adaptive_image_is_the_same_on_a_farm_in_one_process_and_made_again() {
    let order = Order::new(&[]);
    let ImageMetadata { tile_passes, counters, .. } = metadata(&order.alone);
    let (fewest, most) = (tile_passes.iter().min().unwrap(), tile_passes.iter().max().unwrap());
    assert!(*most == PASSES && *fewest < PASSES / 2, "{tile_passes:?}");

    let again = order.folder.path().join("again.exr");
    succeeded(clerestory().arg("render").arg(&order.scene).arg("--like").arg(&order.alone).arg("-o").arg(&again));
    assert_made_alike(&again, &order.alone);

    let farm = farm(&[]);
    order.submit(&farm);
    let job = order.is_fulfilled_by(&farm);
    assert!(job.adaptive && job.stopped_by == Some(StopReason::Samples), "{job:?}");
    assert_eq!((job.complete_passes, job.progress), (PASSES, 1.0));
    let pilot_samples = 2 * 4 * 44 * 44;
    assert_eq!(job.samples, counters.samples + pilot_samples);
    let points = farm.convergence(job.id).points;
    assert_eq!(points.iter().map(|point| point.passes).collect::<Vec<_>>(), [1, 2, 4, 8, 16, 32, 40]);

    // The same samples, in every pixel, are more work and another image.
    let options: Vec<&str> = order.options.iter().copied().filter(|option| *option != "--adaptive").collect();
    let even = rendered_alone(&order.scene, order.folder.path(), "even.exr", &options);
    assert!(metadata(&even).counters.samples > counters.samples);
}

#[test]
fn one_process_counts_what_the_farm_counts() {
    let order = Order::new(&[]);
    let [alone, on_farm] = ["alone.json", "farm.json"].map(|name| order.folder.path().join(name));
    let image = order.folder.path().join("counted.exr");
    let mut render = clerestory();
    render.arg("render").arg(&order.scene).args(&order.options).arg("-o").arg(&image).arg("--stats").arg(&alone);
    succeeded(&mut render);
    let farm = farm(&[]);
    let mut submit = farm.command(&["submit", "--wait", "--stats"]);
    succeeded(submit.arg(&on_farm).arg(&order.scene).args(&order.options));
    let [alone, on_farm] =
        [alone, on_farm].map(|file| serde_json::from_slice::<Value>(&fs::read(file).unwrap()).unwrap());
    assert_eq!(alone, on_farm);
}

#[test]
fn a_target_and_a_time_limit_end_adaptive_jobs_as_they_end_others() {
    let alone = Order::new(&["--target-estimated-mse", "1e-30"]);
    let text = |target: f64| -> &'static str { target.to_string().leak() };
    // Passes of 4 blocks at least, as an estimate needs them.
    let ImageMetadata { tile_passes, .. } = metadata(&alone.alone);
    assert_eq!(tile_passes.iter().min(), Some(&16), "{tile_passes:?}");
    let farm = farm(&[]);
    alone.submit(&farm);
    let job = alone.is_fulfilled_by(&farm);
    let points = farm.convergence(job.id).points;
    let at = points.iter().find(|point| point.passes == 32).unwrap().estimated_mse.unwrap();
    let order = Order::new(&["--target-estimated-mse", text(at)]);
    order.submit(&farm);
    let job = order.is_fulfilled_by(&farm);
    assert_eq!((job.stopped_by, job.complete_passes), (Some(StopReason::EstimatedMse), 32));

    let order = Order::new(&[]);
    farm.submit(&order.scene, &["--size", "44x44", "--tile", "8", "--time", "1", "--adaptive"]);
    let job = farm.wait_until("ended", |job| job.state.is_final());
    assert_eq!(job.stopped_by, Some(StopReason::Time), "{job:?}");
    let [image, again] = ["timed.exr", "again.exr"].map(|name| order.folder.path().join(name));
    fs::write(&image, farm.image(job.id)).unwrap();
    made_again(&order.scene, &image, &again);
    let mut words = clerestory();
    words.arg("render").arg(&order.scene).args(["--size", "44x44", "--tile", "8", "--time", "0.5", "--adaptive"]);
    let summary: Value = serde_json::from_slice(&succeeded(words.arg("--json").arg("-o").arg(&image)).stdout).unwrap();
    assert_eq!(summary["stopped_by"], json!("time"));
}

#[test]
fn too_few_samples_to_share_out_are_refused_with_what_would_do() {
    let folder = tempfile::tempdir().unwrap();
    let scene = crown_sphere(folder.path());
    let farm = Farm::start(None, &[]);
    let mut render = clerestory();
    render.arg("render").arg(&scene).args(["--spp", "32", "--adaptive"]);
    let mut submit = farm.command(&["submit"]);
    submit.arg(&scene).args(["--spp", "32", "--adaptive"]);
    for command in [&mut render, &mut submit] {
        let output = command.output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && words.contains("at least 33") && words.contains("32"), "{words}");
    }
}

/// Kills every coordinator around the moments at which passes are shared out and rounds recorded.
fn kill_around_the_sharing_out(mut farm: Farm, coordinators: usize) {
    let order = Order::new(&[]);
    for rounds in [0, 1, 2, 3, 6] {
        order.submit(&farm);
        farm.wait_until("going on", |job| (job.rounds >= rounds && job.samples > 0) || job.state.is_final());
        for index in 0..coordinators {
            farm.kill_coordinator(index);
            farm.restart_coordinator(index);
        }
        order.is_fulfilled_by(&farm);
    }
    farm.kill_worker(0);
    farm.start_worker("successor");
    order.submit(&farm);
    order.is_fulfilled_by(&farm);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn killing_the_coordinator_around_the_sharing_out_changes_no_bit() {
    kill_around_the_sharing_out(farm(&[]), 1);
}

#[test]
fn killing_either_of_two_coordinators_around_the_sharing_out_changes_no_bit() {
    let (database, bucket) = (postgres().new_database(), format!("s3://{}/farm", s3().new_bucket()));
    let options = ["--database", &database, "--object-store", &bucket, "--lease-nodes", "30", "--lease-seconds", "2"];
    let mut farm = Farm::start_several(2, &s3().environment(), &options);
    farm.start_worker("north");
    farm.start_worker("south");
    kill_around_the_sharing_out(farm, 2);
}

#[test]
fn a_job_that_is_cancelled_keeps_an_image_that_can_be_made_again() {
    let order = Order::new(&[]);
    let farm = farm(&[]);
    farm.submit(&order.scene, &["--size", "44x44", "--tile", "8", "--spp", "1000000", "--adaptive"]);
    farm.wait_until("shared out", |job| job.rounds >= 3);
    let job = farm.newest_job();
    succeeded(farm.command(&["cancel"]).arg(job.id.to_string()));
    let job = farm.wait_until("ended", |job| job.state.is_final());
    assert_eq!(job.state, JobState::Cancelled);
    let [image, again] = ["cut.exr", "again.exr"].map(|name| order.folder.path().join(name));
    fs::write(&image, farm.image(job.id)).unwrap();
    made_again(&order.scene, &image, &again);
}

fn made_again(scene: &Path, image: &Path, again: &Path) {
    succeeded(clerestory().arg("render").arg(scene).arg("--like").arg(image).arg("-o").arg(again));
    assert_same_bits(image, again);
}
