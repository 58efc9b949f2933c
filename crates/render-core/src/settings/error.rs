//! What can be wrong with a scene.

use std::fmt;
use std::path::PathBuf;

use serde_path_to_error::Segment;
use thiserror::Error;

use super::SCENE_FORMAT_VERSION;
use super::path::{JsonPath, MemberStep, ROOT};

/// A scene that cannot be used. Every error names the place in the scene file, what stands there and what would be
/// right.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The text is not JSON.
    #[error("{ROOT}: not valid JSON: {message}")]
    Syntax {
        /// What the JSON reader says, with line and column.
        message: String,
    },
    /// The file is of a version that this build does not read.
    #[error("version: version {found} is not supported, this build reads 1 to {SCENE_FORMAT_VERSION}")]
    UnsupportedVersion {
        /// The version in the file.
        found: String,
    },
    /// A member is unknown, missing, written twice or of the wrong type.
    #[error("{path}: {message}")]
    Structure {
        /// Place in the scene file.
        path: String,
        /// What was found and what was expected.
        message: String,
    },
    /// A value of the right type that makes no sense.
    #[error("{path}: found {found}, must be {expected}")]
    Value {
        /// Place in the scene file.
        path: String,
        /// What stands there.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// A file that the scene names cannot be used.
    #[error("{path}: file \"{name}\" {problem}")]
    Asset {
        /// Place in the scene file that names it.
        path: String,
        /// Its name as written there.
        name: String,
        /// What is wrong with it.
        problem: AssetProblem,
    },
    /// The scene file itself cannot be read.
    #[error("{ROOT}: cannot read the scene file {}: {source}", file.display())]
    Unreadable {
        /// The scene file.
        file: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
}

/// What can be wrong with a file that a scene names.
#[derive(Debug, Error)]
pub enum AssetProblem {
    /// It was not supplied with the scene.
    #[error("is missing: it must be supplied with the scene")]
    Missing,
    /// The operating system cannot read it.
    #[error("cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    /// It is a symbolic link, or in a folder that is one, and its target is not in the folder of the scene file.
    #[error("leads to {}, outside the folder of the scene file: copy it into that folder", target.display())]
    Outside {
        /// The file itself.
        target: PathBuf,
    },
    /// It, or what it decodes to, is larger than what this build accepts.
    #[error("has {found}, must have at most {limit}")]
    TooLarge {
        /// How much it holds.
        found: String,
        /// How much is allowed.
        limit: String,
    },
    /// Its content makes no sense.
    #[error("{0}")]
    Malformed(String),
}

impl AssetProblem {
    /// Content that makes no sense: a phrase that goes on after the name of the file. Messages of decoders may quote
    /// the file, so they are cut to a line.
    pub(crate) fn malformed(message: impl fmt::Display) -> Self {
        Self::Malformed(one_line(&message.to_string()))
    }
}

impl SceneError {
    /// The place in the scene file, such as `panes[2].front.crown.wavelength`; `$` for the file as a whole.
    pub fn path(&self) -> &str {
        match self {
            Self::Syntax { .. } | Self::Unreadable { .. } => ROOT,
            Self::UnsupportedVersion { .. } => "version",
            Self::Structure { path, .. } | Self::Value { path, .. } | Self::Asset { path, .. } => path,
        }
    }

    /// The same without a place in a text, for a text that nobody has written.
    pub(crate) fn without_place_in_text(mut self) -> Self {
        if let Self::Structure { message, .. } = &mut self
            && let Some(at) = message.rfind(" at line ")
        {
            message.truncate(at);
        }
        self
    }

    /// The same with another path, where there is one.
    pub(crate) fn with_path(mut self, change: impl FnOnce(&str) -> Option<String>) -> Self {
        if let Self::Structure { path, .. } | Self::Value { path, .. } | Self::Asset { path, .. } = &mut self
            && let Some(changed) = change(path)
        {
            *path = changed;
        }
        self
    }

    /// A value of the right type that makes no sense.
    pub(crate) fn value(path: &JsonPath<'_>, found: impl fmt::Display, expected: impl fmt::Display) -> Self {
        Self::Value { path: path.to_string(), found: one_line(&found.to_string()), expected: expected.to_string() }
    }

    /// What the reader says of text that is JSON but not a scene, at its place.
    pub(crate) fn from_json(error: serde_path_to_error::Error<serde_json::Error>) -> Self {
        let path = match written(error.path()).as_str() {
            "" => ROOT.to_owned(),
            path => one_line(path),
        };
        let mut message = one_line(&error.inner().to_string());
        if let Some(place) = NAME_WITHOUT_MEMBERS.iter().find_map(|said| message.strip_prefix(said)) {
            let name = path.rsplit('.').next().unwrap_or_default();
            message = format!("found the name alone, must be {{\"{name}\": {{...}}}} with its members{place}");
        }
        if !error.inner().is_syntax() {
            return Self::Structure { path, message };
        }
        // The text is known to be JSON. What the reader still calls a syntax error is one of these.
        let message = if message.starts_with("number out of range") {
            format!("{message}, must be a finite number")
        } else if message.starts_with("trailing characters") {
            message.replacen("trailing characters", "too many elements", 1)
        } else {
            "must be one choice: a string, or an object with exactly one member, named after the choice".to_owned()
        };
        Self::Structure { path, message }
    }
}

/// What the reader says of a choice that has members and is given by its name alone.
const NAME_WITHOUT_MEMBERS: [&str; 2] =
    ["invalid type: unit variant, expected newtype variant", "invalid type: unit variant, expected struct variant"];

/// A path of the reader, written as a [`JsonPath`]; empty for the scene itself.
fn written(path: &serde_path_to_error::Path) -> String {
    let mut text = String::new();
    for segment in path {
        let step = match segment {
            Segment::Seq { index } => format!("[{index}]"),
            Segment::Map { key: name } | Segment::Enum { variant: name } => {
                MemberStep { name, is_first: text.is_empty() }.to_string()
            }
            Segment::Unknown => "[?]".to_owned(),
        };
        text.push_str(&step);
    }
    text
}

/// At most this many characters of a user's text are repeated in a message.
const MAX_QUOTED: usize = 300;

/// `text` on one line and of bounded length.
fn one_line(text: &str) -> String {
    let mut line: String = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if let Some((end, _)) = line.char_indices().nth(MAX_QUOTED) {
        line.truncate(end);
        line.push_str("...");
    }
    line
}
