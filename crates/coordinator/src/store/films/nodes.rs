//! Accepted nodes: the rows of the film. [Acceptance](crate::store::results::acceptance) inserts them, and merging
//! replaces them.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use clerestory_api::JobId;
use clerestory_film::NodeAddress;

use crate::model::{BlobRange, Merge, NodeRow, Removed, StoredNode, TilePasses, Work};
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, address, is_of_nodes, nodes_json, rows_of, to_json};
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::engine::writer::Turn;

fn work(row: &Row) -> Result<Work, StoreError> {
    Ok(Work { counters: row.json("counters")?, builds: row.json("builds")? })
}

fn blob_range(row: &Row) -> Result<BlobRange, StoreError> {
    let length = row.optional_integer("blob_length")?.map(|length| {
        u64::try_from(length).map_err(|_| StoreError::Corrupt { column: "blob_length", value: length.to_string() })
    });
    Ok(BlobRange { blob: row.text("blob")?, offset: row.number("blob_offset")?, length: length.transpose()? })
}

fn node_row(row: &Row) -> Result<NodeRow, StoreError> {
    Ok(NodeRow { address: address(row)?, blob_range: blob_range(row)?, work: work(row)? })
}

fn stored_node(row: &Row) -> Result<StoredNode, StoreError> {
    Ok(StoredNode { address: address(row)?, blob: row.text("blob")? })
}

/// Those of some nodes that are still in the same blob.
pub(in crate::store) async fn still_stored(
    connection: &mut Connection,
    job: JobId,
    nodes: &BTreeSet<StoredNode>,
) -> Result<BTreeSet<NodeAddress>, StoreError> {
    let statement = format!(
        "select frame, tile, level, idx, blob from nodes where {}",
        is_of_nodes(connection.engine(), "nodes", 1, 2)
    );
    let addresses = nodes_json(nodes.iter().map(|node| &node.address))?;
    let rows = query(statement).bind(job.to_string()).bind(addresses).fetch_all(connection).await?;
    let mut still = BTreeSet::new();
    for row in &rows {
        let found = stored_node(row)?;
        if nodes.contains(&found) {
            still.insert(found.address);
        }
    }
    Ok(still)
}

/// What [`node_row`] reads.
const COLUMNS: &str = "frame, tile, level, idx, blob, blob_offset, blob_length, counters, builds";

impl Store {
    /// The accepted nodes of some tiles of a frame that begin before a pass, ordered by tile and pass.
    pub(crate) async fn nodes(
        &self,
        job: JobId,
        frame: u32,
        tiles: Range<u32>,
        before_pass: u32,
    ) -> Result<Vec<NodeRow>, StoreError> {
        let rows = query(format!(
            "select {COLUMNS} from nodes where job = $1 and frame = $2 and tile >= $3 and tile < $4 and first_pass < \
             $5 \
             and first_pass < (select passes from jobs where id = $1) order by tile, first_pass"
        ))
        .bind(job.to_string())
        .bind(i64::from(frame))
        .bind(i64::from(tiles.start))
        .bind(i64::from(tiles.end))
        .bind(i64::from(before_pass))
        .fetch_all(&self.readers)
        .await?;
        rows.iter().map(node_row).collect()
    }

    /// The accepted nodes of the pilot of some tiles of a frame, ordered by tile and pass.
    pub(crate) async fn pilot(&self, job: JobId, frame: u32, tiles: Range<u32>) -> Result<Vec<NodeRow>, StoreError> {
        let rows = query(format!(
            "select {COLUMNS} from nodes where job = $1 and frame = $2 and tile >= $3 and tile < $4 \
             and first_pass >= (select passes from jobs where id = $1) order by tile, first_pass"
        ))
        .bind(job.to_string())
        .bind(i64::from(frame))
        .bind(i64::from(tiles.start))
        .bind(i64::from(tiles.end))
        .fetch_all(&self.readers)
        .await?;
        rows.iter().map(node_row).collect()
    }

