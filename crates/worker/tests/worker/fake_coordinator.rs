//! A fake coordinator: scripted answers, and a record of the calls that a worker makes.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard};

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::{delete, get, post, put};
use axum::{Json, Router};
use clerestory_api::{
    FENCING_TOKEN_HEADER, JobId, JobScene, Lease, LeaseId, LeaseRenewal, LeaseReturn, NodeAddress, NodeAnswer,
    NodeVerdict, PROBLEM_MEDIA_TYPE, PartialAnswer, PartialPieces, SceneReport, WorkerActivity, WorkerId,
    WorkerRegistration, WorkerState, WorkerView,
};
use clerestory_film::{DecodeBudget, Expectation, Rendered, Sampling, TileGrid, partial};
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::scene;
use serde_json::{Value, json};
use tokio::sync::Notify;

use crate::running_worker::{RunningWorker, TIMEOUT};

/// What the coordinator answers, and the calls that it has received.
#[derive(Default)]
pub(crate) struct FakeState {
    pub(crate) scene: Value,
    pub(crate) scene_hash: String,
    /// Answers to claims, first to last. After these the queue has no work.
    pub(crate) claims: VecDeque<Claim>,
    /// Refusals of uploads, first to last. After these all uploads are accepted.
    pub(crate) failing_uploads: VecDeque<Response>,
    /// Registered workers. A claim of another is refused.
    pub(crate) known: Vec<WorkerId>,
    /// Jobs whose scenes the worker had at its last claim, the last used first.
    pub(crate) built: Vec<JobId>,
    /// Renewals of the first lease are refused.
    pub(crate) lease_is_over: bool,
    /// Renewals of the first lease say that none of its nodes is outstanding.
    pub(crate) nothing_is_wanted: bool,
    /// The largest body that a proxy before the coordinator passes on.
    pub(crate) proxy_limit: Option<usize>,
    /// The largest partial that the coordinator accepts.
    pub(crate) partial_limit: Option<usize>,
    /// Sizes of the bodies that the proxy or the coordinator refused.
    pub(crate) refused_bytes: Vec<usize>,
    /// Pieces of partials by their hashes.
    pub(crate) pieces: BTreeMap<String, Bytes>,
    /// Whether the coordinator loses all pieces once, before it assembles them.
    pub(crate) loses_pieces: bool,
    /// Whether requests for the scene wait.
    pub(crate) holds_scene: bool,
    pub(crate) scenes: u32,
    /// Whether leases ask for a report on the scene, until there is one.
    pub(crate) wants_report: bool,
    /// Answers to reports on the scene, first to last. After these all reports are taken.
    pub(crate) failing_reports: VecDeque<Response>,
    /// Reports that were taken, each with the number of nodes uploaded before.
    pub(crate) reports: Vec<(LeaseId, SceneReport, usize)>,
    pub(crate) heartbeats: Vec<WorkerActivity>,
    /// How often leases were renewed.
    pub(crate) renewals: usize,
    /// Edge of the image in pixels. The edge of a tile is half of it.
    pub(crate) edge: u32,
    pub(crate) uploads: Vec<Upload>,
    pub(crate) returns: Vec<(LeaseId, LeaseReturn)>,
    pub(crate) leases: BTreeMap<LeaseId, Lease>,
    pub(crate) outstanding: BTreeMap<LeaseId, u32>,
    pub(crate) registrations: Vec<WorkerRegistration>,
    /// Workers that ended, each with the number of leases returned before.
    pub(crate) ended: Vec<(String, usize)>,
}

/// The answer to a claim.
pub(crate) enum Claim {
    Lease(Lease),
    Garbage(&'static str),
    ForgetWorker,
}

/// An accepted upload.
#[derive(Clone)]
pub(crate) struct Upload {
    pub(crate) lease: LeaseId,
    pub(crate) token: String,
    pub(crate) nodes: Vec<NodeAddress>,
}

/// A coordinator without a queue or a store.
#[derive(Clone, Default)]
pub(crate) struct FakeCoordinator {
    state: Arc<Mutex<FakeState>>,
    pub(crate) changed: Arc<Notify>,
}

impl FakeCoordinator {
    /// What the coordinator answers from now on, and the calls so far.
    pub(crate) fn lock(&self) -> MutexGuard<'_, FakeState> {
        self.state.lock().unwrap()
    }

    /// Waits until a call has made the condition true.
    pub(crate) async fn until(&self, condition: impl Fn(&FakeState) -> bool) {
        let waiting = async {
            loop {
                let changed = self.changed.notified();
                if condition(&self.lock()) {
                    return;
                }
                changed.await;
            }
        };
        tokio::time::timeout(TIMEOUT, waiting).await.expect("the worker did not make the expected calls");
    }

    /// Changes the scene, and its hash with it.
    pub(crate) fn set_scene(&self, change: impl FnOnce(&mut Value)) {
        let mut state = self.lock();
        change(&mut state.scene);
        let description = SceneDescription::parse(state.scene.to_string().as_bytes()).unwrap();
        let bundle = SceneBundle::from_parts(description, BTreeMap::new()).unwrap();
        state.scene_hash = bundle.scene_hash().to_string();
    }

