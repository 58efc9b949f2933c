//! `clerestory jobs`: lists the jobs of a farm, newest first.

use clap::Args;
use clerestory_api::{ConvergencePoint, JobView};

use crate::connection::ConnectionArguments;
use crate::failure::Failure;
use crate::job_samples::samples_text;
use crate::output::{print_json, print_line};
use crate::text::printable;

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
    for job in &jobs {
        print_line(&row(job))?;
        if let Some(trouble) = trouble(job) {
            print_line(&format!("  {}", printable(trouble)))?;
        }
    }
    Ok(())
}

/// Why a job is held, waits for a worker of another build, may fail or has failed.
fn trouble(job: &JobView) -> Option<&str> {
    let hold = job.hold.as_ref().map(|hold| hold.reason.as_str());
    let wait = job.waits_for_build.as_ref().map(|wait| wait.reason.as_str());
    let refusal = job.scene_refusal.as_ref().map(|refusal| refusal.reason.as_str());
    hold.or(wait).or(refusal).or(job.failure.as_deref())
}

/// The state of a job in a word. A job that is held or waits for a build gets no leases in any state.
fn state_text(job: &JobView) -> &'static str {
    match job {
        JobView { hold: Some(_), .. } => "held",
        JobView { waits_for_build: Some(_), .. } => "waiting",
        job => job.state.name(),
    }
}

fn row(job: &JobView) -> String {
    let mse = job.latest.as_ref().map_or_else(|| "-".to_owned(), mse_text);
    let (id, done) = (job.id.to_string(), format!("{:.1}%", job.progress * 100.0));
    let is_held_up = job.hold.is_some() || job.waits_for_build.is_some();
    let is_building = job.samples == 0 && job.building_workers > 0 && !is_held_up;
    let state = if is_building { "building" } else { state_text(job) };
    let (method, name) = (printable(&job.integrator), printable(&job.name));
    line([&id, state, &done, &samples_text(job, ""), &mse, &method, &name])
}

fn line([id, state, done, samples, mse, method, name]: [&str; 7]) -> String {
    format!("{id:<36}  {state:<9}  {done:>6}  {samples:>24}  {mse:>15}  {method:<6}  {name}")
}

/// The error against the reference, or, marked with `~`, the estimate of an image without one.
fn mse_text(point: &ConvergencePoint) -> String {
    match (point.mse, point.estimated_mse) {
        (Some(measured), _) => format!("{measured:.3e}"),
        (None, Some(estimated)) => format!("~{estimated:.3e}"),
        (None, None) => "-".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_that_is_held_or_waits_or_has_failed_says_why() {
        let job = |state: &str, more: &str| -> JobView {
            let counters = r#"{"height_evaluations":0,"solver_calls":0,"converged":0,"unique_solutions":0,
                "trials":0,"truncated":0,"rays":0,"samples":0}"#;
            let text = format!(
                r#"{{"id":"01890a5d-ac96-774b-bcce-b302099a8057","name":"window","state":"{state}","priority":0,
                "integrator":"path","scene_hash":"","missing_light":[],"frames":1,"width":8,"height":8,"tile_size":8,
                "tiles":1,"samples_per_pass":16,"passes":1,"complete_passes":0,"rounds":0,"progress":0.0,"samples":0,
                "core_ms":0,"created_ms":0,"counters":{counters}{more}}}"#
            );
            serde_json::from_str(&text).unwrap()
        };
        let running = job("running", "");
        assert_eq!((state_text(&running), trouble(&running)), ("running", None));
        let node = r#"{"frame":0,"tile":0,"level":0,"index":0}"#;
        let held =
            job("running", &format!(r#","hold":{{"since_ms":0,"reason":"workers died","node":{node},"workers":[]}}"#));
        assert_eq!((state_text(&held), trouble(&held)), ("held", Some("workers died")));
        let waits = job("running", r#","waits_for_build":{"reason":"start a worker of build `b`"}"#);
        assert_eq!((state_text(&waits), trouble(&waits)), ("waiting", Some("start a worker of build `b`")));
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
}
