//! Splits of nodes in the queue.
//!
//! A node is the sum of its two halves. So a row can become two at any moment before it is accepted, as the rates of
//! the workers require. A worker that was leased the whole node may still bring it:
//! [acceptance](crate::store::results::acceptance) takes all of its parts.

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

/// Splits a node in the queue, and answers a part with at most `most_samples`, or of one pass. A node that is no
/// larger is answered whole. The rest stays in the queue as the other halves. All parts keep the state of the node:
/// free, or held under its lease.
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
        "insert into pending (job, round, frame, tile, level, idx, failures, failed_on, died_on, lost_by, lease, \
         repeats) \
         select job, round, frame, tile, c0, c1, failures, failed_on, died_on, lost_by, lease, repeats from pending \
         cross join {} as parts \
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
