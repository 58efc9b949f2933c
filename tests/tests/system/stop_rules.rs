//! Jobs that a target ends: at the first round that reaches it, with the image that so many samples make, whatever dies
//! meanwhile.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::fs;
use std::path::PathBuf;

use clerestory_api::{ConvergencePoint, JobState, JobView, StopReason};
use clerestory_film::{DecodeBudget, FrameImage, mean_squared_standard_error};
use clerestory_test_servers::postgres;
use clerestory_tests::farm::{Farm, clerestory, succeeded};
use clerestory_tests::made_images::{assert_made_alike, rendered_alone};
use clerestory_tests::small_blocks::crown_sphere;
use serde_json::{Value, json};
use tempfile::TempDir;

/// Pixels across and down; tiles do not divide them.
const SIZE: [&str; 2] = ["--size", "24x24"];

/// Samples in a pixel at which the targets are reached. They are whole blocks, more than the four that an estimate
/// needs, and a round of 48 passes.
const END: u32 = 192;

/// A farm sums errors in another order, which may round upwards.
const ROUNDING: f64 = 1.0 + 1e-9;

/// A scene with small passes and blocks, and a reference with noise of its own.
struct Order {
    folder: TempDir,
    /// The options that ask for it.
    options: Vec<String>,
    reason: StopReason,
    /// The image that one process makes of [`END`] samples in each pixel.
    alone: PathBuf,
}

impl Order {
    /// A target that is reached when the error against a reference is that of [`END`] samples.
    fn by_measured_error() -> Self {
        let (folder, alone) = Self::scene();
        let reference = ["--seed", "7", "--spp", "1024"];
        let reference =
            rendered_alone(&scene(&folder), folder.path(), "reference.exr", &[&SIZE[..], &reference].concat());
        let words = succeeded(clerestory().arg("compare").arg(&alone).arg(&reference).arg("--json"));
        let metrics: Value = serde_json::from_slice(&words.stdout).unwrap();
        let target = (metrics["corrected_mse"].as_f64().unwrap() * ROUNDING).to_string();
        let options = ["--target-mse", &target, "--reference", reference.to_str().unwrap()].map(str::to_owned);
        Self { folder, options: options.to_vec(), reason: StopReason::Mse, alone }
    }

    /// A target that is reached when the image's own noise is that of [`END`] samples.
    fn by_estimated_error() -> Self {
        let (folder, alone) = Self::scene();
        let image = FrameImage::decode(&fs::read(&alone).unwrap(), DecodeBudget { pixel_bytes: 1 << 24 }).unwrap();
        let target = (mean_squared_standard_error(&image).unwrap() * ROUNDING).to_string();
        let options = ["--target-estimated-mse", &target].map(str::to_owned);
        Self { folder, options: options.to_vec(), reason: StopReason::EstimatedMse, alone }
    }

    fn scene() -> (TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        crown_sphere(folder.path());
        let samples = END.to_string();
        let options = [&SIZE[..], &["--spp", &samples]].concat();
        let alone = rendered_alone(&scene(&folder), folder.path(), "alone.exr", &options);
        (folder, alone)
    }

    fn options(&self) -> Vec<&str> {
        SIZE.into_iter().chain(self.options.iter().map(String::as_str)).collect()
    }

    fn submit(&self, farm: &Farm) {
        farm.submit(&scene(&self.folder), &[self.options(), vec!["--tile", "16"]].concat());
    }

    /// The newest job ends as it should.
    #[track_caller]
    fn is_fulfilled_by(&self, farm: &Farm) {
        let job = ended(farm);
        assert_eq!((job.state, job.stopped_by), (JobState::Done, Some(self.reason)), "{job:?}");
        assert_eq!(job.complete_passes * job.samples_per_pass, END, "{job:?}");
        let image = self.folder.path().join(format!("{}.exr", job.id));
        fs::write(&image, farm.image(job.id)).unwrap();
        assert_made_alike(&image, &self.alone);
    }
}

fn scene(folder: &TempDir) -> PathBuf {
    folder.path().join("crown-sphere.json")
}

fn ended(farm: &Farm) -> JobView {
    farm.wait_until("ended", |job| job.state.is_final())
}

