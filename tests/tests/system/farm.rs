//! One process, or a farm of any size in which anything dies: the same bits.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use clerestory_api::{JobState, JobView, StopReason};
use clerestory_film::{DecodeBudget, FrameImage};
use clerestory_test_servers::{S3Server, postgres, s3};
use clerestory_tests::farm::{Farm, clerestory, succeeded};
use clerestory_tests::made_images::{assert_made_alike, assert_same_bits, rendered_alone, rendered_by};
use clerestory_tests::waiting::until;
use tempfile::TempDir;

use crate::readiness::unreadiness;

/// What is asked for: a scene and options. No number of passes (16 samples each) is a power of two, and no tile size
/// divides the images.
struct Order {
    scene: &'static str,
    options: &'static [&'static str],
}

const WITH_CONE: Order = Order {
    scene: "references/crown-sphere.json",
    options: &["--size", "44x44", "--spp", "208", "--integrator", "cone"],
};

/// The file of the image that one process makes of it.
static ALONE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::read(WITH_CONE.rendered_alone(&folder)).expect("an image")
});

/// Writes the image that one process makes of [`WITH_CONE`] into a folder.
fn alone_in(folder: &TempDir) -> PathBuf {
    let image = folder.path().join("alone.exr");
    std::fs::write(&image, &*ALONE).expect("a writable folder");
    image
}

impl Order {
    fn scene(&self) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(self.scene)
    }

    /// Submits it, with tiles of this edge.
    fn submit(&self, farm: &Farm, tile: &str) {
        farm.submit(&self.scene(), &[self.options, &["--tile", tile]].concat());
    }

    /// The image that one process makes.
    fn rendered_alone(&self, folder: &TempDir) -> PathBuf {
        rendered_alone(&self.scene(), folder.path(), "alone.exr", self.options)
    }
}

#[test]
fn farms_of_any_size_make_the_same_bits_as_one_process() {
    let order = |scene, options| Order { scene, options };
    let orders = [
        order("references/crown-sphere.json", &["--size", "40x40", "--spp", "112", "--integrator", "cone"][..]),
        order("references/crown-sphere.json", &["--size", "40x40", "--spp", "80", "--integrator", "fnee"]),
        // With a light plane.
        order("room.json", &["--size", "40x40", "--spp", "48", "--integrator", "auto"]),
    ];
    let orders = orders.map(|order| {
        let folder = tempfile::tempdir().unwrap();
        let alone = order.rendered_alone(&folder);
        assert!(has_caustics(&alone), "{}: no light in the layer caustic", order.scene);
        (order, folder, alone)
    });
    for (workers, tile, lease_nodes) in [(1, "64", "1"), (2, "16", "9"), (5, "16", "3")] {
        let mut farm = Farm::start(None, &["--lease-nodes", lease_nodes]);
        for worker in 0..workers {
            farm.start_worker(&format!("worker {worker}"));
        }
        for (order, folder, alone) in &orders {
            order.submit(&farm, tile);
            assert_made_alike(&rendered_by(&farm, folder.path()), alone);
        }
    }
}

/// Whether the layer `caustic` of an image has light.
fn has_caustics(image: &Path) -> bool {
    let file = std::fs::read(image).expect("a file");
    let image = FrameImage::decode(&file, DecodeBudget { pixel_bytes: 1 << 24 }).expect("an image");
    image.layers().caustic.as_ref().is_some_and(|layer| layer.as_flattened().iter().any(|value| *value > 0.0))
}

#[test]
fn submit_brings_the_same_files_as_render() {
    let folder = tempfile::tempdir().unwrap();
    let files = |name: &str, integrator: &str, words: &mut Command| {
        let [image, stats] = [".exr", ".json"].map(|ending| folder.path().join(format!("{name}{ending}")));
        let words = words.arg(WITH_CONE.scene()).args(["--size", "40x40", "--spp", "48", "--integrator", integrator]);
        succeeded(words.arg("--png").arg("-o").arg(&image).arg("--stats").arg(&stats));
        (image, stats)
    };
    let mut farm = Farm::start(None, &["--lease-nodes", "1"]);
    farm.start_worker("nave");
    for integrator in ["fnee", "auto", "light"] {
        let alone = files("alone", integrator, clerestory().arg("render"));
        let together = files("together", integrator, &mut farm.command(&["submit", "--wait", "--tile", "16"]));
        assert_made_alike(&together.0, &alone.0);
        let read = |file: &Path| std::fs::read(file).expect("a file");
        assert_eq!(String::from_utf8_lossy(&read(&together.1)), String::from_utf8_lossy(&read(&alone.1)));
        let png = |image: &Path| read(&image.with_extension("png"));
        assert!(png(&together.0) == png(&alone.0), "the same light looks different");
        let chosen = farm.newest_job().chosen_methods.expect("a report of the worker");
        assert_eq!(chosen.is_empty(), integrator != "auto", "{chosen:?}");
    }
}

