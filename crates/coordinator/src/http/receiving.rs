//! Memory for partials that are received, and the pieces of partials on their way.

use bytes::{Bytes, BytesMut};
use clerestory_api::{ContentHash, LeaseId};
use tokio::sync::{Semaphore, SemaphorePermit};

use super::extract::ArrivingBody;
use super::problem::ApiError;
use crate::blobs::{BlobError, Blobs};
use crate::memory::MemoryBudget;

/// Bytes of partials that are received at the same time, beside one that exceeds them.
const RECEIVED_BYTES: u64 = 32 << 20;

/// Bytes of a partial that are reserved before they arrive. Few partials are larger, and a sender that stops holds
/// little.
const RESERVED_BYTES: u64 = 1 << 20;

/// Memory for partials that are received, and where pieces of partials are stored.
#[derive(Debug)]
pub(crate) struct ReceivingMemory {
    blobs: Blobs,
    budget: MemoryBudget,
    /// Permit to receive the rest of a partial beyond the budget: partials that have begun to arrive could wait for
    /// each other.
    beyond: Semaphore,
}

impl ReceivingMemory {
    /// Memory of which everything is free.
    pub(crate) fn new(blobs: Blobs) -> Self {
        Self { blobs, budget: MemoryBudget::new(RECEIVED_BYTES), beyond: Semaphore::new(1) }
    }

    /// Receives a body as its memory becomes free.
    pub(super) async fn receive(&self, mut arriving: ArrivingBody) -> Result<(Bytes, Room<'_>), ApiError> {
        let mut room = self.room(arriving.announced_bytes());
        room.widen_to(1).await;
        let announced = arriving.announced_bytes().unwrap_or(0);
        let mut body = BytesMut::with_capacity(announced.min(RESERVED_BYTES) as usize);
        while let Some(piece) = arriving.piece().await? {
            room.widen_to((body.len() + piece.len()) as u64).await;
            body.extend_from_slice(&piece);
        }
        Ok((body.freeze(), room))
    }

    /// Memory for a partial of these announced bytes, of which none is reserved yet.
    pub(super) fn room(&self, announced: Option<u64>) -> Room<'_> {
        Room { memory: self, announced, bytes: 0, permits: Vec::new(), beyond: None }
    }

    /// Stores a piece of a partial.
    pub(super) async fn put_piece(&self, lease: LeaseId, hash: ContentHash, piece: Bytes) -> Result<(), BlobError> {
        self.blobs.put_piece(lease, hash, piece).await
    }

    /// Bytes of a stored piece, or `None` when it is not there.
    pub(super) async fn piece_size(&self, lease: LeaseId, hash: ContentHash) -> Result<Option<u64>, BlobError> {
        self.blobs.piece_size(lease, hash).await
    }

    /// A stored piece.
    pub(super) async fn piece(&self, lease: LeaseId, hash: ContentHash) -> Result<Bytes, BlobError> {
        self.blobs.piece(lease, hash).await
    }

    /// Removes stored pieces.
    pub(super) async fn remove_pieces(&self, lease: LeaseId, pieces: &[ContentHash]) {
        self.blobs.remove_pieces(lease, pieces).await;
    }
}

/// Memory of one partial, reserved as it arrives. A sender that announces much and sends nothing reserves little.
pub(super) struct Room<'a> {
    memory: &'a ReceivingMemory,
    announced: Option<u64>,
    /// Reserved bytes.
    bytes: u64,
    permits: Vec<SemaphorePermit<'a>>,
    /// Allows any number of bytes.
    beyond: Option<SemaphorePermit<'a>>,
}

impl Room<'_> {
    /// Waits until these bytes are reserved.
    pub(super) async fn widen_to(&mut self, bytes: u64) {
        let memory = self.memory;
        while self.bytes < bytes && self.beyond.is_none() {
            let rest = self.announced.map_or(RESERVED_BYTES, |announced| announced.saturating_sub(self.bytes));
            let more = rest.clamp(1, RESERVED_BYTES);
            let reserved = memory.budget.reserve(more);
            if self.bytes == 0 {
                self.permits.push(reserved.await);
            } else {
                tokio::select! {
                    biased;
                    reserved = reserved => self.permits.push(reserved),
                    // Partials that have partly arrived may hold the whole budget. One at a time arrives to its end.
                    // The semaphore is never closed.
                    Ok(beyond) = memory.beyond.acquire() => self.beyond = Some(beyond),
                }
            }
            self.bytes += more;
        }
    }
}
