//! Visits of the round finalizer to films: one task at a time for each job, and a pause after each failure.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use clerestory_api::JobId;
use tokio::sync::mpsc;
use tokio::task::JoinSet;

use super::film_state::FilmState;
use super::finalizer::RoundFinalizer;

/// Visits films until the coordinator stops.
pub(crate) async fn run(finalizer: Arc<RoundFinalizer>, mut films: mpsc::UnboundedReceiver<JobId>) {
    let mut visits = Visits { finalizer, films: BTreeMap::new(), running: JoinSet::new() };
    let mut waiting = Vec::new();
    loop {
        tokio::select! {
            () = visits.finalizer.stopping().cancelled() => break,
            count = films.recv_many(&mut waiting, 1024) => {
                if count == 0 {
                    break;
                }
                let jobs: BTreeSet<JobId> = waiting.drain(..).collect();
                for job in jobs {
                    visits.begin(job);
                }
            }
            Some(visited) = visits.running.join_next() => match visited {
                Ok((job, state)) => visits.end(job, state),
                Err(error) => tracing::error!(%error, "a visit to a film failed"),
            },
        }
    }
    while visits.running.join_next().await.is_some() {}
    if let Err(error) = visits.finalizer.release_leases().await {
        tracing::warn!(%error, "the film leases of this coordinator end by themselves in some seconds");
    }
}

struct Visits {
    finalizer: Arc<RoundFinalizer>,
    films: BTreeMap<JobId, Film>,
    running: JoinSet<(JobId, Option<FilmState>)>,
}

/// The film of a job.
enum Film {
    /// No task visits it.
    Idle(FilmState),
    /// A task visits it.
    Visited {
        /// Whether it was notified since.
        again: bool,
    },
}

impl Visits {
    /// Visits a film, at once or after the running visit.
    fn begin(&mut self, job: JobId) {
        let state = match self.films.get_mut(&job) {
            Some(Film::Visited { again }) => {
                *again = true;
                return;
            }
            Some(Film::Idle(state)) if state.is_backing_off() => return,
            Some(Film::Idle(state)) => std::mem::take(state),
            None => FilmState::default(),
        };
        self.films.insert(job, Film::Visited { again: false });
        let finalizer = Arc::clone(&self.finalizer);
        self.running.spawn(async move {
            let visiting = Arc::clone(&finalizer);
            // In a task of its own: a visit that panics counts as one that failed.
            let visited = tokio::spawn(async move { visiting.visit(job, state).await });
            let state = visited.await.unwrap_or_else(|error| {
                tracing::error!(%job, %error, "finalizing the rounds of a film failed");
                let mut state = FilmState { failures: u32::MAX, ..FilmState::default() };
                finalizer.wake_after(job, state.back_off());
                Some(state)
            });
            (job, state)
        });
    }

    /// Stores the state that a visit has left, or forgets a job that has ended.
    fn end(&mut self, job: JobId, state: Option<FilmState>) {
        let visited = self.films.remove(&job);
        if let Some(state) = state {
            self.films.insert(job, Film::Idle(state));
        }
        if matches!(visited, Some(Film::Visited { again: true })) {
            self.begin(job);
        }
    }
}
