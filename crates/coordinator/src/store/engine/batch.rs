//! Batches: writes of one kind that share a few statements.
//!
//! Writes that arrive while one waits for its turn join its batch. Thousands of workers send heartbeats and renew
//! leases every few seconds. Batches go [first](Turn::First), before all other writes.

use std::mem;
use std::sync::{Arc, Mutex, PoisonError};

use futures::future::BoxFuture;
use tokio::sync::oneshot;

use crate::store::engine::error::StoreError;
use crate::store::engine::source::Connection;
use crate::store::engine::writer::{Turn, Writer};

/// Most writes in a batch: all other writes wait meanwhile.
const MOST: usize = 256;

/// The outcomes of the writes of a batch, in their order.
pub(in crate::store) type Outcomes<T, E> = Result<Vec<Result<T, E>>, StoreError>;

/// Writes a batch.
pub(in crate::store) type WriteAll<W, T, E> = for<'c> fn(&'c mut Connection, Vec<W>) -> BoxFuture<'c, Outcomes<T, E>>;

/// Writes of one kind that wait.
#[derive(Debug)]
pub(in crate::store) struct Batch<W, T, E> {
    waiting: Arc<Mutex<Vec<Waiting<W, T, E>>>>,
}

#[derive(Debug)]
struct Waiting<W, T, E> {
    write: W,
    reply: oneshot::Sender<Result<T, E>>,
}

impl<W, T, E> Clone for Batch<W, T, E> {
    fn clone(&self) -> Self {
        Self { waiting: Arc::clone(&self.waiting) }
    }
}

impl<W, T, E> Default for Batch<W, T, E> {
    fn default() -> Self {
        Self { waiting: Arc::default() }
    }
}

impl<W, T, E> Batch<W, T, E>
where
    W: Clone + Send + 'static,
    T: Send + 'static,
    E: From<StoreError> + Send + 'static,
{
    /// Writes with the next batch.
    pub(in crate::store) async fn write(&self, writer: &Writer, write: W, all: WriteAll<W, T, E>) -> Result<T, E> {
        let (reply, answer) = oneshot::channel();
        if self.add(Waiting { write, reply }) {
            self.begin(writer, all);
        }
        answer.await.unwrap_or_else(|_| Err(StoreError::Closed.into()))
    }

    /// Begins a batch. Other callers depend on it, so it goes on when its first caller disconnects.
    fn begin(&self, writer: &Writer, all: WriteAll<W, T, E>) {
        let written: BoxFuture<'static, ()> = Box::pin(self.clone().write_all(writer.clone(), all));
        tokio::spawn(written);
    }

    /// Adds a write, and answers whether it is the first of its batch.
    fn add(&self, write: Waiting<W, T, E>) -> bool {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.push(write);
        waiting.len() == 1
    }

    fn put(&self, writes: Vec<Waiting<W, T, E>>) {
        *self.waiting.lock().unwrap_or_else(PoisonError::into_inner) = writes;
    }

    fn take(&self) -> Vec<Waiting<W, T, E>> {
        mem::take(&mut *self.waiting.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Takes the writes of one batch, and answers whether more wait.
    fn take_some(&self) -> (Vec<Waiting<W, T, E>>, bool) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let most = waiting.len().min(MOST);
        let rest = waiting.split_off(most);
        (mem::replace(&mut *waiting, rest), !waiting.is_empty())
    }

    async fn write_all(self, writer: Writer, all: WriteAll<W, T, E>) {
        let taken = Self::default();
        let (batch, writing, again) = (self.clone(), taken.clone(), writer.clone());
        let written = writer.write(Turn::First, move |connection| {
            Box::pin(async move {
                let (waiting, is_more) = batch.take_some();
                if is_more {
                    batch.begin(&again, all);
                }
                let writes = waiting.iter().map(|waiting| waiting.write.clone()).collect();
                writing.put(waiting);
                all(connection, writes).await
            })
        });
        match written.await {
            Ok(outcomes) => {
                for (waiting, outcome) in taken.take().into_iter().zip(outcomes) {
                    // The caller may have gone away.
                    let _ = waiting.reply.send(outcome);
                }
            }
            Err(error) => {
                let error: StoreError = error;
                let mut failed = taken.take();
                if failed.is_empty() {
                    // No transaction took them. The next write begins a batch again.
                    failed = self.take();
                }
                for waiting in failed {
                    let _ = waiting.reply.send(Err(error.clone().into()));
                }
            }
        }
    }
}
