//! Why a command failed, and its exit code.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clerestory_api::ClientError;
use clerestory_experiments::ExperimentError;
use clerestory_export::ExportError;
use clerestory_film::{CompareError, ImageError, LayerError, PreviewError};
use clerestory_local_render::LocalRenderError;
use clerestory_render_core::scene::SceneError;

/// Exit code of a command whose arguments or settings cannot be used.
pub(crate) const USAGE: u8 = 2;

/// Exit code of an interrupted command, as shells have it.
pub(crate) const INTERRUPTED: u8 = 130;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// Arguments or settings that cannot be used; the message says what would be right.
    #[error("{0}")]
    Usage(String),
    /// The threads that run the command could not be started.
    #[error("cannot start")]
    Runtime(#[source] io::Error),
    /// Standard output cannot be written.
    #[error("cannot write to standard output")]
    Output(#[source] io::Error),
    /// A file cannot be read.
    #[error("cannot read {}", file.display())]
    Read { file: PathBuf, source: io::Error },
    /// A file cannot be written.
    #[error("cannot write {}", file.display())]
    Write { file: PathBuf, source: io::Error },
    /// A file cannot be written, and its content is kept in another.
    #[error("cannot write {}, so it is in {} instead", file.display(), kept.display())]
    WrittenElsewhere { file: PathBuf, kept: PathBuf, source: io::Error },
    /// A configuration file does not say what it should.
    #[error("cannot use the configuration in {}", file.display())]
    Configuration { file: PathBuf, source: Box<toml::de::Error> },
    /// The scene is not valid.
    #[error("cannot use the scene {}", file.display())]
    Scene { file: PathBuf, source: SceneError },
    /// The options change a scene into one that is not valid.
    #[error("cannot use these options with the scene {}", file.display())]
    Overrides { file: PathBuf, source: SceneError },
    /// A scene cannot be exported.
    #[error("cannot export the scene {}", file.display())]
    Export { file: PathBuf, source: ExportError },
    /// A file is no image that can be used.
    #[error("cannot use the image {}", file.display())]
    Image { file: PathBuf, source: ImageError },
    /// A file has no layer that can be shown.
    #[error("cannot use the image {}", file.display())]
    Layer { file: PathBuf, source: LayerError },
    /// Two images cannot be compared.
    #[error("cannot compare the images")]
    Compare(#[source] CompareError),
    /// Rendering in this process failed.
    #[error("cannot render")]
    Render(#[source] LocalRenderError),
    /// Rendering in this process panicked: a fault of this program.
    #[error("rendering failed, which is a fault of Clerestory")]
    RenderPanic(#[source] tokio::task::JoinError),
    /// The threads that render could not be started.
    #[error("cannot start the threads that render")]
    Threads(#[source] rayon::ThreadPoolBuildError),
    /// What was rendered is no image.
    #[error("cannot make the image")]
    BadImage(#[source] ImageError),
    /// The PNG cannot be made.
    #[error("cannot make the PNG")]
    Preview(#[source] PreviewError),
    /// An experiment failed.
    #[error(transparent)]
    Experiment(ExperimentError),
    /// The coordinator could not be asked, or refused.
    #[error("the coordinator at {address}")]
    Coordinator { address: String, source: ClientError },
    /// The address or token of a coordinator cannot be used.
    #[error("cannot set up the connection to the coordinator")]
    Connection(#[source] ClientError),
    /// The coordinator cannot listen.
    #[error("cannot listen on {address}: {}", expected_address(address, source))]
    Listen { address: String, source: io::Error },
    /// A coordinator or worker of this process cannot work.
    #[error("the {service} cannot work")]
    Service {
        service: &'static str,
        /// Whether its settings cannot be used.
        is_usage: bool,
        source: Box<dyn Error + Send + Sync>,
    },
    /// The socket of the viewer failed.
    #[error("the viewer's socket failed")]
    Viewer(#[source] io::Error),
    /// A process of the farm did not start or ended too early.
    #[error("{message}")]
    Process {
        message: String,
        /// Whether it could not use its arguments or settings, which come from the farm's.
        is_usage: bool,
    },
    /// A process of the farm could not be started at all.
    #[error("cannot start a process of the farm")]
    Spawn(#[source] io::Error),
    /// The user interrupted the command.
    #[error("{0}")]
    Interrupted(String),
    /// A job or a render ended before it was done.
    #[error("{0}")]
    Job(String),
}

impl From<ExperimentError> for Failure {
    /// A failure of the program around the experiment is that failure; any other is the experiment's.
    fn from(error: ExperimentError) -> Self {
        match error {
            ExperimentError::Host(cause) => match cause.downcast::<Self>() {
                Ok(failure) => *failure,
                Err(cause) => Self::Experiment(ExperimentError::Host(cause)),
            },
            error => Self::Experiment(error),
        }
    }
}

/// The address that would be right instead of one on which a coordinator cannot listen.
fn expected_address(address: &str, reason: &io::Error) -> String {
    match (reason.kind(), address.rsplit_once(':')) {
        (io::ErrorKind::AddrInUse, Some((host, _))) => {
            format!(
                "the port is taken, perhaps by another farm: choose another, or --listen {host}:0 to be given a free \
                 one"
            )
        }
        (io::ErrorKind::PermissionDenied, _) => "expected a port that this user may listen on, 1024 or more".to_owned(),
        _ => "expected an address of this machine, such as 127.0.0.1:7171".to_owned(),
    }
}

impl Failure {
    /// A scene that cannot be used. A file that cannot be read is [`Failure::Read`].
    pub(crate) fn scene(file: &Path, source: SceneError) -> Self {
        match source {
            SceneError::Unreadable { file, source } => Self::Read { file, source },
            source => Self::Scene { file: file.to_owned(), source },
        }
    }

    /// The exit code: 2 for arguments or settings that cannot be used, 130 for an interruption, else 1.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Usage(_)
            | Self::Configuration { .. }
            | Self::Overrides { .. }
            | Self::Process { is_usage: true, .. }
            | Self::Service { is_usage: true, .. } => ExitCode::from(USAGE),
            Self::Connection(error) if error.is_usage() => ExitCode::from(USAGE),
            // The text is no address on any machine.
            Self::Listen { source, .. } if source.kind() == io::ErrorKind::InvalidInput => ExitCode::from(USAGE),
            Self::Interrupted(_) => ExitCode::from(INTERRUPTED),
            _ => ExitCode::FAILURE,
        }
    }

    /// Whether the reader of standard output has gone.
    pub(crate) fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }

    /// The failure and its causes, outermost first.
    pub(crate) fn causes(&self) -> impl Iterator<Item = &(dyn Error + 'static)> {
        std::iter::successors(Some(self as &dyn Error), |&error| error.source())
    }
}
