//! A worker against a coordinator that misbehaves in every way that a real one does.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::collections::{BTreeMap, VecDeque};
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::{delete, get, post, put};
use axum::{Json, Router};
use clerestory_api::{
    FENCING_TOKEN_HEADER, JobId, JobScene, Lease, LeaseId, LeaseRenewal, LeaseReturn, NodeAddress, NodeAnswer,
    NodeVerdict, PROBLEM_MEDIA_TYPE, PartialAnswer, PartialPieces, WorkerActivity, WorkerId, WorkerRegistration,
    WorkerState, WorkerView,
};
use clerestory_film::{DecodeBudget, Expectation, Rendered, Sampling, TileGrid, partial};
use clerestory_render_core::scene::{self, SceneBundle, SceneDescription};
use clerestory_worker::{Config, WorkerError, run};
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::{Notify, oneshot};

/// Longest time that any of these tests may take before it counts as stuck.
const PATIENCE: Duration = Duration::from_secs(60);

/// What the fake coordinator answers, and what it has been told.
#[derive(Default)]
struct Fake {
    scene: Value,
    scene_hash: String,
    /// Answers to claims, first to last; afterwards there is no work.
    claims: VecDeque<Claim>,
    /// Answers to uploads that are not taken, first to last; afterwards all are.
    failing_uploads: VecDeque<Response>,
    /// Workers that are known; a claim of another is refused.
    known: Vec<WorkerId>,
    /// Jobs whose scenes the worker had when it claimed last, the last used first.
    built: Vec<JobId>,
    lease_is_over: bool,
    /// Renewals of the first lease are told that nothing of it is wanted.
    nothing_is_wanted: bool,
    /// The largest body that a proxy before the coordinator lets through.
    proxy_limit: Option<usize>,
    /// The largest partial that the coordinator takes.
    partial_limit: Option<usize>,
    /// Sizes of the bodies that were too large, for the proxy or the coordinator.
    refused_bytes: Vec<usize>,
    /// Pieces of partials by their hashes.
    pieces: BTreeMap<String, Bytes>,
    /// Pieces that are lost before they are put together, once.
    loses_pieces: bool,
    /// Whether the scene is given out.
    holds_scene: bool,
    scenes: u32,
    heartbeats: Vec<WorkerActivity>,
    /// Edge of the image in pixels, of which a tile has half.
    edge: u32,
    uploads: Vec<Upload>,
    returns: Vec<(LeaseId, LeaseReturn)>,
    leases: BTreeMap<LeaseId, Lease>,
    outstanding: BTreeMap<LeaseId, u32>,
    registrations: Vec<WorkerRegistration>,
    /// Workers that have said that they end, each with what had been given back before.
    ended: Vec<(String, usize)>,
}

enum Claim {
    Lease(Lease),
    Garbage(&'static str),
    ForgetWorker,
}

#[derive(Clone)]
struct Upload {
    lease: LeaseId,
    token: String,
    nodes: Vec<NodeAddress>,
}

#[derive(Clone, Default)]
struct Farm {
    fake: Arc<Mutex<Fake>>,
    changed: Arc<Notify>,
}

impl Farm {
    fn lock(&self) -> MutexGuard<'_, Fake> {
        self.fake.lock().unwrap()
    }

    /// Waits until the coordinator has been told enough.
    async fn until(&self, condition: impl Fn(&Fake) -> bool) {
        let waiting = async {
            loop {
                let changed = self.changed.notified();
                if condition(&self.lock()) {
                    return;
                }
                changed.await;
            }
        };
        tokio::time::timeout(PATIENCE, waiting).await.expect("the coordinator was not told what it should have been");
    }

    /// Starts the coordinator and a worker.
    async fn start(&self) -> RunningWorker {
        self.start_with(None).await
    }

    /// Starts the coordinator, and a worker whose scenes may take so many bytes.
    async fn start_with(&self, memory: Option<u64>) -> RunningWorker {
        let router = Router::new()
            .route("/api/v1/workers", post(register))
            .route("/api/v1/workers/{id}", delete(end))
            .route("/api/v1/workers/{id}/heartbeat", post(heartbeat))
            .route("/api/v1/leases", post(claim))
            .route("/api/v1/leases/{id}/renew", post(renew))
            .route("/api/v1/leases/{id}/partial", put(upload))
            .route("/api/v1/leases/{id}/pieces/{hash}", put(upload_piece))
            .route("/api/v1/leases/{id}/pieces", post(assemble))
            .route("/api/v1/leases/{id}/return", post(give_back))
            .route("/api/v1/jobs/{id}/scene", get(scene))
            .layer(DefaultBodyLimit::disable())
            .with_state(self.clone());
        RunningWorker::at(router, memory).await
    }
}

