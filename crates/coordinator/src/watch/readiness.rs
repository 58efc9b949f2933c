//! Whether a coordinator is ready (`/readyz`): whether what a caller brings could be stored now.
//!
//! Each part is tried by a write: the database by a row, the blob store by a small blob; and the disk under the data directory needs room. An outcome
//! holds for some seconds, whoever asks, so that probes cost little, and none is made while nobody asks. A coordinator that is about to stop is not
//! ready, and goes on serving for as long as it takes a load balancer to see that.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex as BlockingMutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::Mutex;

use crate::farm::Farm;
use crate::store::StoreError;
use crate::tasks::to_completion;

/// How long a good outcome holds.
const GOOD_FOR: Duration = Duration::from_secs(2);

/// How long that of the blob store holds: a bucket is paid by the request.
const BLOBS_GOOD_FOR: Duration = Duration::from_secs(10);

/// How long a bad outcome holds.
const BAD_FOR: Duration = Duration::from_millis(500);

/// How long a part may take to answer.
const PATIENCE: Duration = Duration::from_secs(4);

/// Least room on the disk of the data directory: enough for the partials that are received at once.
const LEAST_ROOM: u64 = 64 << 20;

/// Who has asked within this time asks again and again.
const ASKED_LATELY: Duration = Duration::from_secs(60);

/// What keeps a coordinator from being ready.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum NotReady {
    /// It stops.
    #[error("the coordinator is stopping")]
    Stopping,
    /// Something cannot be written.
    #[error("nothing can be stored now: {0}")]
    Unwritable(String),
}

/// What is known of readiness.
#[derive(Debug, Default)]
pub(crate) struct Readiness {
    is_withdrawn: AtomicBool,
    asked: BlockingMutex<Option<Instant>>,
    last: Mutex<Last>,
}

/// The last outcome.
#[derive(Debug, Default)]
struct Last {
    tried: Option<(Instant, Result<(), NotReady>)>,
    blobs_were_good: Option<Instant>,
}

impl Readiness {
    /// Says from now on that the coordinator is not ready. Answers whether somebody asks again and again, and has to be served until it hears so.
    pub(crate) fn withdraw(&self) -> bool {
        self.is_withdrawn.store(true, Ordering::SeqCst);
        let asked = *self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.is_some_and(|asked| asked.elapsed() < ASKED_LATELY)
    }

    async fn find_out(&self, farm: &Farm) -> Result<(), NotReady> {
        let mut last = self.last.lock().await;
        if let Some((tried, outcome)) = &last.tried {
            let good_for = if outcome.is_ok() { GOOD_FOR } else { BAD_FOR };
            if tried.elapsed() < good_for {
                return outcome.clone();
            }
        }
        let blobs_are_good = last.blobs_were_good.is_some_and(|tried| tried.elapsed() < BLOBS_GOOD_FOR);
        let blobs = async { if blobs_are_good { Ok(()) } else { try_blobs(farm).await } };
        let (database, blobs) = tokio::join!(try_database(farm), blobs);
        last.blobs_were_good = match (&blobs, blobs_are_good) {
            (Ok(()), true) => last.blobs_were_good,
            (Ok(()), false) => Some(Instant::now()),
            (Err(_), _) => None,
        };
        let problems = [database, blobs, look_for_room(farm)].into_iter().filter_map(Result::err);
        let (problems, causes): (Vec<String>, Vec<String>) =
            problems.map(|problem| (problem.words, problem.cause)).unzip();
        let outcome = if problems.is_empty() { Ok(()) } else { Err(NotReady::Unwritable(problems.join("; "))) };
        let before = last.tried.take().map_or(Ok(()), |(_, outcome)| outcome);
        match &outcome {
            Err(error) if before != outcome => tracing::error!(%error, ?causes, "the coordinator is not ready"),
            Ok(()) if before.is_err() => tracing::info!("the coordinator is ready again"),
            _ => {}
        }
        last.tried = Some((Instant::now(), outcome.clone()));
        outcome
    }
}

/// Why a part cannot be used.
struct Problem {
    /// What anybody may be told.
    words: String,
    /// What the log has besides: it may name machines and roles.
    cause: String,
}

impl Problem {
    fn new(words: impl Into<String>, cause: impl ToString) -> Self {
        Self { words: words.into(), cause: cause.to_string() }
    }
}

