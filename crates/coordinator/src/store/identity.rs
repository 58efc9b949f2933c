//! The identity of a farm, and the key that only its coordinators know.

use futures::future::BoxFuture;
use uuid::Uuid;

use crate::model::{CheckKey, Identity};
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;

impl Store {
    /// The identity of the farm. The first call creates it.
    pub(crate) async fn identity(&self) -> Result<Identity, StoreError> {
        self.write(|connection| Box::pin(async move { read_identity(connection).await })).await
    }

    /// The key that selects nodes for checks. The first call creates it.
    pub(crate) async fn check_key(&self) -> Result<CheckKey, StoreError> {
        self.write(|connection| Box::pin(async move { read_check_key(connection).await })).await
    }

    /// Claims a blob store while no other coordinator can, and records that the farm has one. The claim's own error is
    /// the inner one.
    pub(crate) async fn claim_blobs<E, F>(&self, claim: F) -> Result<Result<(), E>, StoreError>
    where
        E: Send + 'static,
        F: FnOnce(Identity) -> BoxFuture<'static, Result<(), E>> + Send + 'static,
    {
        self.write(|connection| {
            Box::pin(async move {
                let claimed = claim(read_identity(connection).await?).await;
                if claimed.is_ok() {
                    query("update farm set has_blobs = 1 where has_blobs = 0").execute(connection).await?;
                }
                Ok(claimed)
            })
        })
        .await
    }
}

async fn read_check_key(connection: &mut Connection) -> Result<CheckKey, StoreError> {
    read_identity(connection).await?;
    let mut fresh = [0; 32];
    getrandom::fill(&mut fresh).map_err(|error| StoreError::Database(error.to_string()))?;
    query("update farm set check_key = $1 where check_key is null")
        .bind(hex::encode(fresh))
        .execute(&mut *connection)
        .await?;
    let key = query("select check_key from farm").fetch_one(connection).await?.text("check_key")?;
    let mut bytes = [0; 32];
    let decoded = hex::decode_to_slice(&key, &mut bytes);
    decoded
        .map(|()| CheckKey(bytes))
        .map_err(|_| StoreError::Corrupt { column: "check_key", value: "a text".to_owned() })
}

async fn read_identity(connection: &mut Connection) -> Result<Identity, StoreError> {
    query("insert into farm (single, id) values (1, $1) on conflict (single) do nothing")
        .bind(Uuid::now_v7().to_string())
        .execute(&mut *connection)
        .await?;
    let row = query("select id, has_blobs from farm").fetch_one(connection).await?;
    Ok(Identity { farm: row.parsed("id")?, has_blobs: row.integer("has_blobs")? != 0 })
}
