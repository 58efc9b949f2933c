//! Garage, a distributed object store, as a cluster of one node.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::free_port;
use crate::s3::{ACCESS_KEY, REGION, SECRET_KEY};
use crate::watched;

/// Name of the environment variable with the path of Garage's program.
const PROGRAM: &str = "CLERESTORY_TEST_GARAGE";

/// What the nodes of a cluster share.
const CLUSTER_SECRET: &str = "7374726f6e67207374616e642074686520776964652077696e646f7773206f66";

/// Garage's program, with the file that configures its only node.
#[derive(Debug)]
pub(crate) struct Garage {
    program: PathBuf,
    settings: PathBuf,
}

impl Garage {
    /// Garage over a folder, to listen on this port, if the environment says where its program is.
    pub(crate) fn if_wanted(folder: &Path, port: u16) -> io::Result<Option<Self>> {
        let Some(program) = std::env::var_os(PROGRAM) else { return Ok(None) };
        let settings = folder.join("garage.toml");
        let folder = folder.display();
        let cluster_port = free_port()?;
        let text = format!(
            r#"metadata_dir = "{folder}/metadata"
data_dir = "{folder}/data"
db_engine = "sqlite"
metadata_fsync = true
data_fsync = true
replication_factor = 1
rpc_bind_addr = "127.0.0.1:{cluster_port}"
rpc_public_addr = "127.0.0.1:{cluster_port}"
rpc_secret = "{CLUSTER_SECRET}"
[s3_api]
s3_region = "{REGION}"
api_bind_addr = "127.0.0.1:{port}"
"#
        );
        fs::write(&settings, text)?;
        Ok(Some(Self { program: program.into(), settings }))
    }

    /// The command that serves.
    pub(crate) fn server(&self) -> Command {
        let mut command = watched::command(&self.program);
        command.arg("-c").arg(&self.settings).args(["server", "--single-node", "--default-access-key"]);
        command.envs([("GARAGE_DEFAULT_ACCESS_KEY", ACCESS_KEY), ("GARAGE_DEFAULT_SECRET_KEY", SECRET_KEY)]);
        command.env("RUST_LOG", "error").stderr(Stdio::null());
        command
    }

    /// Makes an empty bucket; the server has to run.
    pub(crate) fn make_bucket(&self, name: &str) -> io::Result<()> {
        self.run(&["bucket", "create", name])?;
        self.run(&["bucket", "allow", "--read", "--write", "--owner", name, "--key", ACCESS_KEY])
    }

    fn run(&self, arguments: &[&str]) -> io::Result<()> {
        let mut command = Command::new(&self.program);
        let output = command.arg("-c").arg(&self.settings).args(arguments).output()?;
        let words = || String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.success() { Ok(()) } else { Err(io::Error::other(words())) }
    }
}
