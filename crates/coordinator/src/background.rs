//! Threads for work that no request waits for: what the [keeper](crate::keeper) does.
//!
//! Rounds become complete for many tiles at once, and merging them takes all processors for as long as it lasts. Threads that merge are of
//! lower priority than those that answer, so that leases are granted meanwhile as at any other time. They are a runtime of their own,
//! whose blocking threads are of that priority too.

use std::future::Future;
use std::io;

use rustix::process::{getpriority_process, setpriority_process};
use tokio::runtime::{Builder, Handle, Runtime};
use tokio_util::task::AbortOnDropHandle;

/// How far below the others' priority these threads' is, as nice values count: they get a quarter of a processor that another wants all of.
const LOWER: i32 = 5;

/// The lowest priority that there is.
const LOWEST: i32 = 19;

/// Threads on which tasks are polled; what takes long runs on others.
const THREADS: usize = 2;

/// The threads. Whoever drops them drops what runs there.
#[derive(Debug)]
pub(crate) struct Background {
    handle: Handle,
    runtime: Option<Runtime>,
}

impl Background {
    /// Starts them.
    pub(crate) fn start() -> io::Result<Self> {
        let mut builder = Builder::new_multi_thread();
        builder.worker_threads(THREADS).thread_name("background").enable_all();
        // Of the systems that have priorities, Linux keeps one for each thread.
        if cfg!(target_os = "linux") {
            let priority = (getpriority_process(None)? + LOWER).min(LOWEST);
            builder.on_thread_start(move || {
                if let Err(error) = setpriority_process(None, priority) {
                    tracing::debug!(%error, "a thread that merges has the priority of all else");
                }
            });
        }
        let runtime = builder.build()?;
        Ok(Self { handle: runtime.handle().clone(), runtime: Some(runtime) })
    }

    /// Runs a task on them, until it ends or the answer is dropped.
    pub(crate) fn spawn<T: Send + 'static>(
        &self,
        task: impl Future<Output = T> + Send + 'static,
    ) -> AbortOnDropHandle<T> {
        AbortOnDropHandle::new(self.handle.spawn(task))
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            // Tasks drop it, and those must not wait.
            runtime.shutdown_background();
        }
    }
}
