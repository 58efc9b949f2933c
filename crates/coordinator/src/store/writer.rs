//! The one writer of a coordinator: groups the writes that wait into one transaction.
//!
//! It has a thread of its own: statements of the embedded database run right there, and a commit waits for the disk.
//!
//! A commit costs a sync of the disk, whatever it holds. So writes that have gathered while the last commit ran go
//! into the next one, each in a savepoint of its own: a write that fails takes nothing else with it. A caller is answered
//! after the commit, never before. A write whose caller has gone away is carried out all the same, unless it is [for the caller alone](Turn::ForCaller).
//!
//! A transaction takes no more writes when it has gone on for [some time](GROUPED): those who come meanwhile wait for all of it, and a server has to
//! step over every row that it has replaced so far.
//!
//! Some have a [turn](Turn) of their own. Those that keep leases and workers alive come before all that waits, some times a second, so that a farm with more to do than its
//! coordinator can follow gets slow, and does not let its leases run out. Patient writes, for which no worker waits, come last: each transaction ends with one
//! of them, if there is any. So they come to their turn
//! however much else there is, and whatever else there is waits for one of them in each transaction before its own answer.
//!
//! When the connection is lost, or nothing is heard over it for long, the writes of that transaction fail, whether or not it was committed at
//! the last moment: whoever repeats one is told what is there. The next transaction gets a new connection.

use std::time::{Duration, Instant};

use futures::future::BoxFuture;
use tokio::sync::{mpsc, oneshot};

use super::StoreError;
use super::patience::in_time;
use super::source::{Connection, Source};

/// Most writes in one transaction.
const GROUP: usize = 64;

/// How long a transaction takes more writes.
const GROUPED: Duration = Duration::from_millis(10);

/// Least time between transactions that begin with [first](Turn::First) writes while others wait: the more of those have gathered, the less each costs.
const BETWEEN_FIRST: Duration = Duration::from_millis(100);

/// Writes that may wait before callers are held back.
const QUEUE: usize = 256;

/// When a write is carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// Before all that waits.
    First,
    /// After all that came before it.
    Usual,
    /// The same, but not at all if its caller has gone away by then: it would do harm.
    ForCaller,
    /// At the end of a transaction that has no other of this kind.
    Patient,
}

/// A handle on the writer task.
#[derive(Clone, Debug)]
pub(super) struct Writer {
    first: mpsc::Sender<Box<dyn Write>>,
    writes: mpsc::Sender<Message>,
    patient: mpsc::Sender<Box<dyn Write>>,
}

enum Message {
    Write(Box<dyn Write>),
    Close(oneshot::Sender<()>),
}

/// What waits for the writer.
struct Queues {
    first: mpsc::Receiver<Box<dyn Write>>,
    writes: mpsc::Receiver<Message>,
    patient: mpsc::Receiver<Box<dyn Write>>,
}

impl Queues {
    /// No more is let in; what waits is still written.
    fn close(&mut self) {
        self.first.close();
        self.writes.close();
        self.patient.close();
    }
}

impl Writer {
    /// Starts the thread. It owns the connection and ends when it is closed or the last handle is dropped.
    pub(super) fn start(source: Source, connection: Connection) -> std::io::Result<Self> {
        let (first, first_queue) = mpsc::channel(QUEUE);
        let (writes, queue) = mpsc::channel(QUEUE);
        let (patient, patient_queue) = mpsc::channel(QUEUE);
        let queues = Queues { first: first_queue, writes: queue, patient: patient_queue };
        let runtime = tokio::runtime::Handle::current();
        let serve = move || runtime.block_on(serve(source, Some(connection), queues));
        std::thread::Builder::new().name("store-writer".to_owned()).spawn(serve)?;
        Ok(Self { first, writes, patient })
    }

    /// Runs `write` when it is its turn and answers when that is committed. An error rolls this write back.
    pub(super) async fn write<T, E, F>(&self, turn: Turn, write: F) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
        F: for<'c> FnOnce(&'c mut Connection) -> BoxFuture<'c, Result<T, E>> + Send + 'static,
    {
        let (reply, answer) = oneshot::channel();
        let is_for_caller = turn == Turn::ForCaller;
        let waiting = Box::new(Waiting { write: Some(write), is_for_caller, result: None, reply });
        let is_in = match turn {
            Turn::First => self.first.send(waiting).await.is_ok(),
            Turn::Usual | Turn::ForCaller => self.writes.send(Message::Write(waiting)).await.is_ok(),
            Turn::Patient => self.patient.send(waiting).await.is_ok(),
        };
        if !is_in {
            return Err(StoreError::Closed.into());
        }
        answer.await.map_err(|_| StoreError::Closed)?
    }

    /// Lets the writes that wait run, then stops.
    pub(super) async fn close(&self) {
        let (done, wait) = oneshot::channel();
        if self.writes.send(Message::Close(done)).await.is_ok() {
            // An error means that the task has already ended, which is what is wanted.
            let _ = wait.await;
        }
    }
}

/// A write with its caller, whatever their types.
trait Write: Send {
    /// Runs it; `false` asks for the savepoint to be rolled back.
    fn run<'c>(&'c mut self, connection: &'c mut Connection) -> BoxFuture<'c, bool>;
    /// Whether it is still to be carried out.
    fn is_wanted(&self) -> bool;
    /// Answers the caller, once it is known how the transaction ended.
    fn answer(self: Box<Self>, transaction: &Result<(), StoreError>);
}

