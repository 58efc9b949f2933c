//! URIs of buffers and pictures: bytes within the file (`data:`), or the name of a file beside it.

use std::fmt;

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::{percent_decode, percent_decode_str};

use super::fault::fault;
use crate::settings::AssetProblem;
use crate::settings::check::{ASSET_NAME_RULE, is_asset_name};

/// What a URI names.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Resource {
    /// The bytes of a `data:` URI.
    Data(Vec<u8>),
    /// A file by its name, relative to the glTF file. The name holds to the rule for names of assets.
    File(String),
}

/// Some programs leave the padding out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Characters of a URI in a message.
const QUOTED: usize = 80;

impl Resource {
    /// Reads the URI at `place`.
    pub(super) fn of(uri: &str, place: impl fmt::Display) -> Result<Self, AssetProblem> {
        match without_scheme(uri) {
            Some(data) => data_bytes(data).map(Self::Data).map_err(|problem| fault(place, problem)),
            None => file_name(uri).map(Self::File).map_err(|problem| fault(place, problem)),
        }
    }

    /// The name of the file that a URI names, without decoding a `data:` URI.
    pub(super) fn file_of(uri: &str, place: impl fmt::Display) -> Result<Option<String>, AssetProblem> {
        match without_scheme(uri) {
            Some(_) => Ok(None),
            None => file_name(uri).map(Some).map_err(|problem| fault(place, problem)),
        }
    }
}

/// What follows `data:`.
fn without_scheme(uri: &str) -> Option<&str> {
    let (scheme, data) = uri.split_at_checked(5)?;
    scheme.eq_ignore_ascii_case("data:").then_some(data)
}

fn data_bytes(data: &str) -> Result<Vec<u8>, String> {
    let Some((header, content)) = data.split_once(',') else {
        return Err("a data: URI must have a comma before its bytes".to_owned());
    };
    let is_base64 = header.rsplit(';').next().is_some_and(|last| last.trim().eq_ignore_ascii_case("base64"));
    let content = percent_decode_str(content);
    if !is_base64 {
        return Ok(content.collect());
    }
    let content: std::borrow::Cow<'_, [u8]> = content.into();
    BASE64.decode(&content).map_err(|error| format!("a data: URI that is not base64: {error}"))
}

/// The name of a file that lies beside the glTF file or below its folder.
fn file_name(uri: &str) -> Result<String, String> {
    let refuse = |why: &str| {
        let start: String = uri.chars().take(QUOTED).collect();
        Err(format!("found \"{start}\", {why}"))
    };
    let Ok(name) = percent_decode(uri.as_bytes()).decode_utf8() else {
        return refuse("must be percent-encoded UTF-8");
    };
    let parts: Vec<&str> = name.split('/').filter(|part| *part != ".").collect();
    let name = parts.join("/");
    if !is_asset_name(&name) {
        return refuse(&format!("must be a path relative to the glTF file {ASSET_NAME_RULE}"));
    }
    Ok(name)
}
