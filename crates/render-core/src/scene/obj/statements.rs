//! The statements of an OBJ file that count, each in one piece.

use crate::scene::text::{Lines, Words, quoted};
use crate::settings::AssetProblem;
use clerestory_film::file_format::without_byte_order_mark;

/// What a statement says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Position,
    TextureCoordinate,
    Normal,
    Face,
    /// The beginning of an object.
    Object,
    /// The beginning of a group.
    Group,
    /// The material of the faces that follow.
    Material,
    /// The files that describe materials.
    Libraries,
}

/// A statement that counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Statement<'a> {
    pub(super) kind: Kind,
    pub(super) arguments: &'a [u8],
    /// The number of its first line.
    line: usize,
    text: &'a [u8],
}

impl Statement<'_> {
    /// What is wrong with it.
    pub(super) fn problem(&self, message: impl std::fmt::Display) -> AssetProblem {
        let (line, text) = (self.line, quoted(self.text));
        AssetProblem::malformed(format_args!("is not a readable OBJ file: line {line}, \"{text}\": {message}"))
    }
}

/// The statements of a file that count.
pub(super) struct Statements<'a> {
    lines: Lines<'a>,
    /// A statement of several lines.
    joined: Vec<u8>,
}

impl<'a> Statements<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { lines: Lines::new(without_byte_order_mark(bytes), 1), joined: Vec::new() }
    }

    pub(super) fn next(&mut self) -> Option<Statement<'_>> {
        loop {
            let text = self.lines.next()?;
            let line = self.lines.number();
            let mut words = Words(text);
            // Names may end with a backslash that continues nothing, as folders do on Windows.
            let named = |kind, arguments| Some(Statement { kind, arguments, line, text });
            let kind = match words.next() {
                Some(b"v") => Kind::Position,
                Some(b"vt") => Kind::TextureCoordinate,
                Some(b"vn") => Kind::Normal,
                Some(b"f") => Kind::Face,
                Some(b"o") => return named(Kind::Object, words.0),
                Some(b"g") => return named(Kind::Group, words.0),
                Some(b"usemtl") => return named(Kind::Material, words.0),
                Some(b"mtllib") => return named(Kind::Libraries, words.0),
                // More lines of other statements are none of these either, except with numbers in other places.
                Some(b"l" | b"p") => {
                    self.skip_continuation(text);
                    continue;
                }
                _ => continue,
            };
            let Some(first) = without_backslash(words.0) else {
                return Some(Statement { kind, arguments: without_comment(words.0), line, text });
            };
            self.joined.clear();
            self.joined.extend(first);
            let mut continued = true;
            while continued && let Some(next) = self.lines.next() {
                self.joined.push(b' ');
                let part = without_backslash(next);
                continued = part.is_some();
                self.joined.extend(part.unwrap_or_else(|| without_comment(next)));
            }
            return Some(Statement { kind, arguments: &self.joined, line, text });
        }
    }

    fn skip_continuation(&mut self, mut line: &'a [u8]) {
        while without_backslash(line).is_some()
            && let Some(next) = self.lines.next()
        {
            line = next;
        }
    }
}

/// A line up to its comment.
fn without_comment(line: &[u8]) -> &[u8] {
    line.split(|byte| *byte == b'#').next().unwrap_or(line)
}

/// A line that the next one continues, up to the backslash that says so; `None` of any other.
fn without_backslash(line: &[u8]) -> Option<&[u8]> {
    let line = line.trim_ascii_end().strip_suffix(b"\\")?;
    (!line.contains(&b'#')).then_some(line)
}
