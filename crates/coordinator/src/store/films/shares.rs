//! Shares of the passes of adaptive jobs, which [pass sharing](crate::films::pass_sharing) decides.

use std::collections::BTreeMap;
use std::ops::Range;

use clerestory_api::JobId;
use clerestory_film::{PassRange, Share};

use crate::model::{JobRecord, Removed, TilePasses};
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, big, rows_of, to_json};
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::films::nodes;

/// Tiles in one read: few of them may have a pass in a round.
const TILES: u32 = 1024;

impl Store {
    /// The passes of each tile of a job at each round.
    pub(crate) async fn tile_passes(&self, job: &JobRecord) -> Result<TilePasses, StoreError> {
        if job.shared_samples.is_none() {
            return Ok(TilePasses::default());
        }
        let rows = query(ALL).bind(job.id.to_string()).fetch_all(&self.readers).await?;
        shared(job, &rows)
    }

    /// Stores the shares of all tiles of a job. `false`, without changes, when shares are stored already or when nodes
    /// were removed since the job was read.
    pub(crate) async fn share_out(
        &self,
        job: &JobRecord,
        shares: BTreeMap<u32, Vec<Share>>,
    ) -> Result<bool, StoreError> {
        let job = job.clone();
        self.write(move |connection| Box::pin(async move { share_out(connection, &job, &shares).await })).await
    }

    /// Deletes the pilot of some tiles of a frame, when its job has shares or has ended. The pilot of a job that was
    /// [restarted](crate::store::results::redo) meanwhile stays.
    pub(crate) async fn discard_pilot(&self, job: JobId, frame: u32, tiles: Range<u32>) -> Result<Removed, StoreError> {
        self.write(move |connection| Box::pin(async move { discard_pilot(connection, job, frame, tiles).await })).await
    }
}

const ALL: &str = "select frame, tile, share from tile_shares where job = $1 order by frame, tile";

/// As [`Store::tile_passes`], as the transaction reads it.
pub(in crate::store) async fn tile_passes(
    connection: &mut Connection,
    job: &JobRecord,
) -> Result<TilePasses, StoreError> {
    if !job.adaptive {
        return Ok(TilePasses::default());
    }
    let rows = query(ALL).bind(job.id.to_string()).fetch_all(connection).await?;
    shared(job, &rows)
}

fn shared(job: &JobRecord, rows: &[Row]) -> Result<TilePasses, StoreError> {
    let Some(adaptation) = job.adaptation().filter(|_| !rows.is_empty()) else { return Ok(TilePasses::default()) };
    let mut by_frame: BTreeMap<u32, Vec<Share>> = BTreeMap::new();
    for row in rows {
        by_frame.entry(row.number("frame")?).or_default().push(share(row)?);
    }
    Ok(TilePasses::shared(adaptation, by_frame))
}

fn share(row: &Row) -> Result<Share, StoreError> {
    let units = row.integer("share")?;
    let share = u32::try_from(units).ok().and_then(Share::new);
    share.ok_or_else(|| StoreError::Corrupt { column: "share", value: units.to_string() })
}

/// The work of some tiles of a frame in a round.
pub(in crate::store) struct RoundTiles {
    /// Tiles with passes in the round, in order, and those passes.
    pub(in crate::store) tiles: Vec<(u32, PassRange)>,
    /// The tile after those that were read.
    pub(in crate::store) next: u32,
    /// Tiles with passes in the round, as far as is known.
    pub(in crate::store) count: u32,
}

/// The work of the tiles of a frame in a round, from one tile on, as far as one read goes.
pub(in crate::store) async fn round_tiles(
    connection: &mut Connection,
    job: &JobRecord,
    frame: u32,
    first_tile: u32,
    round_passes: PassRange,
) -> Result<RoundTiles, StoreError> {
    let count = job.grid.len();
    let Some(adaptation) = job.adaptation().filter(|_| job.shared_samples.is_some()) else {
        let next = count.min(first_tile.saturating_add(TILES));
        return Ok(RoundTiles { tiles: (first_tile..next).map(|tile| (tile, round_passes)).collect(), next, count });
    };
    let rows = query(
        "select tile, share from tile_shares where job = $1 and frame = $2 and tile >= $3 order by tile limit $4",
    )
    .bind(job.id.to_string())
    .bind(i64::from(frame))
    .bind(i64::from(first_tile))
    .bind(i64::from(TILES))
    .fetch_all(connection)
    .await?;
    let mut tiles = Vec::new();
    let mut next = first_tile;
    for row in &rows {
        let (tile, share) = (row.number("tile")?, share(row)?);
        let first = adaptation.passes(share, round_passes.first);
        let count = adaptation.passes(share, round_passes.first + round_passes.count) - first;
        if count > 0 {
            tiles.push((tile, PassRange { first, count }));
        }
        next = tile + 1;
    }
    let next = if rows.len() < TILES as usize { count } else { next };
    Ok(RoundTiles { count: tiles.len() as u32, tiles, next })
}

async fn share_out(
    connection: &mut Connection,
    job: &JobRecord,
    shares: &BTreeMap<u32, Vec<Share>>,
) -> Result<bool, StoreError> {
    let Some(adaptation) = job.adaptation() else { return Ok(false) };
    let mut samples = 0;
    let mut rows = Vec::new();
    for (frame, shares) in shares {
        for (tile, share) in (0..).zip(shares) {
            let pixels = job.grid.tile(tile).map_or(0, |tile| tile.pixels() as u64);
            samples += pixels * u64::from(adaptation.passes(*share, job.passes)) * u64::from(job.samples_per_pass);
            rows.push((*frame, tile, share.units()));
        }
    }
    let decided =
        query("update jobs set shared_samples = $2 where id = $1 and shared_samples is null and redone_nodes = $3")
            .bind(job.id.to_string())
            .bind(big(samples))
            .bind(big(job.redone_nodes))
            .execute(&mut *connection)
            .await?;
    if decided == 0 {
        return Ok(false);
    }
    if rows.len() as u64 != u64::from(job.frames) * u64::from(job.grid.len()) {
        let value = format!("a pilot of {} tiles", rows.len());
        return Err(StoreError::Corrupt { column: "nodes", value });
    }
    let statement = format!(
        "insert into tile_shares (job, frame, tile, share) select $1, c0, c1, c2 from {} as listed_shares",
        rows_of(connection.engine(), 2, &[Kind::Integer; 3])
    );
    query(statement).bind(job.id.to_string()).bind(to_json(&rows)?).execute(&mut *connection).await?;
    Ok(true)
}

async fn discard_pilot(
    connection: &mut Connection,
    job: JobId,
    frame: u32,
    tiles: Range<u32>,
) -> Result<Removed, StoreError> {
    let rows = query(
        "delete from nodes where job = $1 and frame = $2 and tile >= $3 and tile < $4 and first_pass >= (select \
         passes from jobs \
         where id = $1 and (shared_samples is not null or state not in ('queued', 'running'))) \
         returning blob, blob_offset, blob_length",
    )
    .bind(job.to_string())
    .bind(i64::from(frame))
    .bind(i64::from(tiles.start))
    .bind(i64::from(tiles.end))
    .fetch_all(&mut *connection)
    .await?;
    nodes::removed_at(connection, &rows).await
}
