//! Why a worker ends.

use std::error::Error;

use clerestory_api::ClientError;
use clerestory_render_core::probe::ProbeError;

/// Why a worker cannot work. Transient failures are not among them: the worker goes on when a coordinator is away, a
/// lease is lost, or a scene cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// The coordinator's address or the token cannot be used, or something else answers there.
    #[error("cannot set up the connection to the coordinator")]
    Connection(#[source] ClientError),
    /// The coordinator refuses the registration.
    #[error("the coordinator refuses this worker")]
    Refused(#[source] ClientError),
    /// The probe image cannot be rendered.
    #[error("cannot render the probe image")]
    Probe(#[from] ProbeError),
    /// Rendering the probe image panicked.
    #[error("rendering the probe image failed")]
    ProbePanic(#[source] tokio::task::JoinError),
    /// The threads that render could not be started.
    #[error("cannot start the threads that render")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// An error and its causes in one line.
pub(crate) fn with_causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(next) = cause {
        text.push_str(": ");
        text.push_str(&next.to_string());
        cause = next.source();
    }
    text
}
