//! The one writer of a coordinator: it groups waiting writes into one transaction.
//!
//! The writer has a thread of its own: statements of SQLite run on it, and a commit waits for the disk.
//!
//! A commit costs a sync of the disk, whatever it holds. So the writes that arrive during one commit form the next
//! transaction. Each has a savepoint of its own, so that a failing write rolls back alone. A caller is answered after
//! the commit, never before. The write of a caller that disconnects is carried out all the same, unless it is a
//! [claim](Turn::Claim).
//!
//! A transaction takes no more writes after [some time](GROUPED). Later writes wait for all of it, and a server steps
//! over every row that it has replaced so far. This time grows with the last commit. Otherwise a slow disk would get
//! few writes for each commit, and spend most of its time on commits.
//!
//! Some writes have a [turn](Turn) of their own. Claims alternate with the usual writes, so that an idle worker does
//! not wait for everything that others uploaded while the disk paused. Renewals, heartbeats and film leases go first,
//! several times a second, so that an overloaded farm gets slow but keeps its leases. Patient writes, for which no
//! worker waits, go last: each transaction ends with at most one. So they make progress under any load, and delay each
//! transaction by one write.
//!
//! When the connection is lost or silent for too long, the writes of its transaction fail, whether or not it was
//! committed. A caller that repeats one is told what is there. The next transaction gets a new connection. The same
//! happens after an error about the connection itself ([`Damage`]), such as a read-only session.

use std::collections::VecDeque;
use std::iter;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use futures::future::BoxFuture;
use tokio::sync::{mpsc, oneshot, watch};

use crate::store::engine::damage::Damage;
use crate::store::engine::error::StoreError;
use crate::store::engine::source::{Connection, Source};
use crate::store::engine::timeouts::in_time;
use crate::tasks::panic_message;

/// Most writes in one transaction.
const GROUP: usize = 64;

/// How long a transaction takes more writes, at least and at most. Between these it is as long as the last commit.
const GROUPED: [Duration; 2] = [Duration::from_millis(10), Duration::from_millis(50)];

/// Least time between transactions that begin with [first](Turn::First) writes while others wait. The larger such a
/// batch, the less each write costs.
const BETWEEN_FIRST: Duration = Duration::from_millis(100);

/// Writes that may wait before callers are held back.
const QUEUE: usize = 256;

/// When a write is carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) enum Turn {
    /// Before all that waits.
    First,
    /// In the order of arrival, alternating with claims.
    Usual,
    /// As usual writes, but dropped when its caller has disconnected: nobody would work off the lease.
    Claim,
    /// At the end of a transaction, one in each.
    Patient,
}

/// A handle on the writer task.
#[derive(Clone, Debug)]
pub(in crate::store) struct Writer {
    first: mpsc::Sender<Box<dyn Write>>,
    claims: mpsc::Sender<Box<dyn Write>>,
    writes: mpsc::Sender<Message>,
    patient: mpsc::Sender<Box<dyn Write>>,
    /// The message of the thread's panic, if it panicked.
    failure: watch::Receiver<Option<String>>,
}

enum Message {
    Write(Box<dyn Write>),
    Close(oneshot::Sender<()>),
}

/// What waits for the writer.
struct Queues {
    first: mpsc::Receiver<Box<dyn Write>>,
    claims: mpsc::Receiver<Box<dyn Write>>,
    writes: mpsc::Receiver<Message>,
    patient: mpsc::Receiver<Box<dyn Write>>,
}

impl Queues {
    /// Refuses further writes. Waiting writes are still carried out.
    fn close(&mut self) {
        self.first.close();
        self.claims.close();
        self.writes.close();
        self.patient.close();
    }
}

