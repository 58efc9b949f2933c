//! Follows a job to its end: progress and rounds, across restarts of the coordinator.

use std::collections::BTreeSet;
use std::time::Duration;

use clerestory_api::{
    Client, ClientError, ConvergencePoint, Event, EventBody, JobId, JobView, LiveMeasurement, WorkerId, WorkerState,
    WorkerView,
};
use futures::StreamExt;
use futures::stream::FuturesUnordered;
use tokio::time::{Instant, MissedTickBehavior};

use crate::connection::Connection;
use crate::failure::Failure;
use crate::job_samples::samples_text;
use crate::outage::{Outage, RECONNECT_PAUSE};
use crate::progress::{Advance, Progress};
use crate::text::printable;

/// Time without a worker before the user is told: a worker that is just starting needs a moment.
const WORKER_TIMEOUT: Duration = Duration::from_secs(5);

/// Time between two requests for the error between rounds: coordinators measure it no more often.
const LIVE_PERIOD: Duration = Duration::from_secs(1);

/// Longest wait for that error.
const LIVE_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest timeouts of an event stream.
#[derive(Clone, Copy, Debug)]
struct StreamTimeouts {
    /// Before its first event, which a coordinator sends at once.
    first: Duration,
    /// Later. Coordinators send a comment every few seconds, and older builds every 15.
    later: Duration,
    /// Time between two requests for the job after such a silence.
    poll: Duration,
}

const STREAM_TIMEOUTS: StreamTimeouts =
    StreamTimeouts { first: Duration::from_secs(5), later: Duration::from_secs(20), poll: Duration::from_secs(2) };

/// Shows a job's progress and rounds until it ends, and returns the job. An unreachable coordinator is called again,
/// and the user is told. Where a proxy holds events back, the job is requested periodically instead.
pub(crate) async fn follow(connection: &Connection, job: JobId, progress: &mut Progress) -> Result<JobView, Failure> {
    follow_through(connection, job, progress, STREAM_TIMEOUTS).await
}

async fn follow_through(
    connection: &Connection,
    job: JobId,
    progress: &mut Progress,
    timeouts: StreamTimeouts,
) -> Result<JobView, Failure> {
    let mut follower = Follower {
        connection,
        job,
        progress,
        timeouts,
        is_answered: false,
        is_held_back: false,
        rounds: 0,
        live: None,
        outage: Outage::default(),
        workers: Workers::Unknown,
        is_held: false,
        is_waiting: false,
        is_refused: false,
        builders: BTreeSet::new(),
        view: None,
    };
    loop {
        match follower.until_final().await {
            Ok(Some(view)) => {
                follower.progress.finish();
                return Ok(view);
            }
            Ok(None) => {}
            Err(error) if error.is_transient() && (follower.is_answered || !error.is_misdirected()) => {
                follower.outage.note(connection, follower.progress, &error);
            }
            Err(error) => return Err(connection.failure(error)),
        }
        tokio::time::sleep(RECONNECT_PAUSE).await;
    }
}

struct Follower<'a> {
    connection: &'a Connection,
    job: JobId,
    progress: &'a mut Progress,
    timeouts: StreamTimeouts,
    /// Whether a coordinator has answered.
    is_answered: bool,
    /// Whether the user knows that no events arrive.
    is_held_back: bool,
    /// Rounds shown so far.
    rounds: u32,
    /// The error between rounds, in words.
    live: Option<String>,
    outage: Outage,
    workers: Workers,
    /// Whether the user knows that the job is held.
    is_held: bool,
    /// Whether the user knows that the job waits for a worker of another build.
    is_waiting: bool,
    /// Whether the user knows that a machine could not build the scene.
    is_refused: bool,
    /// Workers that build the scene.
    builders: BTreeSet<WorkerId>,
    /// The job, as the last event showed it.
    view: Option<JobView>,
}

/// Whether the farm has a worker that can render.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Workers {
    Unknown,
    Present,
    Absent,
    /// Absent, and the user knows.
    Missed,
}

impl Workers {
    /// Takes note of all workers.
    fn note_all(&mut self, workers: &[WorkerView]) {
        if *self == Self::Unknown {
            *self = Self::Absent;
        }
        workers.iter().for_each(|worker| self.note(worker));
    }

