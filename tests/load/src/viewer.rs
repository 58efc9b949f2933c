//! A viewer: fetches the preview of a job again and again, as the page does, and notes the age of each preview.
//!
//! The age of a preview is the time since the first node was acknowledged that the preview lacks. It is zero when the
//! preview lacks none. Nodes behind a gap of the film show when the gap closes.

use std::time::Duration;

use clerestory_api::{Client, JobId, JobState, PreviewQuery, ProblemCode};
use tokio::time::Instant;

use crate::tally::Tally;

/// Shortest time between two requests, as on the page.
const PERIOD: Duration = Duration::from_millis(300);

/// Fetches previews of the running job while times are measured, and then waits for the last one, so that slow previews
/// count. Failed previews are requested again.
pub(crate) async fn look(client: &Client, tally: &Tally) {
    let mut watched = None;
    while tally.is_measuring() {
        watched = running(client, tally, watched).await;
        let next = Instant::now() + PERIOD;
        if let Some(job) = watched {
            look_at(client, tally, job).await;
        }
        tokio::time::sleep_until(next).await;
    }
}

/// The running job that was watched before, or else the oldest running one.
async fn running(client: &Client, tally: &Tally, watched: Option<JobId>) -> Option<JobId> {
    let is_running = |state| state == JobState::Running;
    if let Some(job) = watched
        && client.job(job).await.is_ok_and(|job| is_running(job.state))
    {
        return Some(job);
    }
    match client.jobs().await {
        Ok(jobs) => jobs.into_iter().rev().find(|job| is_running(job.state)).map(|job| job.id),
        Err(_) => {
            tally.repeats();
            None
        }
    }
}

async fn look_at(client: &Client, tally: &Tally, job: JobId) {
    let start = Instant::now();
    match client.preview(job, &PreviewQuery::default()).await {
        Ok(preview) => tally.seen(job, preview.accepted_nodes, start),
        Err(failure) if failure.problem().is_some_and(|problem| problem.code == ProblemCode::NoImageYet) => {}
        Err(_) => tally.preview_failed(),
    }
}
