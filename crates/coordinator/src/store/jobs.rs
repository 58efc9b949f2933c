//! Rows of jobs.

use std::collections::BTreeMap;

use clerestory_api::{BuiltScene, ContentHash, JobId, StopReason};
use clerestory_film::counters::Counters;
use clerestory_film::{Targets, TileGrid};

use crate::model::{Ending, JobRecord, NewJob, StoredKind};
use crate::store::checks;
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{big, to_json};
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::events;

/// What [`record`] reads.
pub(in crate::store) const COLUMNS: &str = "\
     id, name, state, stopped_by, failure, failed_node, hold, priority, scene_hash, integrator, missing_light, \
     assumptions, scene_is_built, left_to_chance, chosen_methods, import_notes, scene_refusal, frames, width, height, \
     tile_size, light_plane, caustic, samples_per_pass, samples_per_block, passes, reference, probe_digest, \
     time_limit_ms, target_mse, target_estimated_mse, adaptive, shared_samples, created_ms, started_ms, finished_ms, \
     reopened_ms, cursor_round, cursor_frame, cursor_tile, rounds, complete_passes, accepted_nodes, redone_nodes, \
     samples, core_ms, counters";

/// The job of a row.
pub(in crate::store) fn record(row: &Row) -> Result<JobRecord, StoreError> {
    Ok(JobRecord {
        id: row.parsed("id")?,
        name: row.text("name")?,
        state: row.word("state")?,
        stopped_by: row.optional_word("stopped_by")?,
        failure: row.optional_text("failure")?,
        failed_node: row.optional_json("failed_node")?,
        hold: row.optional_json("hold")?,
        priority: row.number("priority")?,
        scene_hash: row.text("scene_hash")?,
        integrator: row.text("integrator")?,
        missing_light: row.json("missing_light")?,
        assumptions: row.json("assumptions")?,
        built_scene: built_scene(row)?,
        scene_refusal: row.optional_json("scene_refusal")?,
        frames: row.number("frames")?,
        grid: TileGrid::new(row.number("width")?, row.number("height")?, row.number("tile_size")?)
            .with_light_plane(row.integer("light_plane")? != 0)
            .with_caustic(row.integer("caustic")? != 0),
        samples_per_pass: row.number("samples_per_pass")?,
        samples_per_block: row.number("samples_per_block")?,
        passes: row.number("passes")?,
        reference: row.optional_parsed("reference")?,
        probe_digest: row.optional_text("probe_digest")?,
        time_limit_ms: row.optional_integer("time_limit_ms")?,
        targets: Targets {
            mse: row.optional_float("target_mse")?,
            estimated_mse: row.optional_float("target_estimated_mse")?,
        },
        adaptive: row.integer("adaptive")? != 0,
        shared_samples: row.optional_integer("shared_samples")?.map(|_| row.number("shared_samples")).transpose()?,
        created_ms: row.integer("created_ms")?,
        started_ms: row.optional_integer("started_ms")?,
        finished_ms: row.optional_integer("finished_ms")?,
        reopened_ms: row.optional_integer("reopened_ms")?,
        cursor: [row.number("cursor_round")?, row.number("cursor_frame")?, row.number("cursor_tile")?],
        rounds: row.number("rounds")?,
        complete_passes: row.number("complete_passes")?,
        accepted_nodes: row.number("accepted_nodes")?,
        redone_nodes: row.number("redone_nodes")?,
        samples: row.number("samples")?,
        core_ms: row.integer("core_ms")?,
        counters: row.json("counters")?,
    })
}

/// What is known of a job's scene that a worker has built.
fn built_scene(row: &Row) -> Result<Option<BuiltScene>, StoreError> {
    if row.integer("scene_is_built")? == 0 {
        return Ok(None);
    }
    Ok(Some(BuiltScene {
        left_to_chance: row.json("left_to_chance")?,
        chosen_methods: row.json("chosen_methods")?,
        import_notes: row.json("import_notes")?,
    }))
}

