//! Whether a coordinator is ready (`/readyz`): whether what a caller brings could be stored now.
//!
//! A check writes a row to the database and a small blob to the blob store. It also checks the free space on the disk
//! of the data directory. An outcome holds for some seconds, so that probes cost little. A coordinator that is about to
//! stop is not ready. It goes on serving until a load balancer has seen that.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex as BlockingMutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::Mutex;
use tokio_util::sync::CancellationToken;

use crate::blobs::Blobs;
use crate::store::{Store, StoreError};
use crate::tasks::to_completion;

/// How long a good outcome holds.
const GOOD_FOR: Duration = Duration::from_secs(2);

/// How long a good outcome of the blob store holds: a bucket is paid by the request.
const BLOBS_GOOD_FOR: Duration = Duration::from_secs(10);

/// How long a bad outcome holds.
const BAD_FOR: Duration = Duration::from_millis(500);

/// How long a part may take to answer.
const TIMEOUT: Duration = Duration::from_secs(4);

/// Least room on the disk of the data directory: enough for the partials that are received at once.
const LEAST_ROOM: u64 = 64 << 20;

/// A probe that asked within this time asks again and again.
const ASKED_LATELY: Duration = Duration::from_secs(60);

/// Why a coordinator is not ready.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum NotReady {
    /// It stops.
    #[error("the coordinator is stopping")]
    Stopping,
    /// Something cannot be written.
    #[error("nothing can be stored now: {0}")]
    Unwritable(String),
}

/// Whether the coordinator is ready.
#[derive(Debug)]
pub(crate) struct Readiness {
    store: Store,
    blobs: Blobs,
    /// The data directory, if the database or the blobs are in it.
    directory: Option<PathBuf>,
    stopping: CancellationToken,
    is_withdrawn: AtomicBool,
    /// When a probe asked last.
    asked: BlockingMutex<Option<Instant>>,
    last: Mutex<Last>,
}

/// The last outcome.
#[derive(Debug, Default)]
struct Last {
    checked: Option<(Instant, Result<(), NotReady>)>,
    blobs_were_good: Option<Instant>,
}

impl Readiness {
    /// Readiness of a coordinator that stores here.
    pub(crate) fn new(store: Store, blobs: Blobs, directory: Option<PathBuf>, stopping: CancellationToken) -> Self {
        let is_withdrawn = AtomicBool::new(false);
        Self {
            store,
            blobs,
            directory,
            stopping,
            is_withdrawn,
            asked: BlockingMutex::default(),
            last: Mutex::default(),
        }
    }

    /// Reports from now on that the coordinator is not ready. Answers whether a probe asks again and again: it has to
    /// be served until it has seen this.
    pub(crate) fn withdraw(&self) -> bool {
        self.is_withdrawn.store(true, Ordering::SeqCst);
        let asked = *self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.is_some_and(|asked| asked.elapsed() < ASKED_LATELY)
    }

    /// Whether the coordinator is ready.
    pub(crate) async fn check(self: &Arc<Self>) -> Result<(), NotReady> {
        if self.is_withdrawn.load(Ordering::SeqCst) || self.stopping.is_cancelled() {
            return Err(NotReady::Stopping);
        }
        *self.asked.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        let readiness = Arc::clone(self);
        // A probe hangs up before a silent database times out: the outcome is for the next probe.
        let outcome = to_completion(async move { readiness.last_or_new().await }).await;
        outcome.unwrap_or_else(|error| {
            tracing::error!(%error, "readiness cannot be checked");
            Err(NotReady::Unwritable("the coordinator failed; its log has the cause".to_owned()))
        })
    }

    async fn last_or_new(&self) -> Result<(), NotReady> {
        let mut last = self.last.lock().await;
        if let Some((checked, outcome)) = &last.checked {
            let good_for = if outcome.is_ok() { GOOD_FOR } else { BAD_FOR };
            if checked.elapsed() < good_for {
                return outcome.clone();
            }
        }
        let blobs_are_good = last.blobs_were_good.is_some_and(|checked| checked.elapsed() < BLOBS_GOOD_FOR);
        let blobs = async { if blobs_are_good { Ok(()) } else { self.check_blobs().await } };
        let (database, blobs) = tokio::join!(self.check_database(), blobs);
        last.blobs_were_good = match (&blobs, blobs_are_good) {
            (Ok(()), true) => last.blobs_were_good,
            (Ok(()), false) => Some(Instant::now()),
            (Err(_), _) => None,
        };
        let problems = [database, blobs, self.check_room()].into_iter().filter_map(Result::err);
        let (problems, causes): (Vec<String>, Vec<String>) =
            problems.map(|problem| (problem.words, problem.cause)).unzip();
        let outcome = if problems.is_empty() { Ok(()) } else { Err(NotReady::Unwritable(problems.join("; "))) };
        let before = last.checked.take().map_or(Ok(()), |(_, outcome)| outcome);
        match &outcome {
            Err(error) if before != outcome => tracing::error!(%error, ?causes, "the coordinator is not ready"),
            Ok(()) if before.is_err() => tracing::info!("the coordinator is ready again"),
            _ => {}
        }
        last.checked = Some((Instant::now(), outcome.clone()));
        outcome
    }

