//! Memory for submissions that are checked, and the queue for it.
//!
//! What a submission takes is known before it is taken. Small ones have memory of their own, so that they do not wait for a large one that takes
//! seconds. The queue is short, and nobody waits in it for long: a caller that is turned away comes back.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use clerestory_api::ProblemCode;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::http::problem::ApiError;
use crate::memory::permits;

/// Bytes of memory for each byte of a submission while it is parsed, most of which are numbers of inline meshes, and for what it is parsed to.
const PARSED_BYTES: u64 = 32;
const DESCRIBED_BYTES: u64 = 4;

/// A submission that takes no more is small, and a body of which no more is parsed.
const SMALL: u64 = 16 << 20;
const SMALL_BODY: u64 = SMALL / PARSED_BYTES;

/// Memory for bodies that are received: for small ones, and for all others.
const BODIES: [u64; 2] = [16 << 20, 64 << 20];

/// Memory for submissions that are parsed, and for what they are parsed to.
const PARSED: [u64; 2] = [64 << 20, 256 << 20];

/// Memory for small scenes that are checked.
const SMALL_SCENES: u64 = 64 << 20;

/// Most submissions that wait for memory.
const MOST_WAITING: usize = 64;

/// Longest wait for memory: proxies give up after a minute or half of one.
const LONGEST_WAIT: Duration = Duration::from_secs(20);

/// When a caller that is turned away is to come back.
const COMES_BACK_AFTER: Duration = Duration::from_secs(5);

/// The memory of all submissions.
#[derive(Debug)]
pub(crate) struct Submissions {
    bodies: Pool,
    parsed: Pool,
    scenes: Pool,
    waiting: AtomicUsize,
    longest_wait: Duration,
}

/// Memory for small things of one kind, and for large ones.
#[derive(Debug)]
struct Pool {
    small: Arc<Semaphore>,
    large: Arc<Semaphore>,
}

impl Pool {
    fn new(bytes: [u64; 2]) -> Self {
        let [small, large] = bytes.map(|bytes| Arc::new(Semaphore::new(permits(bytes) as usize)));
        Self { small, large }
    }

    fn of(&self, is_small: bool) -> &Arc<Semaphore> {
        if is_small { &self.small } else { &self.large }
    }
}

/// Memory of one submission; free again when it is dropped.
#[derive(Debug)]
pub(crate) struct Room {
    permit: OwnedSemaphorePermit,
    bytes: u64,
    /// Whether it is part of what small ones have.
    pub(crate) is_small: bool,
}

impl Room {
    /// Gives back what is more than these bytes.
    pub(crate) fn shrink(&mut self, bytes: u64) {
        let surplus = self.permit.num_permits().saturating_sub(permits(bytes) as usize);
        drop(self.permit.split(surplus));
        self.bytes = self.bytes.min(bytes);
    }
}

/// Memory of a submission while it is parsed.
#[derive(Debug)]
pub(crate) struct ParsingRoom {
    room: Room,
    described: u64,
}

impl ParsingRoom {
    /// Gives back what is only needed while it is parsed, and keeps the rest as long as the scene is described.
    pub(crate) fn parsed(mut self) -> Room {
        self.room.shrink(self.described);
        self.room
    }
}

impl Submissions {
    /// Memory for scenes that take so many bytes together, besides what small ones have.
    pub(crate) fn new(bytes: u64) -> Self {
        Self {
            bodies: Pool::new(BODIES),
            parsed: Pool::new(PARSED),
            scenes: Pool::new([SMALL_SCENES, bytes]),
            waiting: AtomicUsize::new(0),
            longest_wait: LONGEST_WAIT,
        }
    }

    /// Waits for memory for a body that is received, of so many bytes at the most.
    pub(crate) async fn for_body(&self, bytes: u64) -> Result<Room, ApiError> {
        self.wait(&self.bodies, bytes, bytes <= SMALL_BODY).await
    }

    /// Waits for memory to parse a body of so many bytes.
    pub(crate) async fn for_parsing(&self, body_bytes: u64) -> Result<ParsingRoom, ApiError> {
        let [_, most] = PARSED;
        let [bytes, described] = [PARSED_BYTES, DESCRIBED_BYTES].map(|each| body_bytes.saturating_mul(each).min(most));
        Ok(ParsingRoom { room: self.wait(&self.parsed, bytes, bytes <= SMALL).await?, described })
    }

    /// Waits for memory for a scene that takes so many bytes, no more than there are for all.
    pub(crate) async fn for_scene(&self, bytes: u64) -> Result<Room, ApiError> {
        self.wait(&self.scenes, bytes, bytes <= SMALL).await
    }

    /// Takes the memory for a scene of which more is known, if it is free; `room` is the memory that it has.
    pub(crate) fn grow(&self, room: Room, bytes: u64) -> Option<Room> {
        if bytes <= room.bytes {
            return Some(room);
        }
        let is_small = bytes <= SMALL;
        let semaphore = self.scenes.of(is_small);
        let held = if is_small == room.is_small { permits(room.bytes) } else { 0 };
        let mut permit = Arc::clone(semaphore).try_acquire_many_owned(permits(bytes).saturating_sub(held)).ok()?;
        if held > 0 {
            permit.merge(room.permit);
        }
        Some(Room { permit, bytes, is_small })
    }

    async fn wait(&self, pool: &Pool, bytes: u64, is_small: bool) -> Result<Room, ApiError> {
        let (memory, needed) = (pool.of(is_small), permits(bytes));
        if let Ok(permit) = Arc::clone(memory).try_acquire_many_owned(needed) {
            return Ok(Room { permit, bytes, is_small });
        }
        let queued = Queued::enter(&self.waiting).ok_or_else(busy)?;
        let permit = tokio::time::timeout(self.longest_wait, Arc::clone(memory).acquire_many_owned(needed));
        let permit = permit.await.map_err(|_| busy())?.map_err(ApiError::internal)?;
        drop(queued);
        Ok(Room { permit, bytes, is_small })
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
    async fn a_small_submission_does_not_wait_for_large_ones_that_come_or_are_parsed() {
        let submissions = Submissions::new(LARGE);
        let body = SMALL_BODY + 1;
        let (mut coming, mut parsed) = (Vec::new(), Vec::new());
        while submissions.bodies.large.available_permits() >= permits(body) as usize {
            coming.push(submissions.for_body(body).await.unwrap());
        }
        while submissions.parsed.large.available_permits() >= permits(body * PARSED_BYTES) as usize {
            parsed.push(submissions.for_parsing(body).await.unwrap());
        }
        submissions.for_body(SMALL_BODY).await.unwrap();
        submissions.for_parsing(SMALL_BODY).await.unwrap();
        // What has been parsed leaves room for the next.
        let described: Vec<Room> = parsed.into_iter().map(ParsingRoom::parsed).collect();
        submissions.for_parsing(body).await.unwrap();
        drop(described);
        let [_, most] = PARSED;
        assert_eq!(submissions.parsed.large.available_permits(), permits(most) as usize);
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
        assert_eq!(submissions.scenes.large.available_permits(), permits(2 * LARGE) as usize);
        assert_eq!(submissions.scenes.small.available_permits(), permits(SMALL_SCENES) as usize);
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
        submissions.for_scene(SMALL).await.expect("what is free is not waited for");
        drop(held);
        for waiting in waiting {
            waiting.await.unwrap().unwrap();
        }
        submissions.for_scene(LARGE).await.unwrap();
    }
}
