//! The Clerestory coordinator: queue, merge, HTTP API and dashboard.
//!
//! - [`config`]: its configuration;
//! - `model`: records, and the rules that depend on nothing else;
//! - `store`: jobs, leases, accepted nodes, rounds and events in one SQL database;
//! - `blobs`: assets and nodes, written once, in a directory or a bucket of an S3-compatible store;
//! - `watch`: views, event streams, notifications, liveness and readiness;
//! - `films`: acceptance, merging, rounds, images, previews, repair and garbage collection;
//! - `jobs`: submissions, claims, deadlines, and calls about jobs and workers;
//! - `http`: the API, authorisation, limits, problem documents; `dashboard`: the page;
//! - [`server`]: starting and stopping, and the one place that knows all parts.
//!
//! Each of these uses only those above it: `model < store, blobs < watch < films < jobs < http < server`. `clock`,
//! `memory`, `tasks`, `directory`, `background` and `error_chain` use none of them.
//!
//! # Invariants
//!
//! - What is acknowledged is on disk. Blobs are synced, or acknowledged by the object store, before the transaction
//!   that names them, and that transaction commits before the answer. What a coordinator holds in memory is a cache.
//! - A node is accepted only under a valid lease, and only if no accepted node of its tile shares a pass with it.
//! - Nothing here renders: of the render core only its scenes are used.
//! - No part holds the whole coordinator: each is given its store, clock, budgets and notifications.
//! - Domain modules know no HTTP: their errors become problems in one `From`.

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