    /// Takes note of a worker.
    fn note(&mut self, worker: &WorkerView) {
        if matches!(worker.state, WorkerState::Rendering | WorkerState::Idle) {
            *self = Self::Present;
        }
    }
}

/// How much of an event stream has arrived, and when it last grew.
struct StreamProgress {
    pieces: u64,
    at: Instant,
}

impl StreamProgress {
    fn new(pieces: u64) -> Self {
        Self { pieces, at: Instant::now() }
    }
}

impl Follower<'_> {
    /// Reads one event stream. Returns `None` when the stream ends before the job. The next stream shows whether the
    /// coordinator is away.
    async fn until_final(&mut self) -> Result<Option<JobView>, ClientError> {
        let (client, job) = (&self.connection.client, self.job);
        // A proxy that waits for the end of an answer passes on nothing of an endless one.
        let Ok(opened) = tokio::time::timeout(self.timeouts.first, client.events(Some(job), None)).await else {
            return self.poll_until_final().await;
        };
        let mut events = opened?;
        self.catch_up().await?;
        self.note_answer();
        let worker_timeout = tokio::time::sleep(WORKER_TIMEOUT);
        tokio::pin!(worker_timeout);
        let mut measurements = tokio::time::interval(LIVE_PERIOD);
        measurements.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut live = FuturesUnordered::new();
        let mut received = StreamProgress::new(events.pieces());
        loop {
            let silence_ends =
                received.at + if received.pieces == 0 { self.timeouts.first } else { self.timeouts.later };
            let event = tokio::select! {
                event = events.next() => event,
                () = tokio::time::sleep_until(silence_ends) => {
                    if events.pieces() == received.pieces {
                        return self.poll_until_final().await;
                    }
                    received = StreamProgress::new(events.pieces());
                    continue;
                }
                () = &mut worker_timeout, if self.workers == Workers::Absent => {
                    self.note_missing_workers();
                    continue;
                }
                // Measuring is work for the coordinator, so the error is requested only for a visible progress bar.
                _ = measurements.tick(), if self.progress.is_drawn() && live.is_empty() => {
                    live.push(live_error(client, job));
                    continue;
                }
                Some(error) = live.next() => {
                    self.live = error;
                    continue;
                }
            };
            let Some(Ok(Event { body, .. })) = event else { return Ok(None) };
            received = StreamProgress::new(events.pieces());
            let views = match body {
                EventBody::Snapshot { jobs, workers } => {
                    self.workers.note_all(&workers);
                    for worker in &workers {
                        self.note_builder(worker);
                    }
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
                    self.workers.note(&worker);
                    if self.note_builder(&worker) {
                        self.show_again();
                    }
                    continue;
                }
            };
            let Some(view) = views.into_iter().find(|view| view.id == self.job) else { continue };
            self.show(view.clone());
            if view.state.is_final() {
                self.catch_up().await?;
                return Ok(Some(view));
            }
        }
    }

    /// Requests the job periodically until it ends.
    async fn poll_until_final(&mut self) -> Result<Option<JobView>, ClientError> {
        let (client, job) = (&self.connection.client, self.job);
        let mut period = tokio::time::interval(self.timeouts.poll);
        period.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            period.tick().await;
            let view = client.job(job).await?;
            self.note_answer();
            if !std::mem::replace(&mut self.is_held_back, true) {
                let (address, seconds) = (self.connection.address(), self.timeouts.poll.as_secs());
                self.progress.note(&format!(
                    "No events come from {address}, perhaps because a proxy holds them back: asking every {seconds} \
                     s instead"
                ));
            }
            if self.workers == Workers::Unknown {
                self.workers.note_all(&client.workers().await?);
            }
            if self.workers == Workers::Absent {
                self.note_missing_workers();
            }
            if self.progress.is_drawn() && !view.state.is_final() {
                self.live = live_error(client, job).await;
            }
            self.catch_up().await?;
            self.show(view.clone());
            if view.state.is_final() {
                return Ok(Some(view));
            }
        }
    }

    /// Notes that the coordinator has answered.
    fn note_answer(&mut self) {
        self.is_answered = true;
        self.outage.end(self.connection, self.progress);
    }

    /// Notes whether a worker builds the scene. Returns whether that is new.
    fn note_builder(&mut self, worker: &WorkerView) -> bool {
        if worker.building.is_some_and(|building| building.job == self.job) {
            self.builders.insert(worker.id)
        } else {
            self.builders.remove(&worker.id)
        }
    }

    /// Shows how far the job is.
    fn show(&mut self, view: JobView) {
        self.note_hold(&view);
        self.note_build_wait(&view);
        self.note_scene_refusal(&view);
        self.view = Some(view);
        self.show_again();
    }

    fn show_again(&mut self) {
        let Some(view) = &self.view else { return };
        let advance = Advance {
            fraction: view.progress,
            activity: building_text(self.builders.len().max(view.building_workers as usize))
                .filter(|_| view.samples == 0),
            samples: Some(self.samples_text(view)),
            samples_per_second: view.samples_per_second,
            remaining: view.remaining_ms.and_then(|left| u64::try_from(left).ok()).map(Duration::from_millis),
        };
        self.progress.show(&advance);
    }

    /// The number of samples, and the error between rounds.
    fn samples_text(&self, view: &JobView) -> String {
        let samples = samples_text(view, " samples a pixel");
        match self.live.as_ref().filter(|_| !view.state.is_final()) {
            Some(live) => format!("{samples}, {live}"),
            None => samples,
        }
    }

    /// Tells the user, once each, that the job is held and that it goes on.
    fn note_hold(&mut self, view: &JobView) {
        match (&view.hold, std::mem::replace(&mut self.is_held, view.hold.is_some())) {
            (Some(hold), false) => {
                let (reason, id, address) = (printable(&hold.reason), view.id, self.connection.address());
                self.progress.note(&format!(
                    "The job is held: {reason}. Get it going again with `clerestory release {id} --coordinator \
                     {address}`"
                ));
            }
            (None, true) if !view.state.is_final() => self.progress.note("The job is released and goes on"),
            _ => {}
        }
    }

    /// Tells the user, once each, that the job waits for a worker of another build and that it goes on.
    fn note_build_wait(&mut self, view: &JobView) {
        match (&view.waits_for_build, std::mem::replace(&mut self.is_waiting, view.waits_for_build.is_some())) {
            (Some(wait), false) => self.progress.note(&format!("The job waits: {}", printable(&wait.reason))),
            (None, true) if !view.state.is_final() => self.progress.note("The job goes on"),
            _ => {}
        }
    }

    /// Tells the user, once, that a machine could not build the scene.
    fn note_scene_refusal(&mut self, view: &JobView) {
        let Some(refusal) = &view.scene_refusal else { return };
        if !std::mem::replace(&mut self.is_refused, true) {
            let (name, reason) = (printable(&refusal.worker.name), printable(&refusal.reason));
            self.progress.note(&format!(
                "Worker `{name}` cannot build the scene: {reason}. Another machine tries it, and the job fails if that \
                 one cannot either"
            ));
        }
    }

    /// Tells the user, once, that the farm has no worker.
    fn note_missing_workers(&mut self) {
        self.workers = Workers::Missed;
        let address = self.connection.address();
        self.progress.note(&format!(
            "The farm has no worker yet: unless one is starting, start one with `clerestory worker --coordinator \
                 {address}`"
        ));
    }

    /// Shows the rounds that no event showed.
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

