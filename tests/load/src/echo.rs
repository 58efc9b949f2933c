//! The ceiling of HTTP: exchanges with a server that does nothing, through the crates of worker and coordinator.

use std::net::Ipv4Addr;
use std::time::{Duration, Instant};

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::routing::put;
use backon::{ExponentialBuilder, Retryable};
use bytes::Bytes;
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tokio_util::task::AbortOnDropHandle;

use crate::error::LoadError;

/// Most connections. Both ends of each are open files of this process, and more are not faster.
const MOST_CONNECTIONS: u32 = 1000;

/// Measured time.
const TIME: Duration = Duration::from_secs(2);

/// Exchanges per second over `connections` connections at the same time, at most 1000. Each sends a body of `bytes`
/// bytes and waits for a short answer. Server and clients are in this process.
pub(crate) async fn exchanges_per_second(connections: u32, bytes: usize) -> Result<f64, LoadError> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.map_err(LoadError::Listen)?;
    let url = format!("http://{}/", listener.local_addr().map_err(LoadError::Listen)?);
    let router =
        Router::new().route("/", put(async |body: Bytes| body.len().to_string())).layer(DefaultBodyLimit::disable());
    let _server = AbortOnDropHandle::new(tokio::spawn(axum::serve(listener, router).into_future()));
    let client = reqwest::Client::builder().no_proxy().build().map_err(LoadError::Echo)?;
    let body = Bytes::from(vec![7; bytes]);
    let connections = connections.min(MOST_CONNECTIONS);
    // Connections are made before the time starts.
    exchange_until(&client, &url, connections, &body, Instant::now()).await?;
    let start = Instant::now();
    let exchanges = exchange_until(&client, &url, connections, &body, start + TIME).await?;
    Ok(exchanges as f64 / start.elapsed().as_secs_f64())
}

/// Exchanges over all connections until `end`, at least one over each. Returns their number.
async fn exchange_until(
    client: &reqwest::Client,
    url: &str,
    connections: u32,
    body: &Bytes,
    end: Instant,
) -> Result<u64, LoadError> {
    let mut clients = JoinSet::new();
    for _ in 0..connections {
        let (client, url, body) = (client.clone(), url.to_owned(), body.clone());
        clients.spawn(async move {
            let exchange = async || client.put(&url).body(body.clone()).send().await?.error_for_status()?.bytes().await;
            let mut exchanges = 0;
            loop {
                // Like a worker, repeats a connection that fails.
                exchange.retry(ExponentialBuilder::default().with_jitter()).await?;
                exchanges += 1;
                if Instant::now() >= end {
                    return Ok::<u64, reqwest::Error>(exchanges);
                }
            }
        });
    }
    let mut exchanges = 0;
    while let Some(ended) = clients.join_next().await {
        let ended = ended.map_err(|panic| LoadError::Ended(format!("a measurement failed: {panic}")))?;
        exchanges += ended.map_err(LoadError::Echo)?;
    }
    Ok(exchanges)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn every_connection_exchanges_at_least_once() {
        let rate = exchanges_per_second(3, 1000).await.unwrap();
        assert!(rate.is_finite() && rate > 0.0, "{rate}");
    }
}
