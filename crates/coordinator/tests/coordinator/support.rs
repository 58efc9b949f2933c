//! A coordinator on a free port, and workers that make noise instead of light.

use std::collections::BTreeMap;
use std::path::Path;

use bytes::Bytes;
use clerestory_api::{
    Client, ContentHash, Event, EventBody, JobId, JobState, JobSubmission, JobView, Lease, LeaseRequest, NodeVerdict,
    PartialAnswer, PartialUpload, WorkerId, WorkerRegistration,
};
use clerestory_coordinator::{Config, run};
use clerestory_film::counters::Counters;
use clerestory_film::{
    DecodeBudget, FilmTile, FirstHitSums, FrameImage, Node, NodeAddress, PartialHeader, PassSums, Rendered, Sampling,
    Tile, TileGrid, partial,
};
use futures::StreamExt;
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

pub(crate) const WIDTH: u32 = 37;
pub(crate) const HEIGHT: u32 = 20;
pub(crate) const TILE: u32 = 16;
pub(crate) const SAMPLES_PER_PASS: u32 = 4;
pub(crate) const SAMPLES_PER_BLOCK: u32 = 16;

pub(crate) struct TestFarm {
    pub(crate) directory: TempDir,
    pub(crate) client: Client,
    pub(crate) address: String,
    config: Config,
    stop: oneshot::Sender<()>,
    server: JoinHandle<()>,
}

impl TestFarm {
    pub(crate) async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    pub(crate) async fn start_with(adjust: impl FnOnce(&mut Config)) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let mut config = Config::new(directory.path());
        // By chance, nodes would be rendered twice that a test counts.
        config.checked_fraction = 0.0;
        adjust(&mut config);
        Self::serve(directory, config).await
    }

    pub(crate) async fn serve(directory: TempDir, config: Config) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let (stop, stopped) = oneshot::channel::<()>();
        let running = config.clone();
        let server = tokio::spawn(async move {
            let shutdown = async { stopped.await.unwrap_or_default() };
            run(listener, running, shutdown).await.unwrap();
        });
        let client = Client::new(&address, None).unwrap();
        Self { directory, client, address, config, stop, server }
    }

    pub(crate) async fn stop(self) -> (TempDir, Config) {
        self.stop.send(()).unwrap();
        self.server.await.unwrap();
        (self.directory, self.config)
    }

    pub(crate) async fn restarted(self) -> Self {
        let (directory, config) = self.stop().await;
        Self::serve(directory, config).await
    }

    pub(crate) async fn submit(&self, passes: u32) -> JobView {
        self.client.submit_job(&submission(passes)).await.unwrap()
    }

    /// Renders an image of `reference_passes`, and then a job that has it as its reference. Answers both, done.
    pub(crate) async fn against_a_reference(&self, reference_passes: u32, passes: u32) -> [JobView; 2] {
        let first = self.submit(reference_passes).await;
        let worker = self.worker().await;
        worker.drain().await;
        let first = self.finished(first.id).await;
        let reference = self.client.image(first.id).await.unwrap();
        let hash = hash(&reference);
        self.client.upload_asset(&hash, reference, |_| ()).await.unwrap();
        let submission = JobSubmission { reference: Some(hash), ..submission(passes) };
        let second = self.client.submit_job(&submission).await.unwrap();
        worker.drain().await;
        [first, self.finished(second.id).await]
    }

    pub(crate) async fn worker(&self) -> TestWorker {
        self.worker_named("noise").await
    }

    pub(crate) async fn worker_named(&self, name: &str) -> TestWorker {
        self.worker_like(name, WorkerRegistration::default()).await
    }

    /// A worker with the digests of a registration.
    pub(crate) async fn worker_like(&self, name: &str, registration: WorkerRegistration) -> TestWorker {
        let registration =
            WorkerRegistration { name: name.to_owned(), cores: 2, build: "test".to_owned(), ..registration };
        let id = self.client.register_worker(&registration).await.unwrap().id;
        TestWorker { client: self.client.clone(), id }
    }

    /// Waits until the job is in a final state.
    pub(crate) async fn finished(&self, job: JobId) -> JobView {
        self.until(job, |job| job.state.is_final()).await
    }

    /// Waits until the job is as wanted.
    pub(crate) async fn until(&self, job: JobId, is_wanted: impl Fn(&JobView) -> bool) -> JobView {
        let mut events = self.client.events(Some(job), None).await.unwrap();
        while let Some(event) = events.next().await {
            let view = match event.unwrap().body {
                EventBody::Snapshot { jobs, .. } => jobs.into_iter().next().unwrap(),
                EventBody::Job { job } | EventBody::Progress { job } => *job,
                _ => continue,
            };
            if is_wanted(&view) {
                return view;
            }
        }
        panic!("the event stream ended before the job was as wanted");
    }

    pub(crate) async fn image(&self, job: JobId) -> FrameImage {
        decoded(&self.client.image(job).await.unwrap())
    }

    /// How many blobs of nodes are stored.
    pub(crate) fn node_blobs(&self) -> usize {
        self.blobs_in("nodes")
    }

    /// How many blobs are stored in a folder.
    pub(crate) fn blobs_in(&self, folder: &str) -> usize {
        fn files(directory: &Path) -> usize {
            let Ok(entries) = std::fs::read_dir(directory) else { return 0 };
            entries.map(|entry| entry.unwrap().path()).map(|path| if path.is_dir() { files(&path) } else { 1 }).sum()
        }
        files(&self.directory.path().join("blobs").join(folder))
    }
}

