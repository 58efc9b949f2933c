//! Following a job to its end: progress and rounds, across restarts of the coordinator.

use std::time::Duration;

use clerestory_api::{
    Client, ClientError, ConvergencePoint, Event, EventBody, JobId, JobView, LiveMeasurement, ProblemCode, WorkerState,
    WorkerView,
};
use futures::StreamExt;
use futures::stream::FuturesUnordered;
use tokio::time::MissedTickBehavior;

use crate::commands::jobs::samples_text;
use crate::connection::Connection;
use crate::failure::{Failure, root_cause};
use crate::terminal::{Advance, Progress};

/// Pause before the event stream is opened again, or a call repeated.
const RECONNECT_PAUSE: Duration = Duration::from_millis(500);

/// How long a farm may be without a worker before the user is told: one that is just being started needs a moment.
const WORKER_PATIENCE: Duration = Duration::from_secs(5);

/// How often the error between rounds is asked for: coordinators measure it no more often.
const LIVE_PERIOD: Duration = Duration::from_secs(1);

/// How long it is waited for.
const LIVE_PATIENCE: Duration = Duration::from_secs(5);

/// How often in a row a call may meet a fault of the coordinator, which need not pass as an outage does.
const MOST_FAULTS: u32 = 10;

/// Shows a job's progress and rounds until it ends; returns it as it ended. A coordinator that goes away is waited for,
/// and the user is told.
pub(crate) async fn follow(connection: &Connection, job: JobId, progress: &mut Progress) -> Result<JobView, Failure> {
    let mut follower = Follower {
        connection,
        job,
        progress,
        rounds: 0,
        live: None,
        outage: Outage::default(),
        workers: Workers::Unknown,
    };
    loop {
        match follower.until_final().await {
            Ok(Some(view)) => {
                follower.progress.finish();
                return Ok(view);
            }
            Ok(None) => {}
            Err(error) if error.is_transient() => follower.outage.note(connection, follower.progress, &error),
            Err(error) => return Err(connection.failure(error)),
        }
        tokio::time::sleep(RECONNECT_PAUSE).await;
    }
}

/// Repeats a call that changes nothing until the coordinator answers it. A coordinator that goes away is waited for, and
/// the user is told.
pub(crate) async fn until_answered<T, Answer>(
    connection: &Connection,
    progress: &Progress,
    mut call: impl FnMut() -> Answer,
) -> Result<T, Failure>
where
    Answer: Future<Output = Result<T, ClientError>>,
{
    let mut outage = Outage::default();
    let mut faults = 0;
    loop {
        match call().await {
            Ok(answer) => {
                outage.end(connection, progress);
                return Ok(answer);
            }
            Err(error) if error.is_transient() && faults < MOST_FAULTS => {
                let is_fault = error.problem().is_some_and(|problem| problem.code == ProblemCode::Internal);
                faults = if is_fault { faults + 1 } else { 0 };
                outage.note(connection, progress, &error);
                tokio::time::sleep(error.pause(RECONNECT_PAUSE)).await;
            }
            Err(error) => return Err(connection.failure(error)),
        }
    }
}

/// Whether the user has been told that the coordinator does not answer.
#[derive(Default)]
struct Outage {
    is_known: bool,
}

impl Outage {
    /// Says, once in an outage, that the coordinator does not answer.
    fn note(&mut self, connection: &Connection, progress: &Progress, error: &ClientError) {
        if !std::mem::replace(&mut self.is_known, true) {
            let (address, reason) = (connection.address(), root_cause(error));
            progress.note(&format!("The coordinator at {address} does not answer, trying again: {reason}"));
        }
    }

    /// Says that an outage is over.
    fn end(&mut self, connection: &Connection, progress: &Progress) {
        if std::mem::replace(&mut self.is_known, false) {
            progress.note(&format!("The coordinator at {} answers again", connection.address()));
        }
    }
}

struct Follower<'a> {
    connection: &'a Connection,
    job: JobId,
    progress: &'a mut Progress,
    /// Rounds shown so far.
    rounds: u32,
    /// The error between rounds, in words.
    live: Option<String>,
    outage: Outage,
    workers: Workers,
}

/// Whether somebody is there who could render.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Workers {
    Unknown,
    Present,
    Absent,
    /// Absent, and the user has been told.
    Missed,
}

impl Workers {
    /// Hears of all workers.
    fn hear_all(&mut self, workers: &[WorkerView]) {
        if *self == Self::Unknown {
            *self = Self::Absent;
        }
        workers.iter().for_each(|worker| self.hear(worker));
    }

    /// Hears of a worker.
    fn hear(&mut self, worker: &WorkerView) {
        if matches!(worker.state, WorkerState::Rendering | WorkerState::Idle) {
            *self = Self::Present;
        }
    }
}