    /// Accepted passes of some tiles of a frame, from the first on without a gap, in the order of the tiles.
    pub(crate) async fn complete_passes(
        &self,
        job: JobId,
        frame: u32,
        tiles: Range<u32>,
    ) -> Result<Vec<u32>, StoreError> {
        let rows = query(
            "select tile, first_pass, end_pass from nodes \
             where job = $1 and frame = $2 and tile >= $3 and tile < $4 and first_pass < (select passes from jobs \
             where id = $1) \
             order by tile, first_pass",
        )
        .bind(job.to_string())
        .bind(i64::from(frame))
        .bind(i64::from(tiles.start))
        .bind(i64::from(tiles.end))
        .fetch_all(&self.readers)
        .await?;
        let mut complete = vec![0; tiles.len()];
        for row in rows {
            let [tile, first, end] = [row.number::<u32>("tile")?, row.number("first_pass")?, row.number("end_pass")?];
            let passes = tile.checked_sub(tiles.start).and_then(|tile| complete.get_mut(tile as usize));
            if let Some(passes) = passes.filter(|passes| **passes == first) {
                *passes = end;
            }
        }
        Ok(complete)
    }

    /// A node, if it is still in this blob.
    pub(crate) async fn node_at(
        &self,
        job: JobId,
        node: &NodeAddress,
        blob: &str,
    ) -> Result<Option<NodeRow>, StoreError> {
        let row = query(format!(
            "select {COLUMNS} from nodes \
             where job = $1 and frame = $2 and tile = $3 and level = $4 and idx = $5 and blob = $6"
        ))
        .bind(job.to_string())
        .bind(i64::from(node.frame))
        .bind(i64::from(node.tile))
        .bind(i64::from(node.level))
        .bind(i64::from(node.index))
        .bind(blob)
        .fetch_optional(&self.readers)
        .await?;
        row.as_ref().map(node_row).transpose()
    }

    /// All accepted nodes of a job, and their blobs.
    pub(crate) async fn stored_nodes(&self, job: JobId) -> Result<Vec<StoredNode>, StoreError> {
        let rows = query("select frame, tile, level, idx, blob from nodes where job = $1")
            .bind(job.to_string())
            .fetch_all(&self.readers)
            .await?;
        rows.iter().map(stored_node).collect()
    }

    /// The jobs that have nodes in some blobs.
    pub(crate) async fn jobs_with_nodes_in(&self, blobs: &BTreeSet<String>) -> Result<BTreeSet<JobId>, StoreError> {
        let rows = query("select distinct job, blob from nodes").fetch_all(&self.readers).await?;
        let mut jobs = BTreeSet::new();
        for row in &rows {
            if blobs.contains(&row.text("blob")?) {
                jobs.insert(row.parsed("job")?);
            }
        }
        Ok(jobs)
    }

    /// Names of all blobs that hold accepted nodes.
    pub(crate) async fn node_blobs(&self) -> Result<BTreeSet<String>, StoreError> {
        let rows = query("select distinct blob from nodes").fetch_all(&self.readers).await?;
        rows.iter().map(|row| row.text("blob")).collect()
    }

    /// Replaces children by their merged parents, with the sums of their work. Fails without changes when a pass is
    /// missing or when nodes were removed since the sum was taken: the sum may include them.
    pub(crate) async fn replace(&self, job: JobId, redone: u64, merges: Vec<Merge>) -> Result<Removed, StoreError> {
        let write = self.write_in(Turn::Patient, move |connection| {
            Box::pin(async move { replace(connection, job, redone, &merges).await })
        });
        write.await
    }
}

/// The first pass of a node, and the end of its passes.
pub(in crate::store) fn ends(address: &NodeAddress) -> [i64; 2] {
    let passes = address.passes();
    [i64::from(passes.first), i64::from(passes.first) + i64::from(passes.count)]
}

