//! The address of the coordinator, and the token for it.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use clerestory_api::{Client, ClientError, JobId, ProblemCode};

use crate::failure::Failure;

/// Environment variable with the farm's token. There is no option for the token, because other users can see options.
pub(crate) const TOKEN_VARIABLE: &str = "CLERESTORY_TOKEN";

/// Environment variable that names a file with the token. It is read apart from the options: these win over
/// [`TOKEN_VARIABLE`], and it does not.
const TOKEN_FILE_VARIABLE: &str = "CLERESTORY_TOKEN_FILE";

/// Default address of a coordinator.
pub(crate) const DEFAULT_LISTEN: &str = "127.0.0.1:7171";

/// Options of every command that talks to a coordinator.
#[derive(Clone, Debug, Args)]
pub(crate) struct ConnectionArguments {
    /// Address of the coordinator.
    #[arg(
        long, value_name = "URL", default_value_t = format!("http://{DEFAULT_LISTEN}"), env = "CLERESTORY_COORDINATOR"
    )]
    pub(crate) coordinator: String,
    /// File with the farm's token [env: CLERESTORY_TOKEN_FILE]; the token itself can be in CLERESTORY_TOKEN.
    #[arg(long, value_name = "FILE")]
    pub(crate) token_file: Option<PathBuf>,
}

/// A client with the address of its coordinator for messages.
#[derive(Clone, Debug)]
pub(crate) struct Connection {
    pub(crate) client: Client,
}

impl ConnectionArguments {
    /// Makes a client. Nothing is sent yet.
    pub(crate) fn open(&self) -> Result<Connection, Failure> {
        Connection::open(&self.coordinator, token(self.token_file.as_deref(), None)?.as_deref())
    }
}

impl Connection {
    pub(crate) fn open(address: &str, token: Option<&str>) -> Result<Self, Failure> {
        let client = Client::new(address, token).map_err(Failure::Connection)?;
        Ok(Self { client })
    }

    /// Address of the coordinator, for messages.
    pub(crate) fn address(&self) -> &str {
        self.client.address()
    }

    /// Fails unless a coordinator answers at the address and takes the token. A busy coordinator will do.
    pub(crate) async fn check(&self) -> Result<(), Failure> {
        match self.client.integrators().await {
            Err(error) if error.problem().is_none_or(|problem| problem.code == ProblemCode::Unauthorized) => {
                Err(self.failure(error))
            }
            _ => Ok(()),
        }
    }

    /// Adds the coordinator's address to the failure of a call.
    pub(crate) fn failure(&self, source: ClientError) -> Failure {
        Failure::Coordinator { address: self.address().to_owned(), source }
    }

    /// The page of a job.
    pub(crate) fn job_page(&self, job: JobId) -> String {
        format!("{}/#/jobs/{job}", self.address())
    }
}

/// The file with the token that the environment names.
pub(crate) fn named_token_file() -> Option<PathBuf> {
    std::env::var_os(TOKEN_FILE_VARIABLE).filter(|name| !name.is_empty()).map(PathBuf::from)
}

/// The token: from the file of an option, else from the environment, else from the file of a configuration. White space
/// around it does not count.
pub(crate) fn token(option: Option<&Path>, configured: Option<&Path>) -> Result<Option<String>, Failure> {
    if let Some(file) = option {
        return token_in(file).map(Some);
    }
    if let Ok(token) = std::env::var(TOKEN_VARIABLE) {
        return Ok(Some(token.trim().to_owned()).filter(|token| !token.is_empty()));
    }
    named_token_file().or_else(|| configured.map(Path::to_owned)).map(|file| token_in(&file)).transpose()
}

fn token_in(file: &Path) -> Result<String, Failure> {
    let text = fs::read_to_string(file).map_err(|source| Failure::Read { file: file.to_owned(), source })?;
    match text.trim() {
        "" => Err(Failure::Usage(format!(
            "the token file {} is empty: expected something like the output of `openssl rand -hex 32`",
            file.display()
        ))),
        token => Ok(token.to_owned()),
    }
}