/// A farm of two workers whose leases reach far beyond a round.
fn farm(options: &[&str]) -> Farm {
    let mut farm = Farm::start(None, &[&["--lease-nodes", "40", "--lease-seconds", "2"], options].concat());
    farm.start_worker("north");
    farm.start_worker("south");
    farm
}

/// The first round that reaches a target, and no other, is the last.
fn ends_at_the_first_round_that_is_good_enough(order: &Order, error: impl Fn(&ConvergencePoint) -> Option<f64>) {
    let farm = farm(&[]);
    order.submit(&farm);
    order.is_fulfilled_by(&farm);
    let job = farm.newest_job();
    let target = job.target_mse.or(job.target_estimated_mse).unwrap();
    let errors: Vec<Option<f64>> = farm.convergence(job.id).points.iter().map(&error).collect();
    let (last, others) = errors.split_last().unwrap();
    assert!(last.unwrap() <= target, "{errors:?}");
    assert!(others.iter().flatten().all(|error| *error > target), "{errors:?}");

    // One process stops at the same round by itself.
    let image = order.folder.path().join("stopped.exr");
    let mut words = clerestory();
    words.arg("render").arg(scene(&order.folder)).args(order.options()).arg("--json").arg("-o").arg(&image);
    let summary: Value = serde_json::from_slice(&succeeded(&mut words).stdout).unwrap();
    assert_eq!(summary["stopped_by"], json!(order.reason));
    assert_made_alike(&image, &order.alone);
}

#[test]
fn a_measured_error_ends_a_job_at_the_first_round_that_reaches_it() {
    ends_at_the_first_round_that_is_good_enough(&Order::by_measured_error(), |point| point.corrected_mse);
}

#[test]
fn an_estimated_error_ends_a_job_at_the_first_round_that_reaches_it() {
    // Four blocks of 16 samples.
    let counts = |point: &ConvergencePoint| point.samples_per_pixel >= 64;
    let error = |point: &ConvergencePoint| point.estimated_mse.filter(|_| counts(point));
    ends_at_the_first_round_that_is_good_enough(&Order::by_estimated_error(), error);
}

#[test]
fn samples_and_time_end_a_job_before_a_target_that_is_out_of_reach() {
    let order = Order::by_estimated_error();
    let farm = farm(&[]);
    let unreachable = ["--size", "24x24", "--target-estimated-mse", "1e-30"];
    for (limit, reason) in [(["--spp", "80"], StopReason::Samples), (["--time", "1"], StopReason::Time)] {
        farm.submit(&scene(&order.folder), &[&unreachable[..], &limit].concat());
        assert_eq!(ended(&farm).stopped_by, Some(reason));
        let image = order.folder.path().join("limited.exr");
        let mut words = clerestory();
        words.arg("render").arg(scene(&order.folder)).args(unreachable).args(limit).arg("--json").arg("-o").arg(&image);
        let summary: Value = serde_json::from_slice(&succeeded(&mut words).stdout).unwrap();
        assert_eq!(summary["stopped_by"], json!(reason));
    }
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn killing_the_coordinator_around_the_last_round_changes_neither_it_nor_a_bit() {
    kill_around_the_last_round(&Order::by_measured_error(), &[]);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn killing_the_coordinator_around_the_last_round_changes_neither_it_nor_a_bit_in_postgres() {
    kill_around_the_last_round(&Order::by_estimated_error(), &["--database", &postgres().new_database()]);
}

fn kill_around_the_last_round(order: &Order, options: &[&str]) {
    let mut farm = farm(options);
    // The last round is the seventh: of 1, 2, 4, 8, 16, 32 and 48 passes.
    for rounds in [3, 5, 6, 7] {
        order.submit(&farm);
        farm.wait_until("going on", |job| job.rounds >= rounds || job.state.is_final());
        farm.kill_coordinator(0);
        farm.restart_coordinator(0);
        order.is_fulfilled_by(&farm);
    }
    farm.kill_worker(0);
    farm.start_worker("successor");
    order.submit(&farm);
    order.is_fulfilled_by(&farm);
}
