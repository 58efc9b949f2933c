//! Why a load cannot be measured.

use std::error::Error;
use std::io;
use std::path::PathBuf;

use clerestory_api::ClientError;

/// Why a load cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// A setting cannot be used; the message says what would be right.
    #[error("{0}")]
    Usage(String),
    /// A file cannot be read.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The coordinator cannot be started.
    #[error("cannot start {}", program.display())]
    Spawn {
        /// The program.
        program: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The coordinator does not answer or refuses a call.
    #[error("the coordinator refuses a call")]
    Coordinator(#[from] ClientError),
    /// A database cannot be measured.
    #[error("cannot measure the database")]
    Database(#[source] Box<dyn Error + Send + Sync>),
    /// A server for the speed of HTTP cannot listen.
    #[error("cannot listen on the loopback interface")]
    Listen(#[source] io::Error),
    /// The speed of HTTP cannot be measured.
    #[error("an exchange with a server of this process failed")]
    Echo(#[source] reqwest::Error),
    /// The load ended before it was measured.
    #[error("{0}")]
    Ended(String),
}

/// An error and its causes in one line.
pub fn report(error: &(dyn Error + 'static)) -> String {
    let causes = std::iter::successors(Some(error), |&error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}
