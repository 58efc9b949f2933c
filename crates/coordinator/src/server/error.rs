//! Why a coordinator cannot start, or ends.

use std::io;
use std::path::PathBuf;

use crate::blobs::BlobError;
use crate::config::{Bucket, ExposedWithoutToken};
use crate::films::FilmError;
use crate::store::{SchemaError, StoreError};
use crate::tasks::Ended;

/// The coordinator cannot start, or failed.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// It would be open to the network.
    #[error(transparent)]
    Exposed(#[from] ExposedWithoutToken),
    /// The data directory cannot be used.
    #[error("cannot use the data directory `{}`", directory.display())]
    Directory {
        /// The directory.
        directory: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Another coordinator uses it.
    #[error("the data directory `{}` is in use by another coordinator", directory.display())]
    InUse {
        /// The directory.
        directory: PathBuf,
    },
    /// The object store does not answer, or refuses.
    #[error("cannot use the object store {bucket}")]
    ObjectStore {
        /// The bucket.
        bucket: Bucket,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The blobs are another farm's.
    #[error(
        "the blobs in {place} cannot be used with the database {database}: {problem}; a blob store and a database go \
         together"
    )]
    ForeignBlobs {
        /// Where the blobs are.
        place: String,
        /// What people call the database.
        database: String,
        /// Whose they are.
        problem: String,
    },
    /// The database's address cannot be used.
    #[error("cannot use the address of the database: {problem}")]
    DatabaseAddress {
        /// Why.
        problem: String,
    },
    /// The database cannot be used.
    #[error(transparent)]
    Database(#[from] SchemaError),
    /// The stored state cannot be read.
    #[error("cannot read the stored state: {0}")]
    State(String),
    /// A task has failed that it cannot do without.
    #[error("the coordinator cannot go on without its task `{task}`: {problem}")]
    Task {
        /// What the task does.
        task: &'static str,
        /// How it ended.
        problem: String,
    },
    /// The system refuses a socket or a thread.
    #[error("the system refuses a socket or a thread")]
    System(#[from] io::Error),
}

impl From<Ended> for RunError {
    fn from(Ended { task, problem }: Ended) -> Self {
        Self::Task { task, problem }
    }
}

impl From<StoreError> for RunError {
    fn from(error: StoreError) -> Self {
        Self::State(error.to_string())
    }
}

impl From<BlobError> for RunError {
    fn from(error: BlobError) -> Self {
        Self::State(error.to_string())
    }
}

impl From<FilmError> for RunError {
    fn from(error: FilmError) -> Self {
        Self::State(error.to_string())
    }
}