struct RunningWorker {
    stop: oneshot::Sender<()>,
    ended: tokio::task::JoinHandle<Result<(), WorkerError>>,
}

impl RunningWorker {
    /// Starts a server and a worker.
    async fn at(router: Router, memory: Option<u64>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let coordinator = format!("http://{}", listener.local_addr().unwrap());
        tokio::spawn(async { axum::serve(listener, router).await });
        let config = Config {
            coordinator,
            token: None,
            name: "test".into(),
            threads: NonZeroUsize::new(2).unwrap(),
            memory,
            build: "test build".into(),
        };
        let (stop, stopped) = oneshot::channel::<()>();
        let ended = tokio::spawn(run(config, async {
            let _ = stopped.await;
        }));
        Self { stop, ended }
    }

    async fn stop(self) {
        let _ = self.stop.send(());
        tokio::time::timeout(PATIENCE, self.ended).await.expect("the worker does not end").unwrap().unwrap();
    }
}

/// A farm with a scene of 16x16 pixels in tiles of 8, one sample in a pass.
fn farm() -> Farm {
    farm_of(16)
}

/// A farm with a scene of `edge` x `edge` pixels in four tiles, one sample in a pass.
fn farm_of(edge: u32) -> Farm {
    let text = json!({
        "version": 1,
        "name": "one wall",
        "film": {"width": edge, "height": edge},
        "camera": {"perspective": {
            "position": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 40
        }},
        "integrator": {"path": {"max_depth": 4}},
        "sampling": {"samples_per_pass": 1, "samples_per_block": 1},
        "materials": {"white": {"diffuse": {"reflectance": {"colour": [0.8, 0.8, 0.8]}}}},
        "meshes": [{"name": "wall", "material": "white", "source": {"inline": {
            "positions": [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]],
            "triangles": [[0, 1, 2], [0, 2, 3]]
        }}}],
        "lights": [{"point": {"name": "lamp", "position": [1, 1, 2], "intensity": [5, 5, 5]}}]
    });
    let description = SceneDescription::parse(text.to_string().as_bytes()).unwrap();
    let bundle = SceneBundle::from_parts(description, BTreeMap::new()).unwrap();
    let farm = Farm::default();
    farm.lock().edge = edge;
    farm.lock().scene = text;
    farm.lock().scene_hash = bundle.scene_hash().to_string();
    farm
}

fn lease(number: u64, nodes: Vec<NodeAddress>) -> Lease {
    let id: LeaseId = format!("00000000-0000-7000-8000-{number:012}").parse().unwrap();
    let job: JobId = "00000000-0000-7000-8000-00000000000a".parse().unwrap();
    Lease {
        id,
        token: number,
        job,
        scene_hash: String::new(),
        nodes,
        deadline_ms: 0,
        expires_in_ms: 600,
        gather_ms: 1000,
    }
}

/// All tiles over the passes `[index * 2^level, (index + 1) * 2^level)`.
fn wave(level: u32, index: u32) -> Vec<NodeAddress> {
    (0..4).map(|tile| NodeAddress { frame: 0, tile, level, index }).collect()
}

/// More work than the patience of any test.
fn endless() -> Vec<NodeAddress> {
    (0..1_000_000).map(|index| NodeAddress { frame: 0, tile: 0, level: 0, index }).collect()
}

fn problem(status: u16, code: &str) -> Response {
    let body = json!({"type": "about:blank", "title": code, "status": status, "detail": "by test", "code": code});
    (StatusCode::from_u16(status).unwrap(), [("content-type", PROBLEM_MEDIA_TYPE)], body.to_string()).into_response()
}

fn login_page() -> Response {
    ([("content-type", "text/html")], "<html>Please sign in</html>").into_response()
}

