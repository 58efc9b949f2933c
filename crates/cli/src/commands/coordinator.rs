//! `clerestory coordinator`: the coordinator in this process.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use clerestory_coordinator::{Bucket, Config, PostgresUrl, Token};
use serde::{Deserialize, Serialize};
use tokio::net::TcpListener;
use tracing::info;

use crate::connection::{DEFAULT_LISTEN, named_token_file, token};
use crate::failure::Failure;
use crate::numbers::positive;
use crate::output::print_line;
use crate::settings::{self, DEFAULT_DATA};
use crate::shutdown::{self, Parent};
use crate::version::BUILD;

/// Options of `clerestory coordinator`.
#[derive(Debug, Args)]
pub(crate) struct CoordinatorArguments {
    /// TOML file with the same settings; options and environment win over it.
    #[arg(long, value_name = "FILE", env = "CLERESTORY_COORDINATOR_CONFIG")]
    config: Option<PathBuf>,
    /// Address on which it listens; port 0 takes a free one [default: 127.0.0.1:7171].
    #[arg(long, value_name = "HOST:PORT", env = "CLERESTORY_LISTEN")]
    listen: Option<String>,
    /// Folder for the database and the images [default: clerestory-data].
    #[arg(long, value_name = "FOLDER", env = "CLERESTORY_DATA")]
    data: Option<PathBuf>,
    /// PostgreSQL database of the farm's state, such as postgres://clerestory@db.example/farm. Without one, the state
    /// is a file in the data folder. A password is safer in the environment.
    #[arg(long, value_name = "URL", env = "CLERESTORY_DATABASE", hide_env_values = true)]
    database: Option<String>,
    /// Bucket of an S3-compatible object store for scenes, references and images, such as s3://glass/farm. Without one,
    /// they are in the data folder. Endpoint, region and keys come from AWS_ENDPOINT_URL, AWS_REGION, AWS_ACCESS_KEY_ID
    /// and AWS_SECRET_ACCESS_KEY.
    #[arg(long, value_name = "URL", env = "CLERESTORY_OBJECT_STORE")]
    object_store: Option<String>,
    /// File with the farm's token, required off loopback [env: CLERESTORY_TOKEN_FILE]; the token itself can be in
    /// CLERESTORY_TOKEN.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Lifetime of a lease that its worker does not renew [default: 60].
    #[arg(long, value_name = "SECONDS", env = "CLERESTORY_LEASE_SECONDS", value_parser = positive)]
    lease_seconds: Option<NonZeroU32>,
    /// Time that the work of a lease should take [default: 10].
    #[arg(long, value_name = "SECONDS", env = "CLERESTORY_LEASE_WORK_SECONDS", value_parser = positive)]
    lease_work_seconds: Option<NonZeroU32>,
    /// Fraction of nodes that a second worker renders too, as a check. A worker whose bits differ from those of two
    /// others gets no more work [default: 0.01].
    #[arg(long, value_name = "FRACTION", env = "CLERESTORY_CHECKED_FRACTION", value_parser = fraction)]
    checked_fraction: Option<f64>,
    /// Put exactly this many nodes into each lease, whatever time they take; for experiments.
    #[arg(long, value_name = "N", env = "CLERESTORY_LEASE_NODES", value_parser = positive)]
    lease_nodes: Option<NonZeroU32>,
    /// Print the settings of all layers together, as a configuration file, and end.
    #[arg(long)]
    print_config: bool,
    /// Stop when standard input ends; for a coordinator that belongs to another process.
    #[arg(long, hide = true)]
    stop_with_stdin: bool,
}

/// The settings, with the names of the configuration file.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Settings {
    listen: String,
    data: PathBuf,
    database: Option<String>,
    object_store: Option<String>,
    token_file: Option<PathBuf>,
    lease_seconds: NonZeroU32,
    lease_work_seconds: NonZeroU32,
    checked_fraction: f64,
    lease_nodes: Option<NonZeroU32>,
    max_asset_bytes: u64,
    max_partial_bytes: u64,
    submission_bytes: u64,
    node_cache_bytes: usize,
    image_bytes: u64,
    preview_bytes: u64,
}