    /// Starts the coordinator and a worker.
    pub(crate) async fn start(&self) -> RunningWorker {
        self.start_with(None).await
    }

    /// Starts the coordinator, and a worker whose scenes may take `memory` bytes.
    pub(crate) async fn start_with(&self, memory: Option<u64>) -> RunningWorker {
        let router = Router::new()
            .route("/api/v1/workers", post(register))
            .route("/api/v1/workers/{id}", delete(end))
            .route("/api/v1/workers/{id}/heartbeat", post(heartbeat))
            .route("/api/v1/leases", post(claim))
            .route("/api/v1/leases/{id}/renew", post(renew))
            .route("/api/v1/leases/{id}/scene", post(report_scene))
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

/// A coordinator with a scene of 16 x 16 pixels in tiles of 8, one sample in a pass.
pub(crate) fn coordinator() -> FakeCoordinator {
    coordinator_of_image(16)
}

/// A coordinator with a scene of `edge` x `edge` pixels in four tiles, one sample in a pass.
pub(crate) fn coordinator_of_image(edge: u32) -> FakeCoordinator {
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
    let coordinator = FakeCoordinator::default();
    coordinator.lock().edge = edge;
    coordinator.set_scene(|scene| *scene = text);
    coordinator
}

/// A lease on these nodes, with `number` as its fencing token.
pub(crate) fn lease(number: u64, nodes: Vec<NodeAddress>) -> Lease {
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
        upload_linger_ms: 1000,
        wants_report: false,
    }
}

/// All tiles over the passes `[index * 2^level, (index + 1) * 2^level)`.
pub(crate) fn all_tiles(level: u32, index: u32) -> Vec<NodeAddress> {
    (0..4).map(|tile| NodeAddress { frame: 0, tile, level, index }).collect()
}

/// More nodes than a worker renders before the timeout.
pub(crate) fn endless() -> Vec<NodeAddress> {
    (0..1_000_000).map(|index| NodeAddress { frame: 0, tile: 0, level: 0, index }).collect()
}

/// A problem document.
pub(crate) fn problem(status: u16, code: &str) -> Response {
    let body = json!({"type": "about:blank", "title": code, "status": status, "detail": "by test", "code": code});
    (StatusCode::from_u16(status).unwrap(), [("content-type", PROBLEM_MEDIA_TYPE)], body.to_string()).into_response()
}

/// The answer of a server that is no coordinator.
pub(crate) fn login_page() -> Response {
    ([("content-type", "text/html")], "<html>Please sign in</html>").into_response()
}

async fn register(
    State(coordinator): State<FakeCoordinator>,
    Json(registration): Json<WorkerRegistration>,
) -> Json<WorkerView> {
    let mut state = coordinator.lock();
    let id: WorkerId = format!("00000000-0000-7000-8000-{:012}", state.registrations.len()).parse().unwrap();
    let (name, cores, build) = (registration.name.clone(), registration.cores, registration.build.clone());
    state.registrations.push(registration);
    state.known = vec![id];
    coordinator.changed.notify_waiters();
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

async fn claim(State(coordinator): State<FakeCoordinator>, Json(request): Json<Value>) -> Response {
    let mut state = coordinator.lock();
    let worker: WorkerId = request["worker"].as_str().unwrap().parse().unwrap();
    if !state.known.contains(&worker) {
        return problem(404, "unknown_worker");
    }
    state.built = serde_json::from_value(request["built"].clone()).unwrap_or_default();
    coordinator.changed.notify_waiters();
    match state.claims.pop_front() {
        Some(Claim::Lease(lease)) => {
            let lease = Lease { wants_report: state.wants_report && state.reports.is_empty(), ..lease };
            state.outstanding.insert(lease.id, lease.nodes.len() as u32);
            state.leases.insert(lease.id, lease.clone());
            state.lease_is_over &= lease.token == 1;
            state.nothing_is_wanted &= lease.token == 1;
            coordinator.changed.notify_waiters();
            Json(lease).into_response()
        }
        Some(Claim::Garbage(body)) => ([("content-type", "application/json")], body).into_response(),
        Some(Claim::ForgetWorker) => {
            state.known.clear();
            problem(404, "unknown_worker")
        }
        None => StatusCode::NO_CONTENT.into_response(),
    }
}

async fn renew(State(coordinator): State<FakeCoordinator>) -> Response {
    let mut state = coordinator.lock();
    state.renewals += 1;
    coordinator.changed.notify_waiters();
    if state.lease_is_over {
        return problem(409, "lease_expired");
    }
    let outstanding = u32::from(!state.nothing_is_wanted);
    Json(LeaseRenewal { deadline_ms: 0, expires_in_ms: 600, outstanding }).into_response()
}

async fn heartbeat(State(coordinator): State<FakeCoordinator>, Json(activity): Json<WorkerActivity>) -> StatusCode {
    coordinator.lock().heartbeats.push(activity);
    coordinator.changed.notify_waiters();
    StatusCode::NO_CONTENT
}

async fn scene(State(coordinator): State<FakeCoordinator>, Path(job): Path<String>) -> Json<JobScene> {
    coordinator.lock().scenes += 1;
    coordinator.changed.notify_waiters();
    coordinator.until(|state| !state.holds_scene).await;
    let state = coordinator.lock();
    Json(JobScene {
        job: job.parse().unwrap(),
        scene: state.scene.clone(),
        scene_hash: state.scene_hash.clone(),
        assets: BTreeMap::new(),
        tile_size: state.edge / 2,
        light_plane: false,
        caustic: false,
        passes: 1 << 20,
    })
}

async fn report_scene(
    State(coordinator): State<FakeCoordinator>,
    Path(id): Path<String>,
    Json(report): Json<SceneReport>,
) -> Response {
    let mut state = coordinator.lock();
    if let Some(failure) = state.failing_reports.pop_front() {
        return failure;
    }
    let uploaded = state.uploads.iter().map(|upload| upload.nodes.len()).sum();
    state.reports.push((id.parse().unwrap(), report, uploaded));
    coordinator.changed.notify_waiters();
    StatusCode::NO_CONTENT.into_response()
}

async fn upload(
    State(coordinator): State<FakeCoordinator>,
    Path(id): Path<String>,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    let token = headers[FENCING_TOKEN_HEADER].to_str().unwrap().to_owned();
    take(&coordinator, id.parse().unwrap(), token, &body, body.len())
}

async fn upload_piece(
    State(coordinator): State<FakeCoordinator>,
    Path((_, hash)): Path<(String, String)>,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    assert!(headers.contains_key(FENCING_TOKEN_HEADER));
    let mut state = coordinator.lock();
    if let Some(refusal) = state.refusal(body.len()) {
        return refusal;
    }
    assert_eq!(scene::ContentHash::of(&body).to_string(), hash);
    state.pieces.insert(hash, body);
    StatusCode::NO_CONTENT.into_response()
}

async fn assemble(
    State(coordinator): State<FakeCoordinator>,
    Path(id): Path<String>,
    Json(partial): Json<PartialPieces>,
) -> Response {
    if std::mem::take(&mut coordinator.lock().loses_pieces) {
        coordinator.lock().pieces.clear();
        return problem(409, "missing_pieces");
    }
    let pieces = coordinator.lock().pieces.clone();
    let body: Vec<u8> = partial.pieces.iter().flat_map(|hash| pieces[&hash.to_string()].to_vec()).collect();
    take(&coordinator, id.parse().unwrap(), partial.token.to_string(), &body, 0)
}

impl FakeState {
    /// The refusal of a proxy or the coordinator, if a body of `bytes` is too large.
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

/// Accepts a partial that arrived in a body of `body_bytes`.
fn take(coordinator: &FakeCoordinator, lease: LeaseId, token: String, partial: &[u8], body_bytes: usize) -> Response {
    let mut state = coordinator.lock();
    if let Some(failure) = state.failing_uploads.pop_front().or_else(|| state.refusal(body_bytes)) {
        return failure;
    }
    let nodes = nodes_of(partial, &state.scene_hash, &state.leases[&lease], state.edge);
    let outstanding = state.outstanding.get_mut(&lease).unwrap();
    *outstanding = outstanding.saturating_sub(nodes.len() as u32);
    let outstanding = *outstanding;
    let answers = nodes.iter().map(|node| NodeAnswer { node: *node, verdict: NodeVerdict::Accepted, reason: None });
    let answer = PartialAnswer { nodes: answers.collect(), outstanding };
    state.uploads.push(Upload { lease, token, nodes });
    coordinator.changed.notify_waiters();
    Json(answer).into_response()
}

async fn give_back(
    State(coordinator): State<FakeCoordinator>,
    Path(id): Path<String>,
    Json(body): Json<LeaseReturn>,
) -> StatusCode {
    coordinator.lock().returns.push((id.parse().unwrap(), body));
    coordinator.changed.notify_waiters();
    StatusCode::NO_CONTENT
}

async fn end(State(coordinator): State<FakeCoordinator>, Path(id): Path<String>) -> StatusCode {
    let mut state = coordinator.lock();
    let returns = state.returns.len();
    state.ended.push((id, returns));
    StatusCode::NO_CONTENT
}

/// The uploaded nodes of a lease, in order.
pub(crate) fn uploaded(state: &FakeState, lease: &Lease) -> Vec<NodeAddress> {
    let mut nodes: Vec<_> = state
        .uploads
        .iter()
        .filter(|upload| upload.lease == lease.id)
        .flat_map(|upload| upload.nodes.clone())
        .collect();
    nodes.sort();
    nodes
}

/// The nodes in a partial. They must be among those of the lease.
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
        grid: TileGrid::new(edge, edge, edge / 2),
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
