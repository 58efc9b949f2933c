//! The header of a PLY file: which elements it has, and of which properties.

use super::super::mesh_format::refuse_other_formats;
use super::super::text::{Lines, Words, quoted};
use crate::settings::AssetProblem;
use clerestory_film::file_format::without_byte_order_mark;

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

/// Names of types, the old and the new.
const SCALARS: [(&[u8], Scalar); 16] = [
    (b"char", Scalar::I8),
    (b"uchar", Scalar::U8),
    (b"short", Scalar::I16),
    (b"ushort", Scalar::U16),
    (b"int", Scalar::I32),
    (b"uint", Scalar::U32),
    (b"float", Scalar::F32),
    (b"double", Scalar::F64),
    (b"int8", Scalar::I8),
    (b"uint8", Scalar::U8),
    (b"int16", Scalar::I16),
    (b"uint16", Scalar::U16),
    (b"int32", Scalar::I32),
    (b"uint32", Scalar::U32),
    (b"float32", Scalar::F32),
    (b"float64", Scalar::F64),
];

impl Scalar {
    fn named(name: &[u8]) -> Option<Self> {
        SCALARS.iter().find(|(known, _)| *known == name).map(|(_, scalar)| *scalar)
    }

    /// Bytes of a number in a binary file.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Whether it holds whole numbers.
    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

/// A number of an element, or a list of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    /// The type of the length of a list.
    pub(super) length: Option<Scalar>,
}

/// Records of the same properties.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

/// A header.
#[derive(Clone, Debug)]
pub(super) struct Header<'a> {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// What comes after it.
    pub(super) body: &'a [u8],
    /// The number of its last line.
    pub(super) lines: usize,
}

/// What is wrong with a file.
pub(super) fn malformed(message: impl std::fmt::Display) -> AssetProblem {
    AssetProblem::malformed(format_args!("is not a readable PLY file: {message}"))
}

impl<'a> Header<'a> {
    /// Reads the header of a file.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, AssetProblem> {
        let bytes = without_byte_order_mark(bytes);
        let mut lines = Lines::new(bytes, 1);
        let magic = lines.next().unwrap_or_default();
        if Words(magic).next() != Some(b"ply") {
            refuse_other_formats(bytes, "PLY")?;
            return Err(malformed(format_args!("it begins with \"{}\", must begin with \"ply\"", quoted(magic))));
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        while let Some(line) = lines.next() {
            let number = lines.number();
            let refuse = |what: &str| malformed(format_args!("line {number}, \"{}\": {what}", quoted(line)));
            let words: Vec<&[u8]> = Words(line).collect();
            match words[..] {
                [] | [b"comment" | b"obj_info", ..] => {}
                [b"format", name, version] => {
                    let known = match name {
                        b"ascii" => Encoding::Text,
                        b"binary_little_endian" => Encoding::LittleEndian,
                        b"binary_big_endian" => Encoding::BigEndian,
                        _ => {
                            return Err(refuse("the format must be ascii, binary_little_endian or binary_big_endian"));
                        }
                    };
                    if version != b"1.0" {
                        return Err(refuse("the version must be 1.0"));
                    }
                    if encoding.replace(known).is_some_and(|other| other != known) {
                        return Err(refuse("an earlier line states another format"));
                    }
                }
                [b"element", name, count] => {
                    let count = str::from_utf8(count).ok().and_then(|count| count.parse().ok());
                    let count = count.ok_or_else(|| refuse("must have a whole number of elements"))?;
                    let name = String::from_utf8_lossy(name).into_owned();
                    if elements.iter().any(|element| element.name == name) {
                        return Err(refuse("an earlier element has the same name"));
                    }
                    elements.push(Element { name, count, properties: Vec::new() });
                }
                [b"property", ref words @ ..] => {
                    let element = elements.last_mut().ok_or_else(|| refuse("must come after an element"))?;
                    let property = property(words).map_err(refuse)?;
                    if element.properties.iter().any(|other| other.name == property.name) {
                        return Err(refuse("an earlier property has the same name"));
                    }
                    element.properties.push(property);
                }
                [b"end_header"] => {
                    let encoding = encoding.ok_or_else(|| malformed("its header has no line \"format\""))?;
                    let body = body(bytes, lines.rest().len(), encoding);
                    return Ok(Self { encoding, elements, body, lines: number });
                }
                _ => {
                    return Err(refuse(
                        "a header has the lines format, element, property, comment, obj_info and end_header",
                    ));
                }
            }
        }
        Err(malformed("its header does not end with a line \"end_header\""))
    }

    /// The element of this name.
    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|element| element.name == name)
    }
}

/// A property of these words after the first.
fn property(words: &[&[u8]]) -> Result<Property, &'static str> {
    const TYPES: &str = "the type must be char, uchar, short, ushort, int, uint, float, double, or int8 to float64";
    let scalar = |name: &[u8]| Scalar::named(name).ok_or(TYPES);
    let (name, type_name, length) = match *words {
        [b"list", length, type_name, name] => (name, type_name, Some(scalar(length)?)),
        [type_name, name] => (name, type_name, None),
        _ => return Err("must be \"property TYPE NAME\" or \"property list TYPE TYPE NAME\""),
    };
    if length.is_some_and(|length| !length.is_integer()) {
        return Err("the length of a list must be a whole number");
    }
    Ok(Property { name: String::from_utf8_lossy(name).into_owned(), scalar: scalar(type_name)?, length })
}

/// What comes after a header. That of a binary file begins behind as much as ends a line of the header: its first byte
/// may look like the second half of CRLF.
fn body(bytes: &[u8], rest: usize, encoding: Encoding) -> &[u8] {
    let first_end = bytes.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(0);
    let lines_end_with_cr = bytes[first_end..].starts_with(b"\r") && !bytes[first_end..].starts_with(b"\r\n");
    let start = bytes.len() - rest;
    let took_more = encoding != Encoding::Text && lines_end_with_cr && bytes[..start].ends_with(b"\r\n");
    &bytes[start - usize::from(took_more)..]
}