async fn register(State(farm): State<Farm>, Json(registration): Json<WorkerRegistration>) -> Json<WorkerView> {
    let mut fake = farm.lock();
    let id: WorkerId = format!("00000000-0000-7000-8000-{:012}", fake.registrations.len()).parse().unwrap();
    let (name, cores, build) = (registration.name.clone(), registration.cores, registration.build.clone());
    fake.registrations.push(registration);
    fake.known = vec![id];
    farm.changed.notify_waiters();
    Json(WorkerView {
        id,
        name,
        cores,
        build,
        state: WorkerState::Idle,
        job: None,
        building: None,
        leased_nodes: 0,
        accepted_nodes: 0,
        refused_partials: 0,
        samples: 0,
        core_ms: 0,
        samples_per_second: None,
        quarantine: None,
        probe_digest: None,
        passed_over: Vec::new(),
        registered_ms: 0,
        seen_ms: 0,
    })
}

async fn claim(State(farm): State<Farm>, Json(request): Json<Value>) -> Response {
    let mut fake = farm.lock();
    let worker: WorkerId = request["worker"].as_str().unwrap().parse().unwrap();
    if !fake.known.contains(&worker) {
        return problem(404, "unknown_worker");
    }
    fake.built = serde_json::from_value(request["built"].clone()).unwrap_or_default();
    farm.changed.notify_waiters();
    match fake.claims.pop_front() {
        Some(Claim::Lease(lease)) => {
            fake.outstanding.insert(lease.id, lease.nodes.len() as u32);
            fake.leases.insert(lease.id, lease.clone());
            fake.lease_is_over &= lease.token == 1;
            fake.nothing_is_wanted &= lease.token == 1;
            farm.changed.notify_waiters();
            Json(lease).into_response()
        }
        Some(Claim::Garbage(body)) => ([("content-type", "application/json")], body).into_response(),
        Some(Claim::ForgetWorker) => {
            fake.known.clear();
            problem(404, "unknown_worker")
        }
        None => StatusCode::NO_CONTENT.into_response(),
    }
}

async fn renew(State(farm): State<Farm>) -> Response {
    let fake = farm.lock();
    if fake.lease_is_over {
        return problem(409, "lease_expired");
    }
    let outstanding = u32::from(!fake.nothing_is_wanted);
    Json(LeaseRenewal { deadline_ms: 0, expires_in_ms: 600, outstanding }).into_response()
}

async fn heartbeat(State(farm): State<Farm>, Json(activity): Json<WorkerActivity>) -> StatusCode {
    farm.lock().heartbeats.push(activity);
    farm.changed.notify_waiters();
    StatusCode::NO_CONTENT
}

async fn scene(State(farm): State<Farm>, Path(job): Path<String>) -> Json<JobScene> {
    farm.lock().scenes += 1;
    farm.changed.notify_waiters();
    farm.until(|fake| !fake.holds_scene).await;
    let fake = farm.lock();
    Json(JobScene {
        job: job.parse().unwrap(),
        scene: fake.scene.clone(),
        scene_hash: fake.scene_hash.clone(),
        assets: BTreeMap::new(),
        tile_size: fake.edge / 2,
        passes: 1 << 20,
    })
}

async fn upload(State(farm): State<Farm>, Path(id): Path<String>, headers: HeaderMap, body: Bytes) -> Response {
    let token = headers[FENCING_TOKEN_HEADER].to_str().unwrap().to_owned();
    take(&farm, id.parse().unwrap(), token, &body, body.len())
}

async fn upload_piece(
    State(farm): State<Farm>,
    Path((_, hash)): Path<(String, String)>,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    assert!(headers.contains_key(FENCING_TOKEN_HEADER));
    let mut fake = farm.lock();
    if let Some(refusal) = fake.refusal(body.len()) {
        return refusal;
    }
    assert_eq!(scene::ContentHash::of(&body).to_string(), hash);
    fake.pieces.insert(hash, body);
    StatusCode::NO_CONTENT.into_response()
}

async fn assemble(State(farm): State<Farm>, Path(id): Path<String>, Json(partial): Json<PartialPieces>) -> Response {
    if std::mem::take(&mut farm.lock().loses_pieces) {
        farm.lock().pieces.clear();
        return problem(409, "missing_pieces");
    }
    let pieces = farm.lock().pieces.clone();
    let body: Vec<u8> = partial.pieces.iter().flat_map(|hash| pieces[&hash.to_string()].to_vec()).collect();
    take(&farm, id.parse().unwrap(), partial.token.to_string(), &body, 0)
}

