//! Assets: which content has been uploaded.

use clerestory_api::ContentHash;

use super::row::big;
use super::sql::query;
use super::{Store, StoreError};

impl Store {
    /// Whether the content has been uploaded.
    pub(crate) async fn has_asset(&self, hash: ContentHash) -> Result<bool, StoreError> {
        let found =
            query("select 1 from assets where hash = $1").bind(hash.to_string()).fetch_optional(&self.readers).await?;
        Ok(found.is_some())
    }

    /// Bytes of some uploaded contents together, each counted as often as it is named.
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
}