struct Waiting<T, E, F> {
    write: Option<F>,
    is_for_caller: bool,
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
        !(self.is_for_caller && self.reply.is_closed())
    }

    fn answer(self: Box<Self>, transaction: &Result<(), StoreError>) {
        let result = match (self.result, transaction) {
            (Some(Err(error)), _) => Err(error),
            (_, Err(error)) => Err(error.clone().into()),
            (Some(Ok(value)), Ok(())) => Ok(value),
            (None, Ok(())) => Err(StoreError::Closed.into()),
        };
        // The caller may have gone away; its write stands.
        let _ = self.reply.send(result);
    }
}

async fn serve(source: Source, mut connection: Option<Connection>, mut queues: Queues) {
    let mut waiting: Vec<Box<dyn Write>> = Vec::with_capacity(GROUP);
    let mut closing = Vec::new();
    let mut last_first = Instant::now();
    loop {
        let (mut first, mut messages, mut patient) = (Vec::new(), Vec::new(), None);
        if waiting.is_empty() {
            tokio::select! {
                biased;
                Some(message) = queues.writes.recv() => messages.push(message),
                Some(write) = queues.patient.recv() => patient = Some(write),
                Some(write) = queues.first.recv() => first.push(write),
                else => break,
            }
        }
        if !first.is_empty() || last_first.elapsed() >= BETWEEN_FIRST {
            first.extend(std::iter::from_fn(|| queues.first.try_recv().ok()).take(GROUP));
        }
        let room = GROUP - waiting.len() - messages.len();
        messages.extend(std::iter::from_fn(|| queues.writes.try_recv().ok()).take(room));
        let mut patient = patient.or_else(|| queues.patient.try_recv().ok());
        for message in messages {
            match message {
                Message::Write(write) => waiting.push(write),
                Message::Close(done) => {
                    queues.close();
                    closing.push(done);
                }
            }
        }
        waiting.retain(|write| write.is_wanted());
        if first.is_empty() && waiting.is_empty() && patient.is_none() {
            continue;
        }
        let (ended, outcome) = commit(&source, &mut connection, &mut first, &mut waiting, patient.as_mut()).await;
        if let Err(error) = &outcome {
            tracing::error!(%error, writes = first.len() + ended, "transaction failed");
        }
        if !first.is_empty() {
            last_first = Instant::now();
        }
        for write in first.into_iter().chain(waiting.drain(..ended)).chain(patient) {
            write.answer(&outcome);
        }
    }
    if let Some(connection) = connection
        && let Err(error) = connection.close().await
    {
        tracing::error!(%error, "closing the database failed");
    }
    for done in closing {
        // Nobody waits if the caller of `close` gave up.
        let _ = done.send(());
    }
}

/// Runs writes in a transaction: those that are first, as many of the others as there is time for, and a patient one. Answers with how many of the
/// others it has ended, and how.
async fn commit(
    source: &Source,
    held: &mut Option<Connection>,
    first: &mut [Box<dyn Write>],
    writes: &mut [Box<dyn Write>],
    patient: Option<&mut Box<dyn Write>>,
) -> (usize, Result<(), StoreError>) {
    // Whatever is wrong with a connection, it is not used again unless its transaction has come to an end.
    let mut connection = match begun(source, held.take()).await {
        Ok(connection) => connection,
        Err(error) => return (writes.len(), Err(error)),
    };
    let mut ended = 0;
    let outcome = in_time(source.patience().transaction, async {
        run_some(&mut connection, first, writes, patient, &mut ended).await?;
        connection.batch("commit").await
    })
    .await;
    let is_over = match &outcome {
        Ok(()) => Ok(()),
        Err(_) => in_time(source.patience().connection, connection.batch("rollback")).await,
    };
    match is_over {
        Ok(()) => *held = Some(connection),
        Err(error) => tracing::error!(%error, "the connection to the database is given up"),
    }
    (ended, outcome)
}

/// A connection on which a transaction has begun: the one at hand, or a new one where that is lost.
async fn begun(source: &Source, held: Option<Connection>) -> Result<Connection, StoreError> {
    if let Some(mut connection) = held {
        match in_time(source.patience().turn, connection.begin()).await {
            Ok(()) => return Ok(connection),
            Err(error) => tracing::warn!(%error, "the connection to the database is lost"),
        }
    }
    let mut connection = source.writer().await?;
    in_time(source.patience().turn, connection.begin()).await?;
    Ok(connection)
}

async fn run_some(
    connection: &mut Connection,
    first: &mut [Box<dyn Write>],
    writes: &mut [Box<dyn Write>],
    patient: Option<&mut Box<dyn Write>>,
    ended: &mut usize,
) -> Result<(), StoreError> {
    // What ends a write goes to the database together with what begins the next; the last ends with the transaction.
    let mut between = "savepoint one_write";
    const NEXT: &str = "release savepoint one_write; savepoint one_write";
    for write in first {
        run_one(connection, between, write).await?;
        between = NEXT;
    }
    let start = Instant::now();
    for write in writes {
        *ended += 1;
        run_one(connection, between, write).await?;
        between = NEXT;
        if start.elapsed() >= GROUPED {
            break;
        }
    }
    match patient {
        Some(write) => run_one(connection, between, write).await,
        None => Ok(()),
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