impl Fake {
    /// What a proxy or the coordinator says to a body of so many bytes that is too large.
    fn refusal(&mut self, bytes: usize) -> Option<Response> {
        let is_above = |limit: Option<usize>| limit.is_some_and(|limit| bytes > limit);
        let refusal = if is_above(self.proxy_limit) {
            let page = "<html><head><title>413 Request Entity Too Large</title></head></html>";
            (StatusCode::PAYLOAD_TOO_LARGE, [("content-type", "text/html")], page).into_response()
        } else if is_above(self.partial_limit) {
            problem(413, "body_too_large")
        } else {
            return None;
        };
        self.refused_bytes.push(bytes);
        Some(refusal)
    }
}

/// Takes a partial that came in a body of so many bytes.
fn take(farm: &Farm, lease: LeaseId, token: String, partial: &[u8], body_bytes: usize) -> Response {
    let mut fake = farm.lock();
    if let Some(failure) = fake.failing_uploads.pop_front().or_else(|| fake.refusal(body_bytes)) {
        return failure;
    }
    let nodes = nodes_of(partial, &fake.scene_hash, &fake.leases[&lease], fake.edge);
    let outstanding = fake.outstanding.get_mut(&lease).unwrap();
    *outstanding = outstanding.saturating_sub(nodes.len() as u32);
    let outstanding = *outstanding;
    let answers = nodes.iter().map(|node| NodeAnswer { node: *node, verdict: NodeVerdict::Accepted, reason: None });
    let answer = PartialAnswer { nodes: answers.collect(), outstanding };
    fake.uploads.push(Upload { lease, token, nodes });
    farm.changed.notify_waiters();
    Json(answer).into_response()
}

async fn give_back(State(farm): State<Farm>, Path(id): Path<String>, Json(body): Json<LeaseReturn>) -> StatusCode {
    farm.lock().returns.push((id.parse().unwrap(), body));
    farm.changed.notify_waiters();
    StatusCode::NO_CONTENT
}

async fn end(State(farm): State<Farm>, Path(id): Path<String>) -> StatusCode {
    let mut fake = farm.lock();
    let returns = fake.returns.len();
    fake.ended.push((id, returns));
    StatusCode::NO_CONTENT
}

fn uploaded(fake: &Fake, lease: &Lease) -> Vec<NodeAddress> {
    let mut nodes: Vec<_> =
        fake.uploads.iter().filter(|upload| upload.lease == lease.id).flat_map(|upload| upload.nodes.clone()).collect();
    nodes.sort();
    nodes
}

#[tokio::test]
async fn the_nodes_of_each_lease_arrive_under_its_token_and_nothing_is_given_back() {
    let farm = farm();
    let (first, second) = (lease(1, wave(0, 0)), lease(2, wave(2, 1)));
    farm.lock().claims = VecDeque::from([Claim::Lease(first.clone()), Claim::Lease(second.clone())]);
    let worker = farm.start().await;
    farm.until(|fake| uploaded(fake, &first) == first.nodes && uploaded(fake, &second) == second.nodes).await;
    worker.stop().await;
    let fake = farm.lock();
    assert!(fake.uploads.iter().all(|upload| upload.token == if upload.lease == first.id { "1" } else { "2" }));
    assert_eq!(fake.returns, []);
    assert_eq!((fake.registrations[0].cores, fake.registrations[0].build.as_str()), (2, "test build"));
}

#[tokio::test]
async fn a_result_is_kept_until_the_coordinator_can_take_it() {
    let farm = farm();
    let lease = lease(1, wave(0, 0));
    farm.lock().claims.push_back(Claim::Lease(lease.clone()));
    farm.lock().failing_uploads = VecDeque::from([
        StatusCode::SERVICE_UNAVAILABLE.into_response(),
        StatusCode::REQUEST_TIMEOUT.into_response(),
        problem(408, "body_too_slow"),
        (StatusCode::TOO_MANY_REQUESTS, [("retry-after", "1")]).into_response(),
        login_page(),
    ]);
    let worker = farm.start().await;
    farm.until(|fake| uploaded(fake, &lease) == lease.nodes).await;
    worker.stop().await;
    assert_eq!(farm.lock().returns, []);
}

