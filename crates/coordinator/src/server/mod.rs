//! Starting and stopping.
//!
//! The caller brings the socket and says when to stop, as in mini-redis, so that tests and the one-machine farm can
//! choose both. Every task that is started here is awaited here.

mod coordinator;
mod error;
mod storage;

use std::future::Future;
use std::time::Duration;

use futures::future::BoxFuture;
use tokio::net::TcpListener;
use tokio_util::task::AbortOnDropHandle;

use self::coordinator::Coordinator;

pub use self::error::RunError;
use crate::background::Background;
use crate::config::Config;
use crate::http;
use crate::tasks::Ended;

/// How long a coordinator that other machines reach serves on after it has reported that it is not ready: load
/// balancers ask every few seconds.
const DRAIN_TIME: Duration = Duration::from_secs(6);

/// How long running requests, and then tasks, may take to finish when the coordinator stops.
const GRACE: Duration = Duration::from_secs(10);

/// Serves on `listener` until `shutdown` resolves, then finishes the running requests.
///
/// # Errors
///
/// [`RunError`] when the coordinator would be open to the network without a token, when its data cannot be used, when
/// the system refuses a socket or a thread, or when a task fails that it cannot do without.
pub async fn run(
    listener: TcpListener,
    config: Config,
    shutdown: impl Future<Output = ()> + Send,
) -> Result<(), RunError> {
    run_until(listener, config, Box::pin(shutdown)).await
}

/// As [`run`]. A boxed future is compiled where it is boxed: the whole coordinator once, in this crate, and not in each
/// caller.
fn run_until<'a>(
    listener: TcpListener,
    config: Config,
    shutdown: BoxFuture<'a, ()>,
) -> BoxFuture<'a, Result<(), RunError>> {
    Box::pin(serve_until(listener, config, shutdown))
}

async fn serve_until(listener: TcpListener, config: Config, shutdown: BoxFuture<'_, ()>) -> Result<(), RunError> {
    let address = listener.local_addr()?;
    config.check_exposure(address)?;
    let lock = storage::lock(&config)?;
    let coordinator = Coordinator::open(config).await?;
    let store = coordinator.store().clone();
    let outcome = serve(listener, coordinator, shutdown, DRAIN_TIME).await;
    store.close().await;
    drop(lock);
    tracing::info!("coordinator stopped");
    outcome
}

/// Serves with an open coordinator until `shutdown` resolves, or a task fails that it needs.
async fn serve(
    listener: TcpListener,
    coordinator: Coordinator,
    shutdown: BoxFuture<'_, ()>,
    drain_time: Duration,
) -> Result<(), RunError> {
    let address = listener.local_addr()?;
    tracing::info!(%address, directory = %coordinator.directory().display(), "coordinator started");
    let background = Background::start()?;
    let (store, stopping) = (coordinator.store().clone(), coordinator.stopping().clone());
    let api = coordinator.api().clone();
    let readiness = api.readiness.clone();
    let mut tasks = coordinator.start(&background).await?;
    let serving = tokio::spawn(http::serve(listener, http::router(api), stopping.clone()));
    let mut server = AbortOnDropHandle::new(serving);
    let draining = async {
        shutdown.await;
        tracing::info!("coordinator stopping");
        let is_watched = readiness.withdraw();
        if is_watched && !address.ip().is_loopback() {
            tokio::time::sleep(drain_time).await;
        }
    };
    let outcome = tokio::select! {
        () = draining => Ok(()),
        Some(ended) = tasks.next_ended() => Err(ended.into()),
        problem = store.writer_failed() => Err(Ended { task: "writing to the database", problem }.into()),
        ended = &mut server => Err(Ended::of("serving HTTP", ended).into()),
    };
    stopping.cancel();
    if !server.is_finished() && tokio::time::timeout(GRACE, server).await.is_err() {
        tracing::warn!("some requests did not finish in time");
    }
    if tokio::time::timeout(GRACE, tasks.all_ended()).await.is_err() {
        tracing::warn!("some tasks did not finish in time");
    }
    outcome
}

#[cfg(test)]
mod tests {
    use std::error::Error;

    use clerestory_api::JobId;
    use clerestory_test_servers::postgres;
    use tokio::sync::oneshot;
    use uuid::Uuid;

