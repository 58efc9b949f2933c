//! Why a submission is refused: each reason names the field, its value and what would be right.

use clerestory_api::ContentHash;
use clerestory_film::{InvalidTarget, SamplingError};
use clerestory_render_core::scene::SceneError;
use clerestory_render_core::scene::description::SCENE_FORMAT_VERSION;
use tokio::task::JoinError;

use super::submission_memory::Busy;
use crate::films::FilmError;
use crate::model::UnprintableName;
use crate::store::StoreError;

/// A submission is refused, or could not be checked.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SubmissionError {
    /// A field has a value that it cannot have.
    #[error("the value of `{field}` cannot be used")]
    InvalidField {
        /// The field.
        field: String,
        /// Its value.
        value: String,
        /// What would be right.
        expected: String,
    },
    /// A name cannot be shown.
    #[error(transparent)]
    Name(#[from] UnprintableName),
    /// The scene cannot be used.
    #[error("{detail}")]
    InvalidScene {
        /// What is wrong.
        detail: String,
        /// The field.
        field: String,
        /// Its value.
        value: Option<String>,
        /// What would be right.
        expected: Option<String>,
    },
    /// The reference cannot be used.
    #[error("{detail}")]
    InvalidReference {
        /// What is wrong.
        detail: String,
        /// The reference.
        hash: ContentHash,
        /// What would be right.
        expected: String,
    },
    /// Contents must be uploaded first.
    #[error("{} of the named contents must be uploaded first; `missing` lists them", .0.len())]
    MissingAssets(Vec<ContentHash>),
    /// There is no memory to check it now.
    #[error(transparent)]
    Busy(#[from] Busy),
    /// An asset cannot be read, or the database failed.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// The scene cannot be written as JSON.
    #[error("the scene cannot be written as JSON")]
    Json(#[from] serde_json::Error),
    /// The sampling of a valid scene is impossible.
    #[error("the scene's sampling is impossible")]
    Sampling(#[from] SamplingError),
    /// The computation was stopped.
    #[error("the computation was stopped")]
    Stopped(#[from] JoinError),
}

impl SubmissionError {
    /// A field that has a value which it cannot have.
    pub(super) fn invalid_field(field: impl Into<String>, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::InvalidField { field: field.into(), value: value.to_string(), expected: expected.into() }
    }
}

impl From<StoreError> for SubmissionError {
    fn from(error: StoreError) -> Self {
        Self::Film(error.into())
    }
}

impl From<InvalidTarget> for SubmissionError {
    fn from(InvalidTarget { field, value, expected }: InvalidTarget) -> Self {
        Self::invalid_field(field, serde_json::Value::from(value), expected)
    }
}

impl From<SceneError> for SubmissionError {
    fn from(error: SceneError) -> Self {
        let field = match error.path() {
            "" | "$" => "scene".to_owned(),
            path if path.starts_with('[') => format!("scene{path}"),
            path => format!("scene.{path}"),
        };
        let mut detail = error.to_string();
        if let (SceneError::Structure { .. }, Some(position)) = (&error, detail.rfind(" at line ")) {
            // It is a position in the scene as it was taken out of the submission, which nobody sees.
            detail.truncate(position);
        }
        let (value, expected) = match error {
            SceneError::Value { found, expected, .. } => (Some(found), Some(expected)),
            SceneError::UnsupportedVersion { found } => (Some(found), Some(format!("1 to {SCENE_FORMAT_VERSION}"))),
            SceneError::Asset { name, .. } => (Some(name), None),
            _ => (None, None),
        };
        Self::InvalidScene { detail, field, value, expected }
    }
}
