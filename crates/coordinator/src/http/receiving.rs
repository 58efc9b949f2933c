//! Memory for partials that are received.

use bytes::{Bytes, BytesMut};
use tokio::sync::SemaphorePermit;

use crate::farm::Farm;
use crate::http::extract::ArrivingBody;
use crate::http::problem::ApiError;
use crate::memory::permits;

/// Bytes of a partial for which memory is kept before they have come: few partials are larger, and those who stop sending hold little.
const PIECE_BYTES: u64 = 1 << 20;

/// Receives a partial when there is room for it.
pub(super) async fn receive(farm: &Farm, mut arriving: ArrivingBody) -> Result<(Bytes, Room<'_>), ApiError> {
    let mut room = Room::new(farm, arriving.announced_bytes());
    room.widen_to(1).await?;
    let mut body = BytesMut::with_capacity(arriving.announced_bytes().unwrap_or(0).min(PIECE_BYTES) as usize);
    while let Some(piece) = arriving.piece().await? {
        room.widen_to((body.len() + piece.len()) as u64).await?;
        body.extend_from_slice(&piece);
    }
    Ok((body.freeze(), room))
}

/// Memory for a partial, taken as it comes. Whoever has announced much and sends nothing takes no more than a piece of it.
pub(super) struct Room<'a> {
    farm: &'a Farm,
    announced: Option<u64>,
    /// Bytes that there is room for.
    bytes: u64,
    permits: Vec<SemaphorePermit<'a>>,
    /// Makes room for any number.
    beyond: Option<SemaphorePermit<'a>>,
}

impl<'a> Room<'a> {
    /// No memory yet, for a partial of which so many bytes are announced.
    pub(super) fn new(farm: &'a Farm, announced: Option<u64>) -> Self {
        Self { farm, announced, bytes: 0, permits: Vec::new(), beyond: None }
    }

    /// Waits until there is room for so many bytes.
    pub(super) async fn widen_to(&mut self, bytes: u64) -> Result<(), ApiError> {
        let farm = self.farm;
        while self.bytes < bytes && self.beyond.is_none() {
            let rest = self.announced.map_or(PIECE_BYTES, |announced| announced.saturating_sub(self.bytes));
            let more = rest.clamp(1, PIECE_BYTES);
            let room = farm.receiving.acquire_many(permits(more));
            if self.bytes == 0 {
                self.permits.push(room.await.map_err(ApiError::internal)?);
            } else {
                tokio::select! {
                    biased;
                    room = room => self.permits.push(room.map_err(ApiError::internal)?),
                    // All of the room may be taken by partials of which a part has come: one at a time comes to its end.
                    beyond = farm.receiving_beyond.acquire() => {
                        self.beyond = Some(beyond.map_err(ApiError::internal)?);
                    }
                }
            }
            self.bytes += more;
        }
        Ok(())
    }
}