    use super::*;
    use crate::blobs::Blobs;
    use crate::store::StoreError;

    /// A coordinator in a folder of its own.
    async fn opened() -> (tempfile::TempDir, Coordinator) {
        let directory = tempfile::tempdir().unwrap();
        let coordinator = Coordinator::open(Config::new(directory.path())).await.unwrap();
        (directory, coordinator)
    }

    #[tokio::test]
    async fn a_coordinator_whose_writer_panics_ends_with_an_error() {
        let (_directory, coordinator) = opened().await;
        let store = coordinator.store().clone();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let planted = async {
            let write = store.write::<(), StoreError, _>(|_| panic!("a planted fault"));
            assert!(write.await.is_err(), "nothing is acknowledged");
        };
        let (served, ()) =
            tokio::join!(serve(listener, coordinator, Box::pin(std::future::pending()), Duration::ZERO), planted);
        let words = served.unwrap_err().to_string();
        assert!(words.contains("writing to the database") && words.contains("a planted fault"), "{words}");
        assert!(store.write::<(), StoreError, _>(|_| Box::pin(async { Ok(()) })).await.is_err());
        store.close().await;
    }

    #[tokio::test]
    async fn a_coordinator_that_is_asked_whether_it_is_ready_serves_on_when_it_has_said_no() {
        let (_directory, coordinator) = opened().await;
        // Other machines reach it here.
        let listener = TcpListener::bind("0.0.0.0:0").await.unwrap();
        let address = format!("http://127.0.0.1:{}", listener.local_addr().unwrap().port());
        let (stop, stopped) = oneshot::channel();
        let server = tokio::spawn(async move {
            let shutdown = async { stopped.await.unwrap_or_default() };
            serve(listener, coordinator, Box::pin(shutdown), Duration::from_secs(3600)).await
        });
        let status = async |path: &str| reqwest::get(format!("{address}{path}")).await.unwrap().status().as_u16();
        assert_eq!(status("/readyz").await, 204);
        stop.send(()).unwrap();
        while status("/readyz").await != 503 {}
        assert_eq!(status("/healthz").await, 204);
        assert!(!server.is_finished());
        server.abort();
    }

    #[tokio::test]
    async fn blobs_that_no_row_names_are_gone_after_a_start() {
        let (directory, coordinator) = opened().await;
        let blobs = Blobs::in_directory(directory.path().join("blobs")).unwrap();
        blobs.put_nodes(JobId::from(Uuid::now_v7()), vec![b"node".to_vec()]).await.unwrap();
        coordinator.store().close().await;
        drop(coordinator);
        let again = Coordinator::open(Config::new(directory.path())).await.unwrap();
        assert!(blobs.node_blobs().await.unwrap().is_empty());
        again.store().close().await;
    }

    #[tokio::test]
    async fn a_failed_start_says_each_cause_once() {
        let foreign = tempfile::tempdir().unwrap();
        std::fs::write(foreign.path().join("farm.sqlite"), "no database at all, but long enough to look like one")
            .unwrap();
        let elsewhere = tempfile::tempdir().unwrap();
        let closed = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let at =
            |database: String| Config { database: Some(database.parse().unwrap()), ..Config::new(elsewhere.path()) };
        let no_certificate = format!("{}?sslmode=verify-full&sslrootcert=/none", postgres().new_database());
        for (config, expected) in [
            (Config::new(foreign.path()), "not a database"),
            (at(format!("postgres://glazier@{closed}/farm")), "refused"),
            (at(postgres().new_database_in("LATIN1")), "LATIN1"),
            (at(no_certificate), "TLS"),
            (at("postgres://glazier@127.0.0.1/farm?sslmode=sometimes".to_owned()), "sometimes"),
        ] {
            let error = Coordinator::open(config).await.map(drop).unwrap_err();
            let causes = std::iter::successors(Some(&error as &dyn Error), |&error| error.source());
            let causes: Vec<String> = causes.map(ToString::to_string).collect();
            let all = causes.join(": ");
            assert!(all.contains(expected), "{all}");
            assert!(causes.windows(2).all(|pair| !pair[0].contains(&pair[1])), "{causes:?}");
        }
    }
}