#[test]
fn killing_a_worker_and_then_the_coordinator_changes_no_bit() {
    kill_a_worker_and_then_the_coordinator(&[]);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn killing_a_worker_and_then_the_coordinator_changes_no_bit_in_postgres() {
    kill_a_worker_and_then_the_coordinator(&["--database", &postgres().new_database()]);
}

fn kill_a_worker_and_then_the_coordinator(options: &[&str]) {
    let mut farm = Farm::start(None, &[&["--lease-nodes", "4", "--lease-seconds", "2"], options].concat());
    begin(&mut farm);
    farm.kill_worker(0);
    kill_the_coordinator(&mut farm);
    assert_made_as_alone(&farm);
}

/// Kills the coordinator once the job has gone on, and starts another, which has all that was acknowledged.
fn kill_the_coordinator(farm: &mut Farm) {
    let before = farm.wait_until("going on", |job| job.progress > 0.3);
    assert_eq!(before.state, JobState::Running, "the job must still run when the coordinator is killed");
    farm.kill_coordinator(0);
    farm.restart_coordinator(0);
    let after = farm.newest_job();
    assert!(after.progress >= before.progress, "acknowledged work was lost: {after:?}");
}

#[test]
fn a_worker_that_is_asked_to_stop_gives_its_work_back() {
    let folder = tempfile::tempdir().unwrap();
    let alone = alone_in(&folder);
    // Leases that would outlast the test: only giving them back lets the other worker finish.
    let mut farm = Farm::start(None, &["--lease-nodes", "40", "--lease-seconds", "3600"]);
    farm.start_worker("polite");
    WITH_CONE.submit(&farm, "16");
    farm.wait_until("begun", |job| job.progress > 0.05);
    assert!(farm.stop_worker(0).success());
    farm.start_worker("successor");
    assert_same_bits(&rendered_by(&farm, folder.path()), &alone);
}

#[test]
fn a_time_limited_image_is_made_again_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let scene = WITH_CONE.scene();
    let limits = ["--size", "72x72", "--tile", "16", "--time", "2"];
    let alone = rendered_alone(&scene, folder.path(), "limited.exr", &limits);
    let mut farm = Farm::start(None, &[]);
    farm.start_worker("only");
    farm.submit(&scene, &limits);
    let together = rendered_by(&farm, folder.path());
    assert_eq!(farm.newest_job().stopped_by, Some(StopReason::Time));
    for limited in [alone, together] {
        let again = rendered_alone(&scene, folder.path(), "again.exr", &["--like", limited.to_str().unwrap()]);
        assert_same_bits(&again, &limited);
    }
}

