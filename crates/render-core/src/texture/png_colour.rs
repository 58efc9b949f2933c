//! What a PNG file says of its colours. They are taken as sRGB, so a file that says otherwise is refused.

use super::png_metadata::{Chunks, number};
use crate::settings::AssetProblem;

/// Chromaticities of white, red, green and blue, x and y of each.
const REC_709: [f64; 8] = [0.3127, 0.329, 0.64, 0.33, 0.3, 0.6, 0.15, 0.06];

/// Red, green and blue of sRGB in a colour profile: XYZ, adapted to D50.
const SRGB_COLUMNS: [(&[u8; 4], [f64; 3]); 3] =
    [(b"rXYZ", [0.4361, 0.2225, 0.0139]), (b"gXYZ", [0.3851, 0.7169, 0.0971]), (b"bXYZ", [0.1431, 0.0606, 0.7141])];

/// What sRGB makes of half the largest value.
const SRGB_OF_HALF: f64 = 0.2140;

/// Programs round, and use 2.2 for the curve of sRGB.
const TOLERANCE: f64 = 0.02;

/// Checks what a PNG file says of its colours; of a grey one, of its brightness. `profile` is its colour profile, if
/// any.
pub(crate) fn check(png: &[u8], profile: Option<&[u8]>, is_grey: bool) -> Result<(), AssetProblem> {
    let refuse = |found: String| {
        Err(AssetProblem::malformed(format_args!(
            "is a PNG file with {found}, must be sRGB: convert it, or save it as EXR"
        )))
    };
    let chunk = |name| Chunks::of(png).find_content(name);
    // As the PNG specification orders them: the first that is there counts.
    if let Some(&[primaries, transfer, ..]) = chunk(b"cICP") {
        return match (primaries, transfer) {
            (1, 13) => Ok(()),
            (_, 13) if is_grey => Ok(()),
            _ => refuse(format!("the colour space (cICP) of primaries {primaries} and transfer {transfer}")),
        };
    }
    if let Some(profile) = profile {
        let profile = Profile(profile);
        return match profile.is_srgb(is_grey) {
            true => Ok(()),
            false => refuse(format!("the colour profile \"{}\"", profile.name())),
        };
    }
    if chunk(b"sRGB").is_some() {
        return Ok(());
    }
    if let Some(gamma) = chunk(b"gAMA").and_then(|chunk| number(chunk, 0)) {
        let gamma = f64::from(gamma) / 1e5;
        if (gamma - 1.0 / 2.2).abs() > TOLERANCE {
            return refuse(format!("a gamma (gAMA) of {gamma}"));
        }
    }
    if let Some(chunk) = chunk(b"cHRM").filter(|_| !is_grey) {
        let found: Vec<f64> =
            (0..8).filter_map(|index| number(chunk, 4 * index)).map(|value| f64::from(value) / 1e5).collect();
        if found.len() != 8 || REC_709.iter().zip(&found).any(|(right, found)| (right - found).abs() > TOLERANCE) {
            return refuse(format!("the primaries (cHRM) {found:?}"));
        }
    }
    Ok(())
}

/// An ICC profile.
struct Profile<'a>(&'a [u8]);

impl<'a> Profile<'a> {
    fn is_srgb(&self, is_grey: bool) -> bool {
        let is_column = |(name, right): &(&[u8; 4], [f64; 3])| {
            let column = self.tag(name).map(|tag| [8, 12, 16].map(|place| fixed(tag, place).unwrap_or(f64::NAN)));
            column.is_some_and(|found| found.iter().zip(right).all(|(found, right)| (found - right).abs() < TOLERANCE))
        };
        let is_curve = |name: &[u8; 4]| {
            self.tag(name).and_then(of_half).is_some_and(|value| (value - SRGB_OF_HALF).abs() < TOLERANCE)
        };
        // Some programs store grey pictures with a profile of colours.
        is_grey && is_curve(b"kTRC")
            || SRGB_COLUMNS.iter().all(is_column) && [b"rTRC", b"gTRC", b"bTRC"].into_iter().all(is_curve)
    }

    fn tag(&self, name: &[u8; 4]) -> Option<&'a [u8]> {
        let count = number(self.0, 128)?.min(100) as usize;
        let entry = (0..count).map(|index| 132 + 12 * index).find(|at| self.0.get(*at..at + 4) == Some(name))?;
        let [start, length] = [number(self.0, entry + 4)?, number(self.0, entry + 8)?].map(|number| number as usize);
        self.0.get(start..start.checked_add(length)?)
    }

    fn name(&self) -> String {
        let tag = self.tag(b"desc").unwrap_or_default();
        let name: String = match tag.first_chunk::<4>() {
            // One of several languages, in UTF-16.
            Some(b"mluc") => {
                let [length, start] = [20, 24].map(|place| number(tag, place).unwrap_or(0) as usize);
                let text = start.checked_add(length).and_then(|end| tag.get(start..end)).unwrap_or_default();
                let (units, _) = text.as_chunks::<2>();
                char::decode_utf16(units.iter().map(|unit| u16::from_be_bytes(*unit))).filter_map(Result::ok).collect()
            }
            _ => String::from_utf8_lossy(tag.get(12..).unwrap_or_default()).into_owned(),
        };
        let name: String = name.chars().take_while(|character| *character != '\0').take(60).collect();
        if name.is_empty() { "without a name".to_owned() } else { name }
    }
}

/// A number with 16 bits behind the point.
fn fixed(bytes: &[u8], place: usize) -> Option<f64> {
    number(bytes, place).map(|bits| f64::from(bits.cast_signed()) / 65_536.0)
}

/// What a curve makes of half the largest value.
fn of_half(curve: &[u8]) -> Option<f64> {
    let power = |base: f64, exponent: f64| libm::pow(base.max(0.0), exponent);
    match curve.first_chunk()? {
        b"curv" => {
            let entry = |index: usize| {
                curve.get(12 + 2 * index..)?.first_chunk().map(|bytes| f64::from(u16::from_be_bytes(*bytes)))
            };
            match number(curve, 8)? as usize {
                0 => Some(0.5),
                1 => Some(power(0.5, entry(0)? / 256.0)),
                count => Some((entry((count - 1) / 2)? + entry(count / 2)?) / 2.0 / 65_535.0),
            }
        }
        b"para" => {
            let parameter = |index: usize| fixed(curve, 12 + 4 * index);
            let exponent = parameter(0)?;
            let kind = number(curve, 8)? >> 16;
            if kind == 0 {
                return Some(power(0.5, exponent));
            }
            let curved = power(parameter(1)? * 0.5 + parameter(2)?, exponent);
            match kind {
                1 | 3 => Some(curved),
                2 => Some(curved + parameter(3)?),
                4 => Some(curved + parameter(5)?),
                _ => None,
            }
        }
        _ => None,
    }
}
