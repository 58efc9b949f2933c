//! Rounds: all tiles are complete up to the same pass, and its error is measured.

use clerestory_api::{ConvergencePoint, JobId, StopReason};

use crate::model::{CompleteRound, Ending, JobRecord, RecordedRound, StoredKind, round_error, stop_reason};
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::big;
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::films::{nodes, shares as adaptive};
use crate::store::{events, jobs};

impl Store {
    /// The next round of a job, if it is complete and not recorded.
    pub(crate) async fn complete_round(&self, job: &JobRecord) -> Result<Option<CompleteRound>, StoreError> {
        let Some(passes) = job.boundaries().end(job.rounds) else { return Ok(None) };
        // A job may have tens of thousands of earlier rounds, and this query is frequent: only incomplete ones are
        // read.
        let looked = query(
            "select (select count(*) from round_work where job = $1 and round = $2) as opened, \
             (select count(*) from round_work where job = $1 and round <= $2 and completed_ms is null and outstanding \
             > 0) as incomplete, \
             (select count(*) from checks where job = $1 and round <= $2) as checks",
        );
        let looked = looked.bind(job.id.to_string()).bind(i64::from(job.rounds)).fetch_one(&self.readers).await?;
        // Rounds are opened in their order.
        let is_opened = looked.integer("opened")? == i64::from(job.frames);
        if !is_opened || looked.integer("incomplete")? + looked.integer("checks")? > 0 {
            return Ok(None);
        }
        let (measured, mut core_ms, mut completed_ms) = self.last_measured(job).await?;
        let round_work =
            query("select core_ms, completed_ms from round_work where job = $1 and round > $2 and round <= $3")
                .bind(job.id.to_string())
                .bind(measured)
                .bind(i64::from(job.rounds))
                .fetch_all(&self.readers)
                .await?;
        for work in &round_work {
            core_ms = core_ms.saturating_add(work.integer("core_ms")?);
            completed_ms = completed_ms.max(work.optional_integer("completed_ms")?.unwrap_or(0));
        }
        Ok(Some(CompleteRound { round: job.rounds, passes, core_ms, completed_ms }))
    }

    /// The last round with points, the time spent up to it, and when its last node was accepted. The work up to it has
    /// not changed since: when its nodes are rendered again, its points and all later ones are deleted.
    async fn last_measured(&self, job: &JobRecord) -> Result<(i64, i64, i64), StoreError> {
        let last = query(
            "select round, core_ms, wall_ms from rounds where job = $1 and frame = 0 and round < $2 \
             order by round desc limit 1",
        );
        let last = last.bind(job.id.to_string()).bind(i64::from(job.rounds)).fetch_optional(&self.readers).await?;
        let Some(last) = last else { return Ok((-1, 0, 0)) };
        let completed_ms = last.integer("wall_ms")?.saturating_add(job.started_ms.unwrap_or(0));
        Ok((last.integer("round")?, last.integer("core_ms")?, completed_ms))
    }

    /// Records a round, with one point for each frame, and ends the job when that is the last one or has reached a
    /// target. All in one transaction, so that the job ends at the same round whenever the coordinator stops. `None`,
    /// without changes, when the round was recorded before, when nodes were removed since the job was read, or when
    /// the job has failed.
    pub(crate) async fn record_round(
        &self,
        job: &JobRecord,
        points: Vec<ConvergencePoint>,
        now_ms: i64,
    ) -> Result<Option<RecordedRound>, StoreError> {
        let (id, round, redone) = (job.id, job.rounds, job.redone_nodes);
        let passes = job.boundaries().end(round).unwrap_or(job.passes);
        let last = (passes == job.passes).then_some(StopReason::Samples);
        let errors: Vec<_> = points.iter().map(round_error).collect();
        let reason = job.targets.reached(job.samples_per_block, &errors).map(stop_reason).or(last);
        let job = job.clone();
        self.write(move |connection| {
            Box::pin(async move {
                let recorded = query(
                    "update jobs set rounds = rounds + 1, complete_passes = $3 \
                     where id = $1 and rounds = $2 and redone_nodes = $4 and state <> 'failed'",
                )
                .bind(id.to_string())
                .bind(i64::from(round))
                .bind(i64::from(passes))
                .bind(big(redone))
                .execute(&mut *connection)
                .await?;
                if recorded == 0 {
                    return Ok(None);
                }
                for point in points {
                    insert(connection, id, &point).await?;
                    let kind = StoredKind::Round { frame: point.frame, round };
                    events::record(connection, kind, id, now_ms).await?;
                }
                let Some(reason) = reason else { return Ok(Some(RecordedRound::default())) };
                Ok(Some(end(connection, &job, passes, reason, now_ms).await?))
            })
        })
        .await
    }

