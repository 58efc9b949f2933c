//! Workers: the machines of the farm.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::{JobId, WorkerId};

/// A worker introduces itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WorkerRegistration {
    /// A name for people, for instance the machine's.
    pub name: String,
    /// Threads that render.
    pub cores: u32,
    /// Which build of Clerestory it runs.
    pub build: String,
    /// Digest of the first probe, over all methods of its time. Jobs that older builds began are pinned to it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probe_digest: Option<String>,
    /// Digests of the probe by the name of the method: of its first probe case, of its first two, and so on. They tell
    /// builds and machines apart that compute other bits. Those of images with the layer `caustic` have ` with caustic`
    /// behind the name. Workers of older builds send none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub method_digests: BTreeMap<String, Vec<String>>,
}

/// What a worker does while it brings no nodes, as its heartbeats say.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WorkerActivity {
    /// The scene that it builds; absent when it builds none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub building: Option<SceneBuilding>,
}

/// A scene that a worker builds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneBuilding {
    /// The job whose scene it is.
    pub job: JobId,
    /// For how long.
    pub for_ms: u64,
}

/// Where a worker stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WorkerState {
    /// It holds a lease.
    Rendering,
    /// It was heard of lately and holds no lease.
    Idle,
    /// It has not been heard of for longer than a lease lasts.
    Silent,
    /// It has said that it ends. Lists leave it out.
    Ended,
    /// It gets no work, since what it rendered was found to be wrong.
    Quarantined,
}

/// Why a worker gets no work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Quarantine {
    /// Since when.
    pub since_ms: i64,
    /// What was found.
    pub reason: String,
    /// Jobs that had ended by then, of which it has rendered nodes: their images may be wrong.
    pub ended_jobs: Vec<JobId>,
}

/// A worker as the coordinator knows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WorkerView {
    /// Its identity.
    pub id: WorkerId,
    /// Its name.
    pub name: String,
    /// Threads that render.
    pub cores: u32,
    /// Which build of Clerestory it runs.
    pub build: String,
    /// Digest of the first probe, as it rendered it; absent if it sent none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probe_digest: Option<String>,
    /// Jobs that it gets no nodes of: workers that compute other bits with their methods began them, and an image has
    /// the bits of one build.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub passed_over: Vec<JobId>,
    /// Where it stands.
    pub state: WorkerState,
    /// The job of its newest lease.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub job: Option<JobId>,
    /// The scene that it builds, at its last heartbeat; absent when it builds none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub building: Option<SceneBuilding>,
    /// Nodes that it holds under lease.
    pub leased_nodes: u32,
    /// Nodes that it brought and that were accepted.
    pub accepted_nodes: u64,
    /// Partials of it that were refused as malformed.
    pub refused_partials: u64,
    /// Camera samples of its accepted nodes.
    pub samples: u64,
    /// Time spent rendering them, summed over cores.
    pub core_ms: i64,
    /// Camera samples a second while it renders with all cores; absent before its first partial.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples_per_second: Option<f64>,
    /// Why it gets no work; absent for a worker that does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quarantine: Option<Quarantine>,
    /// When it registered.
    pub registered_ms: i64,
    /// When it was last heard of.
    pub seen_ms: i64,
}