/// Deletes every node that begins at a pass or after it. When the last round ends there, no other node reaches beyond:
/// none is formed across the end of an unrecorded round.
pub(in crate::store) async fn discard(
    connection: &mut Connection,
    job: JobId,
    first_pass: u32,
) -> Result<Removed, StoreError> {
    let rows = query("delete from nodes where job = $1 and first_pass >= $2 returning blob, blob_offset, blob_length")
        .bind(job.to_string())
        .bind(i64::from(first_pass))
        .fetch_all(&mut *connection)
        .await?;
    removed_at(connection, &rows).await
}

/// The removed blob ranges of some deleted rows.
pub(in crate::store) async fn removed_at(connection: &mut Connection, rows: &[Row]) -> Result<Removed, StoreError> {
    removed(connection, rows.iter().map(blob_range).collect::<Result<_, _>>()?).await
}

/// Deletes every node beyond a round, where tiles have passes of their own.
pub(in crate::store) async fn discard_beyond(
    connection: &mut Connection,
    job: JobId,
    tile_passes: &TilePasses,
    round_passes: u32,
) -> Result<Removed, StoreError> {
    let mut discarded = discard(connection, job, round_passes).await?;
    if !tile_passes.are_shared() {
        return Ok(discarded);
    }
    let kept = query("select frame, tile, level, idx from nodes where job = $1").bind(job.to_string());
    let kept = kept.fetch_all(&mut *connection).await?.iter().map(address).collect::<Result<Vec<_>, _>>()?;
    let is_beyond = |node: &&NodeAddress| node.passes().first >= tile_passes.at(node.frame, node.tile, round_passes);
    let beyond: Vec<NodeAddress> = kept.iter().filter(is_beyond).copied().collect();
    discarded += delete_all(connection, job, &beyond).await?;
    Ok(discarded)
}

/// Whether any nodes of a job are accepted.
pub(in crate::store) async fn has_any(connection: &mut Connection, job: JobId) -> Result<bool, StoreError> {
    let any = query("select 1 from nodes where job = $1 limit 1").bind(job.to_string());
    Ok(any.fetch_optional(connection).await?.is_some())
}

/// Deletes all nodes that share a pass with one of `others`.
pub(in crate::store) async fn take_out(
    connection: &mut Connection,
    job: JobId,
    others: &BTreeSet<NodeAddress>,
) -> Result<(Vec<NodeAddress>, Removed), StoreError> {
    let mut by_tile: BTreeMap<(u32, u32), Vec<NodeAddress>> = BTreeMap::new();
    for node in others {
        by_tile.entry((node.frame, node.tile)).or_default().push(*node);
    }
    let tiles: Vec<&(u32, u32)> = by_tile.keys().collect();
    let statement = format!(
        "select frame, tile, level, idx from nodes where job = $1 and (frame, tile) in {}",
        rows_of(connection.engine(), 2, &[Kind::Integer; 2])
    );
    let found = query(statement).bind(job.to_string()).bind(to_json(&tiles)?);
    let mut taken = Vec::new();
    for row in found.fetch_all(&mut *connection).await? {
        let node = address(&row)?;
        let others = by_tile.get(&(node.frame, node.tile));
        if others.is_some_and(|others| others.iter().any(|other| other.overlaps(&node))) {
            taken.push(node);
        }
    }
    let removed = delete_all(connection, job, &taken).await?;
    Ok((taken, removed))
}

/// Takes out some nodes.
async fn delete_all(connection: &mut Connection, job: JobId, nodes: &[NodeAddress]) -> Result<Removed, StoreError> {
    let rows = delete(connection, job, nodes).await?;
    removed_at(connection, &rows).await
}

/// Deletes the rows of some nodes, and answers them.
async fn delete(connection: &mut Connection, job: JobId, nodes: &[NodeAddress]) -> Result<Vec<Row>, StoreError> {
    let statement =
        format!("delete from nodes where {} returning {COLUMNS}", is_of_nodes(connection.engine(), "nodes", 1, 2));
    query(statement).bind(job.to_string()).bind(nodes_json(nodes)?).fetch_all(connection).await
}

