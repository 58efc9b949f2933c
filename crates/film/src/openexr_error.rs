//! Why an OpenEXR file is not read or written.

use thiserror::Error;

/// Why an OpenEXR file is not read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum OpenExrError {
    /// The first bytes are not those of an OpenEXR file.
    #[error("not an OpenEXR file: {0}")]
    NotOpenExr(String),
    /// The header claims more than the budget allows. Nothing was decoded.
    #[error("the image is too large: {width} x {height} pixels need {needed} bytes; at most {allowed} are allowed")]
    TooLarge {
        /// Pixels across the part that exceeds the budget.
        width: u64,
        /// Pixels down that part.
        height: u64,
        /// Bytes for all parts up to that one.
        needed: u64,
        /// The budget.
        allowed: u64,
    },
    /// A feature of OpenEXR that is not read here.
    #[error("{0} is not supported: save the image flat, as scan lines with ZIP compression")]
    Unsupported(String),
    /// The file holds a part of the picture, or more than it.
    #[error(
        "its pixels (data window) are {data}, its picture (display window) is {display}: save it with both of one \
         size, filled up or cut"
    )]
    OtherWindow {
        /// Where pixels are.
        data: String,
        /// Where the picture is.
        display: String,
    },
    /// The colours are of other primaries than those of this program.
    #[error("its colours (attribute chromaticities) are {found}; convert it to linear Rec. 709")]
    OtherPrimaries {
        /// The primaries.
        found: String,
    },
    /// The file contradicts itself or ends too early.
    #[error("the OpenEXR file is damaged: {0}")]
    Damaged(String),
    /// The file could not be read from where it is.
    #[error("the OpenEXR file cannot be read: {0}")]
    Read(std::io::ErrorKind),
    /// The file could not be written to where it belongs.
    #[error("the OpenEXR file cannot be written: {0}")]
    Write(std::io::ErrorKind),
}

impl From<exr::error::Error> for OpenExrError {
    fn from(error: exr::error::Error) -> Self {
        match error {
            exr::error::Error::NotSupported(what) => {
                let what = what.trim_end_matches(" yet").trim_end_matches(" not supported").trim_end_matches(" are");
                Self::Unsupported(what.to_owned())
            }
            exr::error::Error::Io(error) if !is_of_content(error.kind()) => Self::Read(error.kind()),
            exr::error::Error::Invalid(what) if what == "reference to missing bytes" => {
                Self::Damaged("it ends too early".to_owned())
            }
            exr::error::Error::Invalid(what) => Self::Damaged(what.into_owned()),
            other => Self::Damaged(other.to_string()),
        }
    }
}

/// Whether what a decoder calls an error of reading is one of what was read.
fn is_of_content(kind: std::io::ErrorKind) -> bool {
    matches!(kind, std::io::ErrorKind::InvalidData | std::io::ErrorKind::InvalidInput)
}
