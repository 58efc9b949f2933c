//! Configuration of a coordinator, and the rule that it is not open to the network by accident.

use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use subtle::ConstantTimeEq;
use url::Url;

pub use crate::blobs::{Bucket, InvalidBucket};
pub use crate::clock::Clock;

/// Shortest token that is accepted: 16 characters of a hexadecimal token are 64 bits.
const SHORTEST_TOKEN: usize = 16;

/// How a coordinator is set up.
#[derive(Clone, Debug)]
pub struct Config {
    /// Directory of the database and the blobs, unless they are elsewhere. It is made if there is none, and has one
    /// coordinator at a time.
    pub data_directory: PathBuf,
    /// The PostgreSQL database. None for a SQLite file in the data directory.
    pub database: Option<PostgresUrl>,
    /// The bucket of the blobs. None for the data directory.
    pub bucket: Option<Bucket>,
    /// The token that callers must send. Only a coordinator on a loopback address may have none.
    pub token: Option<Token>,
    /// How long a lease lasts unless it is renewed.
    pub lease_ttl: Duration,
    /// How long the work of a lease should take.
    pub lease_target: Duration,
    /// Fraction of nodes that a second worker renders too, to be compared, 0 to 1.
    pub checked_fraction: f64,
    /// The exact number of nodes in a lease, for experiments and tests.
    pub lease_nodes: Option<u32>,
    /// Largest asset or reference.
    pub max_asset_bytes: u64,
    /// Largest partial.
    pub max_partial_bytes: u64,
    /// Memory for the files of submitted scenes, of all large ones together.
    pub submission_bytes: u64,
    /// Memory for the cache of decoded nodes.
    pub node_cache_bytes: usize,
    /// Memory for rows of images: half for measuring rounds, half for downloads.
    pub image_bytes: u64,
    /// Memory for the cache of previews. A frame whose preview needs more is shown smaller.
    pub preview_bytes: u64,
    /// Where the time comes from.
    pub clock: Clock,
    /// Build of the program, for the metadata of images.
    pub build: String,
}

impl Config {
    /// The defaults, with this data directory and no token.
    pub fn new(data_directory: impl Into<PathBuf>) -> Self {
        Self {
            data_directory: data_directory.into(),
            database: None,
            bucket: None,
            token: None,
            lease_ttl: Duration::from_secs(60),
            lease_target: Duration::from_secs(10),
            checked_fraction: 0.01,
            lease_nodes: None,
            max_asset_bytes: 256 << 20,
            max_partial_bytes: 256 << 20,
            submission_bytes: 1 << 30,
            node_cache_bytes: 64 << 20,
            image_bytes: 128 << 20,
            preview_bytes: 64 << 20,
            clock: Clock::default(),
            build: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }

    /// Refuses to serve the network without a token.
    ///
    /// # Errors
    ///
    /// When other machines can reach this address and there is no token.
    pub fn check_exposure(&self, address: SocketAddr) -> Result<(), ExposedWithoutToken> {
        match self.token {
            None if !address.ip().is_loopback() => Err(ExposedWithoutToken { address }),
            _ => Ok(()),
        }
    }
}

/// Address of a PostgreSQL database, as `postgres://USER:PASSWORD@HOST:PORT/DATABASE`. Its password is never printed.
#[derive(Clone, PartialEq, Eq)]
pub struct PostgresUrl(Url);

/// A text is no address of a PostgreSQL database.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected the address of a PostgreSQL database with one host, such as postgres://clerestory@127.0.0.1:5432/farm"
)]
pub struct InvalidPostgresUrl;

impl FromStr for PostgresUrl {
    type Err = InvalidPostgresUrl;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let url: Url = text.trim().parse().map_err(|_| InvalidPostgresUrl)?;
        let is_postgres = matches!(url.scheme(), "postgres" | "postgresql");
        let is_one_host = url.host_str().is_none_or(|host| !host.contains(','));
        (is_postgres && is_one_host && url.path().len() > 1).then_some(Self(url)).ok_or(InvalidPostgresUrl)
    }
}

impl PostgresUrl {
    /// The address with its password.
    pub(crate) fn secret(&self) -> &str {
        self.0.as_str()
    }
}

impl fmt::Display for PostgresUrl {
    /// The server and the database.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut url = self.0.clone();
        url.set_query(None);
        // Only addresses without a host can have no password.
        if url.set_password(None).is_err() {
            return formatter.write_str("postgres");
        }
        formatter.write_str(url.as_str())
    }
}

