//! Radiance pictures (.hdr): colours of eight bits that share an exponent (Ward 1991, "Real Pixels").
//!
//! The decoders at hand read header lines of any length and multiply run lengths without a bound. This one takes no
//! memory before the size is known, and ends with the bytes.

use std::str;

use super::picture::check_size;
use crate::settings::AssetProblem;
use crate::settings::limits::MAX_PICTURE_BYTES;

/// Bytes of a header, whose lines may hold the commands that made the picture.
const MAX_HEADER_BYTES: usize = 64 << 10;

/// Bytes of a decoded pixel.
pub(super) const PIXEL_BYTES: u64 = 12;

/// Chromaticities of red, green, blue and white of Rec. 709, and by how much those of a file may differ: Radiance's own
/// are a little off.
const REC_709: [f64; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.329];
const SAME_PRIMARIES: f64 = 0.025;

/// What the header of a file says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RadianceHeader {
    /// Pixels across and down.
    pub(super) size: [u64; 2],
    /// What values are divided by.
    exposure: [f64; 3],
    /// Bytes of the header.
    length: usize,
}

/// Whether a file begins as one of these does.
pub(super) fn is_radiance(bytes: &[u8]) -> bool {
    bytes.starts_with(b"#?")
}

fn malformed(problem: impl std::fmt::Display) -> AssetProblem {
    AssetProblem::malformed(format_args!("is not a readable Radiance picture: {problem}"))
}

impl RadianceHeader {
    /// Reads it. A picture that is too large for any scene is an error.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, AssetProblem> {
        let mut exposure = [1.0; 3];
        let mut lines = Lines { bytes: &bytes[..bytes.len().min(MAX_HEADER_BYTES)], place: 0 };
        let mut next = || {
            lines
                .next()
                .ok_or_else(|| malformed(format_args!("its header does not end within {MAX_HEADER_BYTES} bytes")))
        };
        loop {
            let line = next()?;
            if line.is_empty() {
                break;
            }
            let Some((name, value)) = line.split_once('=') else { continue };
            match name.trim() {
                "FORMAT" if value.trim() != "32-bit_rle_rgbe" => {
                    return Err(malformed(format_args!("its FORMAT is {}, must be 32-bit_rle_rgbe", value.trim())));
                }
                "EXPOSURE" => exposure = scaled(exposure, [factor(line, value)?; 3]),
                "COLORCORR" => exposure = scaled(exposure, factors(line, value)?),
                "PRIMARIES" => check_primaries(line, value)?,
                _ => {}
            }
        }
        let size = resolution(next()?)?;
        check_size(size)?;
        let needed = size[0] * size[1] * PIXEL_BYTES;
        if needed > MAX_PICTURE_BYTES {
            let [found, limit] = [needed, MAX_PICTURE_BYTES].map(|bytes| format!("{bytes} bytes of pixels"));
            return Err(AssetProblem::TooLarge { found, limit });
        }
        Ok(Self { size, exposure, length: lines.place })
    }
}

/// Lines of a header.
struct Lines<'a> {
    bytes: &'a [u8],
    place: usize,
}

impl<'a> Lines<'a> {
    /// The next line, without what is not UTF-8; `None` where there is no end of a line.
    fn next(&mut self) -> Option<&'a str> {
        let rest = self.bytes.get(self.place..)?;
        let length = rest.iter().position(|byte| *byte == b'\n')?;
        self.place += length + 1;
        let line = rest[..length].strip_suffix(b"\r").unwrap_or(&rest[..length]);
        // A comment may be in another encoding.
        Some(str::from_utf8(line).unwrap_or("?"))
    }
}

fn scaled(values: [f64; 3], by: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|channel| values[channel] * by[channel])
}

/// The number of a line, which must be above zero.
fn factor(line: &str, text: &str) -> Result<f64, AssetProblem> {
    let value = text.trim().parse::<f64>().ok().filter(|value| *value > 0.0 && value.is_finite());
    value.ok_or_else(|| malformed(format_args!("{line:?} in its header, must be a number above 0")))
}

fn factors(line: &str, text: &str) -> Result<[f64; 3], AssetProblem> {
    let numbers = text.split_whitespace().map(|number| factor(line, number)).collect::<Result<Vec<f64>, _>>()?;
    numbers.try_into().map_err(|_| malformed(format_args!("{line:?} in its header, must be three numbers above 0")))
}