/// Stores accepted nodes.
pub(in crate::store) async fn insert(
    connection: &mut Connection,
    job: JobId,
    nodes: &[NodeRow],
) -> Result<(), StoreError> {
    if nodes.is_empty() {
        return Ok(());
    }
    use Kind::{Integer, Text};
    let columns = [Integer, Integer, Integer, Integer, Integer, Integer, Text, Integer, Integer, Text, Text];
    let statement = format!(
        "insert into nodes (job, frame, tile, level, idx, first_pass, end_pass, blob, blob_offset, blob_length, \
         counters, builds) \
         select $1, c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, c10 from {} as listed_nodes",
        rows_of(connection.engine(), 2, &columns)
    );
    let mut rows = Vec::with_capacity(nodes.len());
    for NodeRow { address, blob_range, work } in nodes {
        let NodeAddress { frame, tile, level, index } = *address;
        let ([first, end], BlobRange { blob, offset, length }) = (ends(address), blob_range);
        let (counters, builds) = (to_json(&work.counters)?, to_json(&work.builds)?);
        rows.push((frame, tile, level, index, first, end, blob, offset, length, counters, builds));
    }
    query(statement).bind(job.to_string()).bind(to_json(&rows)?).execute(connection).await?;
    Ok(())
}

async fn replace(
    connection: &mut Connection,
    job: JobId,
    redone: u64,
    merges: &[Merge],
) -> Result<Removed, StoreError> {
    let row =
        query("select redone_nodes from jobs where id = $1").bind(job.to_string()).fetch_one(&mut *connection).await?;
    if row.number::<u64>("redone_nodes")? != redone {
        return Err(StoreError::Database("nodes were taken out of the film while others were merged".to_owned()));
    }
    let children: Vec<(NodeAddress, usize)> = merges
        .iter()
        .zip(0..)
        .flat_map(|(merge, number)| merge.children.iter().map(move |child| (*child, number)))
        .collect();
    let parents: BTreeMap<NodeAddress, usize> = children.iter().copied().collect();
    let mut sums = vec![(0, Work::default()); merges.len()];
    let mut blob_ranges = Vec::with_capacity(children.len());
    let addresses: Vec<NodeAddress> = children.iter().map(|(child, _)| *child).collect();
    for row in delete(connection, job, &addresses).await? {
        let NodeRow { address, blob_range, work } = node_row(&row)?;
        if let Some((passes, sum)) = parents.get(&address).and_then(|number| sums.get_mut(*number)) {
            *passes += u64::from(address.passes().count);
            *sum += &work;
        }
        blob_ranges.push(blob_range);
    }
    let mut rows = Vec::with_capacity(merges.len());
    for (merge, (passes, work)) in merges.iter().zip(sums) {
        let wanted = merge.parent.passes().count;
        if passes != u64::from(wanted) {
            // The savepoint of the caller rolls the half-done replacement back.
            let value = format!("{passes} of the {wanted} passes of {:?}", merge.parent);
            return Err(StoreError::Corrupt { column: "nodes", value });
        }
        rows.push(NodeRow { address: merge.parent, blob_range: merge.blob_range.clone(), work });
    }
    insert(connection, job, &rows).await?;
    removed(connection, blob_ranges).await
}

/// The deleted blob ranges, with the blobs that hold no accepted node any more.
async fn removed(connection: &mut Connection, blob_ranges: Vec<BlobRange>) -> Result<Removed, StoreError> {
    let mut blobs: BTreeSet<&str> = blob_ranges.iter().map(|blob_range| &*blob_range.blob).collect();
    let all: Vec<[&str; 1]> = blobs.iter().map(|blob| [*blob]).collect();
    let mut used = Vec::new();
    let statement = format!(
        "select c0 as blob from {} as listed_blobs where (select 1 from nodes where blob = c0 limit 1) is not null",
        rows_of(connection.engine(), 1, &[Kind::Text])
    );
    for row in query(statement).bind(to_json(&all)?).fetch_all(&mut *connection).await? {
        used.push(row.text("blob")?);
    }
    for blob in &used {
        blobs.remove(&**blob);
    }
    let blobs = blobs.into_iter().map(str::to_owned).collect();
    Ok(Removed { blob_ranges, blobs })
}
