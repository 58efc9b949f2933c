//! The blob store: assets and nodes, written once, in a directory or a bucket of an S3-compatible store.

mod bucket;
mod clock_skew;
mod store;
#[cfg(test)]
mod tests;

pub use bucket::{Bucket, InvalidBucket};
pub(crate) use store::{BlobError, Blobs, ClaimError, UploadError};
