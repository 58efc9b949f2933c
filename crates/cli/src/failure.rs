//! Why a command failed, and what that means for the exit code.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clerestory_api::{ClientError, ProblemCode};
use clerestory_coordinator::RunError;
use clerestory_experiments::ExperimentError;
use clerestory_film::{CompareError, ImageError, PreviewError};
use clerestory_local_render::LocalRenderError;
use clerestory_render_core::scene::SceneError;
use clerestory_worker::WorkerError;

use crate::connection::TOKEN_VARIABLE;
use crate::shutdown::INTERRUPTED;
use crate::terminal::cause_text;

/// Exit code of a command whose arguments or settings cannot be used.
pub(crate) const USAGE: u8 = 2;

/// What the client's TLS says of an answer without TLS.
const NO_TLS: &str = "InvalidContentType";

/// What the client says of an answer that is no HTTP, as one in TLS is not.
const NO_HTTP: &str = "invalid HTTP version parsed";

/// A command failed. Printed with its causes.
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
    /// A file is no image that can be used.
    #[error("cannot use the image {}", file.display())]
    Image { file: PathBuf, source: ImageError },
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
    /// The coordinator of this process stopped.
    #[error("the coordinator cannot work")]
    CoordinatorStopped(#[from] RunError),
    /// The socket of the viewer failed.
    #[error("the viewer's socket failed")]
    Viewer(#[source] io::Error),
    /// The worker cannot work.
    #[error("the worker cannot work")]
    Worker(#[from] WorkerError),
    /// A process of the farm did not start or ended too early.
    #[error("{message}")]
    Process {
        message: String,
        /// Whether it could not use its arguments or settings, which are those of the farm.
        is_usage: bool,
    },
    /// A process of the farm could not be started at all.
    #[error("cannot start a process of the farm")]
    Spawn(#[source] io::Error),
    /// A database that is measured cannot be used.
    #[error("cannot measure the database")]
    Database(#[source] Box<dyn Error + Send + Sync>),
    /// The speed of HTTP cannot be measured.
    #[error("an exchange with a server of this process failed")]
    Echo(#[source] reqwest::Error),
    /// The user interrupted what cannot be kept.
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

/// What would be right instead of an address on which a coordinator cannot listen.
fn expected_address(address: &str, reason: &io::Error) -> String {
    match (reason.kind(), address.rsplit_once(':')) {
        (io::ErrorKind::AddrInUse, Some((host, _))) => {
            format!(
                "the port is taken, perhaps by another farm: choose another, or --listen {host}:0 to be given a free one"
            )
        }
        (io::ErrorKind::PermissionDenied, _) => "expected a port that this user may listen on, 1024 or more".to_owned(),
        _ => "expected an address of this machine, such as 127.0.0.1:7171".to_owned(),
    }
}

impl Failure {
    /// A scene that cannot be used. A file that cannot be read at all is no matter of scenes.
    pub(crate) fn scene(file: &Path, source: SceneError) -> Self {
        match source {
            SceneError::Unreadable { file, source } => Self::Read { file, source },
            source => Self::Scene { file: file.to_owned(), source },
        }
    }

    /// 2 when the arguments or settings are to blame, 130 when the user interrupted, else 1.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Usage(_)
            | Self::Configuration { .. }
            | Self::Overrides { .. }
            | Self::Process { is_usage: true, .. } => ExitCode::from(USAGE),
            Self::Connection(error) | Self::Worker(WorkerError::Connection(error)) if error.is_usage() => {
                ExitCode::from(USAGE)
            }
            // What is no address at all, whatever this machine's are.
            Self::Listen { source, .. } if source.kind() == io::ErrorKind::InvalidInput => ExitCode::from(USAGE),
            Self::Interrupted(_) => ExitCode::from(INTERRUPTED),
            _ => ExitCode::FAILURE,
        }
    }

    /// Whether the reader of standard output went away.
    pub(crate) fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }

    /// The failure and its causes, outermost first.
    pub(crate) fn causes(&self) -> impl Iterator<Item = &(dyn Error + 'static)> {
        chain(self)
    }

    /// Whether the machine of the coordinator says that nobody listens there.
    fn is_connection_refused(&self) -> bool {
        let mut system = self.causes().filter_map(|cause| cause.downcast_ref::<io::Error>());
        system.any(|error| error.kind() == io::ErrorKind::ConnectionRefused)
    }

    /// What the user can do about it, where the causes do not say.
    pub(crate) fn advice(&self) -> Option<String> {
        let call = self.causes().find_map(|cause| cause.downcast_ref::<ClientError>());
        if let Some(advice) = call.and_then(advice_on_call) {
            return Some(advice);
        }
        if let Self::Write { file, source } | Self::WrittenElsewhere { file, source, .. } = self
            && matches!(source.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded)
        {
            return Some(format!(
                "the disk is full: make room where {} is, or name a file on another disk",
                file.display()
            ));
        }
        let Self::Coordinator { address, .. } = self else { return None };
        if self.is_connection_refused() {
            return Some(
                "no coordinator is there: start one with `clerestory farm` or `clerestory coordinator`, or name another \
                 with --coordinator"
                    .to_owned(),
            );
        }
        let says = |text: &str| self.causes().any(|cause| cause.to_string().contains(text));
        if address.starts_with("https://") && says(NO_TLS) {
            let plain = address.replacen("https", "http", 1);
            return Some(format!("whoever listens there speaks no TLS: is it {plain}?"));
        }
        if address.starts_with("http://") && says(NO_HTTP) {
            let secure = address.replacen("http", "https", 1);
            return Some(format!("whoever listens there speaks no HTTP: is it {secure}?"));
        }
        None
    }
}

/// What the user can do about a call that went wrong on its way, or was refused.
fn advice_on_call(error: &ClientError) -> Option<String> {
    let token = || {
        format!("put the farm's token in the environment variable {TOKEN_VARIABLE}, or in a file named by --token-file")
    };
    match error {
        ClientError::Problem { problem, .. } if problem.code == ProblemCode::Unauthorized => Some(token()),
        ClientError::UnexpectedAnswer { status: 401, answer, .. } => match &answer.challenge {
            Some(challenge) if challenge.to_ascii_lowercase().starts_with("basic") => Some(
                "a proxy in between asks for a name and a password: put them into the address, as in \
                 http://NAME:PASSWORD@farm.example"
                    .to_owned(),
            ),
            _ => Some(token()),
        },
        ClientError::UnexpectedAnswer { status: 407, .. } => Some(
            "the proxy asks for a name and a password: put them into the variable that names it, as in \
             http://NAME:PASSWORD@proxy.example:3128"
                .to_owned(),
        ),
        ClientError::UnexpectedAnswer { answer, .. } if answer.proxy.is_some() => Some(without_proxy()),
        error if error.silent_proxy().is_some() => Some(without_proxy()),
        _ => None,
    }
}

/// How to call without the proxy of the environment.
fn without_proxy() -> String {
    "the environment names that proxy (http_proxy, https_proxy or all_proxy): list the coordinator's host in no_proxy to \
     call it directly"
        .to_owned()
}

/// An error and its causes in one line. Many errors repeat their cause in their own message: each text is written once.
pub(crate) fn report(error: &(dyn Error + 'static)) -> String {
    let mut report: Vec<String> = Vec::new();
    for text in chain(error).map(cause_text).filter(|text| !text.is_empty()) {
        if report.iter().any(|above| above.contains(&text)) {
            continue;
        }
        match report.last_mut() {
            // The cause says all that the error above it says.
            Some(above) if text.starts_with(above.as_str()) => *above = text,
            _ => report.push(text),
        }
    }
    report.join(": ")
}

/// An error and its causes, outermost first.
fn chain<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    std::iter::successors(Some(error), |&error| error.source())
}

/// What is at the bottom of an error, without all that it passed through.
pub(crate) fn root_cause(error: &dyn Error) -> &dyn Error {
    let mut cause = error;
    while let Some(next) = cause.source() {
        cause = next;
    }
    cause
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An error with a cause.
    #[derive(Debug, thiserror::Error)]
    #[error("{message}")]
    struct Link {
        message: &'static str,
        source: Option<Box<Link>>,
    }

    fn link(messages: &[&'static str]) -> Option<Box<Link>> {
        let (message, causes) = messages.split_first()?;
        Some(Box::new(Link { message, source: link(causes) }))
    }

    #[test]
    fn a_cause_that_the_message_above_it_says_is_not_said_again() {
        let report = |causes: &[&'static str]| report(&Failure::Database(link(causes).unwrap()));
        assert_eq!(report(&["no table jobs"]), "cannot measure the database: no table jobs");
        for causes in [
            ["the store: no table jobs", "no table jobs", "no table jobs"],
            ["the store: no table jobs", "no table", "jobs"],
            ["the store", "the store: no table jobs", "no table jobs"],
        ] {
            assert_eq!(report(&causes), "cannot measure the database: the store: no table jobs");
        }
        assert_eq!(report(&["first", "", "second"]), "cannot measure the database: first: second");
    }
}
