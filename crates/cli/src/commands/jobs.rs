//! `clerestory jobs`: the jobs of a farm, newest first.

use std::time::Duration;

use clap::Args;
use clerestory_api::{ConvergencePoint, JobId, JobView, StopReason};

use crate::connection::ConnectionArguments;
use crate::failure::Failure;
use crate::terminal::{duration_text, print_json, print_line, printable};

/// Options of `clerestory jobs`.
#[derive(Debug, Args)]
#[command(
    after_help = "MSE is the error against the job's reference at its last round. For a job without a reference it is \
                  the error that the image's own noise tells, which is marked with ~."
)]
pub(crate) struct JobsArguments {
    #[command(flatten)]
    connection: ConnectionArguments,
    /// Write the list as JSON.
    #[arg(long)]
    json: bool,
}

/// Options of commands that do something with a job.
#[derive(Debug, Args)]
pub(crate) struct OneJob {
    /// The job.
    #[arg(value_parser = parse_job)]
    pub(crate) job: JobId,
    #[command(flatten)]
    pub(crate) connection: ConnectionArguments,
    /// Write the job as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

pub(crate) async fn run(arguments: JobsArguments) -> Result<(), Failure> {
    let connection = arguments.connection.open()?;
    let jobs = connection.client.jobs().await.map_err(|error| connection.failure(error))?;
    if arguments.json {
        return print_json(&jobs);
    }
    print_line(&line(["JOB", "STATE", "DONE", "SAMPLES A PIXEL", "MSE (~ESTIMATE)", "METHOD", "NAME"]))?;
    for job in &jobs {
        print_line(&row(job))?;
        if let Some(trouble) = trouble(job) {
            print_line(&format!("  {}", printable(trouble)))?;
        }
    }
    Ok(())
}

/// Why a job is held or has failed.
fn trouble(job: &JobView) -> Option<&str> {
    job.hold.as_ref().map(|hold| hold.reason.as_str()).or(job.failure.as_deref())
}

/// The state of a job in a word: a held one gets no leases, whatever state it is in.
fn state_text(job: &JobView) -> &'static str {
    if job.hold.is_some() { "held" } else { job.state.name() }
}

/// Reads the identity of a job.
pub(crate) fn parse_job(text: &str) -> Result<JobId, String> {
    text.parse().map_err(|_| "expected the UUID of a job, as `clerestory jobs` lists them".to_owned())
}

fn row(job: &JobView) -> String {
    let mse = job.latest.as_ref().map_or_else(|| "-".to_owned(), mse_text);
    let (id, done) = (job.id.to_string(), format!("{:.1}%", job.progress * 100.0));
    let is_building = job.samples == 0 && job.building_workers > 0;
    let state = if is_building { "building" } else { state_text(job) };
    let (method, name) = (printable(&job.integrator), printable(&job.name));
    line([&id, state, &done, &samples_text(job, ""), &mse, &method, &name])
}

fn line([id, state, done, samples, mse, method, name]: [&str; 7]) -> String {
    format!("{id:<36}  {state:<9}  {done:>6}  {samples:>24}  {mse:>15}  {method:<6}  {name}")
}

/// The error against the reference; marked with `~`, what the image itself knows of it where there is no reference.
fn mse_text(point: &ConvergencePoint) -> String {
    match (point.mse, point.estimated_mse) {
        (Some(measured), _) => format!("{measured:.3e}"),
        (None, Some(estimated)) => format!("~{estimated:.3e}"),
        (None, None) => "-".to_owned(),
    }
}

/// Samples in a pixel so far, with a unit behind the number, and what ends the job: their number, an error, or its time.
pub(crate) fn samples_text(job: &JobView, unit: &str) -> String {
    let pixels = u64::from(job.width) * u64::from(job.height) * u64::from(job.frames);
    let samples = match job.stopped_by {
        // What was rendered beyond the round that ended it is not in the image.
        Some(StopReason::Mse | StopReason::EstimatedMse) => {
            f64::from(job.complete_passes) * f64::from(job.samples_per_pass)
        }
        _ => job.samples as f64 / pixels.max(1) as f64,
    };
    let ends = Ends {
        samples: job.total_samples as f64 / pixels.max(1) as f64,
        mse: job.target_mse,
        estimated_mse: job.target_estimated_mse,
        time: job.time_limit_ms.and_then(|limit| u64::try_from(limit).ok()).map(Duration::from_millis),
    };
    ends.words(samples, unit)
}