/// The work of workers that build the scene.
fn building_text(workers: usize) -> Option<String> {
    match workers {
        0 => None,
        1 => Some("1 worker builds the scene".to_owned()),
        workers => Some(format!("{workers} workers build the scene")),
    }
}

/// Requests the error between rounds, as text. A failure is not reported, because the event stream shows whether the
/// coordinator is away.
async fn live_error(client: &Client, job: JobId) -> Option<String> {
    let live = tokio::time::timeout(LIVE_TIMEOUT, client.live(job)).await;
    live.ok().and_then(Result::ok).and_then(|live| live_text(&live))
}

/// The error between rounds, where it is known, and the fraction of the pixels that it covers.
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
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use axum::Router;
    use axum::body::{Body, Bytes};
    use axum::http::{Method, Uri};
    use axum::response::{IntoResponse, Response};
    use clerestory_api::{JobState, JobSubmission};
    use clerestory_coordinator::{Config, run};
    use futures::stream;
    use serde_json::json;
    use tokio::net::TcpListener;
    use tokio::sync::Notify;

    use super::*;

    /// The part of an event stream that a proxy passes on.
    #[derive(Clone, Copy, Debug)]
    enum Passed {
        Nothing,
        Head,
        FirstEvent,
    }

    /// A proxy before a coordinator. It holds back the rest of an event stream and notifies when the job is requested.
    async fn proxy(coordinator: String, passed: Passed, asked: Arc<Notify>) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let carry = async move |method: Method, uri: Uri| -> Response {
            let is_stream = uri.path().ends_with("/events");
            if is_stream && matches!(passed, Passed::Nothing) {
                std::future::pending::<()>().await;
            }
            let request = reqwest::Client::new().request(method, format!("{coordinator}{uri}"));
            let mut answer = request.send().await.unwrap();
            let head = (answer.status(), [("content-type", answer.headers()["content-type"].clone())]);
            if !is_stream {
                if uri.path().split('/').nth_back(1) == Some("jobs") {
                    asked.notify_one();
                }
                return (head.0, head.1, answer.bytes().await.unwrap()).into_response();
            }
            let first = match passed {
                Passed::FirstEvent => answer.chunk().await.unwrap().unwrap(),
                _ => Bytes::new(),
            };
            let body = stream::iter([Ok::<_, std::io::Error>(first)]).chain(stream::pending());
            (head.0, head.1, Body::from_stream(body)).into_response()
        };
        tokio::spawn(axum::serve(listener, Router::new().fallback(carry)).into_future());
        address
    }

    fn submission() -> JobSubmission {
        let scene = json!({
            "version": 1,
            "name": "one wall",
            "film": {"width": 8, "height": 8},
            "camera": {"perspective": {
                "position": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 60
            }},
            "integrator": {"path": {}},
            "materials": {"white": {"diffuse": {"reflectance": {"colour": [0.8, 0.8, 0.8]}}}},
            "meshes": [{"name": "wall", "material": "white", "source": {"inline": {
                "positions": [[-1, -1, 0], [1, -1, 0], [1, 1, 0]], "triangles": [[0, 1, 2]]
            }}}],
            "lights": [{"point": {"name": "lamp", "position": [1, 1, 2], "intensity": [5, 5, 5]}}]
        });
        JobSubmission {
            name: None,
            scene,
            assets: BTreeMap::new(),
            samples_per_pixel: 16,
            tile_size: 8,
            priority: 0,
            reference: None,
            time_limit_ms: None,
            target_mse: None,
            target_estimated_mse: None,
            adaptive: false,
            assumptions: Vec::new(),
        }
    }

    #[tokio::test]
    async fn a_job_is_followed_to_its_end_through_a_proxy_that_holds_events_back() {
        let directory = tempfile::tempdir().unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let coordinator = format!("http://{}", listener.local_addr().unwrap());
        tokio::spawn(run(listener, Config::new(directory.path()), std::future::pending()));
        let client = Client::new(&coordinator, None).unwrap();
        let short = Duration::from_millis(100);
        for passed in [Passed::Nothing, Passed::Head, Passed::FirstEvent] {
            let job = client.submit_job(&submission()).await.unwrap().id;
            let asked = Arc::new(Notify::new());
            let address = proxy(coordinator.clone(), passed, Arc::clone(&asked)).await;
            let connection = Connection::open(&address, None).unwrap();
            let mut progress = Progress::new();
            let timeouts = StreamTimeouts { first: short, later: short, poll: short };
            let followed = follow_through(&connection, job, &mut progress, timeouts);
            let end = async {
                asked.notified().await;
                client.cancel_job(job).await.unwrap();
            };
            let (ended, ()) = tokio::join!(tokio::time::timeout(Duration::from_secs(30), followed), end);
            assert_eq!(ended.expect("it ends").unwrap().state, JobState::Cancelled, "{passed:?}");
        }
    }

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
