//! A bucket of an S3-compatible object store, and its client.

use std::fmt;
use std::time::Duration;

use clerestory_api::is_loopback;
use object_store::aws::{AmazonS3, AmazonS3Builder, AmazonS3ConfigKey};
use object_store::path::Path;
use object_store::prefix::PrefixStore;
use object_store::{BackoffConfig, ClientConfigKey, ClientOptions, RetryConfig};
use url::Url;

use crate::blobs::clock_skew::Explaining;

/// Longest time of all attempts of a call while the store does not answer. Callers of the coordinator have timeouts of
/// their own.
const RETRY_TIMEOUT: Duration = Duration::from_secs(20);

/// Longest time without a byte of an answer.
const SILENCE: Duration = Duration::from_secs(30);

/// Longest pause between two attempts.
const LONGEST_BACKOFF: Duration = Duration::from_secs(2);

/// A proxy that no call goes through.
const UNUSED_PROXY: &str = "http://127.0.0.1:9";

/// Hosts that are called without it: all names and addresses.
const ALL_HOSTS: &str = "*,0.0.0.0/0,::/0";

/// A bucket, a prefix of all names in it, and the settings of its store. No key is ever printed.
#[derive(Clone, PartialEq, Eq)]
pub struct Bucket {
    name: String,
    prefix: Path,
    options: Vec<(AmazonS3ConfigKey, String)>,
}

/// A text does not name a bucket.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a bucket of an S3-compatible object store, such as s3://glass or s3://glass/farm")]
pub struct InvalidBucket;

impl Bucket {
    /// The bucket that is named by `url`, as `s3://BUCKET/PREFIX`, and reached as the variables in `environment` say
    /// whose names begin with `AWS_`: `AWS_ENDPOINT_URL`, `AWS_REGION`, `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`
    /// and whatever else is usual.
    ///
    /// # Errors
    ///
    /// [`InvalidBucket`] when it is not.
    pub fn new(url: &str, environment: impl IntoIterator<Item = (String, String)>) -> Result<Self, InvalidBucket> {
        let url: Url = url.trim().parse().map_err(|_| InvalidBucket)?;
        let is_plain = url.username().is_empty() && url.password().is_none() && url.port().is_none();
        let is_bucket = url.scheme() == "s3" && is_plain && url.query().is_none() && url.fragment().is_none();
        let name = url.host_str().filter(|name| is_bucket && !name.is_empty()).ok_or(InvalidBucket)?.to_owned();
        let prefix = Path::from_url_path(url.path()).map_err(|_| InvalidBucket)?;
        let option = |(name, value): (String, String)| {
            let key = name.starts_with("AWS_").then(|| name.to_ascii_lowercase().parse().ok()).flatten()?;
            Some((key, value))
        };
        Ok(Self { name, prefix, options: environment.into_iter().filter_map(option).collect() })
    }

    /// Whether the store listens only on this machine, and no proxy is set for it.
    fn is_on_loopback(&self) -> bool {
        let names_proxy = |key: &AmazonS3ConfigKey| *key == AmazonS3ConfigKey::Client(ClientConfigKey::ProxyUrl);
        let is_endpoint =
            |key: &AmazonS3ConfigKey| matches!(key, AmazonS3ConfigKey::Endpoint | AmazonS3ConfigKey::S3Endpoint);
        let mut endpoints = self.options.iter().filter(|(key, _)| is_endpoint(key));
        endpoints.any(|(_, url)| url.parse().is_ok_and(|url| is_loopback(&url)))
            && !self.options.iter().any(|(key, _)| names_proxy(key))
    }

    /// A client of it.
    pub(crate) fn client(&self) -> Result<PrefixStore<AmazonS3>, object_store::Error> {
        // A slow reader of a large scene has no time limit while bytes arrive.
        let mut patient = ClientOptions::new().with_timeout_disabled().with_read_timeout(SILENCE);
        if self.is_on_loopback() {
            // A proxy in the environment cannot reach it. The client uses that proxy unless another is set; this one
            // is used for no host.
            patient = patient.with_proxy_url(UNUSED_PROXY).with_proxy_excludes(ALL_HOSTS);
        }
        let builder = AmazonS3Builder::new().with_client_options(patient).with_http_connector(Explaining);
        let builder = self.options.iter().fold(builder, |builder, (key, value)| builder.with_config(*key, value));
        // An endpoint without TLS is wanted so.
        let endpoints = [AmazonS3ConfigKey::Endpoint, AmazonS3ConfigKey::S3Endpoint];
        let plain =
            endpoints.iter().filter_map(|key| builder.get_config_value(key)).any(|url| url.starts_with("http://"));
        let backoff = BackoffConfig { max_backoff: LONGEST_BACKOFF, ..BackoffConfig::default() };
        let retry = RetryConfig { backoff, retry_timeout: RETRY_TIMEOUT, ..RetryConfig::default() };
        let builder = if plain { builder.with_allow_http(true) } else { builder };
        let client = builder.with_bucket_name(&self.name).with_retry(retry).build()?;
        Ok(PrefixStore::new(client, self.prefix.clone()))
    }
}

impl fmt::Display for Bucket {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "s3://{}", self.name)?;
        if self.prefix.as_ref().is_empty() { Ok(()) } else { write!(formatter, "/{}", self.prefix) }
    }
}

impl fmt::Debug for Bucket {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "Bucket({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_are_distinguished_from_other_addresses_and_show_no_key() {
        let environment =
            [("AWS_SECRET_ACCESS_KEY", "lead"), ("AWS_REGION", "mars"), ("HOME", "glazier"), ("AWS_PROFILE", "p")];
        let environment = || environment.map(|(name, value)| (name.to_owned(), value.to_owned()));
        let bucket = Bucket::new(" s3://glass/farm/one/ ", environment()).unwrap();
        assert_eq!(bucket.to_string(), "s3://glass/farm/one");
        assert_eq!(format!("{bucket:?}"), "Bucket(s3://glass/farm/one)");
        assert_eq!(bucket.options.len(), 2, "what has nothing to do with S3 is passed over");
        assert_eq!(Bucket::new("s3://glass", environment()).unwrap().to_string(), "s3://glass");
        for wrong in [
            "",
            "glass",
            "https://s3.example/glass",
            "s3://",
            "s3://key@glass",
            "s3://glass:9000/",
            "s3://glass?region=mars",
        ] {
            assert_eq!(Bucket::new(wrong, []), Err(InvalidBucket), "{wrong}");
        }
    }
}
