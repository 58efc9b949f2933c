//! Memory for submissions that are validated, and the queue for it.
//!
//! The memory of a submission is known before it is taken. Small submissions have memory of their own, so that they do
//! not wait for a large one that takes seconds. The queue is short, and waits in it are short: a caller that is turned
//! away tries again.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use tokio::sync::OwnedSemaphorePermit;

use crate::memory::{MemoryBudget, permits};

/// Bytes of memory for each byte of a submission while it is parsed, most of which are numbers of inline meshes, and
/// for what it is parsed to.
const PARSED_BYTES: u64 = 32;
const DESCRIBED_BYTES: u64 = 4;

/// Largest memory of a small submission, and its largest body.
const SMALL: u64 = 16 << 20;
const SMALL_BODY: u64 = SMALL / PARSED_BYTES;

/// Memory for bodies that are received: of small submissions, and of all others.
const BODIES: [u64; 2] = [16 << 20, 64 << 20];

/// Memory for submissions that are parsed, and for what they are parsed to.
const PARSED: [u64; 2] = [64 << 20, 256 << 20];

/// Memory for the files of small scenes.
const SMALL_SCENES: u64 = 64 << 20;

/// Most submissions that wait for memory.
const MOST_WAITING: usize = 64;

/// Longest wait for memory: proxies give up after half a minute or a minute.
const LONGEST_WAIT: Duration = Duration::from_secs(20);

/// The coordinator is busy with other submissions, and has no memory for this one yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the coordinator is busy with other submissions, and has no memory for this one yet; try again")]
pub(crate) struct Busy;

impl Busy {
    /// Pause before the caller should try again.
    pub(crate) const RETRY_AFTER: Duration = Duration::from_secs(5);
}

/// The memory of all submissions.
#[derive(Debug)]
pub(crate) struct SubmissionMemory {
    bodies: Pool,
    parsed: Pool,
    scenes: Pool,
    waiting: AtomicUsize,
    longest_wait: Duration,
}

/// Memory for small things of one kind, and for large ones.
#[derive(Debug)]
struct Pool {
    small: MemoryBudget,
    large: MemoryBudget,
}

impl Pool {
    fn new(bytes: [u64; 2]) -> Self {
        let [small, large] = bytes.map(MemoryBudget::new);
        Self { small, large }
    }

    fn of(&self, is_small: bool) -> &MemoryBudget {
        if is_small { &self.small } else { &self.large }
    }
}

/// Memory of one submission, freed when it is dropped.
#[derive(Debug)]
pub(crate) struct Room {
    permit: OwnedSemaphorePermit,
}

impl Room {
    /// Frees all but these bytes.
    pub(crate) fn shrink(&mut self, bytes: u64) {
        let surplus = self.permit.num_permits().saturating_sub(permits(bytes) as usize);
        drop(self.permit.split(surplus));
    }
}

/// Memory of a submission while it is parsed.
#[derive(Debug)]
pub(crate) struct ParsingRoom {
    room: Room,
    described: u64,
}

impl ParsingRoom {
    /// Frees the memory that only parsing needs. The rest is kept while the scene is described.
    pub(crate) fn parsed(mut self) -> Room {
        self.room.shrink(self.described);
        self.room
    }
}

impl SubmissionMemory {
    /// Memory in which the files of large scenes take `bytes` together. Small ones have a pool of their own.
    pub(crate) fn new(bytes: u64) -> Self {
        Self {
            bodies: Pool::new(BODIES),
            parsed: Pool::new(PARSED),
            scenes: Pool::new([SMALL_SCENES, bytes]),
            waiting: AtomicUsize::new(0),
            longest_wait: LONGEST_WAIT,
        }
    }

    /// Waits for memory for a body of at most these bytes.
    pub(crate) async fn for_body(&self, bytes: u64) -> Result<Room, Busy> {
        self.wait(&self.bodies, bytes, bytes <= SMALL_BODY).await
    }

    /// Waits for memory to parse a body of these bytes.
    pub(crate) async fn for_parsing(&self, body_bytes: u64) -> Result<ParsingRoom, Busy> {
        let [_, most] = PARSED;
        let [bytes, described] = [PARSED_BYTES, DESCRIBED_BYTES].map(|each| body_bytes.saturating_mul(each).min(most));
        Ok(ParsingRoom { room: self.wait(&self.parsed, bytes, bytes <= SMALL).await?, described })
    }

    /// Waits for memory for the files of a scene, of these bytes.
    pub(crate) async fn for_scene(&self, bytes: u64) -> Result<Room, Busy> {
        self.wait(&self.scenes, bytes, bytes <= SMALL).await
    }

    async fn wait(&self, pool: &Pool, bytes: u64, is_small: bool) -> Result<Room, Busy> {
        let memory = pool.of(is_small);
        if let Some(permit) = memory.try_reserve(bytes) {
            return Ok(Room { permit });
        }
        let queued = Queued::enter(&self.waiting).ok_or(Busy)?;
        let permit = tokio::time::timeout(self.longest_wait, memory.reserve_owned(bytes)).await.map_err(|_| Busy)?;
        drop(queued);
        Ok(Room { permit })
    }
}

/// A place in the queue, freed when it is dropped.
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    const LARGE: u64 = SMALL + 1;

    #[tokio::test]
    async fn a_small_scene_does_not_wait_for_a_large_one() {
        let submissions = SubmissionMemory::new(LARGE);
        let large = submissions.for_scene(LARGE).await.unwrap();
        let small = submissions.for_scene(1).await.unwrap();
        assert_eq!(submissions.scenes.large.available_permits(), 0, "there is no memory for two large ones");
        drop((small, large));
        submissions.for_scene(LARGE).await.unwrap();
    }

    #[tokio::test]
    async fn a_small_submission_does_not_wait_for_large_ones_that_come_or_are_parsed() {
        let submissions = SubmissionMemory::new(LARGE);
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
    async fn nobody_waits_for_long() {
        let submissions = SubmissionMemory { longest_wait: Duration::from_millis(1), ..SubmissionMemory::new(LARGE) };
        let held = submissions.for_scene(LARGE).await.unwrap();
        submissions.for_scene(LARGE).await.unwrap_err();
        drop(held);
        submissions.for_scene(LARGE).await.unwrap();
    }

    #[tokio::test]
    async fn the_queue_is_short() {
        let submissions = Arc::new(SubmissionMemory::new(LARGE));
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
