//! The Clerestory worker: lease, render, upload.
//!
//! [`run`] registers with a coordinator and then repeats: claim a lease (a batch of nodes until a deadline), fetch the
//! scene unless it is still at hand, render the nodes one after another on all cores, and upload them as partials.
//! Uploads overlap with rendering; the queue between the two is short, so a coordinator that cannot keep up slows the
//! worker down instead of filling its memory.
//!
//! - `registration`: who this worker is, and its heartbeats;
//! - `job_cache`: the scenes of the last few jobs, built or being built, and the assets they are made of;
//! - `renderer`: nodes of a lease, rendered on a pool of threads, interruptible between passes;
//! - `uploader`: partials on their way, kept until the coordinator has answered, and cut smaller where a proxy refuses
//!   them;
//! - `machine`: how much memory there is;
//! - `scene_budget`: how much of it scenes take together;
//! - `lease`: one lease from its nodes to its end;
//! - `retry`: what happens while the coordinator is away.
//!
//! # Invariants
//!
//! - Nothing that a coordinator answers makes the worker panic; a scene that cannot be built or a renderer that panics
//!   costs the lease, which is given back with the reason.
//! - A rendered node is dropped only after the coordinator has answered for it, or when the worker itself is told to
//!   end and the coordinator cannot be reached.

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
