//! What a PNG file holds before its pixels, and how much memory that takes to read. Chunks may be compressed, so a file
//! of a few megabytes can hold a colour profile of gigabytes.

use std::io::Cursor;

use image::codecs::png::PngDecoder;
use image::{ImageDecoder, Limits};

use crate::settings::AssetProblem;

/// Bytes of a colour profile. Those of screens have some kilobytes, those of printers a megabyte.
const MAX_PROFILE_BYTES: u64 = 4 << 20;

/// A byte of compressed data becomes no more bytes than this.
const MOST_INFLATED: u64 = 1032;

/// What precedes and follows a colour profile in the smallest PNG file: the signature and a header of one grey pixel,
/// and the first byte of pixels.
const BEFORE_PROFILE: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x01\0\0\0\x01\x08\0\0\0\0\x3a\x7e\x9b\x55";
const AFTER_PROFILE: &[u8] = b"\0\0\0\x01IDAT\0";

/// Bytes that decoders take for themselves.
const DECODER_BYTES: u64 = 64 << 10;

/// Copies of a byte of metadata and of a byte of a profile that are there at once: arrays that grow are twice as large
/// as what is in them, and while they move there is also what they were.
const METADATA_COPIES: u64 = 6;
const PROFILE_COPIES: u64 = 4;

/// A part of a PNG file.
#[derive(Clone, Copy)]
pub(crate) struct Chunk<'a> {
    /// Four letters.
    pub(crate) name: [u8; 4],
    pub(crate) content: &'a [u8],
    /// The content with its length, its name and its checksum.
    whole: &'a [u8],
}

/// The chunks of a PNG file before its pixels.
pub(crate) struct Chunks<'a> {
    rest: &'a [u8],
}

impl<'a> Chunks<'a> {
    /// Those of a file.
    pub(crate) fn of(png: &'a [u8]) -> Self {
        Self { rest: png.get(8..).unwrap_or_default() }
    }

    /// The content of the first of a name.
    pub(crate) fn find_content(mut self, name: &[u8; 4]) -> Option<&'a [u8]> {
        self.find(|chunk| chunk.name == *name).map(|chunk| chunk.content)
    }

    fn is_at_pixels(&self) -> bool {
        self.rest.get(4..8) == Some(b"IDAT")
    }
}

impl<'a> Iterator for Chunks<'a> {
    type Item = Chunk<'a>;

    fn next(&mut self) -> Option<Chunk<'a>> {
        if self.is_at_pixels() {
            return None;
        }
        let length = number(self.rest, 0)? as usize;
        let (whole, rest) = self.rest.split_at_checked(length.checked_add(12)?)?;
        let name = *whole[4..].first_chunk()?;
        self.rest = rest;
        Some(Chunk { name, content: &whole[8..8 + length], whole })
    }
}

/// The number at a place, most significant byte first, as PNG and colour profiles have them.
pub(crate) fn number(bytes: &[u8], place: usize) -> Option<u32> {
    bytes.get(place..)?.first_chunk().map(|bytes| u32::from_be_bytes(*bytes))
}

/// The colour profile of a PNG file, if it has one that can be read. After this, the whole file can be decoded without
/// a limit to its profile.
///
/// # Errors
///
/// When it is too large to be read.
pub(crate) fn profile(png: &[u8]) -> Result<Option<Vec<u8>>, AssetProblem> {
    let chunks = || Chunks::of(png).filter(is_profile);
    let Some(longest) = longest_profile(png) else { return Ok(None) };
    let refused = || {
        AssetProblem::malformed(format_args!(
            "is a PNG file with a colour profile (iCCP) that is larger than {} MiB or damaged, must be sRGB: save it \
             without a profile",
            MAX_PROFILE_BYTES >> 20
        ))
    };
    if longest > MAX_PROFILE_BYTES {
        return Err(refused());
    }
    // The decoder has one limit for all that it reads, and no error for a profile that goes beyond. So it reads the
    // profile by itself.
    let mut file = BEFORE_PROFILE.to_vec();
    chunks().for_each(|chunk| file.extend(chunk.whole));
    file.extend(AFTER_PROFILE);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_PROFILE_BYTES + 2 * longest + DECODER_BYTES);
    let found = PngDecoder::with_limits(Cursor::new(file), limits).and_then(|mut decoder| decoder.icc_profile());
    match found.ok().flatten() {
        Some(profile) if profile.len() as u64 <= MAX_PROFILE_BYTES => Ok(Some(profile)),
        // A damaged one counts for nothing, as in other programs.
        None if MOST_INFLATED * longest <= MAX_PROFILE_BYTES => Ok(None),
        _ => Err(refused()),
    }
}

/// Bytes that reading all before the pixels takes at the most.
pub(crate) fn metadata_bytes(png: &[u8]) -> u64 {
    let mut chunks = Chunks::of(png);
    chunks.by_ref().for_each(drop);
    // What is cut off is read to its end.
    let after = if chunks.is_at_pixels() { chunks.rest.len() } else { 0 };
    let inflated = longest_profile(png).map_or(0, |longest| (MOST_INFLATED * longest).min(MAX_PROFILE_BYTES));
    METADATA_COPIES * (png.len() - after) as u64 + PROFILE_COPIES * inflated
}

fn is_profile(chunk: &Chunk<'_>) -> bool {
    chunk.name == *b"iCCP"
}

/// Compressed bytes of the longest profile; the first one need not be the one that is read, as its checksum may be
/// wrong.
fn longest_profile(png: &[u8]) -> Option<u64> {
    Chunks::of(png).filter(is_profile).map(|chunk| chunk.content.len() as u64).max()
}
