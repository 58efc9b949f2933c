//! Following a job to its end: progress and rounds, across restarts of the coordinator.

use std::time::Duration;

use clerestory_api::{ClientError, ConvergencePoint, EventBody, JobId, JobView};
use futures::StreamExt;

use crate::commands::jobs::samples_text;
use crate::connection::Connection;
use crate::failure::{Failure, root_cause};
use crate::terminal::{Advance, Progress};

/// Pause before the event stream is opened again.
const RECONNECT_PAUSE: Duration = Duration::from_millis(500);

/// Shows a job's progress and rounds until it ends; returns it as it ended. A coordinator that goes away is waited for,
/// and the user is told.
pub(crate) async fn follow(connection: &Connection, job: JobId, progress: &mut Progress) -> Result<JobView, Failure> {
    let mut follower = Follower { connection, job, progress, rounds: 0, is_away: false };
    loop {
        match follower.until_final().await {
            Ok(Some(view)) => {
                follower.progress.finish();
                return Ok(view);
            }
            Ok(None) => {}
            Err(error) if error.is_transient() => follower.note_outage(&error),
            Err(error) => return Err(connection.failure(error)),
        }
        tokio::time::sleep(RECONNECT_PAUSE).await;
    }
}

struct Follower<'a> {
    connection: &'a Connection,
    job: JobId,
    progress: &'a mut Progress,
    /// Rounds shown so far.
    rounds: u32,
    /// Whether the user has been told that the coordinator does not answer.
    is_away: bool,
}

impl Follower<'_> {
    /// Reads one event stream. `None` when it ends before the job does; whether the coordinator is away shows when the
    /// next one is opened.
    async fn until_final(&mut self) -> Result<Option<JobView>, ClientError> {
        let mut events = self.connection.client.events(Some(self.job), None).await?;
        self.catch_up().await?;
        self.note_return();
        while let Some(Ok(event)) = events.next().await {
            let views = match event.body {
                EventBody::Snapshot { jobs, .. } => jobs,
                EventBody::Job { job } | EventBody::Progress { job } => vec![*job],
                EventBody::Round { job, point } => {
                    if job == self.job {
                        self.round(&point);
                    }
                    continue;
                }
                EventBody::Worker { .. } => continue,
            };
            let Some(view) = views.into_iter().find(|view| view.id == self.job) else { continue };
            self.progress.show(&Advance {
                fraction: view.progress,
                samples: Some(samples_text(&view)),
                samples_per_second: view.samples_per_second,
                remaining: view.remaining_ms.and_then(|left| u64::try_from(left).ok()).map(Duration::from_millis),
            });
            if view.state.is_final() {
                self.catch_up().await?;
                return Ok(Some(view));
            }
        }
        Ok(None)
    }

    /// Shows the rounds that no event told of.
    async fn catch_up(&mut self) -> Result<(), ClientError> {
        let series = self.connection.client.convergence(self.job).await?;
        series.points.iter().for_each(|point| self.round(point));
        Ok(())
    }

    /// Says, once in an outage, that the coordinator does not answer.
    fn note_outage(&mut self, error: &ClientError) {
        if !std::mem::replace(&mut self.is_away, true) {
            let (address, reason) = (self.connection.address(), root_cause(error));
            self.progress.note(&format!("The coordinator at {address} does not answer, trying again: {reason}"));
        }
    }

    /// Says that an outage is over.
    fn note_return(&mut self) {
        if std::mem::replace(&mut self.is_away, false) {
            self.progress.note(&format!("The coordinator at {} answers again", self.connection.address()));
        }
    }

    fn round(&mut self, point: &ConvergencePoint) {
        if point.round >= self.rounds {
            self.rounds = point.round + 1;
            self.progress.round(point);
        }
    }
}