/// Refuses colours that are not of Rec. 709.
fn check_primaries(line: &str, text: &str) -> Result<(), AssetProblem> {
    let numbers: Vec<f64> = text.split_whitespace().filter_map(|number| number.parse().ok()).collect();
    let is_known = |known: &[f64; 8]| {
        numbers.len() == 8 && known.iter().zip(&numbers).all(|(known, found)| (known - found).abs() < SAME_PRIMARIES)
    };
    // Some programs write zeros where they know nothing.
    if is_known(&REC_709) || is_known(&[0.0; 8]) {
        return Ok(());
    }
    Err(malformed(format_args!(
        "{line:?} in its header, must be those of Rec. 709 (0.64 0.33 0.30 0.60 0.15 0.06 ...)"
    )))
}

/// Width and height from the last line of a header.
fn resolution(line: &str) -> Result<[u64; 2], AssetProblem> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let edge = |text: &str| text.parse::<u32>().ok().map(u64::from);
    let size = match words[..] {
        ["-Y", height, "+X", width] => edge(width).zip(edge(height)),
        _ => None,
    };
    let problem = || malformed(format_args!("{line:?} after its header, must be \"-Y height +X width\""));
    size.map(|(width, height)| [width, height]).ok_or_else(problem)
}

/// Decodes a file: its size, and its pixels row by row from the top.
pub(super) fn decode(bytes: &[u8]) -> Result<([usize; 2], Vec<[f32; 3]>), AssetProblem> {
    let header = RadianceHeader::read(bytes)?;
    let [width, height] = header.size.map(|edge| edge as usize);
    let mut rest = Bytes(&bytes[header.length..]);
    let mut row = vec![[0_u8; 4]; width];
    let mut pixels = Vec::with_capacity(width * height);
    for number in 0..height {
        read_row(&mut rest, &mut row).ok_or_else(|| malformed(format_args!("row {number} is damaged or cut off")))?;
        pixels.extend(row.iter().map(|pixel| colour(*pixel, header.exposure)));
    }
    Ok(([width, height], pixels))
}

/// Radiance of a pixel.
fn colour([red, green, blue, exponent]: [u8; 4], exposure: [f64; 3]) -> [f32; 3] {
    if exponent == 0 {
        return [0.0; 3];
    }
    let unit = libm::ldexp(1.0, i32::from(exponent) - 136);
    let [r, g, b] = exposure;
    [(red, r), (green, g), (blue, b)].map(|(mantissa, exposure)| (f64::from(mantissa) * unit / exposure) as f32)
}

/// Bytes that have not been read.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|bytes| bytes[0])
    }

    fn pixel(&mut self) -> Option<[u8; 4]> {
        self.take(4)?.first_chunk().copied()
    }
}

/// Rows of fewer pixels, or of more, have no runs for each channel.
const CHANNEL_RUNS: std::ops::Range<usize> = 8..0x8000;

/// Reads a row; `None` when it is damaged or cut off.
fn read_row(bytes: &mut Bytes<'_>, row: &mut [[u8; 4]]) -> Option<()> {
    let first = bytes.pixel()?;
    let [2, 2, high, low] = first else { return read_pixels(bytes, first, row) };
    if high >= 0x80 || !CHANNEL_RUNS.contains(&row.len()) {
        return read_pixels(bytes, first, row);
    }
    if usize::from(high) << 8 | usize::from(low) != row.len() {
        return None;
    }
    for channel in 0..4 {
        let mut place = 0;
        while place < row.len() {
            let count = bytes.byte()?;
            let run = usize::from(if count > 128 { count - 128 } else { count });
            let pixels = row.get_mut(place..place + run).filter(|pixels| !pixels.is_empty())?;
            if count > 128 {
                let value = bytes.byte()?;
                pixels.iter_mut().for_each(|pixel| pixel[channel] = value);
            } else {
                let values = bytes.take(run)?;
                pixels.iter_mut().zip(values).for_each(|(pixel, value)| pixel[channel] = *value);
            }
            place += run;
        }
    }
    Some(())
}

