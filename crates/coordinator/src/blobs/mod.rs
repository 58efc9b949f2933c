//! TODO

mod bucket;
mod clock_skew;
mod store;
#[cfg(test)]
mod tests;

pub use bucket::{Bucket, InvalidBucket};
pub(crate) use store::{BlobError, Blobs, ClaimError, UploadError};