impl Default for Settings {
    fn default() -> Self {
        let config = Config::new(DEFAULT_DATA);
        let seconds = |duration: Duration| {
            let seconds = u32::try_from(duration.as_secs()).ok().and_then(NonZeroU32::new);
            seconds.expect("the defaults are some seconds")
        };
        Self {
            listen: DEFAULT_LISTEN.to_owned(),
            data: config.data_directory,
            database: None,
            object_store: None,
            token_file: None,
            lease_seconds: seconds(config.lease_ttl),
            lease_work_seconds: seconds(config.lease_target),
            checked_fraction: config.checked_fraction,
            lease_nodes: None,
            max_asset_bytes: config.max_asset_bytes,
            max_partial_bytes: config.max_partial_bytes,
            submission_bytes: config.submission_bytes,
            node_cache_bytes: config.node_cache_bytes,
            image_bytes: config.image_bytes,
            preview_bytes: config.preview_bytes,
        }
    }
}

pub(crate) async fn run(arguments: CoordinatorArguments) -> Result<(), Failure> {
    let settings = interpret(&arguments)?;
    if arguments.print_config {
        return print_line(toml::to_string(&settings).expect("settings have a form in TOML").trim_end());
    }
    let config = settings.config(arguments.token_file.as_deref())?;
    let failure = |source| Failure::Listen { address: settings.listen.clone(), source };
    let listener = TcpListener::bind(&settings.listen).await.map_err(failure)?;
    let address = listener.local_addr().map_err(failure)?;
    config.check_exposure(address).map_err(|error| Failure::Usage(error.to_string()))?;
    if address.ip().is_unspecified() {
        info!(
            port = address.port(),
            "other machines reach the coordinator by a name or address of this one, on this port"
        );
    }
    let stop = shutdown::token(if arguments.stop_with_stdin { Parent::HoldsStdin } else { Parent::None });
    let mut printed = Ok(());
    // The address is printed when the coordinator serves. A farm waits for it before it starts workers.
    let stopped = async {
        printed = print_line(&format!("http://{}", reachable(address)));
        if printed.is_ok() {
            stop.cancelled().await;
        }
    };
    let ended = clerestory_coordinator::run(listener, config, stopped).await;
    ended.map_err(|error| Failure::Service { service: "coordinator", is_usage: false, source: Box::new(error) })?;
    printed
}

/// Options and environment over the file over the defaults.
fn interpret(arguments: &CoordinatorArguments) -> Result<Settings, Failure> {
    let file: Settings = settings::read(arguments.config.as_deref())?;
    Ok(Settings {
        listen: arguments.listen.clone().unwrap_or(file.listen),
        data: arguments.data.clone().unwrap_or(file.data),
        database: arguments.database.clone().or(file.database),
        object_store: arguments.object_store.clone().or(file.object_store),
        token_file: arguments.token_file.clone().or_else(named_token_file).or(file.token_file),
        lease_seconds: arguments.lease_seconds.unwrap_or(file.lease_seconds),
        lease_work_seconds: arguments.lease_work_seconds.unwrap_or(file.lease_work_seconds),
        checked_fraction: arguments.checked_fraction.unwrap_or(file.checked_fraction),
        lease_nodes: arguments.lease_nodes.or(file.lease_nodes),
        ..file
    })
}

