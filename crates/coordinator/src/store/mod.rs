//! The state of the farm: one SQL database.
//!
//! The embedded default is SQLite in WAL mode with `synchronous=FULL`, and the other PostgreSQL ([`source`]): what is committed
//! survives the loss of power. All writes pass through one writer that groups those that wait into one transaction
//! ([`writer`]); readers have a pool of their own. The SQL keeps to what both engines understand (numbered parameters, text identities,
//! `bigint` milliseconds, `returning`, times bound by the caller), and one suite of tests holds both to the same behaviour. Bytes live
//! in the [blob store](crate::blobs); a row here is what makes a blob part of the farm.

mod assets;
mod checks;
mod database;
mod engine;
mod events;
mod films;
mod identity;
mod jobs;
mod leases;
mod queue;
#[cfg(test)]
pub(crate) mod tests;
mod workers;

pub(crate) use checks::answers::Outcome;
pub(crate) use database::Store;
pub(crate) use engine::error::StoreError;
pub(crate) use engine::postgres::Listener;
pub use engine::schema::SchemaError;
pub(crate) use engine::source::Source;
pub(crate) use leases::expiry::Observation;
pub(crate) use leases::table::LeaseError;
pub(crate) use workers::table::WorkerError;
