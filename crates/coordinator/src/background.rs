//! Background threads: they finalize rounds, for which no request waits.
//!
//! Many tiles become complete at once, and merging them takes all processors for a while. These threads have a lower
//! priority than those that answer requests, so that leases are granted meanwhile as at any other time. They are a
//! runtime of their own, whose blocking threads have the same priority.

use std::future::Future;
use std::io;

use rustix::process::{getpriority_process, setpriority_process};
use tokio::runtime::{Builder, Handle, Runtime};
use tokio_util::task::AbortOnDropHandle;

/// How far below the usual priority they run, in nice values: a busy processor gives them a quarter of its time.
const LOWER: i32 = 5;

/// The lowest priority of the system.
const LOWEST: i32 = 19;

/// Threads that poll tasks. Long computations run on blocking threads.
const THREADS: usize = 2;

/// The threads. Dropping them drops their tasks.
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
        // Linux has a priority for each thread. Other systems have none, or one for the process.
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

    /// Runs a task until it ends or the handle is dropped.
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
            // A task may drop it, and a task must not wait.
            runtime.shutdown_background();
        }
    }
}
