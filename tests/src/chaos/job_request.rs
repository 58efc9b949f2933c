//! A job under attack: submitted until the farm has it, and compared with the image of a render in one process.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use clerestory_api::{JobState, JobView};
use clerestory_film::counters::Counters;
use clerestory_film::{DecodeBudget, FrameImage};

use super::faults::below;
use crate::exr_files::same_samples;
use crate::farm::{clerestory, succeeded};
use crate::random::Random;

/// Scenes and integrators.
const SCENES: [(&str, &str); 5] = [
    ("references/crown-sphere.json", "cone"),
    ("references/crown-sphere.json", "fnee"),
    ("references/bump-point.json", "fnee"),
    ("room.json", "path"),
    ("room.json", "auto"),
];

/// Options for adaptive sampling and targets.
pub(super) type StopRule = &'static [&'static str];

/// All of them.
pub(super) const RULES: [StopRule; 3] = [&[], SHARED_OUT, &["--target-estimated-mse", "0.001"]];
const SHARED_OUT: StopRule = &["--adaptive"];

/// Fewest samples of a pixel in an adaptive job of these scenes.
const LEAST_SHARED_OUT: usize = 512;

/// Pause before the next submission, when it is not known whether the farm has the job.
const PAUSE: Duration = Duration::from_millis(500);

/// A job that a user wants.
pub(super) struct JobRequest {
    /// Its name at the farm. Submitted twice, it is two jobs of that name.
    pub(super) name: String,
    pub(super) rule: StopRule,
    scene: PathBuf,
    options: Vec<String>,
    submission: Submission,
    reference: Reference,
}

/// Whether the farm has the job.
enum Submission {
    /// A command is submitting it.
    Running(Child),
    /// A command has failed. The list of jobs will tell whether the farm has the job.
    Retry(Instant),
    /// The farm has it.
    Accepted,
}

/// The image of a render in one process.
enum Reference {
    Rendering(JoinHandle<Result<Vec<u8>, String>>),
    Ready(Result<Vec<u8>, String>),
}

impl JobRequest {
    /// A random request of at most `most_passes` passes, with a rule. One process starts to render it at once.
    pub(super) fn draw(random: &mut Random, number: usize, most_passes: usize, rule: StopRule) -> Self {
        let (scene, integrator) = SCENES[below(random, SCENES.len())];
        let (least, spread) = if rule == SHARED_OUT { (LEAST_SHARED_OUT, 16) } else { (0, 60) };
        let samples = (least + 16 * (1 + below(random, most_passes))).to_string();
        let size = format!("{}x{}", 40 + below(random, spread), 30 + below(random, spread));
        let tile = ["8", "16", "64"][below(random, 3)];
        let seed = below(random, 1000).to_string();
        let options = ["--integrator", integrator, "--spp", &samples, "--size", &size, "--seed", &seed, "--tile", tile];
        let options: Vec<String> = options.iter().chain(rule).map(|&option| option.to_owned()).collect();
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(scene);
        let reference = {
            let (scene, options) = (scene.clone(), options.clone());
            std::thread::spawn(move || render_reference(&scene, &options))
        };
        let submission = Submission::Retry(Instant::now());
        Self {
            name: format!("request {number}"),
            rule,
            scene,
            options,
            submission,
            reference: Reference::Rendering(reference),
        }
    }

    /// Submits it as a user does, until the farm has it. `jobs` are those that the farm lists.
    pub(super) fn submit(&mut self, command: impl FnOnce(&[&str]) -> Command, jobs: &[JobView]) {
        match &mut self.submission {
            Submission::Running(child) => match child.try_wait() {
                Ok(None) => {}
                Ok(Some(status)) if status.success() => self.submission = Submission::Accepted,
                Ok(Some(_)) | Err(_) => self.submission = Submission::Retry(Instant::now() + PAUSE),
            },
            Submission::Retry(_) if jobs.iter().any(|job| job.name == self.name) => {
                self.submission = Submission::Accepted
            }
            Submission::Retry(when) if *when <= Instant::now() => {
                let mut command = command(&["submit", "--name", &self.name]);
                command.arg(&self.scene).args(&self.options).stdout(Stdio::null()).stderr(Stdio::null());
                self.submission =
                    command.spawn().map_or(Submission::Retry(Instant::now() + PAUSE), Submission::Running);
            }
            Submission::Retry(_) | Submission::Accepted => {}
        }
    }

    /// Whether the farm has it, and all jobs of this name have ended.
    pub(super) fn has_ended(&self, jobs: &[JobView]) -> bool {
        let mut own = jobs.iter().filter(|job| job.name == self.name).peekable();
        matches!(self.submission, Submission::Accepted) && own.peek().is_some() && own.all(|job| job.state.is_final())
    }

    /// What is wrong with a job of this request that has ended, and with its image.
    pub(super) fn check(&mut self, job: &JobView, image: &[u8]) -> Result<(), String> {
        let told = format!("{} {:?}", job.id, self.options);
        if job.state != JobState::Done {
            return Err(format!("{told}: {:?}, {:?}", job.state, job.failure));
        }
        let reference = self.reference().map_err(|error| format!("{told}: {error}"))?;
        same_samples(image, reference).map_err(|difference| format!("{told}: {difference}"))?;
        let [ours, reference] = [counters(image), counters(reference)];
        if ours == reference { Ok(()) } else { Err(format!("{told}: counted {ours:?}, reference {reference:?}")) }
    }

    /// Waits for the image of the render in one process.
    fn reference(&mut self) -> Result<&[u8], String> {
        let panicked = || Reference::Ready(Err("one process alone makes no image".to_owned()));
        self.reference = match std::mem::replace(&mut self.reference, panicked()) {
            Reference::Rendering(thread) => thread.join().map_or_else(|_| panicked(), Reference::Ready),
            there => there,
        };
        match &self.reference {
            Reference::Ready(Ok(image)) => Ok(image),
            Reference::Ready(Err(error)) => Err(error.clone()),
            Reference::Rendering(_) => Err("the image is still to come".to_owned()),
        }
    }
}

impl Drop for JobRequest {
    fn drop(&mut self) {
        if let Submission::Running(child) = &mut self.submission {
            // It may have ended by itself.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Descriptions of jobs that no request submitted.
pub(super) fn unknown_jobs(jobs: &[JobView], requests: &[JobRequest]) -> Vec<String> {
    let unknown = jobs.iter().filter(|job| !requests.iter().any(|request| request.name == job.name));
    unknown.map(|job| format!("{}: no request submitted a job `{}`", job.id, job.name)).collect()
}

fn render_reference(scene: &Path, options: &[String]) -> Result<Vec<u8>, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let image = folder.path().join("alone.exr");
    succeeded(clerestory().arg("render").arg(scene).args(options).arg("-o").arg(&image));
    std::fs::read(&image).map_err(|error| error.to_string())
}

/// The counters of an image. They also show that nothing was merged twice.
fn counters(image: &[u8]) -> Option<Counters> {
    let image = FrameImage::decode(image, DecodeBudget { pixel_bytes: 1 << 24 }).ok()?;
    image.metadata().map(|metadata| metadata.counters)
}
