//! What every blob store must do, in a directory and in a bucket alike, and what only one of them can.
//!
//! Each test that takes [`Blobs`] runs on both (`in_both!`); buckets are those of a real server that the tests start.

use std::collections::BTreeSet;
use std::fs;

use bytes::Bytes;
use clerestory_api::{ContentHash, JobId};
use clerestory_test_servers::s3;
use futures::stream::{self, Stream, StreamExt, TryStreamExt};
use tempfile::TempDir;
use uuid::Uuid;

use crate::blobs::{BlobError, Blobs, Bucket, ClaimError, UploadError};
use crate::model::{BlobRange, Identity};

async fn read(blobs: &Blobs, blob_range: &BlobRange) -> Result<Bytes, BlobError> {
    Ok(blobs.nodes(&blob_range.blob, &[blob_range]).await?.remove(0))
}

fn source(pieces: &[&'static str]) -> impl Stream<Item = Result<Bytes, String>> + Unpin {
    stream::iter(pieces.iter().map(|piece| Ok(Bytes::from_static(piece.as_bytes()))).collect::<Vec<_>>())
}

fn hash(content: &[u8]) -> ContentHash {
    ContentHash::from(*blake3::hash(content).as_bytes())
}

fn a_farm() -> Identity {
    Identity { farm: Uuid::now_v7(), has_blobs: false }
}

fn in_a_directory() -> (Blobs, TempDir) {
    let directory = tempfile::tempdir().unwrap();
    (Blobs::in_directory(directory.path().to_owned()).unwrap(), directory)
}

fn in_a_bucket() -> Blobs {
    let url = format!("s3://{}/farm", s3().new_bucket());
    Blobs::in_bucket(&Bucket::new(&url, s3().environment()).unwrap()).unwrap()
}

async fn names(blobs: &Blobs) -> BTreeSet<String> {
    let found: Vec<_> = blobs.store.list(None).try_collect().await.unwrap();
    found.into_iter().map(|blob| blob.location.to_string()).collect()
}

async fn an_asset_is_kept_only_when_it_is_what_its_name_says(blobs: Blobs) {
    assert_eq!(blobs.put_asset(hash(b"glass"), 100, source(&["gl", "ass"])).await.unwrap(), 5);
    assert_eq!(blobs.asset(hash(b"glass")).await.unwrap(), "glass");
    let (size, mut pieces) = blobs.asset_stream(hash(b"glass")).await.unwrap();
    assert_eq!((size, pieces.next().await.unwrap().unwrap()), (5, Bytes::from_static(b"glass")));
    let wrong = blobs.put_asset(hash(b"lead"), 100, source(&["glass"])).await.unwrap_err();
    assert!(matches!(wrong, UploadError::HashMismatch { found } if found == hash(b"glass")));
    let large = blobs.put_asset(hash(b"glass"), 4, source(&["glass"])).await.unwrap_err();
    assert!(matches!(large, UploadError::TooLarge { limit: 4 }));
    let cut_off = stream::iter([Ok(Bytes::from_static(b"le")), Err("gone")]);
    assert!(matches!(blobs.put_asset(hash(b"lead"), 100, cut_off).await, Err(UploadError::Source("gone"))));
    assert!(blobs.asset(hash(b"lead")).await.unwrap_err().is_missing());
    assert_eq!(blobs.asset(hash(b"glass")).await.unwrap(), "glass", "what was there stays");
    assert_eq!(names(&blobs).await.len(), 1, "refused uploads leave nothing behind");
}

async fn an_asset_of_many_pieces_comes_back_whole(blobs: Blobs) {
    // More than two parts of an upload to S3, the last one short.
    let content: Vec<u8> =
        (0..12_000_000_u32).flat_map(|k| (k.wrapping_mul(2_654_435_761) >> 24).to_le_bytes()[..1].to_vec()).collect();
    let pieces: Vec<Result<Bytes, String>> =
        content.chunks(70_001).map(|piece| Ok(Bytes::copy_from_slice(piece))).collect();
    let size = content.len() as u64;
    assert_eq!(blobs.put_asset(hash(&content), size, stream::iter(pieces)).await.unwrap(), size);
    assert!(blobs.asset(hash(&content)).await.unwrap() == content);
}

async fn put(blobs: &Blobs, node: &str) -> BlobRange {
    let mut blob_ranges = blobs.put_nodes(JobId::from(Uuid::now_v7()), vec![node.as_bytes().to_vec()]).await.unwrap();
    blob_ranges.pop().unwrap()
}

async fn nodes_that_are_stored_together_are_read_one_by_one(blobs: Blobs) {
    let nodes = ["nave", "", "choir"].map(|node| node.as_bytes().to_vec());
    let blob_ranges = blobs.put_nodes(JobId::from(Uuid::now_v7()), nodes.to_vec()).await.unwrap();
    assert_eq!(names(&blobs).await, BTreeSet::from([blob_ranges[0].blob.clone()]));
    assert_eq!(read(&blobs, &blob_ranges[2]).await.unwrap(), "choir");
    assert_eq!(read(&blobs, &blob_ranges[0]).await.unwrap(), "nave");
    let whole = BlobRange { offset: 0, length: None, ..blob_ranges[0].clone() };
    assert_eq!(read(&blobs, &whole).await.unwrap(), "navechoir");
}

async fn blobs_of_nodes_are_listed_and_removed(blobs: Blobs) {
    let kept = put(&blobs, "kept").await;
    let orphan = put(&blobs, "orphan").await;
    blobs.put_asset(hash(b"glass"), 100, source(&["glass"])).await.unwrap();
    let found = blobs.node_blobs().await.unwrap();
    assert_eq!(found, BTreeSet::from([kept.blob.clone(), orphan.blob.clone()]), "and no assets");
    assert_eq!(blobs.remove(vec![orphan.blob.clone()]).await, 1);
    assert_eq!(read(&blobs, &kept).await.unwrap(), "kept");
    assert!(read(&blobs, &orphan).await.unwrap_err().is_missing());
    assert_eq!(names(&blobs).await.len(), 2);
    blobs.remove(vec![kept.blob.clone(), orphan.blob]).await;
    assert!(read(&blobs, &kept).await.unwrap_err().is_missing(), "one that is gone already is no obstacle");
}

async fn a_store_that_takes_blobs_says_so_as_often_as_it_is_asked(blobs: Blobs) {
    for _ in 0..2 {
        blobs.try_to_write().await.unwrap();
    }
    assert!(blobs.node_blobs().await.unwrap().is_empty(), "what it writes is no node");
    blobs.claim(a_farm(), &BTreeSet::new()).await.unwrap();
}

async fn a_store_belongs_to_the_first_farm_that_claims_it(blobs: Blobs) {
    let [ours, theirs] = [(); 2].map(|()| a_farm());
    let nothing = BTreeSet::new();
    blobs.claim(ours, &nothing).await.unwrap();
    blobs.claim(ours, &nothing).await.unwrap();
    let refused = blobs.claim(theirs, &nothing).await.unwrap_err();
    assert!(matches!(&refused, ClaimError::Foreign { owner, .. } if *owner == ours.farm.to_string()), "{refused}");
    blobs.claim(Identity { has_blobs: true, ..ours }, &nothing).await.unwrap();
    assert!(blobs.is_of(ours.farm).await.unwrap() && !blobs.is_of(theirs.farm).await.unwrap());
}

async fn nodes_without_a_mark_are_only_taken_by_a_farm_that_knows_some(blobs: Blobs) {
    let farm = a_farm();
    let node = put(&blobs, "node").await;
    let refused = blobs.claim(farm, &BTreeSet::new()).await.unwrap_err();
    assert!(matches!(refused, ClaimError::Unknown { nodes: 1, .. }), "{refused}");
    blobs.claim(farm, &BTreeSet::from([node.blob.clone()])).await.unwrap();
    assert_eq!(read(&blobs, &node).await.unwrap(), "node");
}

async fn a_farm_has_one_store(blobs: Blobs) {
    let refused = blobs.claim(Identity { has_blobs: true, ..a_farm() }, &BTreeSet::new()).await.unwrap_err();
    assert!(matches!(refused, ClaimError::Elsewhere { .. }), "{refused}");
    assert!(names(&blobs).await.is_empty(), "nothing is left behind");
    blobs.claim(a_farm(), &BTreeSet::new()).await.unwrap();
}

macro_rules! in_both {
    ($($test:ident),* $(,)?) => {
        mod directory {
            $(#[tokio::test]
            async fn $test() {
                let (blobs, _directory) = super::in_a_directory();
                super::$test(blobs).await;
            })*
        }

        mod bucket {
            $(#[tokio::test]
            async fn $test() {
                super::$test(super::in_a_bucket()).await;
            })*
        }
    };
}

in_both!(
    an_asset_is_kept_only_when_it_is_what_its_name_says,
    an_asset_of_many_pieces_comes_back_whole,
    nodes_that_are_stored_together_are_read_one_by_one,
    blobs_of_nodes_are_listed_and_removed,
    a_store_that_takes_blobs_says_so_as_often_as_it_is_asked,
    a_store_belongs_to_the_first_farm_that_claims_it,
    nodes_without_a_mark_are_only_taken_by_a_farm_that_knows_some,
    a_farm_has_one_store,
);

#[tokio::test]
async fn what_was_half_written_in_a_directory_is_removed_when_it_is_opened() {
    let (blobs, directory) = in_a_directory();
    let kept = put(&blobs, "kept").await;
    let half = directory.path().join(format!("{}#1", kept.blob));
    fs::write(&half, b"half").unwrap();
    let blobs = Blobs::in_directory(directory.path().to_owned()).unwrap();
    assert!(!half.exists());
    assert_eq!(read(&blobs, &kept).await.unwrap(), "kept");
}

#[tokio::test]
async fn a_wrong_key_is_an_error() {
    let url = format!("s3://{}", s3().new_bucket());
    let wrong = s3().environment().map(|(name, value)| {
        let value = if name == "AWS_SECRET_ACCESS_KEY" { "cast-iron".to_owned() } else { value };
        (name, value)
    });
    let blobs = Blobs::in_bucket(&Bucket::new(&url, wrong).unwrap()).unwrap();
    assert!(matches!(blobs.claim(a_farm(), &BTreeSet::new()).await, Err(ClaimError::Store(_))));
}

/// A server that refuses everything, at this time.
async fn a_store_that_refuses_at(date: &'static str) -> u16 {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let port = listener.local_addr().unwrap().port();
    tokio::spawn(async move {
        while let Ok((mut caller, _)) = listener.accept().await {
            tokio::spawn(async move {
                let _ = caller.read(&mut [0; 16 << 10]).await;
                let answer =
                    format!("HTTP/1.1 403 Forbidden\r\ndate: {date}\r\ncontent-length: 0\r\nconnection: close\r\n\r\n");
                let _ = caller.write_all(answer.as_bytes()).await;
            });
        }
    });
    port
}

#[tokio::test]
async fn a_store_with_another_time_is_named_with_both_times() {
    let date = "Wed, 01 Jan 2020 12:00:00 GMT";
    let environment = s3().environment_through(a_store_that_refuses_at(date).await);
    let blobs = Blobs::in_bucket(&Bucket::new("s3://glass", environment).unwrap()).unwrap();
    for error in [
        blobs.claim(a_farm(), &BTreeSet::new()).await.unwrap_err().to_string(),
        blobs.try_to_write().await.unwrap_err().to_string(),
    ] {
        assert!(error.contains(date) && error.contains("set the clock of this machine"), "{error}");
        assert_eq!(error.matches("its clock shows").count(), 1, "a cause is said once: {error}");
    }
}
