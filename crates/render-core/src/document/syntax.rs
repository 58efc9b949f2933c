//! What is wrong with a text that is not JSON, and what its author may have meant.

use crate::settings::SceneError;
use clerestory_film::file_format::FileFormat;

/// Refuses a file that is known to hold something other than a scene.
pub(super) fn refuse_other_formats(bytes: &[u8]) -> Result<(), SceneError> {
    match FileFormat::of(bytes) {
        Some(format) if !format.is_json() => Err(SceneError::Syntax { message: format.instead_of_scene() }),
        _ => Ok(()),
    }
}

/// The first byte of a text that is not UTF-8.
pub(super) fn not_utf_8(text: &[u8], place: usize) -> String {
    let before = &text[..place];
    let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
    let start = before.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    let column = String::from_utf8_lossy(&before[start..]).chars().count() + 1;
    let byte = text[place];
    format!(
        "the text is not UTF-8 at line {line} column {column}: the byte {byte:02x}, in Latin-1 \"{}\"; \
         save the file as UTF-8",
        char::from(byte)
    )
}

/// What the JSON reader says, and what is usually the matter there.
pub(super) fn with_hint(text: &[u8], error: &serde_json::Error) -> String {
    match hint(text, error) {
        Some(hint) => format!("{error}: {hint}"),
        None => error.to_string(),
    }
}

fn hint(text: &[u8], error: &serde_json::Error) -> Option<&'static str> {
    let message = error.to_string();
    if message.starts_with("control character") {
        return Some("a text must end on the line on which it begins, and write a tab as \\t");
    }
    let before = text.split_inclusive(|byte| *byte == b'\n').take(error.line().checked_sub(1)?).map(<[u8]>::len);
    let line = before.sum::<usize>();
    // The reader counts to the byte that it did not expect, or to the one before.
    let places = [error.column().saturating_sub(1), error.column()].map(|column| line + column);
    let begins = |words: &[&[u8]]| {
        places.into_iter().filter_map(|at| text.get(at..)).any(|rest| words.iter().any(|word| rest.starts_with(word)))
    };
    match text.get(places[0])? {
        _ if begins(&[b"//", b"/*", b"#"]) => Some("JSON has no comments"),
        _ if begins(&[b"NaN", b"nan", b"Infinity", b"-Infinity", b"inf", b"-inf"]) => {
            Some("a number must be finite and in decimal notation")
        }
        _ if begins(&[b"True", b"False", b"None"]) => Some("JSON writes true, false and null"),
        b'}' | b']' if text[..places[0]].trim_ascii_end().ends_with(b",") => {
            Some("JSON has no comma after the last element or member")
        }
        b'\'' => Some("JSON writes texts and names in double quotes"),
        b'+' | b'.' => Some("a number begins with a digit or a minus"),
        letter if letter.is_ascii_alphabetic() && message.starts_with("key must be a string") => {
            Some("JSON writes names in double quotes")
        }
        _ => None,
    }
}
