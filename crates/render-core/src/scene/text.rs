//! The words and numbers of files of text, in whatever encoding their comments and names are.

use std::borrow::Cow;
use std::str::FromStr;

/// The lines of a text with their numbers from 1. LF, CRLF and CR end a line.
#[derive(Clone, Debug)]
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    /// The lines of a text whose first line has the number `first`.
    pub(super) fn new(text: &'a [u8], first: usize) -> Self {
        Self { rest: text, number: first - 1 }
    }

    /// The number of the last line.
    pub(super) fn number(&self) -> usize {
        self.number
    }

    /// What comes after the last line.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.rest
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let end = self.rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = match rest {
            [b'\r', b'\n', rest @ ..] | [_, rest @ ..] => rest,
            [] => rest,
        };
        Some(line)
    }
}

/// The words of a line.
#[derive(Clone, Debug)]
pub(super) struct Words<'a>(pub(super) &'a [u8]);

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let is_blank = |byte: &u8| matches!(byte, b' ' | b'\t' | 0x0b | 0x0c | b'\n' | b'\r');
        let start = self.0.iter().position(|byte| !is_blank(byte))?;
        let rest = &self.0[start..];
        let (word, rest) = rest.split_at(rest.iter().position(is_blank).unwrap_or(rest.len()));
        self.0 = rest;
        Some(word)
    }
}

/// A number in decimal notation, as C reads and writes it: `-1.`, `.5` and `+1e-3` are some. Infinite when it is too
/// large.
pub(super) fn decimal<T: FromStr>(word: &[u8]) -> Option<T> {
    if !word.iter().all(|byte| byte.is_ascii_digit() || matches!(byte, b'.' | b'+' | b'-' | b'e' | b'E')) {
        return None;
    }
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Whether a word is what C writes for a number that is infinite or none: `-nan`, `inf`, `1.#QNAN`.
pub(super) fn is_not_finite(word: &[u8]) -> bool {
    let word = word.strip_prefix(b"-").or(word.strip_prefix(b"+")).unwrap_or(word).to_ascii_lowercase();
    matches!(&word[..], b"inf" | b"infinity") || word.starts_with(b"nan") || word.starts_with(b"1.#")
}

/// What would be right where a word is no finite number.
pub(super) fn expected_number(word: &[u8]) -> &'static str {
    if is_not_finite(word) || decimal::<f64>(word).is_some() {
        "must be a finite number"
    } else if word.contains(&b',') {
        "must be a number with a point, not a comma"
    } else {
        "must be a number such as -1.5 or 2e-3"
    }
}

/// A name in a file, UTF-8 or else Latin-1.
pub(super) fn name(text: &[u8]) -> String {
    let text = text.trim_ascii();
    match std::str::from_utf8(text) {
        Ok(name) => name.to_owned(),
        Err(_) => text.iter().copied().map(char::from).collect(),
    }
}

/// At most this many bytes of a line are repeated in a message.
const MAX_QUOTED: usize = 60;

/// A line or word in a message.
pub(super) fn quoted(text: &[u8]) -> Cow<'_, str> {
    let text = text.trim_ascii();
    if text.len() <= MAX_QUOTED {
        return String::from_utf8_lossy(text);
    }
    Cow::Owned(format!("{}...", String::from_utf8_lossy(&text[..MAX_QUOTED])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_as_on_any_system() {
        for text in ["a b\nc\n\nd", "a b\r\nc\r\n\r\nd\r\n", "a b\rc\r\rd\r"] {
            let mut lines = Lines::new(text.as_bytes(), 1);
            assert_eq!(lines.by_ref().collect::<Vec<_>>(), [&b"a b"[..], b"c", b"", b"d"]);
            assert_eq!(lines.number(), 4);
        }
    }

    #[test]
    fn words_stand_between_any_blanks() {
        assert_eq!(Words(b"\t v  -1\t2\x0b ").collect::<Vec<_>>(), [&b"v"[..], b"-1", b"2"]);
    }

    #[test]
    fn numbers_are_those_of_c() {
        let numbers = [("-1.", -1.0), (".0", 0.0), ("+1", 1.0), ("1E+05", 1e5), ("-.5e-2", -0.005), ("007", 7.0)];
        for (word, number) in numbers {
            assert_eq!(decimal::<f32>(word.as_bytes()), Some(number), "{word}");
        }
        for word in ["", ".", "-", "e5", "1,5", "0x10", "1d5", "one", "nan", "inf", "1_000", "1.2.3"] {
            assert_eq!(decimal::<f32>(word.as_bytes()), None, "{word}");
        }
        for word in ["nan", "-NaN", "inf", "-Infinity", "1.#QNAN", "-1.#IND", "nan(0x1)"] {
            assert!(is_not_finite(word.as_bytes()), "{word}");
        }
    }
}