#[tokio::test]
async fn a_worker_whose_address_is_not_that_of_a_coordinator_ends_and_says_what_answered() {
    let worker = RunningWorker::at(Router::new().fallback(async || login_page()), None).await;
    let ended = tokio::time::timeout(PATIENCE, worker.ended).await.expect("the worker does not end").unwrap();
    let WorkerError::Connection(answer) = ended.unwrap_err() else { panic!("the coordinator has refused nothing") };
    assert!(answer.to_string().contains("text/html, `<html>Please sign in"), "{answer}");
}

#[tokio::test]
async fn a_worker_that_has_been_forgotten_registers_again_and_goes_on() {
    let farm = farm();
    let lease = lease(1, wave(0, 0));
    farm.lock().claims = VecDeque::from([Claim::ForgetWorker, Claim::Lease(lease.clone())]);
    let worker = farm.start().await;
    farm.until(|fake| uploaded(fake, &lease) == lease.nodes).await;
    worker.stop().await;
    assert_eq!(farm.lock().registrations.len(), 2);
}

#[tokio::test]
async fn a_lease_that_is_over_is_abandoned_for_the_next() {
    let farm = farm();
    let (lost, next) = (lease(1, endless()), lease(2, wave(0, 0)));
    farm.lock().claims = VecDeque::from([Claim::Lease(lost.clone()), Claim::Lease(next.clone())]);
    farm.lock().lease_is_over = true;
    let worker = farm.start().await;
    farm.until(|fake| uploaded(fake, &next) == next.nodes).await;
    worker.stop().await;
    assert!(uploaded(&farm.lock(), &lost).len() < lost.nodes.len());
}

#[tokio::test]
async fn a_lease_of_which_nothing_is_wanted_any_more_is_left_for_the_next() {
    let farm = farm();
    let (lost, next) = (lease(1, endless()), lease(2, wave(0, 0)));
    farm.lock().claims = VecDeque::from([Claim::Lease(lost.clone()), Claim::Lease(next.clone())]);
    let worker = farm.start().await;
    farm.until(|fake| !fake.uploads.is_empty()).await;
    farm.lock().nothing_is_wanted = true;
    farm.until(|fake| uploaded(fake, &next) == next.nodes).await;
    worker.stop().await;
    let fake = farm.lock();
    assert!(uploaded(&fake, &lost).len() < lost.nodes.len());
    assert_eq!(fake.returns, [], "there is nothing to give back");
}

#[tokio::test]
async fn complete_nodes_wait_for_others_as_long_as_the_lease_says() {
    let farm = farm();
    // Long ones, so that they do not fill a partial.
    let nodes = (0..4096).map(|index| NodeAddress { frame: 0, tile: 0, level: 8, index }).collect();
    let lease = Lease { gather_ms: 60_000, ..lease(1, nodes) };
    farm.lock().claims.push_back(Claim::Lease(lease.clone()));
    let worker = farm.start().await;
    farm.until(|fake| !fake.leases.is_empty()).await;
    // Whoever does not listen to it hands in after a second.
    tokio::time::sleep(Duration::from_secs(3)).await;
    assert!(farm.lock().uploads.is_empty());
    worker.stop().await;
    let fake = farm.lock();
    assert!(matches!(fake.uploads.as_slice(), [all] if !all.nodes.is_empty()));
}

#[tokio::test]
async fn told_to_stop_it_uploads_what_is_complete_and_returns_the_rest() {
    let farm = farm();
    let lease = lease(1, endless());
    farm.lock().claims.push_back(Claim::Lease(lease.clone()));
    let worker = farm.start().await;
    farm.until(|fake| !fake.uploads.is_empty()).await;
    worker.stop().await;
    let fake = farm.lock();
    let done = uploaded(&fake, &lease);
    // Two are rendered at a time, and the first may be the one that is left.
    let begun = &lease.nodes[..=done.len()];
    assert!(done.iter().all(|node| begun.contains(node)), "a complete node was not uploaded: {done:?}");
    assert_eq!(fake.returns, [(lease.id, LeaseReturn { token: 1, failure: None })]);
    // It says that it ends once all is given back.
    assert_eq!(fake.ended, [(fake.known[0].to_string(), 1)]);
}

