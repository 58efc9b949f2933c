//! The address of a coordinator, and the proxy on the way to it.
//!
//! The environment may name a proxy (`http_proxy`, `https_proxy`, `all_proxy`, in either case) and exceptions
//! (`no_proxy`). A proxy on another machine cannot reach the loopback interface of this one, so calls to a loopback
//! address never go through a proxy.

use std::net::IpAddr;

use hyper_util::client::proxy::matcher::{Intercept, Matcher};
use reqwest::Url;

use crate::client_error::ClientError;

/// What an address looks like.
const EXAMPLE: &str = "expected something like http://127.0.0.1:7171";

/// Reads the address of a coordinator. It may have a path, as behind a proxy that serves several sites.
pub(crate) fn parse(value: &str) -> Result<Url, ClientError> {
    let invalid = |reason: String| ClientError::InvalidAddress { value: without_credentials(value), reason };
    let value = value.trim();
    let is_web = |url: &Url| matches!(url.scheme(), "http" | "https");
    let Some(url) = value.parse().ok().filter(is_web) else {
        let with_scheme = format!("http://{value}");
        return Err(invalid(match with_scheme.parse::<Url>() {
            Ok(_) if !value.contains("://") => {
                format!("it has no scheme, expected {}", without_credentials(&with_scheme))
            }
            _ => EXAMPLE.to_owned(),
        }));
    };
    if url.fragment().is_some() {
        return Err(invalid(format!("it names a page with `#`, {EXAMPLE}")));
    }
    if url.query().is_some() {
        return Err(invalid(format!("it has a query, {EXAMPLE}")));
    }
    Ok(url)
}

/// The proxy through which calls to an address go.
pub(crate) fn proxy(url: &Url, environment: &Matcher) -> Result<Option<Intercept>, ClientError> {
    if is_loopback(url) {
        return Ok(None);
    }
    let Some(proxy) = url.as_str().parse().ok().and_then(|uri| environment.intercept(&uri)) else { return Ok(None) };
    match proxy.uri().scheme_str() {
        Some("http" | "https") => Ok(Some(proxy)),
        _ => Err(ClientError::UnusableProxy { proxy: shown_proxy(&proxy) }),
    }
}

/// A proxy in messages, without its password.
pub(crate) fn shown_proxy(proxy: &Intercept) -> String {
    proxy.uri().to_string().trim_end_matches('/').to_owned()
}

/// An address in messages, without a name and a password.
pub(crate) fn without_credentials(address: &str) -> String {
    let start = address.find("://").map_or(0, |at| at + 3);
    let end = address[start..].find(['/', '?', '#']).map_or(address.len(), |at| start + at);
    match address[start..end].rfind('@') {
        Some(at) => format!("{}{}", &address[..start], &address[start + at + 1..]),
        None => address.to_owned(),
    }
}

/// Whether an address is one of this machine alone, in any spelling.
pub fn is_loopback(url: &Url) -> bool {
    let host = url.host_str().unwrap_or_default();
    match host.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>() {
        // Calls to the unspecified address reach this machine too.
        Ok(address) => address.to_canonical().is_loopback() || address.is_unspecified(),
        Err(_) => {
            let name = host.trim_end_matches('.');
            name == "localhost" || name.ends_with(".localhost")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proxy_of(address: &str, environment: &Matcher) -> Option<String> {
        proxy(&parse(address).unwrap(), environment).unwrap().map(|proxy| shown_proxy(&proxy))
    }

    #[test]
    fn no_spelling_of_loopback_goes_through_a_proxy() {
        let environment = Matcher::builder().all("http://proxy.example:3128").build();
        for host in [
            "localhost",
            "LocalHost",
            "localhost.",
            "farm.localhost",
            "127.0.0.1",
            "127.1",
            "127.8.9.10",
            "0x7f000001",
            "[::1]",
            "[0:0:0:0:0:0:0:1]",
            "[::ffff:127.0.0.1]",
            "0.0.0.0",
            "[::]",
        ] {
            for address in [format!("http://{host}:7171"), format!("https://{host}/farm/")] {
                assert_eq!(proxy_of(&address, &environment), None, "{address}");
            }
        }
        for host in ["farm.example", "localhost.example", "notlocalhost", "10.0.0.1", "128.0.0.1", "[fe80::1]"] {
            let address = format!("http://{host}:7171");
            assert_eq!(proxy_of(&address, &environment).as_deref(), Some("http://proxy.example:3128"), "{address}");
        }
    }

    #[test]
    fn the_proxy_is_that_of_the_scheme_unless_the_host_is_an_exception() {
        let environment = Matcher::builder()
            .http("http://glazier:lead@plain.example:3128")
            .https("secure.example:3129")
            .no("direct.example, 10.0.0.0/8")
            .build();
        let plain = proxy_of("http://farm.example:7171", &environment);
        assert_eq!(plain.as_deref(), Some("http://plain.example:3128"), "no password is shown");
        assert_eq!(proxy_of("https://farm.example", &environment).as_deref(), Some("http://secure.example:3129"));
        for address in ["http://direct.example:7171", "http://a.direct.example", "https://10.1.2.3"] {
            assert_eq!(proxy_of(address, &environment), None, "{address}");
        }
        assert_eq!(proxy_of("http://farm.example", &Matcher::builder().build()), None);
        let socks = Matcher::builder().all("socks5://proxy.example:1080").build();
        let refused = proxy(&parse("http://farm.example").unwrap(), &socks).unwrap_err().to_string();
        assert!(refused.contains("socks5://proxy.example:1080") && refused.contains("no_proxy"), "{refused}");
    }

    #[test]
    fn an_address_that_cannot_be_one_is_refused_with_what_would_be_right_and_without_its_password() {
        for (address, said) in [
            ("", EXAMPLE),
            ("http://", EXAMPLE),
            ("nonsense", "expected http://nonsense"),
            ("ftp://farm.example:21", EXAMPLE),
            ("farm.example:7171", "expected http://farm.example:7171"),
            ("127.0.0.1:7171", "expected http://127.0.0.1:7171"),
            ("glazier:lead@farm.example:7171", "expected http://farm.example:7171"),
            ("http://farm.example/#/jobs/1", "`#`"),
            ("http://farm.example/?job=1", "query"),
        ] {
            let refused = parse(address).unwrap_err().to_string();
            assert!(refused.contains(said) && !refused.contains("lead"), "{address}: {refused}");
        }
        for address in ["http://farm.example", " http://farm.example/ ", "https://farm.example:7171/glass/farm/"] {
            parse(address).unwrap();
        }
    }
}
