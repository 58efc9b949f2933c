//! Wire types and typed HTTP client of the Clerestory render farm.
//!
//! A client, a worker and the dashboard exchange these types with the coordinator, as JSON. `openapi.json` beside this
//! crate describes the same in the OpenAPI format. [`Client`] has one method for each endpoint. Times are milliseconds
//! since the Unix epoch by the coordinator's clock (`_ms`), durations are milliseconds.
//!
//! # Invariants
//!
//! - Only data and one stateless client: no clock, no threads, no retries. When to try again is the caller's decision,
//!   helped by [`ClientError::is_transient`] and [`ClientError::pause`].

mod address;
mod answer;
mod client;
mod client_error;
mod convergence;
mod counters;
mod event;
mod event_stream;
mod hash;
mod ids;
mod integrator;
mod job;
mod job_scene;
mod lease;
mod preview;
mod printable;
mod problem;
mod session;
mod submission;
mod worker;

pub use address::is_loopback;
pub use answer::UnexpectedAnswer;
pub use client::{Client, ImageDownload};
pub use client_error::ClientError;
pub use convergence::{ConvergencePoint, ConvergenceSeries, LiveMeasurement};
pub use counters::Counters;
pub use event::{Event, EventBody};
pub use event_stream::EventStream;
pub use hash::{ContentHash, InvalidContentHash};
pub use ids::{JobId, LeaseId, WorkerId};
pub use integrator::IntegratorView;
pub use job::{BuildWait, FailedNode, JobHold, JobState, JobView, NamedWorker, SceneRefusal, StopReason};
pub use job_scene::{BuildOutcome, BuiltScene, JobScene, LONGEST_REFUSAL, SceneReport};
pub use lease::{
    CORE_MILLISECONDS_HEADER, FENCING_TOKEN_HEADER, LONGEST_FAILURE, Lease, LeaseRenewal, LeaseRequest, LeaseReturn,
    LeaseToken, NodeAddress, NodeAnswer, NodeVerdict, PartialAnswer, PartialPieces, PartialUpload,
};
pub use preview::{ACCEPTED_NODES_HEADER, Preview, PreviewExposure, PreviewQuery, ToneCurve};
pub use printable::is_printable;
pub use problem::{PROBLEM_MEDIA_TYPE, Problem, ProblemCode};
pub use session::SessionRequest;
pub use submission::JobSubmission;
pub use worker::{Quarantine, SceneBuilding, WorkerActivity, WorkerRegistration, WorkerState, WorkerView};

/// Path under which every endpoint of this version of the API lies.
pub const API_PREFIX: &str = "/api/v1";

/// Media type of an OpenEXR image or partial.
pub const EXR_MEDIA_TYPE: &str = "image/x-exr";

/// Media type of a piece of a partial.
pub const PIECE_MEDIA_TYPE: &str = "application/octet-stream";