#[test]
fn killing_the_object_server_and_the_coordinator_changes_no_bit_in_postgres_and_s3() {
    let mut objects = S3Server::start().unwrap();
    let (database, bucket) = (postgres().new_database(), format!("s3://{}/farm", objects.new_bucket()));
    let options = ["--lease-nodes", "4", "--lease-seconds", "2", "--database", &database, "--object-store", &bucket];
    let mut farm = Farm::start_in(&objects.environment(), None, &options);
    begin(&mut farm);
    objects.kill();
    until("uploads meet no store", || unreadiness(&farm).is_some_and(|reason| reason.contains("the blob store")));
    objects.restart().unwrap();
    kill_the_coordinator(&mut farm);
    assert_made_as_alone(&farm);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn killing_any_of_several_coordinators_stops_nothing_and_changes_no_bit() {
    let mut farm = two_coordinators();
    begin(&mut farm);
    farm.kill_coordinator(0);
    // The other goes on alone, whichever of them kept the film.
    farm.wait_until("going on", |job| job.progress > 0.4);
    farm.restart_coordinator(0);
    farm.kill_coordinator(1);
    assert_made_as_alone(&farm);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn a_suspended_coordinator_stops_nothing_and_changes_no_bit_when_it_wakes_up() {
    let mut farm = two_coordinators();
    let job = begin(&mut farm);
    farm.suspend_coordinator(0, true);
    // Calls that it has taken wait for it, and new ones too: no balancer knows. So the other is asked by itself.
    farm.wait_at(1, "going on", |record| record.id == job.id && record.progress > 0.4);
    farm.suspend_coordinator(0, false);
    assert_made_as_alone(&farm);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn a_coordinator_that_dies_with_a_clock_ten_minutes_fast_holds_nobody_up() {
    let mut farm = two_coordinators();
    farm.kill_coordinator(1);
    farm.faults(0).unwrap().step_clock(600);
    farm.start_worker("first");
    WITH_CONE.submit(&farm, "16");
    // Whatever is claimed is claimed by it, and its leases are those of a worker that dies too.
    farm.wait_until("going on", |job| job.complete_passes > 1);
    farm.kill_worker(0);
    farm.kill_coordinator(0);
    farm.restart_coordinator(1);
    farm.start_worker("second");
    assert_made_as_alone(&farm);
}

/// Starts two workers, and submits a job that is begun when this returns.
fn begin(farm: &mut Farm) -> JobView {
    farm.start_worker("first");
    farm.start_worker("second");
    WITH_CONE.submit(farm, "16");
    farm.wait_until("begun", |job| job.progress > 0.05)
}

/// Tests that the image of the newest job is that which one process makes.
#[track_caller]
fn assert_made_as_alone(farm: &Farm) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    assert_made_alike(&rendered_by(farm, folder.path()), &alone_in(&folder));
}

/// Two coordinators on PostgreSQL and S3.
fn two_coordinators() -> Farm {
    let (database, bucket) = (postgres().new_database(), format!("s3://{}/farm", s3().new_bucket()));
    let options = ["--lease-nodes", "4", "--lease-seconds", "2", "--database", &database, "--object-store", &bucket];
    Farm::start_several(2, &s3().environment(), &options)
}

#[test]
fn a_coordinator_that_keeps_blobs_elsewhere_is_refused() {
    let database = postgres().new_database();
    let farm = Farm::start(None, &["--database", &database]);
    succeeded(&mut farm.command(&["jobs"]));
    let folder = tempfile::tempdir().unwrap();
    let mut command = clerestory();
    let output = command.args(["coordinator", "--listen", "127.0.0.1:0", "--database", &database, "--data"]);
    let output = output.arg(folder.path()).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success());
    assert!(message.contains("has its blobs elsewhere"), "{message}");
    drop(farm);
}

#[test]
fn an_object_store_of_another_farm_is_refused() {
    let bucket = format!("s3://{}", s3().new_bucket());
    let farm = Farm::start_in(&s3().environment(), None, &["--object-store", &bucket]);
    // Once it answers, the bucket is its own.
    succeeded(&mut farm.command(&["jobs"]));
    let folder = tempfile::tempdir().unwrap();
    let mut command = clerestory();
    command.envs(s3().environment()).args([
        "coordinator",
        "--listen",
        "127.0.0.1:0",
        "--object-store",
        &bucket,
        "--data",
    ]);
    let output = command.arg(folder.path()).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success());
    assert!(message.contains(&bucket) && message.contains("belong to the farm"), "{message}");
    drop(farm);
}

#[test]
fn an_address_that_is_no_database_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = clerestory();
    let output = command.args(["coordinator", "--listen", "127.0.0.1:0", "--database", "mysql://db/farm", "--data"]);
    let output = output.arg(folder.path()).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success());
    assert!(message.contains("database") && message.contains("postgres://"), "{message}");
}

#[test]
fn the_farm_needs_a_token_off_loopback_and_says_how_to_make_one() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = clerestory();
    let output = command.args(["coordinator", "--listen", "0.0.0.0:0", "--data"]).arg(folder.path()).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success());
    assert!(message.contains("token") && message.contains("openssl rand"), "{message}");
}

#[test]
fn a_farm_with_a_token_serves_those_who_have_it() {
    let farm = Farm::start(Some("correct-horse-battery-staple"), &[]);
    farm.submit(&WITH_CONE.scene(), &["--size", "16x16", "--spp", "16"]);
    let mut stranger = clerestory();
    let output = stranger.args(["jobs"]).env("CLERESTORY_COORDINATOR", farm.address()).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success());
    assert!(message.contains("token"), "{message}");
}
