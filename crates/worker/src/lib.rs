//! The Clerestory worker: lease, render, upload.
//!
//! [`run`] registers with a coordinator and then works through leases. A lease is nodes to render until a deadline. The
//! worker fetches and builds the scene unless it is in the cache. It renders the nodes one after another on all cores,
//! and uploads them as partials. Uploads overlap with rendering. The queue between the two is short, so a slow
//! coordinator slows the worker down instead of filling its memory.
//!
//! - `registration`: the identity of this worker, and its heartbeats;
//! - `job_cache`: the scenes of the last few jobs, built or being built, and the assets they are made of;
//! - `renderer`: nodes of a lease, rendered on a pool of threads, interruptible between passes;
//! - `uploader`: partials, kept until the coordinator has answered, and split where a proxy refuses them;
//! - `machine`: the memory of this machine;
//! - `scene_budget`: the memory that all scenes may take together;
//! - `lease`: one lease from its nodes to its end;
//! - `retry`: calls that are repeated while the coordinator is away.
//!
//! # Invariants
//!
//! - No answer of a coordinator makes the worker panic. When a scene cannot be built or a renderer panics, the worker
//!   returns the lease with the reason.
//! - A rendered node is dropped only after the coordinator has answered for it. The exception: the worker must end and
//!   cannot reach the coordinator.

mod config;
mod error;
mod job_cache;
mod lease;
mod machine;
mod registration;
mod renderer;
mod retry;
mod run;
mod scene_budget;
mod uploader;

pub use config::Config;
pub use error::WorkerError;
pub use machine::machine_memory;
pub use run::run;
