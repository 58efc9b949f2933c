//! Tasks that a coordinator cannot do without.
//!
//! None of them ends before the coordinator stops. When one panics, the coordinator would answer requests without
//! doing its work. So the whole process ends, and a supervisor restarts it.

use std::any::Any;
use std::future::Future;

use tokio::task::{JoinError, JoinSet};
use tokio_util::task::AbortOnDropHandle;
use tracing::Instrument;

/// A needed task has ended.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Ended {
    /// What it does.
    pub(crate) task: &'static str,
    /// How it ended.
    pub(crate) problem: String,
}

impl Ended {
    /// A task that has ended so.
    pub(crate) fn of(task: &'static str, ended: Result<(), JoinError>) -> Self {
        Self { task, problem: ended.map_or_else(problem, |()| "it ended".to_owned()) }
    }
}

/// Tasks, each with what it does. Dropping them ends them.
#[derive(Debug, Default)]
pub(crate) struct Tasks(JoinSet<(&'static str, Result<(), JoinError>)>);

impl Tasks {
    /// Starts a task.
    pub(crate) fn spawn(&mut self, task: &'static str, work: impl Future<Output = ()> + Send + 'static) {
        self.add(task, AbortOnDropHandle::new(tokio::spawn(work)));
    }

    /// Adds a running task.
    pub(crate) fn add(&mut self, task: &'static str, handle: AbortOnDropHandle<()>) {
        self.0.spawn(async move { (task, handle.await) });
    }

    /// Waits until a task ends. `None` after all have ended.
    pub(crate) async fn next_ended(&mut self) -> Option<Ended> {
        Some(match self.0.join_next().await? {
            Ok((task, ended)) => Ended::of(task, ended),
            // Nothing aborts the tasks that wait for tasks.
            Err(error) => Ended::of("waiting for a task", Err(error)),
        })
    }

    /// Waits until all have ended, and logs those that failed.
    pub(crate) async fn all_ended(&mut self) {
        while let Some(ended) = self.0.join_next().await {
            if let Ok((task, Err(error))) = ended {
                tracing::error!(task, problem = problem(error), "a task failed while the coordinator stopped");
            }
        }
    }
}

/// Runs work to completion that must not be interrupted, such as a write with its notification. The future of a
/// request is dropped at any point when its caller disconnects.
///
/// # Errors
///
/// When the work panics.
pub(crate) async fn to_completion<T: Send + 'static>(
    work: impl Future<Output = T> + Send + 'static,
) -> Result<T, JoinError> {
    tokio::spawn(work.in_current_span()).await
}

fn problem(error: JoinError) -> String {
    match error.try_into_panic() {
        Ok(panic) => panic_message(&*panic),
        Err(error) => error.to_string(),
    }
}

/// What a panic says.
pub(crate) fn panic_message(panic: &(dyn Any + Send)) -> String {
    let words = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("it panicked: {}", words.unwrap_or("without a word"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_task_that_panics_or_ends_is_named_with_what_it_said() {
        let mut tasks = Tasks::default();
        tasks.spawn("going on", std::future::pending());
        tasks.spawn("polishing", async { panic!("no {}", "cloth") });
        let ended = tasks.next_ended().await.unwrap();
        assert_eq!(ended, Ended { task: "polishing", problem: "it panicked: no cloth".to_owned() });
        tasks.spawn("leading", async {});
        assert_eq!(tasks.next_ended().await.unwrap().task, "leading");
    }
}