/// One job, as the transaction reads it.
pub(in crate::store) async fn job_in(connection: &mut Connection, job: JobId) -> Result<Option<JobRecord>, StoreError> {
    let found = query(format!("select {COLUMNS} from jobs where id = $1")).bind(job.to_string());
    found.fetch_optional(connection).await?.as_ref().map(record).transpose()
}

/// Ends a job: its leases end and its pending work is deleted. `false`, without changes, when it already has a final
/// state.
pub(in crate::store) async fn end(
    connection: &mut Connection,
    job: JobId,
    ending: &Ending,
    now_ms: i64,
) -> Result<bool, StoreError> {
    let ended = query(
        "update jobs set state = $2, stopped_by = $3, failure = $4, finished_ms = $5, hold = null, reopened_ms = null \
         where id = $1 and state in ('queued', 'running')",
    )
    .bind(job.to_string())
    .bind(ending.state().name())
    .bind(ending.stopped_by().map(StopReason::name))
    .bind(ending.failure())
    .bind(now_ms)
    .execute(&mut *connection)
    .await?;
    if ended == 0 {
        return Ok(false);
    }
    query("delete from pending where job = $1").bind(job.to_string()).execute(&mut *connection).await?;
    checks::abandon(connection, job).await?;
    query("update leases set state = 'ended' where job = $1 and state = 'active'")
        .bind(job.to_string())
        .execute(&mut *connection)
        .await?;
    events::record(connection, StoredKind::Job, job, now_ms).await?;
    Ok(true)
}

impl Store {
    /// Stores a job.
    pub(crate) async fn insert_job(&self, job: NewJob) -> Result<(), StoreError> {
        self.write(move |connection| Box::pin(async move { insert(connection, &job).await })).await
    }

    /// One job.
    pub(crate) async fn job(&self, job: JobId) -> Result<Option<JobRecord>, StoreError> {
        let found = query(format!("select {COLUMNS} from jobs where id = $1")).bind(job.to_string());
        found.fetch_optional(&self.readers).await?.as_ref().map(record).transpose()
    }

    /// The jobs that have not ended.
    pub(crate) async fn open_jobs(&self) -> Result<Vec<JobId>, StoreError> {
        let rows = query("select id from jobs where state in ('queued', 'running')").fetch_all(&self.readers).await?;
        rows.iter().map(|row| row.parsed("id")).collect()
    }

    /// The jobs that may have an unrecorded round or a pilot to discard. A job may have ended just before either.
    pub(crate) async fn unsettled_jobs(&self) -> Result<Vec<JobId>, StoreError> {
        let unsettled = query(
            "select id from jobs where state in ('queued', 'running') \
             or (adaptive = 1 and (select 1 from nodes where job = jobs.id and first_pass >= jobs.passes limit 1) is \
             not null) \
             or exists (select 1 from round_work where job = jobs.id and round = jobs.rounds)",
        );
        unsettled.fetch_all(&self.readers).await?.iter().map(|row| row.parsed("id")).collect()
    }

    /// All jobs, newest first.
    pub(crate) async fn jobs(&self) -> Result<Vec<JobRecord>, StoreError> {
        let all = query(format!("select {COLUMNS} from jobs order by created_ms desc, id desc"));
        all.fetch_all(&self.readers).await?.iter().map(record).collect()
    }

    /// The canonical scene description of a job and its assets.
    pub(crate) async fn job_scene(
        &self,
        job: JobId,
    ) -> Result<Option<(String, BTreeMap<String, ContentHash>)>, StoreError> {
        let Some(row) =
            query("select scene from jobs where id = $1").bind(job.to_string()).fetch_optional(&self.readers).await?
        else {
            return Ok(None);
        };
        let assets = query("select path, hash from job_assets where job = $1")
            .bind(job.to_string())
            .fetch_all(&self.readers)
            .await?;
        let assets = assets.iter().map(|row| Ok((row.text("path")?, row.parsed("hash")?)));
        Ok(Some((row.text("scene")?, assets.collect::<Result<_, StoreError>>()?)))
    }

