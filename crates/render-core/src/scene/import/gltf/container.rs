//! The two forms of a glTF file: JSON as text (`.gltf`), and JSON with one buffer in a binary container (`.glb`).

use super::fault::fault;
use crate::settings::AssetProblem;
use crate::settings::limits::MAX_SCENE_BYTES;
use clerestory_film::file_format::{FileFormat, without_byte_order_mark};

/// A file of which only the container has been read.
pub(super) struct Container<'a> {
    /// The JSON of the file.
    pub(super) json: &'a [u8],
    /// The buffer of a binary container.
    pub(super) binary: Option<&'a [u8]>,
}

const MAGIC: &[u8] = b"glTF";
const JSON_CHUNK: &[u8] = b"JSON";
const BINARY_CHUNK: &[u8] = b"BIN\0";

/// Bytes of the JSON without its long strings. A parsed member takes many times the bytes of its text.
const MAX_JSON_BYTES: usize = MAX_SCENE_BYTES;

/// Strings of more bytes, such as pictures in `data:` URIs, take no more memory than their text.
const LONG_STRING: usize = 1024;

impl<'a> Container<'a> {
    /// Finds the parts of a file.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, AssetProblem> {
        let container = if bytes.starts_with(MAGIC) { Self::of_binary(bytes)? } else { Self::of_text(bytes)? };
        let found = structure_bytes(container.json);
        if found > MAX_JSON_BYTES {
            return Err(AssetProblem::TooLarge {
                found: format!("{found} bytes of JSON without long strings"),
                limit: format!("{MAX_JSON_BYTES}: keep geometry in buffers"),
            });
        }
        Ok(container)
    }

    fn of_text(bytes: &'a [u8]) -> Result<Self, AssetProblem> {
        let json = without_byte_order_mark(bytes);
        if json.trim_ascii_start().starts_with(b"{") {
            return Ok(Self { json, binary: None });
        }
        let found = match FileFormat::of(bytes) {
            Some(format) => format!("it looks like {format}"),
            None => "it is neither JSON nor a binary container".to_owned(),
        };
        Err(AssetProblem::malformed(format_args!("is not a readable glTF file: {found}")))
    }

    fn of_binary(bytes: &'a [u8]) -> Result<Self, AssetProblem> {
        let (Some(version), Some(length)) = (number(bytes, 4), number(bytes, 8)) else {
            return Err(fault("header", format_args!("the file ends after {} bytes", bytes.len())));
        };
        if version != 2 {
            let message = format!("is of version {version}, must be 2: export the scene as glTF 2.0");
            return Err(fault("header", message));
        }
        let Some(mut rest) = bytes.get(12..length) else {
            let message = format!("says {length} bytes, but the file has {}: it was cut off", bytes.len());
            return Err(fault("header", message));
        };
        let mut container = Self { json: &[], binary: None };
        let mut chunk = 0;
        while let (Some(length), Some(kind)) = (number(rest, 0), rest.get(4..8)) {
            let Some((content, after)) = rest[8..].split_at_checked(length) else {
                let left = rest.len() - 8;
                return Err(fault(format_args!("chunk {chunk}"), format_args!("says {length} bytes, has {left}")));
            };
            match (chunk, kind) {
                (0, JSON_CHUNK) => container.json = without_zeros(content),
                (0, _) => return Err(fault("chunk 0", "must be the JSON of the file")),
                (1, BINARY_CHUNK) => container.binary = Some(content),
                // Chunks of other kinds are of extensions.
                _ => {}
            }
            rest = after;
            chunk += 1;
        }
        if chunk == 0 {
            return Err(fault("header", "no chunk of JSON follows it"));
        }
        Ok(container)
    }
}

/// Four bytes at a place.
fn number(bytes: &[u8], place: usize) -> Option<usize> {
    let number = bytes.get(place..)?.first_chunk()?;
    usize::try_from(u32::from_le_bytes(*number)).ok()
}

/// JSON is padded with spaces; some programs pad it with zeros.
fn without_zeros(json: &[u8]) -> &[u8] {
    let end = json.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    &json[..end]
}

/// The bytes of JSON without its long strings.
fn structure_bytes(json: &[u8]) -> usize {
    let mut total = 0;
    let mut rest = json;
    while let Some(start) = rest.iter().position(|byte| *byte == b'"') {
        let string = &rest[start + 1..];
        let length = string_length(string);
        total += start + 2 + if length > LONG_STRING { 0 } else { length };
        rest = string.get(length + 1..).unwrap_or_default();
    }
    total + rest.len()
}

/// The bytes of a JSON string up to its closing quotation mark.
fn string_length(string: &[u8]) -> usize {
    let mut at = 0;
    while let Some(byte) = string.get(at) {
        match byte {
            b'"' => return at,
            b'\\' => at += 2,
            _ => at += 1,
        }
    }
    string.len()
}
