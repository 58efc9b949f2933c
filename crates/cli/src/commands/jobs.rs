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

pub(crate) async fn run(arguments: JobsArguments) -> Result<(), Failure> {
    let connection = arguments.connection.open()?;
    let jobs = connection.client.jobs().await.map_err(|error| connection.failure(error))?;
    if arguments.json {
        return print_json(&jobs);
    }
    print_line(&line(["JOB", "STATE", "DONE", "SAMPLES A PIXEL", "MSE (~ESTIMATE)", "METHOD", "NAME"]))?;
    jobs.iter().try_for_each(|job| print_line(&row(job)))
}

/// Reads the identity of a job.
pub(crate) fn parse_job(text: &str) -> Result<JobId, String> {
    text.parse().map_err(|_| "expected the UUID of a job, as `clerestory jobs` lists them".to_owned())
}

fn row(job: &JobView) -> String {
    let mse = job.latest.as_ref().map_or_else(|| "-".to_owned(), mse_text);
    let (id, done) = (job.id.to_string(), format!("{:.1}%", job.progress * 100.0));
    let (method, name) = (printable(&job.integrator), printable(&job.name));
    line([&id, job.state.name(), &done, &samples_text(job, ""), &mse, &method, &name])
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
        samples: u64::from(job.passes) * u64::from(job.samples_per_pass),
        mse: job.target_mse,
        estimated_mse: job.target_estimated_mse,
        time: job.time_limit_ms.and_then(|limit| u64::try_from(limit).ok()).map(Duration::from_millis),
    };
    ends.words(samples, unit)
}

/// What ends a job, whichever comes first.
#[derive(Clone, Copy, Debug, Default)]
struct Ends {
    samples: u64,
    mse: Option<f64>,
    estimated_mse: Option<f64>,
    time: Option<Duration>,
}

impl Ends {
    fn words(&self, samples: f64, unit: &str) -> String {
        let digits = if samples.fract() == 0.0 { 0 } else { 1 };
        let ends = [
            self.mse.map(|target| format!("to MSE {target:e}")),
            self.estimated_mse.map(|target| format!("to MSE ~{target:e}")),
            self.time.map(|limit| format!("within {}", duration_text(limit))),
        ];
        let ends: Vec<String> = ends.into_iter().flatten().collect();
        if ends.is_empty() {
            return format!("{samples:.digits$} of {}{unit}", self.samples);
        }
        format!("{samples:.digits$}{unit} {}", ends.join(" or "))
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
        let total = Ends { samples: 256, ..Ends::default() };
        let limited = Ends { time: Some(Duration::from_secs(150)), ..total };
        let unit = " samples a pixel";
        assert_eq!(limited.words(76.5, unit), "76.5 samples a pixel within 2 min 30 s");
        assert_eq!(total.words(128.0, unit), "128 of 256 samples a pixel");
        assert_eq!(total.words(128.0, ""), "128 of 256");
        let targets = Ends { mse: Some(1e-3), estimated_mse: Some(2.5e-4), ..limited };
        assert_eq!(targets.words(16.0, ""), "16 to MSE 1e-3 or to MSE ~2.5e-4 or within 2 min 30 s");
    }
}
