//! Values of new columns that a migration cannot compute in SQL.

use serde_json::Value;

use crate::model::is_same_by_first;
use crate::store::engine::error::StoreError;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;

/// Sets `same_by_first` of the open jobs that older builds stored.
pub(super) async fn same_by_first(connection: &mut Connection) -> Result<(), StoreError> {
    let open = query("select id, scene from jobs where state in ('queued', 'running')");
    for row in open.fetch_all(&mut *connection).await? {
        let (job, scene) = (row.text("id")?, row.text("scene")?);
        let lights =
            serde_json::from_str(&scene).ok().and_then(|scene: Value| Some(scene.get("lights")?.as_array()?.len()));
        if !is_same_by_first(lights.unwrap_or(0)) {
            query("update jobs set same_by_first = 0 where id = $1").bind(job).execute(&mut *connection).await?;
        }
    }
    Ok(())
}
