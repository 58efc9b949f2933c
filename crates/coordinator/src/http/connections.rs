//! Connections: accepted, served, and closed.
//!
//! There may be thousands, mostly of workers that wait or render. Each keeps its read buffer, so the buffer is small:
//! uploads are read in more pieces, which costs little.

use std::io;
use std::time::Duration;

use axum::Router;
use hyper_util::rt::{TokioExecutor, TokioIo};
use hyper_util::server::conn::auto::Builder;
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio_util::sync::CancellationToken;

use crate::http::lingering::Lingering;

/// Bytes of one read, and so the largest head of a request.
const BUFFER: usize = 8 << 10;

/// Pause after a connection could not be accepted, mostly because too many files are open.
const PAUSE: Duration = Duration::from_secs(1);

/// Serves until `stopping`, and then until running requests are answered.
pub(crate) async fn serve(listener: TcpListener, router: Router, stopping: CancellationToken) {
    let mut server = Builder::new(TokioExecutor::new()).http1_only();
    server.http1().max_buf_size(BUFFER);
    let connections = GracefulShutdown::new();
    while let Some(accepted) = stopping.run_until_cancelled(accept(&listener)).await {
        let stream = match accepted {
            Ok(stream) => stream,
            Err(error) => {
                tracing::error!(%error, "no connection can be accepted for now");
                stopping.run_until_cancelled(tokio::time::sleep(PAUSE)).await;
                continue;
            }
        };
        let service = TowerToHyperService::new(router.clone());
        let connection = server.serve_connection(TokioIo::new(Lingering::new(stream)), service).into_owned();
        let connection = connections.watch(connection);
        tokio::spawn(async move {
            if let Err(error) = connection.await {
                tracing::trace!(error, "a connection failed");
            }
        });
    }
    drop(listener);
    connections.shutdown().await;
}

/// The next connection that is still open.
async fn accept(listener: &TcpListener) -> io::Result<TcpStream> {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    loop {
        match listener.accept().await {
            Ok((stream, _)) => return Ok(stream),
            Err(error) if matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset) => {}
            Err(error) => return Err(error),
        }
    }
}
