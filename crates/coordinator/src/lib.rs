//! The Clerestory coordinator: queue, merge, HTTP API and dashboard.
//!
//! - [`config`], [`server`]: how it is set up, started and stopped;
//! - `http`: the API and the dashboard, authorisation, limits, problem documents;
//! - `submit`: from a submission to a job;
//! - `schedule`: rounds, waves, and how passes are cut into nodes;
//! - `stop`: at which round a job ends;
//! - `store`: jobs, leases, accepted nodes, rounds and events in one SQL database;
//! - `blobs`, `bucket`: assets and nodes, written once, in a directory or a bucket of an S3-compatible store;
//! - `acceptance`: partials, decoded with distrust and accepted exactly once;
//! - `keeper`, `film`, `frame`, `convergence`, `images`, `previews`: rounds, merging, error and images, tile by tile;
//! - `events`, `views`, `rate`: what watchers see;
//! - `tidying`: old rows and left-over blobs go;
//! - `readiness`, `tasks`: whether the coordinator can do its work, and what ends it when it cannot any more.
//!
//! # Invariants
//!
//! - What is acknowledged is on disk: blobs are synced, or acknowledged by the object store, before the transaction that names them, and that transaction before
//!   the answer. What a coordinator holds in memory is a cache.
//! - A node is accepted only under a valid lease, and only if no accepted node of its tile shares a pass with it.
//! - Nothing here renders: of the render core only its film and its scenes are used.

mod background;
mod blobs;
mod clock;
pub mod config;
mod dashboard;
mod directory;
mod error_chain;
mod films;
mod http;
mod jobs;
mod memory;
mod model;
pub mod server;
mod store;
mod tasks;
mod watch;

pub use config::{
    Bucket, Clock, Config, ExposedWithoutToken, InvalidBucket, InvalidPostgresUrl, InvalidToken, PostgresUrl, Token,
};
pub use server::{RunError, run};
pub use store::SchemaError;