    /// Ends a job. `false` when it already has a final state.
    pub(crate) async fn end_job(&self, job: JobId, ending: Ending, now_ms: i64) -> Result<bool, StoreError> {
        self.write(move |connection| Box::pin(async move { end(connection, job, &ending, now_ms).await })).await
    }

    /// Ends the jobs whose time limit is reached, and answers which.
    pub(crate) async fn end_jobs_out_of_time(&self, now_ms: i64) -> Result<Vec<JobId>, StoreError> {
        self.write(move |connection| {
            Box::pin(async move {
                let limited = "state in ('queued', 'running') and time_limit_ms is not null";
                let limited = query(format!("select {COLUMNS} from jobs where {limited} order by created_ms, id"));
                let mut ended = Vec::new();
                for row in limited.fetch_all(&mut *connection).await? {
                    let job = record(&row)?;
                    if job.is_out_of_time(now_ms) {
                        end(connection, job.id, &Ending::Done(StopReason::Time), now_ms).await?;
                        ended.push(job.id);
                    }
                }
                Ok(ended)
            })
        })
        .await
    }
}

async fn insert(connection: &mut Connection, job: &NewJob) -> Result<(), StoreError> {
    query(
        "insert into jobs (id, name, state, priority, scene, scene_hash, integrator, missing_light, frames, width, \
         height, tile_size, samples_per_pass, samples_per_block, passes, reference, time_limit_ms, target_mse, \
         target_estimated_mse, adaptive, created_ms, read_by_first, same_by_first, assumptions, light_plane, caustic, \
         scene_is_built) \
         values ($1, $2, 'queued', $3, $4, $5, $6, $7, 1, $8, $9, $10, $11, $12, $13, $14, $15, $16, $17, $18, $19, \
         $20, $21, $22, $23, $24, 0)",
    )
    .bind(job.id.to_string())
    .bind(&job.name)
    .bind(i64::from(job.priority))
    .bind(&job.scene)
    .bind(&job.scene_hash)
    .bind(&job.integrator)
    .bind(to_json(&job.missing_light)?)
    .bind(i64::from(job.grid.width))
    .bind(i64::from(job.grid.height))
    .bind(i64::from(job.grid.tile_size))
    .bind(i64::from(job.samples_per_pass))
    .bind(i64::from(job.samples_per_block))
    .bind(i64::from(job.passes))
    .bind(job.reference.map(|hash| hash.to_string()))
    .bind(job.time_limit_ms)
    .bind(job.targets.mse)
    .bind(job.targets.estimated_mse)
    .bind(i64::from(job.adaptive))
    .bind(job.created_ms)
    .bind(i64::from(job.is_read_by_first))
    .bind(i64::from(job.is_same_by_first))
    .bind(to_json(&job.assumptions)?)
    .bind(i64::from(job.grid.has_light_plane))
    .bind(i64::from(job.grid.has_caustic))
    .execute(&mut *connection)
    .await?;
    for (path, hash) in &job.assets {
        query("insert into job_assets (job, path, hash) values ($1, $2, $3)")
            .bind(job.id.to_string())
            .bind(path)
            .bind(hash.to_string())
            .execute(&mut *connection)
            .await?;
    }
    events::record(connection, StoredKind::Job, job.id, job.created_ms).await
}

/// Adds accepted work to a job that this transaction has read.
pub(in crate::store) async fn add_accepted(
    connection: &mut Connection,
    job: &JobRecord,
    nodes: u64,
    samples: u64,
    core_ms: i64,
    counters: Counters,
) -> Result<(), StoreError> {
    let mut sum = job.counters;
    sum += counters;
    query(
        "update jobs set accepted_nodes = accepted_nodes + $2, samples = samples + $3, \
         core_ms = case when core_ms > 9223372036854775807 - $4 then 9223372036854775807 else core_ms + $4 end, \
         counters = $5 where id = $1",
    )
    .bind(job.id.to_string())
    .bind(big(nodes))
    .bind(big(samples))
    .bind(core_ms)
    .bind(to_json(&sum)?)
    .execute(connection)
    .await?;
    Ok(())
}
