//! Checks the headers of an OpenEXR file before the crate `exr` reads them. That crate accepts windows that are the
//! wrong way round, and its messages do not say what to do.

use std::io::{BufRead, BufReader, ErrorKind, Read, Seek};

use super::openexr_error::OpenExrError;

/// Flags of the version of a file.
const DEEP_DATA: u32 = 1 << 11;
const MULTIPLE_PARTS: u32 = 1 << 12;
const KNOWN_FLAGS: u32 = 0b1_1110 << 8;

/// Methods of compression by their numbers; those after the last that is read are not.
const COMPRESSIONS: [&str; 12] =
    ["none", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB", "HTJ2K256", "HTJ2K32"];
/// B44A. The decoder of DWAA and DWAB allocates whatever a block claims, and the process ends when that fails.
const LAST_READ: u8 = 7;

/// Windows reach at most this far from the origin, as in the library of OpenEXR.
const MAX_COORDINATE: i64 = i32::MAX as i64 / 2;

/// Longest name of an attribute or a channel.
const MAX_NAME_BYTES: u64 = 256;

/// Largest attribute that is looked at: a list of channels.
const MAX_READ_BYTES: u32 = 1 << 20;

/// Checks the headers of all parts, from behind the first four bytes of a file.
pub(super) fn check(file: impl Read + Seek) -> Result<(), OpenExrError> {
    let mut file = BufReader::new(file);
    let version = u32::from_le_bytes(bytes(&mut file)?);
    if version & 0xff != 2 || version & !(KNOWN_FLAGS | 0xff) != 0 {
        return Err(unsupported("a version of OpenEXR other than 2"));
    }
    if version & DEEP_DATA != 0 {
        return Err(unsupported("deep data"));
    }
    loop {
        let attributes = check_part(&mut file)?;
        if version & MULTIPLE_PARTS == 0 || attributes == 0 {
            return Ok(());
        }
    }
}

/// Checks the header of a part, and answers how many attributes it has: none behind the last part.
fn check_part(file: &mut BufReader<impl Read + Seek>) -> Result<usize, OpenExrError> {
    let mut attributes = 0;
    loop {
        let name = name(file)?;
        if name.is_empty() {
            return Ok(attributes);
        }
        let _kind = self::name(file)?;
        let size = u32::from_le_bytes(bytes(file)?);
        let mut rest = i64::from(size);
        match &name[..] {
            b"dataWindow" | b"displayWindow" if size == 16 => {
                check_window(if name == b"dataWindow" { "data" } else { "display" }, bytes(file)?)?;
                rest = 0;
            }
            b"compression" if size == 1 => {
                let [method] = bytes(file)?;
                if method > LAST_READ {
                    let name = COMPRESSIONS.get(usize::from(method)).copied().unwrap_or("unknown");
                    return Err(unsupported(format!("{name} compression")));
                }
                rest = 0;
            }
            b"channels" if size <= MAX_READ_BYTES => {
                let mut list = vec![0; size as usize];
                file.read_exact(&mut list).map_err(ended)?;
                check_channels(&list)?;
                rest = 0;
            }
            b"type" if size <= 32 => {
                let mut kind = vec![0; size as usize];
                file.read_exact(&mut kind).map_err(ended)?;
                if kind.starts_with(b"deep") {
                    return Err(unsupported("deep data"));
                }
                rest = 0;
            }
            _ => {}
        }
        file.seek_relative(rest).map_err(ended)?;
        attributes += 1;
    }
}

/// Checks that a window has pixels.
fn check_window(kind: &str, bytes: [u8; 16]) -> Result<(), OpenExrError> {
    let numbers: [[u8; 4]; 4] = bytemuck::cast(bytes);
    let [min_x, min_y, max_x, max_y] = numbers.map(i32::from_le_bytes);
    let problem = if min_x > max_x || min_y > max_y {
        "ends before it begins"
    } else if [min_x, min_y, max_x, max_y].into_iter().any(|at| i64::from(at).abs() >= MAX_COORDINATE) {
        "is out of range"
    } else {
        return Ok(());
    };
    Err(OpenExrError::Damaged(format!("the {kind} window from ({min_x}, {min_y}) to ({max_x}, {max_y}) {problem}")))
}

/// Checks that every channel of a list has a value in every pixel.
fn check_channels(mut list: &[u8]) -> Result<(), OpenExrError> {
    while let Some(end) = list.iter().position(|byte| *byte == 0).filter(|end| *end > 0) {
        // Type, linearity, and every how many columns and rows there is a value.
        let Some((description, rest)) = list[end + 1..].split_first_chunk::<16>() else { return Ok(()) };
        if description[8..] != [1, 0, 0, 0, 1, 0, 0, 0] {
            let name = String::from_utf8_lossy(&list[..end]);
            return Err(unsupported(format!("channel {name}, which has no value in some pixels (subsampling),")));
        }
        list = rest;
    }
    Ok(())
}

/// A text that ends with a zero.
fn name(file: &mut impl BufRead) -> Result<Vec<u8>, OpenExrError> {
    let mut name = Vec::new();
    file.take(MAX_NAME_BYTES).read_until(0, &mut name).map_err(ended)?;
    match name.pop() {
        Some(0) => Ok(name),
        _ => Err(OpenExrError::Damaged("its header is cut off".to_owned())),
    }
}

fn bytes<const COUNT: usize>(file: &mut impl Read) -> Result<[u8; COUNT], OpenExrError> {
    let mut bytes = [0; COUNT];
    file.read_exact(&mut bytes).map_err(ended)?;
    Ok(bytes)
}

fn ended(error: std::io::Error) -> OpenExrError {
    match error.kind() {
        ErrorKind::UnexpectedEof => OpenExrError::Damaged("its header is cut off".to_owned()),
        kind => OpenExrError::Read(kind),
    }
}

fn unsupported(what: impl Into<String>) -> OpenExrError {
    OpenExrError::Unsupported(what.into())
}
