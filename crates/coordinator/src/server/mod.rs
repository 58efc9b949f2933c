//! Starting and stopping.
//!
//! The caller brings the socket and says when to stop, as in mini-redis; so tests and the one-machine farm can choose
//! both. Every task that is started here is awaited here.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::future::Future;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use futures::future::BoxFuture;
use tokio::net::TcpListener;
use tokio::time::MissedTickBehavior;
use tokio_util::task::AbortOnDropHandle;
use uuid::Uuid;

use crate::background::Background;
use crate::blobs::{BlobError, Blobs, ClaimError};
use crate::config::{Bucket, Clock, Config, ExposedWithoutToken};
use crate::directory;
use crate::error_chain::in_one_line;
use crate::farm::{Bells, Farm};
use crate::films::garbage_collection as tidying;
use crate::films::rounds::finalizer as keeper;
use crate::http;
use crate::store::{Observation, SchemaError, Source, Store, StoreError};
use crate::tasks::{Ended, Tasks};
use crate::watch::notifications::News;
use crate::watch::{events, notifications as news};

/// Longest time between two looks at deadlines.
const LONGEST_TICK: Duration = Duration::from_secs(1);

/// How long nothing may be heard without counting as such: who said that it was there just before, and says so again just after, was silent for
/// less than others wait for it.
const LONGEST_GAP: Duration = Duration::from_secs(5);

/// Leases whose end is logged at one look, each with its worker: a power cut ends thousands.
const MOST_EXPIRED_LOGGED: usize = 16;

/// How long a coordinator that other machines reach goes on serving when it has said that it is not ready: load balancers ask every few seconds.
const LEAVING: Duration = Duration::from_secs(6);

/// How long requests that are under way, and then tasks, may take to finish when the coordinator stops.
const GRACE: Duration = Duration::from_secs(10);

