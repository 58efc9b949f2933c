//! Why an experiment failed.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

use clerestory_film::{CompareError, ImageError, PreviewError};
use clerestory_local_render::LocalRenderError;
use clerestory_render_core::document::OverrideError;
use clerestory_render_core::scene::SceneError;

/// A failure of the [`Host`](crate::Host).
pub type HostError = Box<dyn Error + Send + Sync>;

/// Why an experiment failed.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// A scene cannot be used.
    #[error("cannot use the scene {}", scene.display())]
    Scene {
        /// Its name or file.
        scene: PathBuf,
        /// Why.
        source: SceneError,
    },
    /// A file cannot be read.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file is no image that can be used.
    #[error("cannot use the image {}", file.display())]
    Image {
        /// The file.
        file: PathBuf,
        /// Why.
        source: ImageError,
    },
    /// A render failed.
    #[error("cannot render")]
    Render(#[source] LocalRenderError),
    /// The result of a render is no image.
    #[error("cannot make the image")]
    BadImage(#[source] ImageError),
    /// Two images cannot be compared.
    #[error("cannot compare the images")]
    Compare(#[source] CompareError),
    /// A picture of a computed scene cannot be made.
    #[error("cannot make a picture of the scene")]
    Picture(#[source] Box<dyn Error + Send + Sync>),
    /// A scene cannot be changed.
    #[error("cannot change the scene")]
    Override(#[source] Box<OverrideError>),
    /// The index of references cannot be read.
    #[error("{} is no index of references", file.display())]
    Index {
        /// The file.
        file: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// There are no threads to render on.
    #[error("cannot start a thread")]
    Threads(#[source] rayon::ThreadPoolBuildError),
    /// The report is written, and does not say what it should.
    #[error("{missed} of {all} claims are not met: {} says which", page.display())]
    Claims {
        /// Claims that are not met.
        missed: usize,
        /// All claims.
        all: usize,
        /// The page of the report.
        page: PathBuf,
    },
    /// A PNG cannot be made.
    #[error("cannot make the PNG")]
    Preview(#[source] PreviewError),
    /// A table cannot be written as CSV.
    #[error("cannot write a table as CSV")]
    Table(#[source] io::Error),
    /// A figure cannot be drawn.
    #[error("cannot draw a figure: {0}")]
    Figure(String),
    /// The user interrupted.
    #[error("interrupted; references that were complete are kept in {} for the next time", folder.display())]
    Interrupted {
        /// The folder of the experiment.
        folder: PathBuf,
    },
    /// The host failed, for instance to write a file or to call a farm.
    #[error(transparent)]
    Host(#[from] HostError),
}

impl ExperimentError {
    /// A scene cannot be used.
    pub(crate) fn scene(scene: &Path, source: SceneError) -> Self {
        match source {
            SceneError::Unreadable { file, source } => Self::Read { file, source },
            source => Self::Scene { scene: scene.to_owned(), source },
        }
    }
}