    /// Writes to the database.
    async fn check_database(&self) -> Result<(), Problem> {
        let written = tokio::time::timeout(TIMEOUT, self.store.try_to_write()).await;
        let slow =
            |_| Problem::new(format!("the database has not taken a write in {} s", TIMEOUT.as_secs()), "no answer");
        written.map_err(slow)?.map_err(|error| match &error {
            StoreError::ReadOnly(_) => Problem::new(error.to_string(), &error),
            _ => Problem::new("the database cannot be written (the log has the cause)", &error),
        })
    }

    /// Writes to the blob store.
    async fn check_blobs(&self) -> Result<(), Problem> {
        let written = tokio::time::timeout(TIMEOUT, self.blobs.try_to_write()).await;
        let slow =
            |_| Problem::new(format!("the blob store has not taken a blob in {} s", TIMEOUT.as_secs()), "no answer");
        let refused = |error| Problem::new("the blob store takes no blob (the log has the cause)", error);
        written.map_err(slow)?.map_err(refused)
    }

    /// Looks for room on the disk of the data directory.
    fn check_room(&self) -> Result<(), Problem> {
        let Some(directory) = &self.directory else { return Ok(()) };
        let disk = rustix::fs::statvfs(directory)
            .map_err(|error| Problem::new("the data directory cannot be used (the log has the cause)", error))?;
        has_room(disk.f_bavail.saturating_mul(disk.f_frsize))
    }
}

/// Why a part cannot be used.
struct Problem {
    /// What every caller may read.
    words: String,
    /// What only the log has: it may name machines and roles.
    cause: String,
}

impl Problem {
    fn new(words: impl Into<String>, cause: impl ToString) -> Self {
        Self { words: words.into(), cause: cause.to_string() }
    }
}

fn has_room(bytes: u64) -> Result<(), Problem> {
    if bytes >= LEAST_ROOM {
        return Ok(());
    }
    let (room, least) = (bytes >> 20, LEAST_ROOM >> 20);
    Err(Problem::new(format!("the disk of the data directory has {room} MiB left, and {least} MiB are needed"), ""))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clerestory_test_servers::postgres;

    use super::*;
    use crate::store::Source;
    use crate::store::tests::alter_database;

    /// Readiness of a farm in this directory.
    async fn readiness(source: Source, directory: &Path) -> Arc<Readiness> {
        let store = Store::open(source).await.unwrap();
        let blobs = Blobs::in_directory(directory.join("blobs")).unwrap();
        Arc::new(Readiness::new(store, blobs, Some(directory.to_owned()), CancellationToken::new()))
    }

    async fn in_a_file(directory: &Path) -> Arc<Readiness> {
        readiness(Source::file(&directory.join("farm.sqlite")), directory).await
    }

    /// Waits until readiness is as expected, and answers its problem.
    async fn until(readiness: &Arc<Readiness>, is_ready: bool) -> String {
        loop {
            let found = readiness.check().await;
            if found.is_ok() == is_ready {
                return found.map_or_else(|problem| problem.to_string(), |()| String::new());
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    #[tokio::test]
    async fn a_database_that_takes_no_writes_is_named_until_it_does_again() {
        let (directory, database) = (tempfile::tempdir().unwrap(), postgres().new_database());
        let source = Source::postgres(&database.parse().unwrap()).unwrap();
        let readiness = readiness(source, directory.path()).await;
        assert_eq!(readiness.check().await, Ok(()));
        alter_database(&database, "set default_transaction_read_only = on").await;
        let problem = until(&readiness, false).await;
        assert!(problem.contains("database") && problem.contains("read-only"), "{problem}");
        alter_database(&database, "reset default_transaction_read_only").await;
        until(&readiness, true).await;
        readiness.store.close().await;
    }

    #[tokio::test]
    async fn a_blob_store_that_takes_nothing_is_named_until_it_does_again() {
        let directory = tempfile::tempdir().unwrap();
        let readiness = in_a_file(directory.path()).await;
        let (blobs, away) = (directory.path().join("blobs"), directory.path().join("away"));
        std::fs::rename(&blobs, &away).unwrap();
        std::fs::write(&blobs, "in the way").unwrap();
        let problem = until(&readiness, false).await;
        assert!(problem.contains("the blob store takes no blob"), "{problem}");
        std::fs::remove_file(&blobs).unwrap();
        std::fs::rename(&away, &blobs).unwrap();
        until(&readiness, true).await;
    }

    #[tokio::test]
    async fn a_coordinator_that_leaves_is_not_ready_and_knows_whether_anybody_watches() {
        let directory = tempfile::tempdir().unwrap();
        let readiness = in_a_file(directory.path()).await;
        assert!(!readiness.withdraw(), "nobody has asked");
        assert_eq!(readiness.check().await, Err(NotReady::Stopping));
        let directory = tempfile::tempdir().unwrap();
        let readiness = in_a_file(directory.path()).await;
        assert_eq!(readiness.check().await, Ok(()));
        assert!(readiness.withdraw());
        assert_eq!(readiness.check().await, Err(NotReady::Stopping));
    }

    #[test]
    fn a_disk_that_is_nearly_full_is_not_enough() {
        assert!(has_room(LEAST_ROOM).is_ok());
        let problem = has_room(LEAST_ROOM - 1).err().unwrap();
        assert_eq!(problem.words, "the disk of the data directory has 63 MiB left, and 64 MiB are needed");
    }
}
