//! A store in a file or in PostgreSQL, with workers and jobs to test it with.

use std::collections::BTreeMap;

use clerestory_api::{JobId, JobState, LeaseId, WorkerId, WorkerRegistration};
use clerestory_film::counters::Counters;
use clerestory_film::{NodeAddress, Targets, TileGrid};
use clerestory_test_servers::postgres;
use tempfile::TempDir;
use uuid::Uuid;

use crate::model::{BlobRange, ClaimTerms, CompleteRound, DeliveredNode, Delivery, Grant, Merge, NewJob};
use crate::store::database::Store;
use crate::store::engine::source::Source;
use crate::store::errors::{LeaseError, WorkerError};
use crate::store::leases::expiry::Observation;
use crate::store::results::acceptance::Acceptance;

pub(super) const TTL_MS: i64 = 1000;

/// A node that is on disk, with counters of its own.
pub(super) fn delivered(address: NodeAddress) -> DeliveredNode {
    let counters = Counters { rays: 1 + u64::from(address.index), ..Counters::default() };
    DeliveredNode {
        address,
        blob_range: blob_range(&Uuid::now_v7().to_string(), 0),
        counters,
        digest: String::new(),
        is_selected: false,
    }
}

pub(super) fn blob_range(blob: &str, offset: u64) -> BlobRange {
    BlobRange { blob: blob.to_owned(), offset, length: Some(10) }
}

/// The merge of the two halves of a node.
pub(super) fn merge(parent: NodeAddress, blob_range: BlobRange) -> Merge {
    Merge { parent, blob_range, children: parent.children().unwrap().to_vec() }
}

/// What a worker asks for that has no scene at hand.
pub(super) fn terms(worker: WorkerId, now_ms: i64) -> ClaimTerms {
    ClaimTerms {
        worker,
        built: Vec::new(),
        lease: LeaseId::from(Uuid::now_v7()),
        max_nodes: None,
        fixed_nodes: None,
        target_ms: 1000,
        upload_linger_ms: 1000,
        ttl_ms: TTL_MS,
        alive_ms: i64::MIN,
        now_ms,
    }
}

/// A store with what the tests ask of it.
pub(super) struct Farm {
    pub(super) store: Store,
    pub(super) source: Source,
    /// Of a SQLite file.
    _directory: Option<TempDir>,
}

impl Farm {
    pub(super) async fn at(source: Source, directory: Option<TempDir>) -> Self {
        Self { store: Store::open(source.clone()).await.unwrap(), source, _directory: directory }
    }

    pub(super) async fn in_a_file() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let source = Source::file(&directory.path().join("farm ?#%.sqlite"));
        Self::at(source, Some(directory)).await
    }

    pub(super) async fn in_postgres() -> Self {
        let source = Source::postgres(&postgres().new_database().parse().unwrap()).unwrap();
        Self::at(source, None).await
    }

    pub(super) async fn reopened(self) -> Self {
        self.store.close().await;
        Self { store: Store::open(self.source.clone()).await.unwrap(), ..self }
    }

    pub(super) async fn worker(&self) -> WorkerId {
        self.worker_named("w").await.unwrap()
    }

    pub(super) async fn worker_named(&self, name: &str) -> Result<WorkerId, WorkerError> {
        self.worker_with(name, None).await
    }

    pub(super) async fn worker_with(&self, name: &str, probe_digest: Option<&str>) -> Result<WorkerId, WorkerError> {
        let probe_digest = probe_digest.map(str::to_owned);
        self.worker_like(name, WorkerRegistration { probe_digest, ..WorkerRegistration::default() }).await
    }

    /// A worker with the digests of a registration.
    pub(super) async fn worker_like(
        &self,
        name: &str,
        registration: WorkerRegistration,
    ) -> Result<WorkerId, WorkerError> {
        let id = WorkerId::from(Uuid::now_v7());
        let registration =
            WorkerRegistration { name: name.to_owned(), cores: 2, build: "b".to_owned(), ..registration };
        self.store.register_worker(id, registration, 0).await?;
        Ok(id)
    }

    pub(super) async fn job(&self, passes: u32) -> JobId {
        self.job_with(passes, 0, None).await
    }

    pub(super) async fn job_with(&self, passes: u32, priority: i32, time_limit_ms: Option<i64>) -> JobId {
        self.job_like(|job| NewJob { passes, priority, time_limit_ms, ..job }).await
    }

    pub(super) async fn job_like(&self, change: impl FnOnce(NewJob) -> NewJob) -> JobId {
        let job = change(some_job());
        let id = job.id;
        self.store.insert_job(job).await.unwrap();
        id
    }

    pub(super) async fn claim(&self, worker: WorkerId, nodes: u32, now_ms: i64) -> Option<Grant> {
        let terms = ClaimTerms { fixed_nodes: Some(nodes), ..terms(worker, now_ms) };
        self.store.claim(move || terms).await.unwrap()
    }

    pub(super) async fn deliver(
        &self,
        grant: &Grant,
        nodes: &[NodeAddress],
        now_ms: i64,
    ) -> Result<Acceptance, LeaseError> {
        let nodes = nodes.iter().map(|address| delivered(*address)).collect();
        self.bring(grant, nodes, now_ms).await
    }

    pub(super) async fn bring(
        &self,
        grant: &Grant,
        nodes: Vec<DeliveredNode>,
        now_ms: i64,
    ) -> Result<Acceptance, LeaseError> {
        let (lease, token) = (grant.lease.id, grant.lease.token);
        self.store.accept(Delivery { lease, token, nodes, core_ms: 100, now_ms, alive_ms: now_ms - TTL_MS }).await
    }

    /// Takes back the leases that have run out, as a coordinator does that has just begun to listen: none counts as the
    /// death of its worker.
    pub(super) async fn expire(&self, now_ms: i64) -> u64 {
        let observation = Observation { now_ms, listening_ms: i64::MAX, alive_ms: i64::MIN };
        self.store.expire_leases(observation).await.unwrap().leases.len() as u64
    }

    pub(super) async fn addresses(&self, job: JobId) -> Vec<NodeAddress> {
        self.store.nodes(job, 0, 0..u32::MAX, u32::MAX).await.unwrap().into_iter().map(|node| node.address).collect()
    }

    pub(super) async fn state(&self, job: JobId) -> JobState {
        self.store.job(job).await.unwrap().unwrap().state
    }

    pub(super) async fn next_complete_round(&self, job: JobId) -> Option<CompleteRound> {
        let record = self.store.job(job).await.unwrap().unwrap();
        self.store.complete_round(&record).await.unwrap()
    }
}

/// A job of one pass over a frame of 15 tiles.
pub(crate) fn some_job() -> NewJob {
    NewJob {
        id: JobId::from(Uuid::now_v7()),
        name: "window".to_owned(),
        priority: 0,
        scene: "{}".to_owned(),
        scene_hash: "h".to_owned(),
        integrator: "path".to_owned(),
        missing_light: Vec::new(),
        is_read_by_first: true,
        is_same_by_first: true,
        assumptions: Vec::new(),
        grid: TileGrid::new(70, 40, 16),
        samples_per_pass: 4,
        samples_per_block: 64,
        passes: 1,
        reference: None,
        time_limit_ms: None,
        targets: Targets::default(),
        adaptive: false,
        assets: BTreeMap::new(),
        created_ms: 0,
    }
}
