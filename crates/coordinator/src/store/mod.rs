//! The state of the farm in one SQL database.
//!
//! The default is SQLite in WAL mode with `synchronous=FULL`, the other engine is PostgreSQL. Committed state survives
//! the loss of power. All writes pass through one writer that groups waiting writes into one transaction; readers have
//! a pool of their own. The SQL keeps to what both engines understand: numbered parameters, text identities, `bigint`
//! milliseconds, `returning`, times bound by the caller. One suite of tests holds both engines to the same behaviour.
//! Bytes live in the [blob store](crate::blobs); a row here makes a blob part of the farm.
//!
//! The folders: `engine` has the connections and the writer, `workers` the registered workers, and `films` nodes and
//! rounds. `leases` has leases, `queue` pending work and claims, and `results` the acceptance of nodes and its
//! consequences. `jobs`, `checks`, `assets` and `events` are one file each.

mod assets;
mod checks;
mod database;
mod engine;
mod errors;
mod events;
mod films;
mod identity;
mod jobs;
mod leases;
mod queue;
mod results;
#[cfg(test)]
pub(crate) mod tests;
mod workers;

pub(crate) use database::Store;
pub(crate) use engine::error::StoreError;
pub(crate) use engine::postgres::Listener;
pub use engine::schema::SchemaError;
pub(crate) use engine::source::Source;
pub(crate) use errors::{LeaseError, WorkerError};
pub(crate) use leases::expiry::Observation;
