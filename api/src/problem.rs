//! Problem documents (RFC 9457): how the coordinator says that a request failed, and why.

use std::fmt;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContentHash;

/// Media type of a problem document.
pub const PROBLEM_MEDIA_TYPE: &str = "application/problem+json";

/// What kind of problem it is. Stable: programs may decide by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProblemCode {
    /// No token, or not the farm's.
    Unauthorized,
    /// The request comes from another site's page.
    ForeignOrigin,
    /// There is no such path.
    UnknownPath,
    /// The path exists, the method does not.
    MethodNotAllowed,
    /// There is no such job.
    UnknownJob,
    /// There is no such worker; it registers again.
    UnknownWorker,
    /// What a worker of this name has rendered was found to be wrong.
    WorkerQuarantined,
    /// There is no such lease.
    UnknownLease,
    /// There is no such asset.
    UnknownAsset,
    /// There is no image yet: no node has been accepted.
    NoImageYet,
    /// The body is not JSON, or not of the expected shape.
    InvalidBody,
    /// The body is declared as something else than this endpoint reads, or as encoded.
    UnsupportedMediaType,
    /// The body or the query has an unknown field.
    UnknownField,
    /// A field has a value that it cannot have.
    InvalidField,
    /// A name has control characters, or others that change how a line is shown.
    InvalidName,
    /// The scene is not valid.
    InvalidScene,
    /// The reference image cannot be used with this scene.
    InvalidReference,
    /// The submission names content that has not been uploaded; `missing` lists it.
    MissingAssets,
    /// Pieces of a partial have not been uploaded, or are gone; `missing` lists them.
    MissingPieces,
    /// The uploaded bytes do not have the hash that names them.
    HashMismatch,
    /// The body is larger than allowed.
    BodyTooLarge,
    /// The body took too long to arrive.
    BodyTooSlow,
    /// The partial is not one that can be merged.
    InvalidPartial,
    /// The lease has run out; its nodes went back to the queue.
    LeaseExpired,
    /// The lease was given back.
    LeaseReturned,
    /// The fencing token is not the lease's.
    StaleToken,
    /// The job is not being rendered any more.
    JobNotRunning,
    /// The coordinator cannot serve now; try again.
    Unavailable,
    /// A fault of the coordinator; its log has the cause under the same request id.
    Internal,
    /// A code that this build does not know.
    #[serde(other)]
    Unknown,
}

/// A problem document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Problem {
    /// Identifies the kind of problem: `tag:clerestory,2026:problem:` and the code.
    #[serde(rename = "type")]
    pub kind: String,
    /// The kind of problem in words.
    pub title: String,
    /// HTTP status.
    pub status: u16,
    /// What went wrong here.
    pub detail: String,
    /// The kind of problem for programs.
    pub code: ProblemCode,
    /// Path of the field, header or parameter that is wrong.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// Its value, shortened when long.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<String>,
    /// What would be right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<String>,
    /// Content that has to be uploaded first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<ContentHash>,
    /// Names the request in the coordinator's log.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request_id: Option<String>,
}

impl fmt::Display for Problem {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.title, self.detail)?;
        if let Some(field) = &self.field {
            write!(formatter, "; field `{field}`")?;
        }
        if let Some(value) = &self.value {
            write!(formatter, ", value `{value}`")?;
        }
        if let Some(expected) = &self.expected {
            write!(formatter, ", expected {expected}")?;
        }
        if let Some(request_id) = &self.request_id {
            write!(formatter, " (request {request_id})")?;
        }
        Ok(())
    }
}