impl Writer {
    /// Starts the thread. It owns the connection and ends when it is closed or the last handle is dropped.
    pub(in crate::store) fn start(source: Source, connection: Connection) -> std::io::Result<Self> {
        let (first, first_queue) = mpsc::channel(QUEUE);
        let (claims, claim_queue) = mpsc::channel(QUEUE);
        let (writes, queue) = mpsc::channel(QUEUE);
        let (patient, patient_queue) = mpsc::channel(QUEUE);
        let queues = Queues { first: first_queue, claims: claim_queue, writes: queue, patient: patient_queue };
        let runtime = tokio::runtime::Handle::current();
        let (failed, failure) = watch::channel(None);
        let serve = move || {
            let served = AssertUnwindSafe(|| runtime.block_on(serve(source, Some(connection), queues)));
            if let Err(panic) = catch_unwind(served) {
                failed.send_replace(Some(panic_message(&*panic)));
            }
        };
        std::thread::Builder::new().name("store-writer".to_owned()).spawn(serve)?;
        Ok(Self { first, claims, writes, patient, failure })
    }

    /// Resolves with the message of the thread's panic.
    pub(in crate::store) async fn failed(&self) -> String {
        let mut failure = self.failure.clone();
        let message = failure.wait_for(Option::is_some).await.map(|message| message.clone());
        match message {
            Ok(message) => message.unwrap_or_default(),
            // The thread has ended because it was closed.
            Err(_) => std::future::pending().await,
        }
    }

    /// Runs `write` in its turn and answers after the commit. An error rolls it back.
    pub(in crate::store) async fn write<T, E, F>(&self, turn: Turn, write: F) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
        F: for<'c> FnOnce(&'c mut Connection) -> BoxFuture<'c, Result<T, E>> + Send + 'static,
    {
        let (reply, answer) = oneshot::channel();
        let is_claim = turn == Turn::Claim;
        let waiting = Box::new(Waiting { write: Some(write), is_claim, result: None, reply });
        let is_in = match turn {
            Turn::First => self.first.send(waiting).await.is_ok(),
            Turn::Claim => self.claims.send(waiting).await.is_ok(),
            Turn::Usual => self.writes.send(Message::Write(waiting)).await.is_ok(),
            Turn::Patient => self.patient.send(waiting).await.is_ok(),
        };
        if !is_in {
            return Err(StoreError::Closed.into());
        }
        answer.await.map_err(|_| StoreError::Closed)?
    }

    /// How many writes wait that no transaction has taken yet.
    #[cfg(test)]
    pub(in crate::store) fn waiting(&self) -> usize {
        fn queued<T>(queue: &mpsc::Sender<T>) -> usize {
            queue.max_capacity() - queue.capacity()
        }
        queued(&self.first) + queued(&self.claims) + queued(&self.writes) + queued(&self.patient)
    }

    /// Carries out waiting writes, then stops.
    pub(in crate::store) async fn close(&self) {
        let (done, wait) = oneshot::channel();
        if self.writes.send(Message::Close(done)).await.is_ok() {
            // An error means that the thread has ended already.
            let _ = wait.await;
        }
    }
}

/// A write with its caller, of any types.
trait Write: Send {
    /// Runs it; `false` asks for the savepoint to be rolled back.
    fn run<'c>(&'c mut self, connection: &'c mut Connection) -> BoxFuture<'c, bool>;
    /// Whether it should still be carried out.
    fn is_wanted(&self) -> bool;
    /// Answers the caller with the outcome of the transaction.
    fn answer(self: Box<Self>, transaction: &Result<(), StoreError>);
}

struct Waiting<T, E, F> {
    write: Option<F>,
    is_claim: bool,
    result: Option<Result<T, E>>,
    reply: oneshot::Sender<Result<T, E>>,
}