#[tokio::test]
async fn a_scene_that_cannot_be_built_is_reported_and_the_worker_goes_on() {
    let farm = farm();
    let (broken, next) = (lease(1, wave(0, 0)), lease(2, wave(0, 0)));
    farm.lock().claims = VecDeque::from([Claim::Lease(broken.clone()), Claim::Lease(next.clone())]);
    let good = std::mem::replace(&mut farm.lock().scene["meshes"][0]["material"], json!("gold"));
    let worker = farm.start().await;
    farm.until(|fake| !fake.returns.is_empty()).await;
    farm.lock().scene["meshes"][0]["material"] = good;
    farm.until(|fake| uploaded(fake, &next) == next.nodes).await;
    worker.stop().await;
    let fake = farm.lock();
    let (id, returned) = &fake.returns[0];
    assert_eq!(*id, broken.id);
    assert!(returned.failure.as_ref().is_some_and(|failure| failure.contains("gold")), "{returned:?}");
}

#[tokio::test]
async fn a_scene_that_takes_more_than_the_worker_may_have_is_given_back_with_a_way_out() {
    let farm = farm();
    farm.lock().claims.push_back(Claim::Lease(lease(1, wave(0, 0))));
    let worker = farm.start_with(Some(10 << 10)).await;
    farm.until(|fake| !fake.returns.is_empty()).await;
    worker.stop().await;
    let fake = farm.lock();
    let reason = fake.returns[0].1.failure.as_deref().unwrap_or_default();
    assert!(reason.contains("to build") && reason.contains("a worker that may take more memory"), "{reason}");
}

#[tokio::test]
async fn a_scene_is_kept_unless_the_next_does_not_fit_beside_it() {
    // A small scene counts for a little more than 64 KiB.
    for (memory, keeps_first) in [(200 << 10, true), (100 << 10, false)] {
        let farm = farm();
        let first = lease(1, wave(0, 0));
        let other: JobId = "00000000-0000-7000-8000-00000000000b".parse().unwrap();
        let second = Lease { job: other, ..lease(2, wave(0, 0)) };
        farm.lock().claims = VecDeque::from([Claim::Lease(first.clone()), Claim::Lease(second.clone())]);
        let worker = farm.start_with(Some(memory)).await;
        farm.until(|fake| uploaded(fake, &first) == first.nodes && uploaded(fake, &second) == second.nodes).await;
        let expected = if keeps_first { vec![other, first.job] } else { vec![other] };
        farm.until(|fake| fake.built == expected).await;
        worker.stop().await;
        assert_eq!(farm.lock().returns, [], "both are rendered with {memory} bytes");
    }
}

#[tokio::test]
async fn nodes_that_a_proxy_refuses_together_travel_in_smaller_partials_from_then_on() {
    let farm = farm();
    let (first, second) = (lease(1, wave(0, 0)), lease(2, wave(1, 1)));
    farm.lock().claims = VecDeque::from([Claim::Lease(first.clone())]);
    farm.lock().proxy_limit = Some(8 << 10);
    let worker = farm.start().await;
    farm.until(|fake| uploaded(fake, &first) == first.nodes).await;
    let refused = farm.lock().refused_bytes.len();
    assert!(refused > 0, "the proxy refuses what would travel together");
    farm.lock().claims.push_back(Claim::Lease(second.clone()));
    farm.until(|fake| uploaded(fake, &second) == second.nodes).await;
    worker.stop().await;
    let fake = farm.lock();
    assert_eq!((fake.refused_bytes.len(), fake.pieces.len()), (refused, 0));
    assert_eq!(fake.returns, []);
}

#[tokio::test]
async fn a_node_that_a_proxy_refuses_travels_in_pieces_and_again_when_they_are_lost() {
    let farm = farm_of(64);
    let lease = lease(1, wave(0, 0));
    farm.lock().claims.push_back(Claim::Lease(lease.clone()));
    farm.lock().proxy_limit = Some(10 << 10);
    farm.lock().loses_pieces = true;
    let worker = farm.start().await;
    farm.until(|fake| uploaded(fake, &lease) == lease.nodes).await;
    worker.stop().await;
    let fake = farm.lock();
    assert!(fake.pieces.values().all(|piece| piece.len() <= 10 << 10) && fake.pieces.len() > 4);
    assert_eq!(fake.returns, []);
}

