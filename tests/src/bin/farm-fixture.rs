//! Writes the data of a farm as a killed `clerestory` leaves them. There are jobs that are done, cancelled, failed,
//! queued and running, and leases that workers hold. Tests hold later builds to such data; `tests/data/farms` has those
//! that were written so far.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Parser;
use clerestory_api::{JobState, JobView, Lease, LeaseRequest, LeaseReturn, WorkerRegistration};
use clerestory_render_core::probe;
use clerestory_test_servers::Postgres;
use clerestory_tests::calls::Caller;
use clerestory_tests::farm::{Farm, command_of, succeeded};
use clerestory_tests::pixel_digests::{DigestTable, PixelDigest};
use clerestory_tests::stored_farm::{self, ALONE, DATABASE, JOBS, POSTGRES, SQLITE};
use serde_json::{Value, json};

/// Writes a farm twice: its data folder with SQLite, and a dump of PostgreSQL with the folder of its blobs.
#[derive(Parser)]
struct Arguments {
    /// The binary `clerestory` that writes them.
    #[arg(long)]
    build: PathBuf,
    /// The folder to make.
    #[arg(long)]
    output: PathBuf,
}

/// How much older than now everything seems, seconds: all leases have run out, also by a clock that is months slow.
const AGE: i64 = 250 * 24 * 3600;

/// Edge of a tile: four tiles, of which none is whole but the first.
const TILE: [&str; 2] = ["--tile", "16"];

/// A job. One that is to be killed in the middle takes a second or two.
struct Order {
    name: &'static str,
    integrator: &'static str,
    options: &'static [&'static str],
}

