//! Parts of nodes in the queue. A node is the sum of its two halves, so a row can become two, as often as the pace of the workers asks, at any
//! moment before it is accepted. Who was given the whole may still bring the whole: [acceptance](super::accept) takes all of its parts for it.

use clerestory_film::NodeAddress;

use crate::model::JobRecord;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, rows_of, to_json};
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;

/// Which part of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) enum Side {
    /// Its first passes.
    First,
    /// Its last passes.
    Last,
}

/// A part of a node in the queue that has no more samples than given, or is one pass; the node itself, if it is no larger. The rest of it stays
/// in the queue, cut into the halves that are left over, and all parts are what the node was: free, or held under its lease.
pub(in crate::store) async fn split_off(
    connection: &mut Connection,
    job: &JobRecord,
    node: NodeAddress,
    most_samples: f64,
    side: Side,
) -> Result<NodeAddress, StoreError> {
    let (mut part, mut rest) = (node, Vec::new());
    while job.node_samples(&part) as f64 > most_samples
        && let Some([first, second]) = part.children()
    {
        let (chosen, other) = match side {
            Side::First => (first, second),
            Side::Last => (second, first),
        };
        part = chosen;
        rest.push([other.level, other.index]);
    }
    if rest.is_empty() {
        return Ok(node);
    }
    rest.push([part.level, part.index]);
    let NodeAddress { frame, tile, level, index } = node;
    let cut = format!(
        "insert into pending (job, round, frame, tile, level, idx, failures, failed_on, died_on, lost_by, lease, repeats) \
         select job, round, frame, tile, c0, c1, failures, failed_on, died_on, lost_by, lease, repeats from pending cross join {} as parts \
         where job = $1 and frame = $2 and tile = $3 and level = $4 and idx = $5",
        rows_of(connection.engine(), 6, &[Kind::Integer; 2])
    );
    query(cut)
        .bind(job.id.to_string())
        .bind(i64::from(frame))
        .bind(i64::from(tile))
        .bind(i64::from(level))
        .bind(i64::from(index))
        .bind(to_json(&rest)?)
        .execute(&mut *connection)
        .await?;
    query("delete from pending where job = $1 and frame = $2 and tile = $3 and level = $4 and idx = $5")
        .bind(job.id.to_string())
        .bind(i64::from(frame))
        .bind(i64::from(tile))
        .bind(i64::from(level))
        .bind(i64::from(index))
        .execute(connection)
        .await?;
    Ok(part)
}