impl Settings {
    /// The coordinator's settings. An option that names the token's file wins over the environment, which wins over the
    /// configuration file.
    fn config(&self, token_option: Option<&Path>) -> Result<Config, Failure> {
        let token = token(token_option, self.token_file.as_deref())?.map(|token| token.parse::<Token>()).transpose();
        let database = self.database.as_deref().map(str::parse::<PostgresUrl>).transpose();
        let bucket = self.object_store.as_deref().map(|url| Bucket::new(url, environment())).transpose();
        let checked_fraction = fraction(&self.checked_fraction.to_string());
        Ok(Config {
            checked_fraction: checked_fraction
                .map_err(|error| Failure::Usage(format!("checked_fraction: {}: {error}", self.checked_fraction)))?,
            bucket: bucket.map_err(|error| Failure::Usage(format!("object_store: {error}")))?,
            database: database.map_err(|error| Failure::Usage(format!("database: {error}")))?,
            token: token.map_err(|error| Failure::Usage(error.to_string()))?,
            lease_ttl: Duration::from_secs(self.lease_seconds.get().into()),
            lease_target: Duration::from_secs(self.lease_work_seconds.get().into()),
            lease_nodes: self.lease_nodes.map(NonZeroU32::get),
            max_asset_bytes: self.max_asset_bytes,
            max_partial_bytes: self.max_partial_bytes,
            submission_bytes: self.submission_bytes,
            node_cache_bytes: self.node_cache_bytes,
            image_bytes: self.image_bytes,
            preview_bytes: self.preview_bytes,
            build: BUILD.to_owned(),
            ..Config::new(&self.data)
        })
    }
}

/// Parses a fraction, 0 to 1.
fn fraction(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| (0.0..=1.0).contains(value));
    value.ok_or_else(|| "expected a number from 0 to 1".to_owned())
}

/// The variables of the environment that are text.
fn environment() -> impl Iterator<Item = (String, String)> {
    std::env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)))
}

/// The address at which this machine reaches a server that listens on `address`.
fn reachable(mut address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() {
        address.set_ip(match address {
            SocketAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
            SocketAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
        });
    }
    address
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    /// A command line of this command alone.
    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        arguments: CoordinatorArguments,
    }

    fn interpreted(file: &str, options: &[&str]) -> Settings {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("coordinator.toml");
        std::fs::write(&path, file).unwrap();
        let words = ["coordinator", "--config", path.to_str().unwrap()];
        interpret(&CommandLine::try_parse_from(words.iter().chain(options)).unwrap().arguments).unwrap()
    }

    #[test]
    fn options_win_over_the_file_and_the_file_over_defaults() {
        let settings = interpreted("listen = \"[::1]:80\"\nlease_seconds = 7\n", &["--lease-seconds", "3"]);
        let expected = Settings {
            listen: "[::1]:80".to_owned(),
            lease_seconds: NonZeroU32::new(3).unwrap(),
            ..Settings::default()
        };
        assert_eq!(settings, expected);
    }

    #[test]
    fn what_print_config_prints_is_a_configuration_file_with_the_same_meaning() {
        let settings = interpreted("lease_nodes = 5\ntoken_file = \"secret\"\n", &["--data", "elsewhere"]);
        assert_eq!(interpreted(&toml::to_string(&settings).unwrap(), &[]), settings);
    }

    #[test]
    fn a_fraction_beyond_the_whole_is_refused_wherever_it_stands() {
        assert!(fraction("1.01").is_err() && fraction("NaN").is_err() && fraction("-0.1").is_err());
        let error = interpreted("checked_fraction = 2.0\n", &[]).config(None).unwrap_err().to_string();
        assert!(error.contains("checked_fraction: 2: expected a number from 0 to 1"), "{error}");
        assert_eq!(interpreted("checked_fraction = 0.5\n", &["--checked-fraction", "0"]).checked_fraction, 0.0);
    }

    #[test]
    fn a_server_on_all_interfaces_is_reached_by_loopback() {
        let text = |address: &str| reachable(address.parse().unwrap()).to_string();
        assert_eq!(text("0.0.0.0:7171"), "127.0.0.1:7171");
        assert_eq!(text("[::]:7171"), "[::1]:7171");
        assert_eq!(text("192.0.2.1:7171"), "192.0.2.1:7171");
    }
}