pub(crate) struct TestWorker {
    pub(crate) client: Client,
    pub(crate) id: WorkerId,
}

impl TestWorker {
    pub(crate) fn request(&self) -> LeaseRequest {
        LeaseRequest { worker: self.id, max_nodes: None, wanted_ms: None, wait_ms: 0, built: Vec::new() }
    }

    pub(crate) async fn claim(&self) -> Option<Lease> {
        self.client.claim_lease(&self.request()).await.unwrap()
    }

    pub(crate) async fn upload(
        &self,
        lease: &Lease,
        body: Vec<u8>,
    ) -> Result<PartialAnswer, clerestory_api::ClientError> {
        let upload = PartialUpload { lease: lease.id, token: lease.token, core_ms: 50, body: Bytes::from(body) };
        self.client.upload_partial(upload).await
    }

    /// Renders all work that there is, newest nodes first and one by one, so that the merge tree sees a bad order.
    pub(crate) async fn drain(&self) {
        while let Some(lease) = self.claim().await {
            for node in addresses(&lease).into_iter().rev() {
                let answer = self.upload(&lease, noise_partial(&lease, &[node])).await.unwrap();
                // A worker that has nothing else to do may have taken it over.
                assert_ne!(answer.nodes[0].verdict, NodeVerdict::Refused);
            }
        }
    }
}

pub(crate) fn scene() -> Value {
    json!({
        "version": 1,
        "name": "test",
        "film": {"width": WIDTH, "height": HEIGHT},
        "camera": {"perspective": {
            "position": [0, 0, -2], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 40
        }},
        "integrator": {"path": {}},
        "sampling": {"samples_per_pass": SAMPLES_PER_PASS, "samples_per_block": SAMPLES_PER_BLOCK},
        "materials": {"stone": {"diffuse": {"reflectance": {"colour": [0.6, 0.5, 0.4]}}}},
        "meshes": [{"name": "floor", "material": "stone", "source": {"inline": {
            "positions": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]],
            "triangles": [[0, 1, 2], [0, 2, 3]]
        }}}],
        "lights": [{"sphere": {"name": "globe", "centre": [0, 0, -5], "radius": 0.1, "radiance": [1, 1, 1]}}]
    })
}

pub(crate) fn submission(passes: u32) -> JobSubmission {
    JobSubmission {
        name: None,
        scene: scene(),
        assets: BTreeMap::new(),
        samples_per_pixel: passes * SAMPLES_PER_PASS,
        tile_size: TILE,
        priority: 0,
        reference: None,
        time_limit_ms: None,
        target_mse: None,
        target_estimated_mse: None,
        adaptive: false,
        assumptions: Vec::new(),
    }
}

pub(crate) fn hash(content: &[u8]) -> ContentHash {
    ContentHash::from(*blake3::hash(content).as_bytes())
}

pub(crate) fn grid() -> TileGrid {
    TileGrid::new(WIDTH, HEIGHT, TILE)
}

pub(crate) fn sampling() -> Sampling {
    Sampling::new(SAMPLES_PER_PASS, SAMPLES_PER_BLOCK).unwrap()
}

pub(crate) fn addresses(lease: &Lease) -> Vec<NodeAddress> {
    let address = |node: &clerestory_api::NodeAddress| NodeAddress {
        frame: node.frame,
        tile: node.tile,
        level: node.level,
        index: node.index,
    };
    lease.nodes.iter().map(address).collect()
}

