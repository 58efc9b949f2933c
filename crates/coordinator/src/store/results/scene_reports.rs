//! Reports of workers on the scenes of their jobs. The first report of a job counts.

use clerestory_api::{BuildOutcome, BuiltScene, JobId};

use crate::model::{Ending, SceneReport, StoredKind};
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::to_json;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::errors::LeaseError;
use crate::store::events;
use crate::store::jobs;
use crate::store::leases::table as leases;
use crate::store::workers::table as workers;

impl Store {
    /// Records how building a scene ended. Answers the job if that changed it. A scene that cannot be built ends its
    /// job, and counts as a failure neither of the worker nor of a node.
    pub(crate) async fn report_scene(&self, report: SceneReport) -> Result<Option<JobId>, LeaseError> {
        self.write(move |connection| Box::pin(async move { record(connection, &report).await })).await
    }
}

async fn record(connection: &mut Connection, report: &SceneReport) -> Result<Option<JobId>, LeaseError> {
    let SceneReport { lease, token, outcome, now_ms } = report;
    let (lease, job) = leases::valid_with_job(connection, *lease, *token, *now_ms).await?;
    workers::mark_seen(connection, lease.worker, *now_ms).await?;
    if job.built_scene.is_some() {
        return Ok(None);
    }
    match outcome {
        BuildOutcome::Built(scene) => keep(connection, job.id, scene, *now_ms).await?,
        BuildOutcome::Refused { reason } => {
            let worker = query("select name from workers where id = $1").bind(lease.worker.to_string());
            let worker = worker.fetch_one(&mut *connection).await?.text("name")?;
            let failure = format!("worker `{worker}` cannot build the scene: {reason}");
            jobs::end(connection, job.id, &Ending::Failed(failure), *now_ms).await?;
        }
    }
    Ok(Some(job.id))
}

async fn keep(connection: &mut Connection, job: JobId, scene: &BuiltScene, now_ms: i64) -> Result<(), StoreError> {
    query("update jobs set scene_is_built = 1, left_to_chance = $2, chosen_methods = $3 where id = $1")
        .bind(job.to_string())
        .bind(to_json(&scene.left_to_chance)?)
        .bind(to_json(&scene.chosen_methods)?)
        .execute(&mut *connection)
        .await?;
    events::record(connection, StoredKind::Job, job, now_ms).await
}