impl<T, E, F> Write for Waiting<T, E, F>
where
    T: Send + 'static,
    E: From<StoreError> + Send + 'static,
    F: for<'c> FnOnce(&'c mut Connection) -> BoxFuture<'c, Result<T, E>> + Send + 'static,
{
    fn run<'c>(&'c mut self, connection: &'c mut Connection) -> BoxFuture<'c, bool> {
        Box::pin(async move {
            if let Some(write) = self.write.take() {
                self.result = Some(write(connection).await);
            }
            matches!(self.result, Some(Ok(_)))
        })
    }

    fn is_wanted(&self) -> bool {
        !(self.is_claim && self.reply.is_closed())
    }

    fn answer(self: Box<Self>, transaction: &Result<(), StoreError>) {
        let result = match (self.result, transaction) {
            // What a write has read in a transaction that is rolled back may not be true.
            (_, Err(error)) => Err(error.clone().into()),
            (Some(Err(error)), Ok(())) => Err(error),
            (Some(Ok(value)), Ok(())) => Ok(value),
            (None, Ok(())) => Err(StoreError::Closed.into()),
        };
        // The caller may have disconnected; its write stands.
        let _ = self.reply.send(result);
    }
}

/// Usual writes and claims that wait for a transaction.
#[derive(Default)]
struct Queued {
    claims: VecDeque<Box<dyn Write>>,
    others: VecDeque<Box<dyn Write>>,
    is_claim_next: bool,
}

impl Queued {
    fn is_empty(&self) -> bool {
        self.claims.is_empty() && self.others.is_empty()
    }

    /// The next write to carry out: one of each kind in turn, while there are both.
    fn take(&mut self) -> Option<Box<dyn Write>> {
        iter::from_fn(|| self.pop()).find(|write| write.is_wanted())
    }

    fn pop(&mut self) -> Option<Box<dyn Write>> {
        let is_claim = !self.claims.is_empty() && (self.is_claim_next || self.others.is_empty());
        self.is_claim_next = !is_claim;
        if is_claim { self.claims.pop_front() } else { self.others.pop_front() }
    }
}

async fn serve(source: Source, mut connection: Option<Connection>, mut queues: Queues) {
    let mut queued = Queued::default();
    let mut closing = Vec::new();
    let (mut last_first, mut last_commit) = (Instant::now(), Duration::ZERO);
    loop {
        let (mut first, mut messages, mut patient) = (Vec::new(), Vec::new(), None);
        if queued.is_empty() {
            tokio::select! {
                biased;
                Some(write) = queues.claims.recv() => queued.claims.push_back(write),
                Some(message) = queues.writes.recv() => messages.push(message),
                Some(write) = queues.patient.recv() => patient = Some(write),
                Some(write) = queues.first.recv() => first.push(write),
                else => break,
            }
        }
        if !first.is_empty() || last_first.elapsed() >= BETWEEN_FIRST {
            first.extend(iter::from_fn(|| queues.first.try_recv().ok()).take(GROUP));
        }
        let room = GROUP.saturating_sub(queued.claims.len());
        queued.claims.extend(iter::from_fn(|| queues.claims.try_recv().ok()).take(room));
        let room = GROUP.saturating_sub(queued.others.len() + messages.len());
        messages.extend(iter::from_fn(|| queues.writes.try_recv().ok()).take(room));
        let mut patient = patient.or_else(|| queues.patient.try_recv().ok());
        for message in messages {
            match message {
                Message::Write(write) => queued.others.push_back(write),
                Message::Close(done) => {
                    queues.close();
                    closing.push(done);
                }
            }
        }
        if first.is_empty() && queued.is_empty() && patient.is_none() {
            continue;
        }
        let mut writes = Vec::with_capacity(GROUP);
        let group = Group {
            first: &mut first,
            queued: &mut queued,
            ended: &mut writes,
            patient: patient.as_mut(),
            time: last_commit.clamp(GROUPED[0], GROUPED[1]),
        };
        let outcome = commit(&source, &mut connection, group, &mut last_commit).await;
        if let Err(error) = &outcome {
            tracing::error!(%error, writes = first.len() + writes.len(), "transaction failed");
        }
        if !first.is_empty() {
            last_first = Instant::now();
        }
        for write in first.into_iter().chain(writes).chain(patient) {
            write.answer(&outcome);
        }
    }
    if let Some(connection) = connection
        && let Err(error) = in_time(source.timeouts().connection, connection.close()).await
    {
        tracing::error!(%error, "closing the database failed");
    }
    for done in closing {
        // The caller of `close` may have given up.
        let _ = done.send(());
    }
}