/// What ends a job, whichever comes first.
#[derive(Clone, Copy, Debug, Default)]
struct Ends {
    samples: f64,
    mse: Option<f64>,
    estimated_mse: Option<f64>,
    time: Option<Duration>,
}

impl Ends {
    fn words(&self, samples: f64, unit: &str) -> String {
        let number = |samples: f64| if samples.fract() == 0.0 { format!("{samples}") } else { format!("{samples:.1}") };
        let ends = [
            self.mse.map(|target| format!("to MSE {target:e}")),
            self.estimated_mse.map(|target| format!("to MSE ~{target:e}")),
            self.time.map(|limit| format!("within {}", duration_text(limit))),
        ];
        let ends: Vec<String> = ends.into_iter().flatten().collect();
        if ends.is_empty() {
            return format!("{} of {}{unit}", number(samples), number(self.samples));
        }
        format!("{}{unit} {}", number(samples), ends.join(" or "))
    }
}

/// What ended a job, in words that go on from "done".
pub(crate) fn reason_text(reason: StopReason) -> &'static str {
    match reason {
        StopReason::Samples => "all its samples are rendered",
        StopReason::Time => "its time is up",
        StopReason::Mse => "its target MSE is reached",
        StopReason::EstimatedMse => "its target estimated MSE is reached",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_that_is_held_or_has_failed_says_why() {
        let job = |state: &str, more: &str| -> JobView {
            let counters = r#"{"height_evaluations":0,"solver_calls":0,"converged":0,"unique_solutions":0,"trials":0,"truncated":0,"rays":0,"samples":0}"#;
            let text = format!(
                r#"{{"id":"01890a5d-ac96-774b-bcce-b302099a8057","name":"window","state":"{state}","priority":0,"integrator":"path",
                "scene_hash":"","missing_light":[],"frames":1,"width":8,"height":8,"tile_size":8,"tiles":1,"samples_per_pass":16,"passes":1,
                "complete_passes":0,"rounds":0,"progress":0.0,"samples":0,"core_ms":0,"created_ms":0,"counters":{counters}{more}}}"#
            );
            serde_json::from_str(&text).unwrap()
        };
        let running = job("running", "");
        assert_eq!((state_text(&running), trouble(&running)), ("running", None));
        let node = r#"{"frame":0,"tile":0,"level":0,"index":0}"#;
        let held =
            job("running", &format!(r#","hold":{{"since_ms":0,"reason":"workers died","node":{node},"workers":[]}}"#));
        assert_eq!((state_text(&held), trouble(&held)), ("held", Some("workers died")));
        let failed = job("failed", r#","failure":"it failed on `nave`""#);
        assert_eq!((state_text(&failed), trouble(&failed)), ("failed", Some("it failed on `nave`")));
    }

    #[test]
    fn an_estimated_error_is_told_from_a_measured_one() {
        let mut point = ConvergencePoint::default();
        assert_eq!(mse_text(&point), "-");
        point.estimated_mse = Some(1.25e-3);
        assert_eq!(mse_text(&point), "~1.250e-3");
        point.mse = Some(2e-3);
        assert_eq!(mse_text(&point), "2.000e-3");
    }

    #[test]
    fn samples_have_their_unit_before_a_limit_and_behind_the_total() {
        let total = Ends { samples: 256.0, ..Ends::default() };
        let limited = Ends { time: Some(Duration::from_secs(150)), ..total };
        let unit = " samples a pixel";
        assert_eq!(limited.words(76.5, unit), "76.5 samples a pixel within 2 min 30 s");
        assert_eq!(total.words(128.0, unit), "128 of 256 samples a pixel");
        assert_eq!(total.words(128.0, ""), "128 of 256");
        let shared_out = Ends { samples: 612.25, ..Ends::default() };
        assert_eq!(shared_out.words(88.5, ""), "88.5 of 612.2");
        let targets = Ends { mse: Some(1e-3), estimated_mse: Some(2.5e-4), ..limited };
        assert_eq!(targets.words(16.0, ""), "16 to MSE 1e-3 or to MSE ~2.5e-4 or within 2 min 30 s");
    }
}
