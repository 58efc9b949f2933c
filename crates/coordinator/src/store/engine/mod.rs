//! The database engines: SQLite and PostgreSQL behind one set of statements, one writer, and timeouts.

mod backfill;
pub(in crate::store) mod batch;
mod damage;
pub(in crate::store) mod error;
pub(in crate::store) mod lists;
pub(in crate::store) mod postgres;
mod requirements;
pub(in crate::store) mod row;
pub(in crate::store) mod schema;
pub(in crate::store) mod source;
pub(in crate::store) mod sql;
mod sqlite;
pub(in crate::store) mod timeouts;
mod value;
pub(in crate::store) mod writer;