impl fmt::Debug for PostgresUrl {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "PostgresUrl({self})")
    }
}

/// A coordinator would serve the network without a token.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the coordinator would listen on {address}, which other machines can reach, without a token: make one with \
     `openssl rand -hex 32` and give it to the coordinator and to every worker as CLERESTORY_TOKEN, or listen on \
     127.0.0.1"
)]
pub struct ExposedWithoutToken {
    /// The address.
    pub address: SocketAddr,
}

/// The farm's shared token. It is never printed.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

/// A text cannot be a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the token has {length} {}{}: expected at least {SHORTEST_TOKEN} visible ASCII characters, for instance \
     the output of `openssl rand -hex 32`",
    if *.length == 1 { "character" } else { "characters" },
    if *.visible { "" } else { ", some of them not visible ASCII" }
)]
pub struct InvalidToken {
    length: usize,
    visible: bool,
}

impl FromStr for Token {
    type Err = InvalidToken;

    /// Reads a token; white space around it, such as the end of a file's line, is not part of it.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let text = text.trim();
        let (length, visible) = (text.chars().count(), text.bytes().all(|byte| byte.is_ascii_graphic()));
        if length >= SHORTEST_TOKEN && visible {
            Ok(Self(text.to_owned()))
        } else {
            Err(InvalidToken { length, visible })
        }
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Token(hidden)")
    }
}

impl Token {
    /// Whether `candidate` is this token, in constant time.
    pub(crate) fn matches(&self, candidate: &str) -> bool {
        equal_in_constant_time(&self.0, candidate)
    }

    /// The session cookie of a browser. It opens this coordinator to a browser, and cannot be turned back into the
    /// token.
    pub(crate) fn session(&self) -> String {
        blake3::Hasher::new_derive_key("clerestory browser session, version 1")
            .update(self.0.as_bytes())
            .finalize()
            .to_hex()
            .to_string()
    }

    /// Whether `candidate` is the session of this token.
    pub(crate) fn matches_session(&self, candidate: &str) -> bool {
        equal_in_constant_time(&self.session(), candidate)
    }
}

fn equal_in_constant_time(known: &str, candidate: &str) -> bool {
    known.as_bytes().ct_eq(candidate.as_bytes()).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_loopback_goes_without_a_token() {
        #[track_caller]
        fn check(address: &str, token: Option<&str>, allowed: bool) {
            let mut config = Config::new("data");
            config.token = token.map(|token| token.parse().unwrap());
            assert_eq!(config.check_exposure(address.parse().unwrap()).is_ok(), allowed, "{address}");
        }
        check("127.0.0.1:80", None, true);
        check("[::1]:80", None, true);
        check("0.0.0.0:80", None, false);
        check("[::]:80", None, false);
        check("192.168.1.4:80", None, false);
        check("0.0.0.0:80", Some("0123456789abcdef"), true);
        let error = Config::new("data").check_exposure("0.0.0.0:80".parse().unwrap()).unwrap_err();
        assert!(error.to_string().contains("openssl rand -hex 32"));
    }

    #[test]
    fn addresses_of_databases_are_distinguished_from_others_and_show_no_password() {
        let url: PostgresUrl =
            "postgres://clerestory:se%2Fcret@db.example:5433/farm?sslmode=prefer&password=x".parse().unwrap();
        assert_eq!(url.to_string(), "postgres://clerestory@db.example:5433/farm");
        assert!(!format!("{url:?}").contains("cret") && url.secret().contains("se%2Fcret"));
        for wrong in [
            "",
            "farm.sqlite",
            "mysql://u@h/d",
            "postgres://u@h",
            "postgres://u@h/",
            "postgres://u@h,i/d",
            "postgres://u@h:1,i:2/d",
        ] {
            assert_eq!(wrong.parse::<PostgresUrl>(), Err(InvalidPostgresUrl), "{wrong}");
        }
    }

    #[test]
    fn short_or_invisible_tokens_are_refused_and_no_token_is_printed() {
        assert!("short".parse::<Token>().is_err());
        assert!("0123456789 abcdef".parse::<Token>().is_err());
        let token: Token = " 0123456789abcdef\n".parse().unwrap();
        assert!(token.matches("0123456789abcdef") && !token.matches("0123456789abcdee") && !token.matches(""));
        assert!(!format!("{token:?}").contains("0123"));
        assert!(!token.matches_session("0123456789abcdef") && token.matches_session(&token.session()));
    }
}
