//! A database and a bucket that are restored from backups: neither was taken at the moment of the other.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::time::{Duration, Instant};

use bytes::Bytes;
use clerestory_api::{JobState, JobView};
use clerestory_coordinator::{Bucket, Config};
use clerestory_test_servers::{postgres, s3};
use futures::TryStreamExt;
use object_store::aws::AmazonS3Builder;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt};

use crate::lost::{PASSES, forgetful, render_until, with_a_file};
use crate::support::*;

/// A bucket of its own for a farm.
struct TestBucket {
    bucket: Bucket,
    store: Box<dyn ObjectStore>,
}

impl TestBucket {
    fn new() -> Self {
        let name = s3().new_bucket();
        let options = s3().environment().map(|(name, value)| (name.to_ascii_lowercase().parse().unwrap(), value));
        let builder = AmazonS3Builder::new().with_bucket_name(&name).with_allow_http(true);
        let store = options.into_iter().fold(builder, |builder, (key, value)| builder.with_config(key, value));
        let bucket = Bucket::new(&format!("s3://{name}"), s3().environment()).unwrap();
        Self { bucket, store: Box::new(store.build().unwrap()) }
    }

    async fn names(&self) -> BTreeSet<Path> {
        self.store.list(None).map_ok(|object| object.location).try_collect().await.unwrap()
    }

    async fn nodes(&self) -> BTreeSet<Path> {
        self.names().await.into_iter().filter(|name| name.as_ref().starts_with("nodes/")).collect()
    }

    /// All that is in it now. What goes meanwhile is not.
    async fn backup(&self) -> BTreeMap<Path, Bytes> {
        let mut objects = BTreeMap::new();
        for name in self.names().await {
            match self.store.get(&name).await {
                Ok(found) => drop(objects.insert(name, found.bytes().await.unwrap())),
                Err(error) => assert!(matches!(error, object_store::Error::NotFound { .. }), "{error}"),
            }
        }
        objects
    }

    /// Another with what was saved.
    async fn restored(objects: BTreeMap<Path, Bytes>) -> Self {
        let bucket = Self::new();
        for (name, content) in objects {
            bucket.store.put(&name, content.into()).await.unwrap();
        }
        bucket
    }
}

/// A coordinator over a database and a bucket, with nothing else.
async fn farm_over(database: &str, bucket: &TestBucket) -> TestFarm {
    let adjust = |config: &mut Config| {
        forgetful(config);
        config.database = Some(database.parse().unwrap());
        config.bucket = Some(bucket.bucket.clone());
    };
    TestFarm::start_with(adjust).await
}

/// A dump of a database, as a new database.
fn restored_database(dump: &str) -> String {
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(file.path(), dump).unwrap();
    postgres().restored(file.path())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_whose_database_is_older_than_its_bucket_becomes_the_same_images() {
    let (database, bucket) = (postgres().new_database(), TestBucket::new());
    let farm = farm_over(&database, &bucket).await;
    let job = farm.submit(PASSES).await.id;
    render_until(&farm, job, |view| view.rounds == 2).await;
    let known = bucket.nodes().await;
    let dump = postgres().dump(&database).unwrap();
    render_until(&farm, job, |view| view.state == JobState::Done).await;
    // Of this one the database of the backup knows nothing.
    let unknown = farm.submit(1).await.id;
    render_until(&farm, unknown, |view| view.state == JobState::Done).await;
    let deadline = Instant::now() + Duration::from_secs(60);
    while !bucket.nodes().await.is_disjoint(&known) {
        assert!(Instant::now() < deadline, "what the database of the backup knows is not merged");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let objects = bucket.backup().await;
    farm.stop().await;

    let bucket = TestBucket::restored(objects).await;
    let farm = farm_over(&restored_database(&dump), &bucket).await;
    let jobs = farm.client.jobs().await.unwrap();
    assert_eq!(jobs.iter().map(|view| (view.id, view.state)).collect::<Vec<_>>(), [(job, JobState::Running)]);
    let done = render_until(&farm, job, |view| view.redone_nodes > 0 && view.state.is_final()).await;
    assert_eq!(done.state, JobState::Done, "{:?}", done.failure);
    assert!(bits(&farm.image(job).await) == expected_bits(PASSES));
    farm.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_whose_bucket_is_older_than_its_database_becomes_the_same_images() {
    let (database, bucket) = (postgres().new_database(), TestBucket::new());
    let farm = farm_over(&database, &bucket).await;
    let jobs = [farm.submit(PASSES).await.id, farm.submit(PASSES).await.id];
    let [done, open] = jobs;
    render_until(&farm, done, |view| view.rounds == 1).await;
    let objects = bucket.backup().await;
    let (with_file, content) = with_a_file();
    let asset = hash(&content);
    farm.client.upload_asset(&asset, content.clone(), |_| ()).await.unwrap();
    let lacking = farm.client.submit_job(&with_file).await.unwrap().id;
    render_until(&farm, done, |view| view.state == JobState::Done).await;
    render_until(&farm, open, |view| view.rounds == 3).await;
    let dump = postgres().dump(&database).unwrap();
    farm.stop().await;

    let bucket = TestBucket::restored(objects).await;
    let farm = farm_over(&restored_database(&dump), &bucket).await;
    for job in jobs {
        // One that was open and has lost all begins again: it does nothing twice.
        let has_begun = |view: &JobView| view.id == open || view.redone_nodes > 0;
        let view = render_until(&farm, job, |view| has_begun(view) && view.state.is_final()).await;
        assert_eq!(view.state, JobState::Done, "{:?}", view.failure);
        assert!(bits(&farm.image(job).await) == expected_bits(PASSES));
    }
    // A file of a scene nobody can render.
    let hold = render_until(&farm, lacking, |view| view.hold.is_some()).await.hold.unwrap();
    assert_eq!(hold.asset, Some(asset));
    farm.client.upload_asset(&asset, content, |_| ()).await.unwrap();
    render_until(&farm, lacking, |view| view.state == JobState::Done).await;
    farm.stop().await;
}
