//! Memory for submissions that are checked, and the queue for it.
//!
//! What a submission takes is known before it is taken. Small ones have memory of their own, so that they do not wait for a large one that takes
//! seconds. The queue is short, and nobody waits in it for long: a caller that is turned away comes back.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use clerestory_api::ProblemCode;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::farm::permits;
use crate::http::ApiError;

/// Bytes of memory for each byte of a submission, for what it is parsed to. Most of it are numbers of inline meshes.
const PARSED_BYTES: u64 = 32;

/// Memory for submissions that are parsed, or wait for more.
const PARSED_TOGETHER: u64 = 256 << 20;

/// A scene that takes no more is small.
const SMALL: u64 = 16 << 20;

/// Memory for small scenes.
const SMALL_TOGETHER: u64 = 64 << 20;

/// Most submissions that wait for memory.
const MOST_WAITING: usize = 64;

/// Longest wait for memory: proxies give up after a minute or half of one.
const LONGEST_WAIT: Duration = Duration::from_secs(20);

/// When a caller that is turned away is to come back.
const COMES_BACK_AFTER: Duration = Duration::from_secs(5);

/// The memory of all submissions.
#[derive(Debug)]
pub(crate) struct Submissions {
    parsed: Arc<Semaphore>,
    small: Arc<Semaphore>,
    large: Arc<Semaphore>,
    waiting: AtomicUsize,
    longest_wait: Duration,
}

/// Memory of one submission; free again when it is dropped.
#[derive(Debug)]
pub(crate) struct Room {
    _permit: OwnedSemaphorePermit,
    bytes: u64,
    /// Whether it is part of what small scenes have.
    pub(crate) is_small: bool,
}

impl Submissions {
    /// Memory for scenes that take so many bytes together, besides what small ones have.
    pub(crate) fn new(bytes: u64) -> Self {
        let [parsed, small, large] =
            [PARSED_TOGETHER, SMALL_TOGETHER, bytes].map(|bytes| Arc::new(Semaphore::new(permits(bytes) as usize)));
        Self { parsed, small, large, waiting: AtomicUsize::new(0), longest_wait: LONGEST_WAIT }
    }

    /// Waits for memory for a submission that is parsed, whose body has so many bytes.
    pub(crate) async fn for_parsed(&self, body_bytes: u64) -> Result<Room, ApiError> {
        let bytes = body_bytes.saturating_mul(PARSED_BYTES).min(PARSED_TOGETHER);
        self.wait(&self.parsed, bytes, false).await
    }

    /// Waits for memory for a scene that takes so many bytes, no more than there are for all.
    pub(crate) async fn for_scene(&self, bytes: u64) -> Result<Room, ApiError> {
        let is_small = bytes <= SMALL;
        self.wait(if is_small { &self.small } else { &self.large }, bytes, is_small).await
    }

    /// Takes the memory for a scene of which more is known, if it is free; `room` is the memory that it has.
    pub(crate) fn grow(&self, room: Room, bytes: u64) -> Option<Room> {
        if bytes <= room.bytes {
            return Some(room);
        }
        let is_small = bytes <= SMALL;
        let semaphore = if is_small { &self.small } else { &self.large };
        let held = if is_small == room.is_small { permits(room.bytes) } else { 0 };
        let mut permit = Arc::clone(semaphore).try_acquire_many_owned(permits(bytes).saturating_sub(held)).ok()?;
        if held > 0 {
            permit.merge(room._permit);
        }
        Some(Room { _permit: permit, bytes, is_small })
    }

    async fn wait(&self, semaphore: &Arc<Semaphore>, bytes: u64, is_small: bool) -> Result<Room, ApiError> {
        let queued = Queued::enter(&self.waiting).ok_or_else(busy)?;
        let permit = Arc::clone(semaphore).acquire_many_owned(permits(bytes));
        let permit = tokio::time::timeout(self.longest_wait, permit).await.map_err(|_| busy())?;
        drop(queued);
        Ok(Room { _permit: permit.map_err(ApiError::internal)?, bytes, is_small })
    }
}

/// A place in the queue, free again when it is dropped.
struct Queued<'a>(&'a AtomicUsize);

impl<'a> Queued<'a> {
    fn enter(waiting: &'a AtomicUsize) -> Option<Self> {
        let entered = Self(waiting);
        (waiting.fetch_add(1, Ordering::Relaxed) < MOST_WAITING).then_some(entered)
    }
}

impl Drop for Queued<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

fn busy() -> ApiError {
    let detail = "the coordinator is checking other submissions, and has no memory for this one yet; try again";
    ApiError::new(ProblemCode::Unavailable, detail).retry_after(COMES_BACK_AFTER)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LARGE: u64 = SMALL + 1;

    #[tokio::test]
    async fn a_small_scene_does_not_wait_for_a_large_one() {
        let submissions = Submissions::new(LARGE);
        let large = submissions.for_scene(LARGE).await.unwrap();
        let small = submissions.for_scene(1).await.unwrap();
        assert!(small.is_small && !large.is_small);
        assert!(submissions.grow(small, LARGE).is_none(), "there is no memory for two");
        drop(large);
        submissions.for_scene(LARGE).await.unwrap();
    }

    #[tokio::test]
    async fn memory_grows_by_what_is_missing_and_all_of_it_is_free_again() {
        let submissions = Submissions::new(2 * LARGE);
        let room = submissions.for_scene(LARGE).await.unwrap();
        let room = submissions.grow(room, 2 * LARGE).unwrap();
        assert!(submissions.grow(submissions.for_scene(1).await.unwrap(), LARGE).is_none());
        drop(room);
        let room = submissions.grow(submissions.for_scene(1).await.unwrap(), 2 * LARGE).unwrap();
        assert!(!room.is_small);
        drop(room);
        assert_eq!(submissions.large.available_permits(), permits(2 * LARGE) as usize);
        assert_eq!(submissions.small.available_permits(), permits(SMALL_TOGETHER) as usize);
    }

    #[tokio::test]
    async fn nobody_waits_for_long() {
        let submissions = Submissions { longest_wait: Duration::from_millis(1), ..Submissions::new(LARGE) };
        let held = submissions.for_scene(LARGE).await.unwrap();
        submissions.for_scene(LARGE).await.unwrap_err();
        drop(held);
        submissions.for_scene(LARGE).await.unwrap();
    }

    #[tokio::test]
    async fn the_queue_is_short() {
        let submissions = Arc::new(Submissions::new(LARGE));
        let held = submissions.for_scene(LARGE).await.unwrap();
        let waiting: Vec<_> = (0..MOST_WAITING)
            .map(|_| {
                let submissions = Arc::clone(&submissions);
                tokio::spawn(async move { submissions.for_scene(LARGE).await.map(drop) })
            })
            .collect();
        while submissions.waiting.load(Ordering::Relaxed) < MOST_WAITING {
            tokio::task::yield_now().await;
        }
        submissions.for_scene(LARGE).await.unwrap_err();
        drop(held);
        for waiting in waiting {
            waiting.await.unwrap().unwrap();
        }
        submissions.for_scene(LARGE).await.unwrap();
    }
}