const FAILED: Order = Order { name: "failed", integrator: r#"{"path": {}}"#, options: &["--spp", "1000000"] };
const CANCELLED: Order = Order { name: "cancelled", integrator: r#"{"cone": {}}"#, options: &["--spp", "1000000"] };
const DONE: Order = Order { name: "done", integrator: r#"{"cone": {}}"#, options: &["--spp", "100"] };
const RUNNING: Order = Order { name: "running", integrator: r#"{"fnee": {}}"#, options: &["--spp", "1200"] };
const ADAPTIVE: Order = Order {
    name: "adaptive",
    integrator: r#"{"cone": {}}"#,
    options: &["--spp", "800", "--adaptive", "--priority", "1"],
};
const TARGET: Order = Order {
    name: "with a reference",
    integrator: r#"{"fnee": {"selection": "random"}}"#,
    options: &["--spp", "200", "--target-mse", "2e-5", "--priority", "2"],
};
const QUEUED: Order = Order { name: "queued", integrator: r#"{"mnee": {}}"#, options: &["--spp", "36"] };

fn main() {
    let Arguments { build, output } = Arguments::parse();
    let build = build.canonicalize().expect("the binary is there");
    let scenes = tempfile::tempdir().expect("a temporary folder");
    let mut sqlite = Writing::start(&build, scenes.path(), &[]);
    sqlite.make_jobs();
    let (farm, jobs) = sqlite.killed();
    stored_farm::copy_folder(farm.data(0), &output.join(SQLITE), &is_kept);
    jobs.write(&output.join(SQLITE).join(JOBS), COMMENT);

    let server = Postgres::start_with_faults().expect("PostgreSQL starts");
    server.faults().expect("a disk with faults").step_clock(-AGE);
    let database = server.new_database();
    let mut postgres = Writing::start(&build, scenes.path(), &["--database", &database]);
    postgres.make_jobs();
    let (farm, jobs) = postgres.killed();
    stored_farm::copy_folder(farm.data(0), &output.join(POSTGRES), &is_kept);
    fs::write(output.join(POSTGRES).join(DATABASE), server.dump(&database).expect("a dump"))
        .expect("a writable folder");
    jobs.write(&output.join(POSTGRES).join(JOBS), COMMENT);
}

/// Whether a file is part of the data: not the lock, nor the index of SQLite's log, which is made anew.
fn is_kept(name: &str) -> bool {
    name != "lock" && !name.ends_with("-shm")
}

/// What the table of jobs says about itself.
const COMMENT: &str = "Job, its state when the farm was killed, and mean and digest of its image then; or what \
    `clerestory render` makes of the same. Written by farm-fixture.";

/// A farm that is being written.
struct Writing<'a> {
    build: &'a Path,
    scenes: &'a Path,
    farm: Farm,
    workers: usize,
    jobs: DigestTable,
}

impl<'a> Writing<'a> {
    fn start(build: &'a Path, scenes: &'a Path, options: &[&str]) -> Self {
        // A fifth of the nodes is checked, so that there are checks in the middle.
        let options = [&["--lease-nodes", "2", "--checked-fraction", "0.2"], options].concat();
        let mut farm = Farm::start_of_build(build, &options);
        farm.faults(0).expect("a clock with faults").step_clock(-AGE);
        // A clock that runs is not set back.
        farm.kill_coordinator(0);
        farm.restart_coordinator(0);
        Self { build, scenes, farm, workers: 0, jobs: DigestTable::default() }
    }

    fn make_jobs(&mut self) {
        let reference = self.scenes.join("reference.exr");
        let reference = reference.to_str().expect("text");
        self.submit(&FAILED, &[]);
        let worker = self.start_worker("west");
        self.farm.wait_until("begun", |job| job.rounds >= 2);
        self.farm.kill_worker(worker);
        self.fail();

        let cancelled = self.submit(&CANCELLED, &[]);
        let worker = self.start_worker("north");
        self.farm.wait_until("begun", |job| job.rounds >= 2);
        succeeded(self.farm.command(&["cancel"]).arg(cancelled));
        let done = self.submit(&DONE, &[]);
        self.farm.wait_until("done", |job| job.state == JobState::Done);
        fs::write(reference, self.farm.image(done.parse().expect("the identity of a job"))).expect("a writable folder");

        self.submit(&RUNNING, &[]);
        self.farm.wait_until("in the middle", |job| job.rounds >= 6);
        self.farm.kill_worker(worker);
        self.submit(&ADAPTIVE, &[]);
        let worker = self.start_worker("south");
        self.farm.wait_until("in the middle", |job| job.progress > 0.4);
        self.farm.kill_worker(worker);
        self.submit(&TARGET, &["--reference", reference]);
        let worker = self.start_worker("south");
        self.farm.wait_until("in the middle", |job| job.rounds >= 4);
        self.farm.stop_worker(worker);
        self.submit(&QUEUED, &[]);

        for order in [DONE, RUNNING, ADAPTIVE, QUEUED] {
            self.render_alone(&order, &[]);
        }
        self.render_alone(&TARGET, &["--reference", reference]);
    }

    /// Stops the farm and starts it again, and kills it while two workers hold leases. Answers it with what its jobs
    /// are then.
    fn killed(mut self) -> (Farm, DigestTable) {
        self.farm.stop_coordinator(0);
        self.farm.restart_coordinator(0);
        let samples = self.job(&TARGET).samples;
        let caller = Caller::new(&self.farm);
        claim(&caller, "asleep");
        let worker = self.start_worker("east");
        while self.job(&TARGET).samples == samples {}
        self.farm.kill_worker(worker);
        let jobs = caller.wait(caller.client().jobs()).expect("jobs");
        for JobView { id, name, state, .. } in jobs {
            match caller.wait(caller.client().image(id)) {
                Ok(image) => self.jobs.add(&name, state.name(), PixelDigest::of_image(&image)),
                Err(error) => assert_eq!(state, JobState::Queued, "{error}"),
            }
        }
        self.farm.kill_coordinator(0);
        (self.farm, self.jobs)
    }

    fn job(&self, order: &Order) -> JobView {
        let caller = Caller::new(&self.farm);
        let jobs = caller.wait(caller.client().jobs()).expect("jobs");
        jobs.into_iter().find(|job| job.name == order.name).expect("the job is there")
    }

    fn submit(&self, order: &Order, more: &[&str]) -> String {
        self.farm.submit(&self.scene(order), &[&TILE, order.options, more].concat())
    }

    fn start_worker(&mut self, name: &str) -> usize {
        self.farm.start_worker(name);
        self.workers += 1;
        self.workers - 1
    }

    /// Work of the newest job fails on machine after machine, until the job has failed.
    fn fail(&self) {
        let caller = Caller::new(&self.farm);
        for machine in 1.. {
            let lease = claim(&caller, &format!("out of memory {machine}"));
            let body = LeaseReturn { token: lease.token, failure: Some("out of memory".to_owned()) };
            caller.wait(caller.client().return_lease(lease.id, &body)).expect("a lease that is given back");
            if self.farm.newest_job().state == JobState::Failed {
                return;
            }
        }
    }

    /// Renders what a job renders, with the same build.
    fn render_alone(&mut self, order: &Order, more: &[&str]) {
        let image = self.scenes.join("alone.exr");
        let options = order.options.iter().take_while(|option| **option != "--priority");
        let mut render = command_of(self.build);
        render.arg("render").arg(self.scene(order)).args(TILE).args(options).args(more).arg("-o").arg(&image);
        succeeded(&mut render);
        self.jobs.add(order.name, ALONE, PixelDigest::of_image(&fs::read(image).expect("an image")));
    }

    /// The scene of a job, with small passes and blocks, and the files that it names.
    fn scene(&self, order: &Order) -> PathBuf {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/references");
        let text = fs::read(source.join("bump-sphere.json")).expect("a scene that ships");
        let mut scene: Value = serde_json::from_slice(&text).expect("JSON");
        scene["name"] = json!(order.name);
        scene["integrator"] = serde_json::from_str(order.integrator).expect("JSON");
        scene["film"] = json!({"width": 24, "height": 20});
        scene["sampling"] = json!({"samples_per_pass": 4, "samples_per_block": 16});
        fs::create_dir_all(self.scenes.join("heights")).expect("a writable folder");
        for face in ["heights/bump-front.exr", "heights/bump-back.exr"] {
            fs::copy(source.join(face), self.scenes.join(face)).expect("a face that ships");
        }
        let file = self.scenes.join(format!("{}.json", order.name));
        fs::write(&file, scene.to_string()).expect("a writable folder");
        file
    }
}

/// A lease of a new worker that renders nothing.
fn claim(caller: &Caller, name: &str) -> Lease {
    let probed = probe::digests().expect("a probe");
    let registration = WorkerRegistration {
        name: name.to_owned(),
        cores: 1,
        build: "by hand".to_owned(),
        probe_digest: Some(probed.first),
        method_digests: probed.methods,
    };
    let worker = caller.wait(caller.client().register_worker(&registration)).expect("a registration").id;
    let request = LeaseRequest { worker, max_nodes: None, wanted_ms: None, wait_ms: 0, built: Vec::new() };
    caller.wait(caller.client().claim_lease(&request)).expect("an answer").expect("work")
}
