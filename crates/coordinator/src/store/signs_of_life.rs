//! Signs of life of workers. Those that come while one waits to be written are written with it, by one statement: thousands of workers
//! say every few seconds that they are there.

use std::collections::BTreeSet;
use std::mem;
use std::sync::{Arc, Mutex, PoisonError};

use clerestory_api::{Quarantine, WorkerId};
use tokio::sync::oneshot;

use super::row::to_json;
use super::sql::{Kind, looked_up, query};
use super::{Connection, Store, StoreError, WorkerError};

/// Signs that wait to be written.
#[derive(Clone, Debug, Default)]
pub(super) struct SignsOfLife {
    waiting: Arc<Mutex<Vec<Sign>>>,
}

#[derive(Debug)]
struct Sign {
    worker: WorkerId,
    now_ms: i64,
    reply: oneshot::Sender<Result<(), WorkerError>>,
}

impl SignsOfLife {
    /// Adds a sign, and answers whether it is the first.
    fn add(&self, sign: Sign) -> bool {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.push(sign);
        waiting.len() == 1
    }

    fn put(&self, signs: Vec<Sign>) {
        *self.waiting.lock().unwrap_or_else(PoisonError::into_inner) = signs;
    }

    fn take(&self) -> Vec<Sign> {
        mem::take(&mut *self.waiting.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Store {
    /// Notes that a worker is alive.
    pub(crate) async fn touch_worker(&self, worker: WorkerId, now_ms: i64) -> Result<(), WorkerError> {
        let (reply, answer) = oneshot::channel();
        if self.signs_of_life.add(Sign { worker, now_ms, reply }) {
            // Others depend on it: it goes on when this caller goes away.
            tokio::spawn(note_all(self.clone()));
        }
        answer.await.unwrap_or_else(|_| Err(StoreError::Closed.into()))
    }
}

async fn note_all(store: Store) {
    let signs_of_life = store.signs_of_life.clone();
    let taken = SignsOfLife::default();
    let noting = taken.clone();
    let noted = store.write(move |connection| {
        Box::pin(async move {
            let signs = signs_of_life.take();
            let said: Vec<(WorkerId, i64)> = signs.iter().map(|sign| (sign.worker, sign.now_ms)).collect();
            noting.put(signs);
            note(connection, &said).await
        })
    });
    match noted.await {
        Ok(notes) => {
            for (sign, note) in taken.take().into_iter().zip(notes) {
                // The caller may have gone away.
                let _ = sign.reply.send(note);
            }
        }
        // Nobody took them, perhaps: the next one is to be the first again.
        Err(error) => {
            for sign in taken.take().into_iter().chain(store.signs_of_life.take()) {
                let _ = sign.reply.send(Err(error.clone().into()));
            }
        }
    }
}

/// Notes all signs, and answers what each caller is told.
async fn note(
    connection: &mut Connection,
    signs: &[(WorkerId, i64)],
) -> Result<Vec<Result<(), WorkerError>>, StoreError> {
    let Some(now_ms) = signs.iter().map(|(_, now_ms)| *now_ms).max() else { return Ok(Vec::new()) };
    let workers: BTreeSet<[String; 1]> = signs.iter().map(|(worker, _)| [worker.to_string()]).collect();
    let statement = format!(
        "update workers set seen_ms = $1 where {} and quarantine is null returning id",
        looked_up(connection.engine(), "workers", 2, &[Kind::Text], "id = c0")
    );
    let mut noted = BTreeSet::new();
    for row in query(statement).bind(now_ms).bind(to_json(&workers)?).fetch_all(&mut *connection).await? {
        noted.insert(row.parsed::<WorkerId>("id")?);
    }
    let mut notes = Vec::with_capacity(signs.len());
    for (worker, _) in signs {
        notes.push(if noted.contains(worker) { Ok(()) } else { Err(refusal(connection, *worker).await?) });
    }
    Ok(notes)
}

/// Why nothing is noted of a worker.
async fn refusal(connection: &mut Connection, worker: WorkerId) -> Result<WorkerError, StoreError> {
    let row = query("select quarantine from workers where id = $1").bind(worker.to_string());
    let row = row.fetch_optional(connection).await?;
    let quarantine: Option<Quarantine> = row.map(|row| row.optional_json("quarantine")).transpose()?.flatten();
    Ok(match quarantine {
        Some(Quarantine { reason, .. }) => WorkerError::Quarantined { worker, reason },
        None => WorkerError::Unknown(worker),
    })
}
