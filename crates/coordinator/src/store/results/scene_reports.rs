//! Reports of workers on the scenes of their jobs. The first built scene of a job counts.
//!
//! A refused scene is the word of one machine, which may be faulty or run a stricter build. The refusal is stored and
//! the nodes are free for others. The job ends when a second machine refuses the scene, or at once when no other
//! machine could try it. A scene that a worker has built or rendered can be built: then a refusal is a failure of the
//! lease.

use clerestory_api::{BuildOutcome, BuiltScene, JobId};

use crate::model::{
    Ending, JobRecord, LeaseRecord, LeaseState, SceneChange, SceneRefusal, SceneReport, StoredKind, WorkFailure,
};
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::to_json;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::errors::LeaseError;
use crate::store::films::nodes;
use crate::store::leases::table as leases;
use crate::store::leases::{attempts, failures};
use crate::store::workers::table as workers;
use crate::store::{events, jobs};

impl Store {
    /// Records how building a scene ended, and answers what that changed.
    pub(crate) async fn report_scene(&self, report: SceneReport) -> Result<Option<SceneChange>, LeaseError> {
        self.write(move |connection| Box::pin(async move { record(connection, &report).await })).await
    }
}

async fn record(connection: &mut Connection, report: &SceneReport) -> Result<Option<SceneChange>, LeaseError> {
    let SceneReport { lease, token, ref outcome, now_ms, alive_ms } = *report;
    let (lease, job) = leases::valid_with_job(connection, lease, token, now_ms).await?;
    workers::mark_seen(connection, lease.worker, now_ms).await?;
    match outcome {
        BuildOutcome::Built(_) if job.built_scene.is_some() => Ok(None),
        BuildOutcome::Built(scene) => {
            keep(connection, job.id, scene, now_ms).await?;
            Ok(Some(SceneChange::Built(job.id)))
        }
        BuildOutcome::Refused { reason } if can_be_built(connection, &job).await? => {
            let reason = format!("the scene cannot be built: {reason}");
            let failure = WorkFailure { lease: lease.id, token, reason, refused_partials: 0, now_ms, alive_ms };
            let failed = failures::fail(connection, &failure).await?;
            Ok(Some(failed.map_or(SceneChange::Freed(job.id), SceneChange::Failed)))
        }
        BuildOutcome::Refused { reason } => Ok(refuse(connection, &lease, &job, reason, report).await?),
    }
}

async fn keep(connection: &mut Connection, job: JobId, scene: &BuiltScene, now_ms: i64) -> Result<(), StoreError> {
    query(
        "update jobs set scene_is_built = 1, left_to_chance = $2, chosen_methods = $3, import_notes = $4, \
         scene_refusal = null where id = $1",
    )
    .bind(job.to_string())
    .bind(to_json(&scene.left_to_chance)?)
    .bind(to_json(&scene.chosen_methods)?)
    .bind(to_json(&scene.import_notes)?)
    .execute(&mut *connection)
    .await?;
    events::record(connection, StoredKind::Job, job, now_ms).await
}

/// Whether a worker has built the scene of a job. Workers of earlier builds render without a report.
async fn can_be_built(connection: &mut Connection, job: &JobRecord) -> Result<bool, StoreError> {
    let is_known = job.built_scene.is_some() || job.reopened_ms.is_some();
    Ok(is_known || nodes::has_any(connection, job.id).await?)
}

/// Stores the refusal of one machine, or ends the job.
async fn refuse(
    connection: &mut Connection,
    lease: &LeaseRecord,
    job: &JobRecord,
    reason: &str,
    report: &SceneReport,
) -> Result<Option<SceneChange>, StoreError> {
    let worker = query("select name from workers where id = $1").bind(lease.worker.to_string());
    let name = worker.fetch_one(&mut *connection).await?.text("name")?;
    let refusal = SceneRefusal { worker: lease.worker, name, build: lease.build.clone(), reason: reason.to_owned() };
    if lease.state == LeaseState::Active {
        // Workers with another build fingerprint could try it too, once the job is unpinned.
        leases::release(connection, lease.id).await?;
    }
    let earlier = job.scene_refusal.as_ref().filter(|earlier| earlier.name != refusal.name);
    if earlier.is_none() && attempts::others_could_build(connection, job.id, &refusal.name, report.alive_ms).await? {
        let stored = query("update jobs set scene_refusal = $2 where id = $1").bind(job.id.to_string());
        stored.bind(to_json(&refusal)?).execute(&mut *connection).await?;
        events::record(connection, StoredKind::Job, job.id, report.now_ms).await?;
        return Ok(Some(SceneChange::Freed(job.id)));
    }
    let has_ended = jobs::end(connection, job.id, &Ending::Failed(in_words(earlier, &refusal)), report.now_ms).await?;
    Ok(has_ended.then_some(SceneChange::Failed(job.id)))
}

/// Why the machines refuse the scene.
fn in_words(earlier: Option<&SceneRefusal>, last: &SceneRefusal) -> String {
    let SceneRefusal { name, reason, .. } = last;
    match earlier {
        None => format!("worker `{name}` cannot build the scene: {reason}"),
        Some(earlier) if earlier.reason == *reason => {
            format!("workers `{}` and `{name}` cannot build the scene: {reason}", earlier.name)
        }
        Some(SceneRefusal { name: other, reason: other_reason, .. }) => {
            format!("worker `{name}` cannot build the scene: {reason}; worker `{other}` cannot either: {other_reason}")
        }
    }
}
