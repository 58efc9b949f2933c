//! The numbers of a PLY file after its header, as text or binary.

use super::super::text::{Lines, Words, decimal, expected_number, is_not_finite, quoted};
use super::header::{Element, Encoding, Header, Scalar, malformed};
use crate::settings::AssetProblem;

/// Where the next number is read.
#[derive(Clone, Debug)]
pub(super) enum Body<'a> {
    Text { lines: Lines<'a>, line: &'a [u8], words: Words<'a> },
    Binary { rest: &'a [u8], big_endian: bool },
}

/// The place of a record, for messages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record<'a> {
    pub(super) element: &'a Element,
    pub(super) index: usize,
}

impl<'a> Body<'a> {
    /// The first number after the header.
    pub(super) fn of(header: &Header<'a>) -> Self {
        match header.encoding {
            Encoding::Text => {
                Self::Text { lines: Lines::new(header.body, header.lines + 1), line: b"", words: Words(b"") }
            }
            Encoding::LittleEndian => Self::Binary { rest: header.body, big_endian: false },
            Encoding::BigEndian => Self::Binary { rest: header.body, big_endian: true },
        }
    }

    /// Checks that the rest of the file can hold as many records as the header claims.
    pub(super) fn check_count(&self, element: &Element) -> Result<(), AssetProblem> {
        let (remaining, smallest) = match self {
            // One digit and white space for each number.
            Self::Text { lines, .. } => (lines.rest().len() + 1, 2 * element.properties.len()),
            Self::Binary { rest, .. } => {
                let least =
                    element.properties.iter().map(|property| property.length.unwrap_or(property.scalar).bytes());
                (rest.len(), least.sum())
            }
        };
        if element.count <= remaining / smallest.max(1) && (smallest > 0 || element.count == 0) {
            return Ok(());
        }
        let Element { name, count, .. } = element;
        Err(malformed(format_args!("it claims {count} elements \"{name}\", which it is too short to hold")))
    }

    /// Begins a record: a line of a text that is not blank.
    pub(super) fn begin(&mut self, record: Record<'_>) -> Result<(), AssetProblem> {
        let Self::Text { lines, line, words } = self else { return Ok(()) };
        loop {
            let Some(next) = lines.next() else { return Err(self.ends_early(record)) };
            *line = next;
            *words = Words(next);
            if words.clone().next().is_some() {
                return Ok(());
            }
        }
    }

    /// Ends a record: nothing may be left in the line of a text.
    pub(super) fn end(&mut self, record: Record<'_>) -> Result<(), AssetProblem> {
        if let Self::Text { words, .. } = self
            && words.next().is_some()
        {
            return Err(self.problem(record, "has more numbers than the header says"));
        }
        Ok(())
    }

    /// The next number; one of a text that is not finite is NaN.
    pub(super) fn number(&mut self, scalar: Scalar, record: Record<'_>) -> Result<f64, AssetProblem> {
        let Some(word) = self.word(record)? else { return self.binary(scalar, record) };
        let number = match scalar {
            Scalar::F32 => decimal::<f32>(word).map(f64::from),
            _ => decimal(word),
        };
        match number {
            Some(number) => Ok(number),
            None if is_not_finite(word) => Ok(f64::NAN),
            None => Err(self.not_a_number(word, expected_number(word), record)),
        }
    }

    /// The next number, which is an integer.
    pub(super) fn integer(&mut self, scalar: Scalar, record: Record<'_>) -> Result<i64, AssetProblem> {
        // Every integer of PLY is a double.
        let Some(word) = self.word(record)? else { return Ok(self.binary(scalar, record)? as i64) };
        let number = str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        number.ok_or_else(|| self.not_a_number(word, "must be a whole number", record))
    }

    /// Leaves numbers out.
    pub(super) fn skip(&mut self, scalar: Scalar, count: usize, record: Record<'_>) -> Result<(), AssetProblem> {
        match self {
            Self::Text { words, .. } => {
                if count > 0 && words.nth(count - 1).is_none() {
                    return Err(self.problem(record, "has fewer numbers than the header says"));
                }
            }
            Self::Binary { rest, .. } => {
                let bytes = count.checked_mul(scalar.bytes());
                match bytes.and_then(|bytes| rest.get(bytes..)) {
                    Some(after) => *rest = after,
                    None => return Err(self.ends_early(record)),
                }
            }
        }
        Ok(())
    }

    /// Leaves records of one size out; `false` where they have to be read to be left out.
    pub(super) fn skip_all(&mut self, element: &Element) -> Result<bool, AssetProblem> {
        if matches!(self, Self::Text { .. }) || element.properties.iter().any(|property| property.length.is_some()) {
            return Ok(false);
        }
        let bytes: usize = element.properties.iter().map(|property| property.scalar.bytes()).sum();
        let last = Record { element, index: element.count.saturating_sub(1) };
        self.skip(Scalar::U8, bytes.saturating_mul(element.count), last)?;
        Ok(true)
    }

    /// The next word of a text; `None` in a binary file.
    fn word(&mut self, record: Record<'_>) -> Result<Option<&'a [u8]>, AssetProblem> {
        match self {
            Self::Text { words, .. } => match words.next() {
                Some(word) => Ok(Some(word)),
                None => Err(self.problem(record, "has fewer numbers than the header says")),
            },
            Self::Binary { .. } => Ok(None),
        }
    }

    fn binary(&mut self, scalar: Scalar, record: Record<'_>) -> Result<f64, AssetProblem> {
        let Self::Binary { rest, big_endian } = self else { return Ok(f64::NAN) };
        macro_rules! number {
            ($type:ty) => {
                rest.split_first_chunk().map(|(bytes, after)| {
                    *rest = after;
                    f64::from(if *big_endian { <$type>::from_be_bytes(*bytes) } else { <$type>::from_le_bytes(*bytes) })
                })
            };
        }
        let number = match scalar {
            Scalar::I8 => number!(i8),
            Scalar::U8 => number!(u8),
            Scalar::I16 => number!(i16),
            Scalar::U16 => number!(u16),
            Scalar::I32 => number!(i32),
            Scalar::U32 => number!(u32),
            Scalar::F32 => number!(f32),
            Scalar::F64 => number!(f64),
        };
        number.ok_or_else(|| self.ends_early(record))
    }

    /// What is wrong with a record.
    pub(super) fn problem(&self, record: Record<'_>, message: impl std::fmt::Display) -> AssetProblem {
        let Record { element: Element { name, .. }, index } = record;
        match self {
            Self::Text { lines, line, .. } => {
                let (number, text) = (lines.number(), quoted(line));
                malformed(format_args!("line {number}, \"{text}\": {name} {index} {message}"))
            }
            Self::Binary { .. } => malformed(format_args!("{name} {index} {message}")),
        }
    }

    fn not_a_number(&self, word: &[u8], expected: &str, record: Record<'_>) -> AssetProblem {
        self.problem(record, format_args!("has \"{}\", {expected}", quoted(word)))
    }

    fn ends_early(&self, Record { element: Element { name, count, .. }, index }: Record<'_>) -> AssetProblem {
        malformed(format_args!("it ends before or in {name} {index}; the header says that there are {count}"))
    }
}
