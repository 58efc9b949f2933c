//! Assets: which content has been uploaded.

use std::collections::BTreeSet;

use clerestory_api::{ContentHash, JobHold, JobId};

use crate::model::StoredKind;
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{big, to_json};
use crate::store::engine::row::Row;
use crate::store::engine::sql::query;
use crate::store::events;
use crate::store::leases::expiry;

impl Store {
    /// Whether the content has been uploaded.
    pub(crate) async fn has_asset(&self, hash: ContentHash) -> Result<bool, StoreError> {
        let found =
            query("select 1 from assets where hash = $1").bind(hash.to_string()).fetch_optional(&self.readers).await?;
        Ok(found.is_some())
    }

    /// Bytes of some uploaded contents together. A content that is named twice counts twice.
    pub(crate) async fn asset_bytes(&self, hashes: impl Iterator<Item = ContentHash>) -> Result<u64, StoreError> {
        let mut bytes = 0_u64;
        for hash in hashes {
            let size = query("select size from assets where hash = $1").bind(hash.to_string());
            if let Some(row) = size.fetch_optional(&self.readers).await? {
                bytes = bytes.saturating_add(row.number("size")?);
            }
        }
        Ok(bytes)
    }

    /// Makes an uploaded blob an asset of the farm.
    pub(crate) async fn insert_asset(&self, hash: ContentHash, size: u64, now_ms: i64) -> Result<(), StoreError> {
        self.write(move |connection| {
            Box::pin(async move {
                query("insert into assets (hash, size, created_ms) values ($1, $2, $3) on conflict (hash) do nothing")
                    .bind(hash.to_string())
                    .bind(big(size))
                    .bind(now_ms)
                    .execute(connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }

    /// Releases the jobs that are held for a content, and answers which.
    pub(crate) async fn release_for_asset(&self, hash: ContentHash, now_ms: i64) -> Result<Vec<JobId>, StoreError> {
        let held = "select id, hold from jobs where hold is not null";
        let of_it = move |row: &Row| Ok::<_, StoreError>(row.json::<JobHold>("hold")?.asset == Some(hash));
        let seen = query(held).fetch_all(&self.readers).await?;
        if !seen.iter().map(of_it).collect::<Result<Vec<_>, _>>()?.contains(&true) {
            return Ok(Vec::new());
        }
        self.write(move |connection| {
            Box::pin(async move {
                let mut released = Vec::new();
                for row in &query(held).fetch_all(&mut *connection).await? {
                    let job = row.parsed("id")?;
                    if of_it(row)? && expiry::release(connection, job, now_ms).await? {
                        released.push(job);
                    }
                }
                Ok(released)
            })
        })
        .await
    }

    /// Contents that jobs need which have not ended: assets of their scenes, and references.
    pub(crate) async fn needed_assets(&self) -> Result<BTreeSet<ContentHash>, StoreError> {
        let rows = query(
            "select hash from job_assets join jobs on jobs.id = job where state in ('queued', 'running') \
             union select reference from jobs where reference is not null and state in ('queued', 'running')",
        );
        rows.fetch_all(&self.readers).await?.iter().map(|row| row.parsed("hash")).collect()
    }

    /// Holds the jobs that need a lost content, and answers which.
    pub(crate) async fn hold_for_lost_asset(&self, hash: ContentHash, now_ms: i64) -> Result<Vec<JobId>, StoreError> {
        self.write(move |connection| {
            Box::pin(async move {
                let rows = query(
                    "select jobs.id, path from jobs left join job_assets on job = jobs.id and hash = $1 \
                     where hold is null and state in ('queued', 'running') and (hash is not null or reference = $1)",
                );
                let rows = rows.bind(hash.to_string()).fetch_all(&mut *connection).await?;
                let mut held = Vec::new();
                for row in &rows {
                    let job: JobId = row.parsed("id")?;
                    if held.contains(&job) {
                        continue;
                    }
                    let what = match row.optional_text("path")? {
                        Some(path) => format!("the file `{path}` of its scene"),
                        None => "its reference".to_owned(),
                    };
                    let reason = format!(
                        "{what} is lost or damaged in the blob store (content hash {hash}): when the file is \
                         uploaded again, \
                         as `clerestory submit` of the same scene does, the job goes on"
                    );
                    let hold = JobHold { since_ms: now_ms, reason, node: None, workers: Vec::new(), asset: Some(hash) };
                    query("update jobs set hold = $2 where id = $1")
                        .bind(job.to_string())
                        .bind(to_json(&hold)?)
                        .execute(&mut *connection)
                        .await?;
                    events::record(connection, StoredKind::Job, job, now_ms).await?;
                    held.push(job);
                }
                Ok(held)
            })
        })
        .await
    }
}