/// Whether the coordinator is ready.
pub(crate) async fn check(farm: &Arc<Farm>) -> Result<(), NotReady> {
    let readiness = &farm.readiness;
    if readiness.is_withdrawn.load(Ordering::SeqCst) || farm.stopping.is_cancelled() {
        return Err(NotReady::Stopping);
    }
    *readiness.asked.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    let farm = Arc::clone(farm);
    // Whoever asks hangs up before a silent database is given up: the outcome is for the next.
    let found = to_completion(async move { farm.readiness.find_out(&farm).await }).await;
    found.unwrap_or_else(|error| {
        tracing::error!(%error, "readiness cannot be found out");
        Err(NotReady::Unwritable("the coordinator failed; its log has the cause".to_owned()))
    })
}

/// The database, by a write.
async fn try_database(farm: &Farm) -> Result<(), Problem> {
    let tried = tokio::time::timeout(PATIENCE, farm.store.try_to_write()).await;
    let slow = |_| Problem::new(format!("the database has not taken a write in {} s", PATIENCE.as_secs()), "no answer");
    tried.map_err(slow)?.map_err(|error| match &error {
        StoreError::ReadOnly(_) => Problem::new(error.to_string(), &error),
        _ => Problem::new("the database cannot be written (the log has the cause)", &error),
    })
}

/// The blob store, by a blob.
async fn try_blobs(farm: &Farm) -> Result<(), Problem> {
    let tried = tokio::time::timeout(PATIENCE, farm.blobs.try_to_write()).await;
    let slow =
        |_| Problem::new(format!("the blob store has not taken a blob in {} s", PATIENCE.as_secs()), "no answer");
    let refused = |error| Problem::new("the blob store takes no blob (the log has the cause)", error);
    tried.map_err(slow)?.map_err(refused)
}

/// The disk of the data directory, where anything that lasts is on it.
fn look_for_room(farm: &Farm) -> Result<(), Problem> {
    if farm.config.database.is_some() && farm.config.bucket.is_some() {
        return Ok(());
    }
    let disk = rustix::fs::statvfs(&farm.config.data_directory)
        .map_err(|error| Problem::new("the data directory cannot be used (the log has the cause)", error))?;
    has_room(disk.f_bavail.saturating_mul(disk.f_frsize))
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
    use clerestory_test_servers::postgres;

    use super::*;
    use crate::config::Config;
    use crate::server::open;
    use crate::store::tests::alter_database;

    /// Waits until readiness is as expected, and answers what is said of it.
    async fn until(farm: &Arc<Farm>, is_ready: bool) -> String {
        loop {
            let found = check(farm).await;
            if found.is_ok() == is_ready {
                return found.map_or_else(|problem| problem.to_string(), |()| String::new());
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    #[tokio::test]
    async fn a_database_that_takes_no_writes_is_named_until_it_does_again() {
        let (directory, database) = (tempfile::tempdir().unwrap(), postgres().new_database());
        let config = Config { database: Some(database.parse().unwrap()), ..Config::new(directory.path()) };
        let (farm, _bells) = open(config).await.unwrap();
        assert_eq!(check(&farm).await, Ok(()));
        alter_database(&database, "set default_transaction_read_only = on").await;
        let problem = until(&farm, false).await;
        assert!(problem.contains("database") && problem.contains("read-only"), "{problem}");
        alter_database(&database, "reset default_transaction_read_only").await;
        until(&farm, true).await;
        farm.store.close().await;
    }

    #[tokio::test]
    async fn a_blob_store_that_takes_nothing_is_named_until_it_does_again() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = open(Config::new(directory.path())).await.unwrap();
        let (blobs, away) = (directory.path().join("blobs"), directory.path().join("away"));
        std::fs::rename(&blobs, &away).unwrap();
        std::fs::write(&blobs, "in the way").unwrap();
        let problem = until(&farm, false).await;
        assert!(problem.contains("the blob store takes no blob"), "{problem}");
        std::fs::remove_file(&blobs).unwrap();
        std::fs::rename(&away, &blobs).unwrap();
        until(&farm, true).await;
    }

    #[tokio::test]
    async fn a_coordinator_that_leaves_is_not_ready_and_knows_whether_anybody_watches() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = open(Config::new(directory.path())).await.unwrap();
        assert!(!farm.readiness.withdraw(), "nobody has asked");
        assert_eq!(check(&farm).await, Err(NotReady::Stopping));
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = open(Config::new(directory.path())).await.unwrap();
        assert_eq!(check(&farm).await, Ok(()));
        assert!(farm.readiness.withdraw());
        assert_eq!(check(&farm).await, Err(NotReady::Stopping));
    }

    #[test]
    fn a_disk_that_is_nearly_full_is_not_enough() {
        assert!(has_room(LEAST_ROOM).is_ok());
        let problem = has_room(LEAST_ROOM - 1).err().unwrap();
        assert_eq!(problem.words, "the disk of the data directory has 63 MiB left, and 64 MiB are needed");
    }
}