/// Reads pixels one by one. Where red, green and blue are 1, the fourth number says how often the last pixel is
/// repeated; of several in a row, each has eight bits more.
fn read_pixels(bytes: &mut Bytes<'_>, first: [u8; 4], row: &mut [[u8; 4]]) -> Option<()> {
    let (mut pixel, mut place, mut shift) = (first, 0, 0);
    let mut last = None;
    loop {
        if let [1, 1, 1, count] = pixel {
            let run = usize::from(count).checked_shl(shift).filter(|run| *run <= row.len())?;
            row.get_mut(place..place + run)?.fill(last?);
            place += run;
            shift += 8;
        } else {
            row[place] = pixel;
            last = Some(pixel);
            place += 1;
            shift = 0;
        }
        if place == row.len() {
            return Some(());
        }
        pixel = bytes.pixel()?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, pixels: &[u8]) -> Vec<u8> {
        [b"#?RADIANCE\n", header.as_bytes(), pixels].concat()
    }

    fn problem(bytes: &[u8]) -> String {
        decode(bytes).unwrap_err().to_string()
    }

    #[test]
    fn colours_share_an_exponent() {
        let bytes = file("FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 3\n", &[128, 64, 0, 129, 9, 9, 9, 0, 255, 1, 2, 255]);
        let (size, pixels) = decode(&bytes).unwrap();
        assert_eq!(size, [3, 1]);
        assert_eq!(pixels[..2], [[1.0, 0.5, 0.0], [0.0; 3]]);
        assert_eq!(pixels[2][0], 255.0 * 2.0_f32.powi(119));
    }

    #[test]
    fn runs_of_each_channel_and_runs_of_pixels_say_the_same() {
        let header = "\n-Y 1 +X 10\n";
        let by_channel = [&[2, 2, 0, 10][..], &[138, 128], &[3, 7, 8, 9, 135, 5], &[138, 0], &[138, 130]].concat();
        let pixel = |green: u8| [128, green, 0, 130];
        let by_pixel = [&pixel(7)[..], &pixel(8), &pixel(9), &pixel(5), &[1, 1, 1, 6]].concat();
        let pixels = decode(&file(header, &by_channel)).unwrap().1;
        assert_eq!(decode(&file(header, &by_pixel)).unwrap().1, pixels);
        assert_eq!(pixels[9], [2.0, 5.0 / 64.0, 0.0]);
    }

    #[test]
    fn exposure_and_correction_are_divided_out() {
        let header = "EXPOSURE=2\nEXPOSURE= 0.5\nCOLORCORR=1 2 4\n\n-Y 1 +X 1\n";
        assert_eq!(decode(&file(header, &[128, 128, 128, 129])).unwrap().1, [[1.0, 0.5, 0.25]]);
    }

    #[test]
    fn what_is_wrong_is_told() {
        for (header, pixels, expected) in [
            ("FORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", &[1, 2, 3, 4][..], "must be 32-bit_rle_rgbe"),
            ("EXPOSURE=0\n\n-Y 1 +X 1\n", &[1, 2, 3, 4], "must be a number above 0"),
            ("COLORCORR=1 2\n\n-Y 1 +X 1\n", &[1, 2, 3, 4], "must be three numbers"),
            ("PRIMARIES=0.7 0.3 0.2 0.7 0.1 0.1 0.3 0.3\n\n-Y 1 +X 1\n", &[1, 2, 3, 4], "Rec. 709"),
            ("\n+Y 1 +X 1\n", &[1, 2, 3, 4], "must be \"-Y height +X width\""),
            ("\n-Y 1 +X 99999999999\n", &[1, 2, 3, 4], "must be \"-Y height +X width\""),
            ("\n-Y 0 +X 1\n", &[], "must have some"),
            ("\n-Y 1 +X 20000\n", &[], "at most 16384 x 16384"),
            ("\n-Y 16384 +X 16384\n", &[], "bytes of pixels"),
            ("\n-Y 2 +X 1\n", &[1, 2, 3, 4], "row 1 is damaged or cut off"),
            ("\n-Y 1 +X 2\n", &[1, 1, 1, 2], "row 0"),
            ("\n-Y 1 +X 2\n", &[9, 1, 1, 2, 1, 1, 1, 2], "row 0"),
            ("\n-Y 1 +X 8\n", &[2, 2, 0, 9, 136, 1, 136, 1, 136, 1, 136, 1], "row 0"),
            ("\n-Y 1 +X 8\n", &[2, 2, 0, 8, 0, 1, 136, 1, 136, 1, 136, 1], "row 0"),
            ("\n-Y 1 +X 8\n", &[2, 2, 0, 8, 255, 1, 136, 1, 136, 1, 136, 1], "row 0"),
        ] {
            let found = problem(&file(header, pixels));
            assert!(found.contains(expected), "no {expected:?} in {found:?}");
        }
        let endless = file(&"x".repeat(1 << 20), &[]);
        assert!(problem(&endless).contains("does not end"), "{}", problem(&endless));
        // Run lengths that no integer holds.
        let mut markers = vec![9, 9, 9, 9];
        markers.extend([1, 1, 1, 0].repeat(40));
        markers.extend([1, 1, 1, 1]);
        assert!(problem(&file("\n-Y 1 +X 9\n", &markers)).contains("row 0"));
    }
}
