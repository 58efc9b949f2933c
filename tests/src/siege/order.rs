//! A job under attack: asked for until the farm has it, and held against the image that one process makes.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use clerestory_api::{JobState, JobView};
use clerestory_film::counters::Counters;
use clerestory_film::{DecodeBudget, FrameImage};

use super::blows::below;
use crate::exr_files::same_samples;
use crate::farm::{clerestory, succeeded};
use crate::random::Random;

/// Scenes and integrators.
const SCENES: [(&str, &str); 4] = [
    ("references/crown-sphere.json", "cone"),
    ("references/crown-sphere.json", "fnee"),
    ("references/bump-point.json", "fnee"),
    ("room.json", "path"),
];

/// How its passes are shared out, and when it ends before it has all of them.
pub(super) type Rule = &'static [&'static str];

/// All of them.
pub(super) const RULES: [Rule; 3] = [&[], SHARED_OUT, &["--target-estimated-mse", "0.001"]];
const SHARED_OUT: Rule = &["--adaptive"];

/// Samples that every pixel of these scenes gets at least where passes are shared out.
const LEAST_SHARED_OUT: usize = 512;

/// How long to wait before asking again, when it is not known whether the farm has heard.
const PAUSE: Duration = Duration::from_millis(500);

/// A job that a user wants.
pub(super) struct Order {
    /// Its name at the farm. Asked for twice, there are two jobs of that name.
    pub(super) name: String,
    pub(super) rule: Rule,
    scene: PathBuf,
    options: Vec<String>,
    asking: Asking,
    alone: Alone,
}

/// Whether the farm has it.
enum Asking {
    /// A command is asking.
    Now(Child),
    /// A command has failed; whether the farm has heard it, its list of jobs will say.
    Again(Instant),
    /// It has.
    Done,
}

/// The image that one process makes.
enum Alone {
    Coming(JoinHandle<Result<Vec<u8>, String>>),
    There(Result<Vec<u8>, String>),
}

impl Order {
    /// An order at random, of up to so many passes, with a rule for them. One process begins with it at once.
    pub(super) fn draw(random: &mut Random, number: usize, most_passes: usize, rule: Rule) -> Self {
        let (scene, integrator) = SCENES[below(random, SCENES.len())];
        let (least, spread) = if rule == SHARED_OUT { (LEAST_SHARED_OUT, 16) } else { (0, 60) };
        let samples = (least + 16 * (1 + below(random, most_passes))).to_string();
        let size = format!("{}x{}", 40 + below(random, spread), 30 + below(random, spread));
        let tile = ["8", "16", "64"][below(random, 3)];
        let seed = below(random, 1000).to_string();
        let options = ["--integrator", integrator, "--spp", &samples, "--size", &size, "--seed", &seed, "--tile", tile];
        let options: Vec<String> = options.iter().chain(rule).map(|&option| option.to_owned()).collect();
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(scene);
        let alone = {
            let (scene, options) = (scene.clone(), options.clone());
            std::thread::spawn(move || rendered_alone(&scene, &options))
        };
        let asking = Asking::Again(Instant::now());
        Self { name: format!("order {number}"), rule, scene, options, asking, alone: Alone::Coming(alone) }
    }

    /// Asks for it as a user does, as long as the farm does not have it. `jobs` is what it says that it has.
    pub(super) fn ask(&mut self, command: impl FnOnce(&[&str]) -> Command, jobs: &[JobView]) {
        match &mut self.asking {
            Asking::Now(child) => match child.try_wait() {
                Ok(None) => {}
                Ok(Some(status)) if status.success() => self.asking = Asking::Done,
                Ok(Some(_)) | Err(_) => self.asking = Asking::Again(Instant::now() + PAUSE),
            },
            Asking::Again(_) if jobs.iter().any(|job| job.name == self.name) => self.asking = Asking::Done,
            Asking::Again(when) if *when <= Instant::now() => {
                let mut command = command(&["submit", "--name", &self.name]);
                command.arg(&self.scene).args(&self.options).stdout(Stdio::null()).stderr(Stdio::null());
                self.asking = command.spawn().map_or(Asking::Again(Instant::now() + PAUSE), Asking::Now);
            }
            Asking::Again(_) | Asking::Done => {}
        }
    }

    /// Whether the farm has it and has ended all jobs that it has made of it.
    pub(super) fn has_ended(&self, jobs: &[JobView]) -> bool {
        let mut own = jobs.iter().filter(|job| job.name == self.name).peekable();
        matches!(self.asking, Asking::Done) && own.peek().is_some() && own.all(|job| job.state.is_final())
    }

    /// What is wrong with a job of this order that has ended, and with its image.
    pub(super) fn check(&mut self, job: &JobView, image: &[u8]) -> Result<(), String> {
        let told = format!("{} {:?}", job.id, self.options);
        if job.state != JobState::Done {
            return Err(format!("{told}: {:?}, {:?}", job.state, job.failure));
        }
        let alone = self.alone().map_err(|error| format!("{told}: {error}"))?;
        same_samples(image, alone).map_err(|difference| format!("{told}: {difference}"))?;
        let [ours, alone] = [counters(image), counters(alone)];
        if ours == alone { Ok(()) } else { Err(format!("{told}: counted {ours:?}, alone {alone:?}")) }
    }

    /// The image that one process makes, waited for.
    fn alone(&mut self) -> Result<&[u8], String> {
        let panicked = || Alone::There(Err("one process alone makes no image".to_owned()));
        self.alone = match std::mem::replace(&mut self.alone, panicked()) {
            Alone::Coming(thread) => thread.join().map_or_else(|_| panicked(), Alone::There),
            there => there,
        };
        match &self.alone {
            Alone::There(Ok(image)) => Ok(image),
            Alone::There(Err(error)) => Err(error.clone()),
            Alone::Coming(_) => Err("the image is still to come".to_owned()),
        }
    }
}

impl Drop for Order {
    fn drop(&mut self) {
        if let Asking::Now(child) = &mut self.asking {
            // It may have ended by itself.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// What is wrong with the jobs that nobody has asked for.
pub(super) fn strangers(jobs: &[JobView], orders: &[Order]) -> Vec<String> {
    let unknown = jobs.iter().filter(|job| !orders.iter().any(|order| order.name == job.name));
    unknown.map(|job| format!("{}: nobody has asked for a job `{}`", job.id, job.name)).collect()
}

fn rendered_alone(scene: &Path, options: &[String]) -> Result<Vec<u8>, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let image = folder.path().join("alone.exr");
    succeeded(clerestory().arg("render").arg(scene).args(options).arg("-o").arg(&image));
    std::fs::read(&image).map_err(|error| error.to_string())
}

/// What was counted while an image was rendered: also that nothing was merged twice.
fn counters(image: &[u8]) -> Option<Counters> {
    let image = FrameImage::decode(image, DecodeBudget { pixel_bytes: 1 << 24 }).ok()?;
    image.metadata().map(|metadata| metadata.counters)
}