/// A pass that is a pure function of (pixel, pass), as a renderer's is.
fn noise_pass(address: NodeAddress, tile: Tile) -> Node {
    let value = |pixel: usize, channel: u64| {
        let (x, y) = tile.pixel(pixel);
        let mut state = u64::from(x) << 40 | u64::from(y) << 20 | u64::from(address.index) << 4 | channel;
        state = (state ^ state >> 31).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        state = (state ^ state >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (state >> 11) as f64 / (1_u64 << 53) as f64 * 8.0
    };
    let triples = |first: u64| {
        let triple = |pixel| [0, 1, 2].map(|channel| value(pixel, first + channel)).into();
        (0..tile.pixels()).map(triple).collect::<Vec<_>>()
    };
    let first_hit = sampling().is_in_first_block(address.index).then(|| FirstHitSums {
        albedo: triples(3),
        normal: triples(6),
        depth: (0..tile.pixels()).map(|pixel| value(pixel, 9)).collect(),
    });
    Node::leaf(address, tile, sampling(), &PassSums { beauty: triples(0), caustic: None, first_hit }).unwrap()
}

pub(crate) fn noise_node(address: NodeAddress) -> Node {
    let tile = grid().tile(address.tile).unwrap();
    match address.children() {
        None => noise_pass(address, tile),
        Some([left, right]) => Node::merge(noise_node(left), &noise_node(right)).unwrap(),
    }
}

pub(crate) fn noise_partial(lease: &Lease, nodes: &[NodeAddress]) -> Vec<u8> {
    let rendered = |address: &NodeAddress| Rendered { node: noise_node(*address), counters: noise_counters(*address) };
    partial_of(lease, &nodes.iter().map(rendered).collect::<Vec<_>>())
}

/// What a renderer would count, a different number in every pass of every tile.
pub(crate) fn noise_counters(address: NodeAddress) -> Counters {
    let Some(children) = address.children() else {
        let samples = (grid().tile(address.tile).unwrap().pixels() as u64) * u64::from(SAMPLES_PER_PASS);
        let rays = samples + u64::from(address.tile * 1000 + address.index);
        return Counters { height_evaluations: 7 * rays, rays, samples, ..Counters::default() };
    };
    let mut counters = Counters::default();
    children.into_iter().for_each(|child| counters += noise_counters(child));
    counters
}

pub(crate) fn partial_of(lease: &Lease, nodes: &[Rendered]) -> Vec<u8> {
    let header =
        PartialHeader { job: lease.job.to_string(), scene_hash: lease.scene_hash.clone(), build: "test".to_owned() };
    partial::encode(nodes, &header, &grid()).unwrap()
}

/// What one process counts that renders these passes of every tile.
pub(crate) fn expected_counters(passes: u32) -> Counters {
    let mut counters = Counters::default();
    for tile in 0..grid().len() {
        (0..passes).for_each(|index| counters += noise_counters(NodeAddress { frame: 0, tile, level: 0, index }));
    }
    counters
}

/// The image that one process renders, pass after pass.
pub(crate) fn expected_bits(passes: u32) -> Vec<u32> {
    let mut bits = vec![0; (WIDTH * HEIGHT * 3) as usize];
    for index in 0..grid().len() {
        let tile = grid().tile(index).unwrap();
        let mut film = FilmTile::new(0, index, tile, sampling());
        for pass in 0..passes {
            film.insert(noise_node(NodeAddress { frame: 0, tile: index, level: 0, index: pass })).unwrap();
        }
        let sum = film.sum(passes).unwrap();
        let scale = 1.0 / sum.samples() as f64;
        for pixel in 0..tile.pixels() {
            let (x, y) = tile.pixel(pixel);
            for channel in 0..3 {
                let mean = (f64::from(sum.layers.beauty[pixel][channel]) * scale) as f32;
                bits[((y * WIDTH + x) * 3) as usize + channel] = mean.to_bits();
            }
        }
    }
    bits
}

pub(crate) fn decoded(image: &[u8]) -> FrameImage {
    FrameImage::decode(image, DecodeBudget { pixel_bytes: 1 << 24 }).unwrap()
}

pub(crate) fn bits(image: &FrameImage) -> Vec<u32> {
    image.layers().mean.as_flattened().iter().map(|value| value.to_bits()).collect()
}

pub(crate) fn state_of(event: &Event) -> Option<JobState> {
    match &event.body {
        EventBody::Job { job } => Some(job.state),
        _ => None,
    }
}