impl Follower<'_> {
    /// Reads one event stream. `None` when it ends before the job does; whether the coordinator is away shows when the
    /// next one is opened.
    async fn until_final(&mut self) -> Result<Option<JobView>, ClientError> {
        let mut events = self.connection.client.events(Some(self.job), None).await?;
        self.catch_up().await?;
        self.outage.end(self.connection, self.progress);
        let patience = tokio::time::sleep(WORKER_PATIENCE);
        tokio::pin!(patience);
        let mut looks = tokio::time::interval(LIVE_PERIOD);
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let (client, job) = (&self.connection.client, self.job);
        let mut live = FuturesUnordered::new();
        loop {
            let event = tokio::select! {
                event = events.next() => event,
                () = &mut patience, if self.workers == Workers::Absent => {
                    self.miss_workers();
                    continue;
                }
                // Measuring is work: it is not asked for where nobody sees it.
                _ = looks.tick(), if self.progress.is_drawn() && live.is_empty() => {
                    live.push(live_error(client, job));
                    continue;
                }
                Some(error) = live.next() => {
                    self.live = error;
                    continue;
                }
            };
            let Some(Ok(Event { body, .. })) = event else { return Ok(None) };
            let views = match body {
                EventBody::Snapshot { jobs, workers } => {
                    self.workers.hear_all(&workers);
                    jobs
                }
                EventBody::Job { job } | EventBody::Progress { job } => vec![*job],
                EventBody::Round { job, point } => {
                    if job == self.job {
                        self.round(&point);
                    }
                    continue;
                }
                EventBody::Worker { worker } => {
                    self.workers.hear(&worker);
                    continue;
                }
            };
            let Some(view) = views.into_iter().find(|view| view.id == self.job) else { continue };
            self.progress.show(&Advance {
                fraction: view.progress,
                activity: None,
                samples: Some(self.samples_text(&view)),
                samples_per_second: view.samples_per_second,
                remaining: view.remaining_ms.and_then(|left| u64::try_from(left).ok()).map(Duration::from_millis),
            });
            if view.state.is_final() {
                self.catch_up().await?;
                return Ok(Some(view));
            }
        }
    }

    /// How many samples there are, and how good the image is that they make.
    fn samples_text(&self, view: &JobView) -> String {
        let samples = samples_text(view, " samples a pixel");
        match self.live.as_ref().filter(|_| !view.state.is_final()) {
            Some(live) => format!("{samples}, {live}"),
            None => samples,
        }
    }

    /// Says, once, that nobody renders.
    fn miss_workers(&mut self) {
        self.workers = Workers::Missed;
        let address = self.connection.address();
        self.progress
            .note(&format!("The farm has no worker: start one with `clerestory worker --coordinator {address}`"));
    }

    /// Shows the rounds that no event told of.
    async fn catch_up(&mut self) -> Result<(), ClientError> {
        let series = self.connection.client.convergence(self.job).await?;
        series.points.iter().for_each(|point| self.round(point));
        Ok(())
    }

    fn round(&mut self, point: &ConvergencePoint) {
        if point.round >= self.rounds {
            self.rounds = point.round + 1;
            self.progress.round(point);
        }
    }
}

/// Asks for the error between rounds, in words. It is a courtesy: a coordinator that fails to tell it may know none, and what else is wrong
/// the events show.
async fn live_error(client: &Client, job: JobId) -> Option<String> {
    let live = tokio::time::timeout(LIVE_PATIENCE, client.live(job)).await;
    live.ok().and_then(Result::ok).and_then(|live| live_text(&live))
}

/// The error between rounds, where one is known, and the part of the pixels that it is of.
fn live_text(live: &LiveMeasurement) -> Option<String> {
    let error = match (live.mse, live.estimated_mse) {
        (Some(mse), _) => format!("MSE {mse:.2e}"),
        (None, Some(estimated)) => format!("estimated MSE {estimated:.2e}"),
        (None, None) => return None,
    };
    Some(format!("live: {error} over {:.0} %", (live.covered * 100.0).floor()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_live_error_says_of_how_much_it_is() {
        let job = "01890a5d-ac96-774b-bcce-b302099a8057".parse().unwrap();
        let live = |mse, estimated_mse| {
            live_text(&LiveMeasurement { job, covered: 0.639, samples_per_pixel: 12.5, mse, estimated_mse })
        };
        assert_eq!(live(Some(3.104e-4), Some(1.0)).as_deref(), Some("live: MSE 3.10e-4 over 63 %"));
        assert_eq!(live(None, Some(0.25)).as_deref(), Some("live: estimated MSE 2.50e-1 over 63 %"));
        assert_eq!(live(None, None), None);
    }
}
