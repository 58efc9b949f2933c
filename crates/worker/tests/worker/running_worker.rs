//! A worker beside a server that a test provides.

use std::num::NonZeroUsize;
use std::time::Duration;

use axum::Router;
use clerestory_worker::{Config, WorkerError, run};
use tokio::net::TcpListener;
use tokio::sync::oneshot;

/// Longest time that a test waits for an event.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(60);

/// A worker that runs in this process.
pub(crate) struct RunningWorker {
    stop: oneshot::Sender<()>,
    pub(crate) ended: tokio::task::JoinHandle<Result<(), WorkerError>>,
}

impl RunningWorker {
    /// Starts a server and a worker. The scenes of the worker may take `memory` bytes.
    pub(crate) async fn at(router: Router, memory: Option<u64>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let coordinator = format!("http://{}", listener.local_addr().unwrap());
        tokio::spawn(async { axum::serve(listener, router).await });
        let config = Config {
            coordinator,
            token: None,
            name: "test".into(),
            threads: NonZeroUsize::new(2).unwrap(),
            memory,
            build: "test build".into(),
        };
        let (stop, stopped) = oneshot::channel::<()>();
        let ended = tokio::spawn(run(config, async {
            let _ = stopped.await;
        }));
        Self { stop, ended }
    }

    /// Stops the worker, which must end without an error.
    pub(crate) async fn stop(self) {
        let _ = self.stop.send(());
        tokio::time::timeout(TIMEOUT, self.ended).await.expect("the worker does not end").unwrap().unwrap();
    }
}