/// The coordinator cannot start, or failed.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// It would be open to the network.
    #[error(transparent)]
    Exposed(#[from] ExposedWithoutToken),
    /// The data directory cannot be used.
    #[error("cannot use the data directory `{}`", directory.display())]
    Directory {
        /// The directory.
        directory: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Another coordinator uses it.
    #[error("the data directory `{}` is in use by another coordinator", directory.display())]
    InUse {
        /// The directory.
        directory: PathBuf,
    },
    /// The object store does not answer, or refuses.
    #[error("cannot use the object store {bucket}")]
    ObjectStore {
        /// The bucket.
        bucket: Bucket,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The blobs are another farm's.
    #[error(
        "the blobs in {place} cannot be used with the database {database}: {problem}; a blob store and a database go together"
    )]
    ForeignBlobs {
        /// Where the blobs are.
        place: String,
        /// What people call the database.
        database: String,
        /// Whose they are.
        problem: String,
    },
    /// The database's address cannot be used.
    #[error("cannot use the address of the database: {problem}")]
    DatabaseAddress {
        /// Why.
        problem: String,
    },
    /// The database cannot be used.
    #[error(transparent)]
    Database(#[from] SchemaError),
    /// The stored state cannot be read.
    #[error("cannot read the stored state: {0}")]
    State(String),
    /// A task has failed without which it cannot go on.
    #[error("the coordinator cannot go on without its task `{task}`: {problem}")]
    Task {
        /// What the task does.
        task: &'static str,
        /// How it ended.
        problem: String,
    },
    /// The system refuses a socket or a thread.
    #[error("the system refuses a socket or a thread")]
    System(#[from] io::Error),
}

impl From<Ended> for RunError {
    fn from(Ended { task, problem }: Ended) -> Self {
        Self::Task { task, problem }
    }
}

impl From<StoreError> for RunError {
    fn from(error: StoreError) -> Self {
        Self::State(error.to_string())
    }
}

impl From<BlobError> for RunError {
    fn from(error: BlobError) -> Self {
        Self::State(error.to_string())
    }
}

/// Serves on `listener` until `shutdown` resolves, then finishes the requests that are under way.
///
/// # Errors
///
/// [`RunError`] when the coordinator would be open to the network without a token, when its data cannot be used, when
/// the system refuses a socket or a thread, or when a task of it fails that it cannot do without.
pub async fn run(
    listener: TcpListener,
    config: Config,
    shutdown: impl Future<Output = ()> + Send,
) -> Result<(), RunError> {
    run_until(listener, config, Box::pin(shutdown)).await
}

/// As [`run`]. A boxed future is compiled where it is boxed: all of the coordinator in this crate, once, and not in each that starts one.
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
    let lock = lock(&config)?;
    let (farm, bells) = open(config).await?;
    let outcome = serve(listener, &farm, bells, shutdown, LEAVING).await;
    farm.store.close().await;
    drop(lock);
    tracing::info!("coordinator stopped");
    outcome
}

/// Serves an open farm until `shutdown` resolves, or a task fails that it needs.
async fn serve(
    listener: TcpListener,
    farm: &Arc<Farm>,
    bells: Bells,
    shutdown: BoxFuture<'_, ()>,
    leaving_time: Duration,
) -> Result<(), RunError> {
    let address = listener.local_addr()?;
    tracing::info!(%address, directory = %farm.config.data_directory.display(), "coordinator started");
    let background = Background::start()?;
    let mut tasks = start(farm, bells, &background).await?;
    let mut server = AbortOnDropHandle::new(tokio::spawn(http::serve(
        listener,
        http::router(Arc::clone(farm)),
        farm.stopping.clone(),
    )));
    let leaving = async {
        shutdown.await;
        tracing::info!("coordinator stopping");
        let is_watched = farm.readiness.withdraw();
        if is_watched && !address.ip().is_loopback() {
            tokio::time::sleep(leaving_time).await;
        }
    };
    let outcome = tokio::select! {
        () = leaving => Ok(()),
        Some(ended) = tasks.next_ended() => Err(ended.into()),
        problem = farm.store.writer_failed() => Err(Ended { task: "writing to the database", problem }.into()),
        ended = &mut server => Err(Ended::of("serving HTTP", ended).into()),
    };
    farm.stopping.cancel();
    if !server.is_finished() && tokio::time::timeout(GRACE, server).await.is_err() {
        tracing::warn!("some requests did not finish in time");
    }
    if tokio::time::timeout(GRACE, tasks.all_ended()).await.is_err() {
        tracing::warn!("some tasks did not finish in time");
    }
    outcome
}

/// Opens the farm in its directory and puts it in order after whatever has happened to the last coordinator.
pub(crate) async fn open(config: Config) -> Result<(Arc<Farm>, Bells), RunError> {
    let directory = config.data_directory.clone();
    let file = directory.join("farm.sqlite");
    let source = config.database.as_ref().map_or_else(|| Ok(Source::file(&file)), Source::postgres);
    let source = source.map_err(|error| RunError::DatabaseAddress { problem: in_one_line(&error) })?;
    let database = source.name().to_owned();
    let store = Store::open(source).await?;
    match open_with(config, store.clone(), database).await {
        Ok(opened) => Ok(opened),
        Err(error) => {
            store.close().await;
            Err(error)
        }
    }
}

/// Opens the farm whose database is open.
async fn open_with(config: Config, store: Store, database: String) -> Result<(Arc<Farm>, Bells), RunError> {
    follow_clock(&config.clock, &store).await?;
    let known = store.node_blobs().await?;
    let blobs = blobs(&config, &store, &known, database).await?;
    if !store.is_shared() {
        tidying::remove(&blobs, tidying::orphans(&store, &blobs).await?).await;
    }
    // Workers have gone on rendering while the coordinator was away; they need a term to say so.
    let ttl_ms = i64::try_from(config.lease_ttl.as_millis()).unwrap_or(i64::MAX);
    // Not where another coordinator has heard them meanwhile.
    let now_ms = config.clock.now_ms();
    let heard_ms = if store.is_shared() { now_ms.saturating_sub(ttl_ms) } else { i64::MAX };
    store.extend_leases(now_ms.saturating_add(ttl_ms), heard_ms).await?;
    // A SQLite file has one coordinator, which is the same after a restart.
    let coordinator = if store.is_shared() { Uuid::now_v7() } else { Uuid::nil() };
    let check_key = store.check_key().await?;
    Ok(Farm::new(config, coordinator, check_key, store, blobs))
}

/// Opens the blobs of a farm.
async fn blobs(config: &Config, store: &Store, known: &BTreeSet<String>, database: String) -> Result<Blobs, RunError> {
    let directory = config.data_directory.join("blobs");
    let (opened, place) = match &config.bucket {
        Some(bucket) => {
            let failed = |source: BlobError| RunError::ObjectStore { bucket: bucket.clone(), source: source.into() };
            (Blobs::in_bucket(bucket).map_err(failed)?, bucket.to_string())
        }
        None => {
            let place = directory.display().to_string();
            let opened = Blobs::in_directory(directory.clone());
            (opened.map_err(|source| RunError::Directory { directory, source })?, place)
        }
    };
    match (claimed(&opened, store, known).await?, &config.bucket) {
        (Ok(()), _) => Ok(opened),
        (Err(error @ (ClaimError::Foreign { .. } | ClaimError::Unknown { .. } | ClaimError::Elsewhere { .. })), _) => {
            Err(RunError::ForeignBlobs { place, database, problem: error.to_string() })
        }
        (Err(ClaimError::Store(source)), Some(bucket)) => {
            Err(RunError::ObjectStore { bucket: bucket.clone(), source: source.into() })
        }
        (Err(ClaimError::Store(error)), None) => Err(error.into()),
    }
}

/// Claims a blob store for a farm, which has one. Coordinators that start together take turns.
async fn claimed(blobs: &Blobs, store: &Store, known: &BTreeSet<String>) -> Result<Result<(), ClaimError>, StoreError> {
    let identity = store.identity().await?;
    if identity.has_blobs {
        // Nothing is marked any more.
        return Ok(blobs.claim(identity, known).await);
    }
    let (blobs, known) = (blobs.clone(), known.clone());
    store.claim_blobs(|identity| Box::pin(async move { blobs.claim(identity, &known).await })).await
}

/// Starts the tasks of a farm.
async fn start(farm: &Arc<Farm>, bells: Bells, background: &Background) -> Result<Tasks, StoreError> {
    for job in farm.store.unsettled_jobs().await? {
        // A round may have been complete when the last coordinator stopped.
        farm.look_at_film(job);
    }
    // Those who come back to a coordinator that has stopped for a while come all at once.
    farm.has_active_leases(farm.store.active_leases().await?);
    let last_event = farm.store.last_event_id().await?;
    let mut tasks = Tasks::default();
    tasks.add("recording rounds", background.spawn(keeper::run(Arc::clone(farm), bells.grown)));
    tasks.spawn("telling other coordinators", news::send(Arc::clone(farm), bells.told));
    if farm.store.is_shared() {
        tasks.spawn("hearing other coordinators", news::hear(Arc::clone(farm)));
    }
    tasks.spawn("sending events", events::run(Arc::clone(farm), last_event));
    tasks.spawn("watching deadlines", watch_deadlines(Arc::clone(farm)));
    tasks.spawn("removing what is not needed", tidying::run(Arc::clone(farm)));
    Ok(tasks)
}

/// Makes sure that no other coordinator works in the same directory. The lock ends with the process, however that ends.
fn lock(config: &Config) -> Result<File, RunError> {
    let directory = config.data_directory.clone();
    let open = || {
        directory::create(&config.data_directory)?;
        File::options().create(true).truncate(false).write(true).open(directory.join("lock"))
    };
    match open() {
        Err(source) => Err(RunError::Directory { directory, source }),
        Ok(file) => match file.try_lock() {
            Ok(()) => Ok(file),
            Err(TryLockError::WouldBlock) => Err(RunError::InUse { directory }),
            Err(TryLockError::Error(source)) => Err(RunError::Directory { directory, source }),
        },
    }
}

/// Takes back leases that have run out, and ends jobs whose time is up.
async fn watch_deadlines(farm: Arc<Farm>) {
    let tick = LONGEST_TICK.min(farm.config.lease_ttl / 4).max(Duration::from_millis(1));
    let mut interval = tokio::time::interval(tick);
    // Who has slept has missed nothing that one look does not find.
    interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut looked = Instant::now();
    while farm.stopping.run_until_cancelled(interval.tick()).await.is_some() {
        if looked.elapsed() > tick + LONGEST_GAP {
            // It slept, or waited for the database, and workers were not heard meanwhile.
            farm.listen_anew();
        }
        looked = Instant::now();
        if let Err(error) = look_at_deadlines(&farm).await {
            tracing::error!(%error, "deadlines could not be looked at");
            farm.listen_anew();
        }
    }
}

/// Sets the clock by that of the database, where several coordinators share one.
async fn follow_clock(clock: &Clock, store: &Store) -> Result<(), StoreError> {
    let asked = Instant::now();
    // An answer that was long under way, or waited for a coordinator that slept, is out of date; but better than the machine's clock.
    if let Some(now_ms) = store.now_ms().await?
        && (asked.elapsed() < LONGEST_TICK || !clock.follows())
    {
        clock.follow(now_ms);
    }
    Ok(())
}

/// Takes back leases that have run out, and holds jobs whose workers die.
async fn expire_leases(farm: &Farm, now_ms: i64) -> Result<(), StoreError> {
    let observation = Observation { now_ms, listening_ms: farm.listening_ms(), alive_ms: farm.alive_ms() };
    let expiry = farm.store.expire_leases(observation).await?;
    for expired in expiry.leases.iter().take(MOST_EXPIRED_LOGGED) {
        tracing::warn!(
            lease = %expired.lease, job = %expired.job, job_name = expired.job_name, worker = %expired.worker,
            worker_name = expired.worker_name, nodes = expired.nodes,
            "a lease ran out; its nodes are in the queue again"
        );
    }
    if let Some(more) = expiry.leases.len().checked_sub(MOST_EXPIRED_LOGGED).filter(|more| *more > 0) {
        tracing::warn!(more, "further leases ran out");
    }
    if !expiry.leases.is_empty() {
        farm.tell(News::Work);
    }
    for (job, hold) in expiry.held {
        tracing::error!(%job, reason = hold.reason, "the job is held until somebody releases it");
        farm.tell(News::Job(job));
    }
    for job in expiry.unchecked {
        tracing::error!(%job, "workers died again and again with a node that they were to check; it is not checked");
        farm.tell(News::Wave(job));
    }
    for job in farm.store.release_jobs_of_returned_workers(now_ms).await? {
        tracing::info!(%job, "a worker that was thought dead is back; the job goes on");
        farm.tell(News::Job(job));
    }
    Ok(())
}

/// One look at all deadlines.
pub(crate) async fn look_at_deadlines(farm: &Farm) -> Result<(), StoreError> {
    follow_clock(&farm.config.clock, &farm.store).await?;
    let now_ms = farm.config.clock.now_ms();
    for job in farm.store.end_jobs_out_of_time(now_ms).await? {
        tracing::info!(%job, "time limit reached");
        farm.tell(News::Job(job));
    }
    expire_leases(farm, now_ms).await?;
    // Workers that nobody could hear are not lost.
    if farm.alive_ms() > i64::MIN && farm.store.end_lost_workers(farm.silent_before_ms(), now_ms).await? {
        farm.tell(News::Workers);
    }
    for given_up in farm.store.give_up_checks(farm.alive_ms()).await? {
        match given_up.workers.as_slice() {
            [] | [_] => {
                tracing::debug!(job = %given_up.job, node = %given_up.node, "no other worker can check it")
            }
            workers => {
                let workers: Vec<String> = workers.iter().map(ToString::to_string).collect();
                tracing::error!(job = %given_up.job, node = %given_up.node, ?workers, "two workers render a node to different bits, and no third can decide which is wrong");
            }
        }
        farm.tell(News::Wave(given_up.job));
    }
    farm.has_active_leases(farm.store.active_leases().await?);
    farm.idle.forget_those_who_have_gone(Instant::now());
    let open = farm.store.open_jobs().await?;
    if !open.is_empty() {
        // With time alone, work that another holds becomes work to be taken over; and who was rung for a new job may not be one who can do it.
        farm.ring_for_work();
    }
    if farm.store.is_shared() {
        // What other coordinators did without being heard: they may have died before they told it.
        farm.events.stored();
        farm.ring_for_work();
    }
    // No round depends on the news of it.
    for job in open {
        farm.look_at_film(job);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::error::Error;

    use clerestory_test_servers::postgres;
    use tokio::sync::oneshot;

    use super::*;

    /// A farm in a folder of its own.
    async fn opened() -> (tempfile::TempDir, Arc<Farm>, Bells) {
        let directory = tempfile::tempdir().unwrap();
        let (farm, bells) = open(Config::new(directory.path())).await.unwrap();
        (directory, farm, bells)
    }

    #[tokio::test]
    async fn a_coordinator_whose_writer_panics_ends_with_an_error() {
        let (_directory, farm, bells) = opened().await;
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let planted = async {
            let write = farm.store.write::<(), StoreError, _>(|_| panic!("a planted fault"));
            assert!(write.await.is_err(), "nothing is acknowledged");
        };
        let (served, ()) =
            tokio::join!(serve(listener, &farm, bells, Box::pin(std::future::pending()), Duration::ZERO), planted);
        let words = served.unwrap_err().to_string();
        assert!(words.contains("writing to the database") && words.contains("a planted fault"), "{words}");
        assert!(farm.store.write::<(), StoreError, _>(|_| Box::pin(async { Ok(()) })).await.is_err());
        farm.store.close().await;
    }

    #[tokio::test]
    async fn a_coordinator_that_is_asked_whether_it_is_ready_serves_on_when_it_has_said_no() {
        let (_directory, farm, bells) = opened().await;
        // Other machines reach it here.
        let listener = TcpListener::bind("0.0.0.0:0").await.unwrap();
        let address = format!("http://127.0.0.1:{}", listener.local_addr().unwrap().port());
        let (stop, stopped) = oneshot::channel();
        let serving = Arc::clone(&farm);
        let server = tokio::spawn(async move {
            let shutdown = async { stopped.await.unwrap_or_default() };
            serve(listener, &serving, bells, Box::pin(shutdown), Duration::from_secs(3600)).await
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
            let error = open(config).await.map(drop).unwrap_err();
            let causes = std::iter::successors(Some(&error as &dyn Error), |&error| error.source());
            let causes: Vec<String> = causes.map(ToString::to_string).collect();
            let all = causes.join(": ");
            assert!(all.contains(expected), "{all}");
            assert!(causes.windows(2).all(|pair| !pair[0].contains(&pair[1])), "{causes:?}");
        }
    }
}