    /// All recorded points of a job, by frame and round.
    pub(crate) async fn convergence(&self, job: JobId) -> Result<Vec<ConvergencePoint>, StoreError> {
        let rows = query("select * from rounds where job = $1 order by frame, round")
            .bind(job.to_string())
            .fetch_all(&self.readers)
            .await?;
        rows.iter().map(point).collect()
    }

    /// One recorded point.
    pub(crate) async fn convergence_point(
        &self,
        job: JobId,
        frame: u32,
        round: u32,
    ) -> Result<Option<ConvergencePoint>, StoreError> {
        let row = query("select * from rounds where job = $1 and frame = $2 and round = $3")
            .bind(job.to_string())
            .bind(i64::from(frame))
            .bind(i64::from(round))
            .fetch_optional(&self.readers)
            .await?;
        row.as_ref().map(point).transpose()
    }
}

/// Ends a job with a round, and deletes everything beyond it. A job that ended before keeps what it has.
async fn end(
    connection: &mut Connection,
    job: &JobRecord,
    passes: u32,
    reason: StopReason,
    now_ms: i64,
) -> Result<RecordedRound, StoreError> {
    if !jobs::end(connection, job.id, &Ending::Done(reason), now_ms).await? {
        return Ok(RecordedRound::default());
    }
    query("delete from round_work where job = $1 and round > $2")
        .bind(job.id.to_string())
        .bind(i64::from(job.rounds))
        .execute(&mut *connection)
        .await?;
    let tile_passes = adaptive::tile_passes(connection, job).await?;
    let discarded = nodes::discard_beyond(connection, job.id, &tile_passes, passes).await?;
    Ok(RecordedRound { stopped_by: Some(reason), discarded })
}

fn point(row: &Row) -> Result<ConvergencePoint, StoreError> {
    Ok(ConvergencePoint {
        frame: row.number("frame")?,
        round: row.number("round")?,
        passes: row.number("passes")?,
        samples_per_pixel: row.number("samples_per_pixel")?,
        core_ms: row.integer("core_ms")?,
        wall_ms: row.integer("wall_ms")?,
        recorded_ms: row.integer("recorded_ms")?,
        mse: row.optional_float("mse")?,
        corrected_mse: row.optional_float("corrected_mse")?,
        rel_mse: row.optional_float("rel_mse")?,
        psnr: row.optional_float("psnr")?,
        flip: row.optional_float("flip")?,
        estimated_mse: row.optional_float("estimated_mse")?,
    })
}

async fn insert(connection: &mut Connection, job: JobId, point: &ConvergencePoint) -> Result<(), StoreError> {
    query(
        "insert into rounds (job, frame, round, passes, samples_per_pixel, core_ms, wall_ms, recorded_ms, mse, \
         corrected_mse, rel_mse, psnr, estimated_mse, flip) \
         values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14)",
    )
    .bind(job.to_string())
    .bind(i64::from(point.frame))
    .bind(i64::from(point.round))
    .bind(i64::from(point.passes))
    .bind(big(point.samples_per_pixel))
    .bind(point.core_ms)
    .bind(point.wall_ms)
    .bind(point.recorded_ms)
    .bind(point.mse)
    .bind(point.corrected_mse)
    .bind(point.rel_mse)
    .bind(point.psnr)
    .bind(point.estimated_mse)
    .bind(point.flip)
    .execute(connection)
    .await?;
    Ok(())
}
