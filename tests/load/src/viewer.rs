//! Somebody who looks at a job: fetches its preview again and again, as the page does, and notes how old each is when it comes, and when a newer
//! one replaces it.
//!
//! The age of a preview is the time since the first node was acknowledged that had not been accepted when it was begun; nothing, when all had been. What
//! lies behind a gap of the film is shown when the gap is closed, however fast previews are made.

use std::time::Duration;

use clerestory_api::{Client, JobId, JobState, PreviewQuery, ProblemCode};
use tokio::time::Instant;

use crate::tally::Tally;

/// From one request to the next at least, as in the page.
const PERIOD: Duration = Duration::from_millis(300);

/// Looks at the job that is being rendered for as long as times are measured, and then waits for the preview that is still to come: one
/// that is slow is not left out. What fails is tried again.
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

/// The oldest job that is being rendered; the last one, as long as it is.
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
        Err(_) => tally.looked_in_vain(),
    }
}