/// What goes into a transaction.
struct Group<'a> {
    first: &'a mut [Box<dyn Write>],
    queued: &'a mut Queued,
    /// The queued writes that it has run.
    ended: &'a mut Vec<Box<dyn Write>>,
    patient: Option<&'a mut Box<dyn Write>>,
    /// How long it takes more queued writes.
    time: Duration,
}

/// Runs a transaction: the first writes, queued ones while there is time, and a patient one. Answers also how long the
/// commit took.
async fn commit(
    source: &Source,
    held: &mut Option<Connection>,
    mut group: Group<'_>,
    took: &mut Duration,
) -> Result<(), StoreError> {
    // A connection is used again only when its transaction has ended.
    let mut connection = match begun(source, held.take()).await {
        Ok(connection) => connection,
        Err(error) => {
            group.ended.extend(iter::from_fn(|| group.queued.take()));
            return Err(error);
        }
    };
    let outcome = in_time(source.timeouts().transaction, async {
        group.run(&mut connection).await?;
        let start = Instant::now();
        connection.batch("commit").await?;
        *took = start.elapsed();
        Ok(())
    })
    .await;
    let is_over = match &outcome {
        Ok(()) => Ok(()),
        Err(_) => in_time(source.timeouts().connection, connection.batch("rollback")).await,
    };
    match (is_over, connection.damage()) {
        (Ok(()), Damage::None) => *held = Some(connection),
        (Ok(()), damage) => {
            tracing::warn!(
                "the connection to the database is given up after an error; the next transaction gets a new one"
            );
            source.has_damage(damage);
            // Nobody waits for its goodbye.
            tokio::spawn(in_time(source.timeouts().connection, connection.close()));
        }
        (Err(error), damage) => {
            tracing::error!(%error, "the connection to the database is given up");
            source.has_damage(damage);
        }
    }
    outcome
}

/// A connection with a begun transaction: the held one, or a new one when that is lost.
async fn begun(source: &Source, held: Option<Connection>) -> Result<Connection, StoreError> {
    if let Some(mut connection) = held {
        match in_time(source.timeouts().turn, connection.begin()).await {
            Ok(()) => return Ok(connection),
            Err(error) => {
                tracing::warn!(%error, "the connection to the database is lost");
                source.has_damage(connection.damage());
            }
        }
    }
    let mut connection = source.writer().await?;
    in_time(source.timeouts().turn, connection.begin()).await?;
    Ok(connection)
}

impl Group<'_> {
    async fn run(&mut self, connection: &mut Connection) -> Result<(), StoreError> {
        // The end of one write and the begin of the next are sent together. The last one ends with the transaction.
        let mut between = "savepoint one_write";
        const NEXT: &str = "release savepoint one_write; savepoint one_write";
        for write in &mut *self.first {
            run_one(connection, between, write).await?;
            between = NEXT;
        }
        let start = Instant::now();
        while self.ended.len() < GROUP
            && start.elapsed() < self.time
            && let Some(write) = self.queued.take()
        {
            run_one(connection, between, self.ended.push_mut(write)).await?;
            between = NEXT;
        }
        match &mut self.patient {
            Some(write) => run_one(connection, between, write).await,
            None => Ok(()),
        }
    }
}

async fn run_one(
    connection: &mut Connection,
    before: &'static str,
    write: &mut Box<dyn Write>,
) -> Result<(), StoreError> {
    connection.batch(before).await?;
    if !write.run(connection).await {
        connection.batch("rollback to savepoint one_write").await?;
    }
    Ok(())
}