#[tokio::test]
async fn nodes_that_the_coordinator_refuses_together_travel_one_by_one_and_one_that_is_too_large_is_named() {
    let farm = farm();
    let (small, large) = (lease(1, wave(0, 0)), lease(2, wave(0, 1)));
    farm.lock().claims = VecDeque::from([Claim::Lease(small.clone())]);
    farm.lock().partial_limit = Some(6 << 10);
    let worker = farm.start().await;
    farm.until(|fake| uploaded(fake, &small) == small.nodes).await;
    assert_eq!(farm.lock().returns, []);
    farm.lock().partial_limit = Some(100);
    farm.lock().claims.push_back(Claim::Lease(large.clone()));
    farm.until(|fake| !fake.returns.is_empty()).await;
    worker.stop().await;
    let fake = farm.lock();
    let (id, returned) = &fake.returns[0];
    assert_eq!(*id, large.id);
    let reason = returned.failure.as_deref().unwrap_or_default();
    assert!(reason.contains("the coordinator takes no partial of"), "{reason}");
}

#[tokio::test]
async fn a_scene_that_is_built_for_longer_than_its_lease_lasts_serves_the_next_lease() {
    let farm = farm();
    let (lost, next) = (lease(1, wave(0, 0)), lease(2, wave(0, 0)));
    farm.lock().claims = VecDeque::from([Claim::Lease(lost.clone()), Claim::Lease(next.clone())]);
    farm.lock().holds_scene = true;
    farm.lock().nothing_is_wanted = true;
    let worker = farm.start().await;
    // The second lease is claimed while the scene is under way.
    farm.until(|fake| fake.scenes > 0 && fake.leases.contains_key(&next.id)).await;
    farm.until(|fake| fake.heartbeats.iter().any(|activity| activity.building.is_some())).await;
    farm.lock().holds_scene = false;
    farm.changed.notify_waiters();
    farm.until(|fake| uploaded(fake, &next) == next.nodes).await;
    worker.stop().await;
    let fake = farm.lock();
    assert_eq!(fake.scenes, 1, "it is fetched and built once");
    assert_eq!((uploaded(&fake, &lost), fake.returns.len()), (Vec::new(), 0));
    assert!(fake.heartbeats.iter().flat_map(|activity| activity.building).all(|building| building.job == next.job));
}

#[tokio::test]
async fn nonsense_from_the_coordinator_does_not_end_the_worker() {
    let farm = farm();
    let last = lease(9, wave(0, 0));
    let strange = |number, node| Claim::Lease(lease(number, vec![node]));
    farm.lock().claims = VecDeque::from([
        Claim::Garbage("{\"id\": 5"),
        Claim::Garbage("[]"),
        strange(1, NodeAddress { frame: 0, tile: 4, level: 0, index: 0 }),
        strange(2, NodeAddress { frame: 1, tile: 0, level: 0, index: 0 }),
        strange(3, NodeAddress { frame: 0, tile: 0, level: 77, index: 1 }),
        strange(4, NodeAddress { frame: 0, tile: u32::MAX, level: 31, index: u32::MAX }),
        Claim::Lease(lease(5, Vec::new())),
        Claim::Lease(last.clone()),
    ]);
    let worker = farm.start().await;
    farm.until(|fake| uploaded(fake, &last) == last.nodes).await;
    worker.stop().await;
    let reasons = farm.lock().returns.iter().filter(|(_, body)| body.failure.is_some()).count();
    assert_eq!(reasons, 4);
}

/// The nodes in a partial, which must be some of those leased.
fn nodes_of(body: &[u8], scene_hash: &str, lease: &Lease, edge: u32) -> Vec<NodeAddress> {
    let leased = |node: &NodeAddress| clerestory_film::NodeAddress {
        frame: node.frame,
        tile: node.tile,
        level: node.level,
        index: node.index,
    };
    let expected = Expectation {
        job: lease.job.to_string(),
        scene_hash: scene_hash.to_owned(),
        grid: TileGrid { width: edge, height: edge, tile_size: edge / 2 },
        sampling: Sampling::new(1, 1).unwrap(),
        allowed: lease.nodes.iter().map(leased).collect(),
    };
    let nodes = partial::decode(body, &expected, DecodeBudget { pixel_bytes: 1 << 30 }).unwrap();
    let wire = |rendered: &Rendered| {
        let clerestory_film::NodeAddress { frame, tile, level, index } = rendered.node.address();
        NodeAddress { frame, tile, level, index }
    };
    nodes.iter().map(wire).collect()
}
