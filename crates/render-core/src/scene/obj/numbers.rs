//! The numbers of an OBJ file: positions, colours, texture coordinates and normals.

use glam::DVec3;

use super::counts::Counts;
use super::statements::{Kind, Statement, Statements};
use crate::scene::text::{Words, decimal, expected_number, is_not_finite, quoted};
use crate::settings::AssetProblem;
use crate::texture::srgb_to_linear;

/// How a file is used, which decides what counts of its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// One mesh, as a scene file names it. Positions are rounded to 32 bits. Colours and normals or texture coordinates
    /// that some corners lack are left out. More detail would change the pixels of scenes that exist.
    OneMesh,
    /// The parts of a building. Positions have 64 bits, for buildings in the coordinates of a country. Colours count,
    /// and so do normals and texture coordinates of some corners.
    Parts,
}

/// The numbers of a file, which faces name.
pub(super) struct Numbers {
    pub(super) extent: Extent,
    pub(super) positions: Vec<DVec3>,
    /// Colours of the positions, linear; empty where no position has any.
    pub(super) colours: Vec<[f32; 3]>,
    pub(super) texture_coordinates: Vec<[f32; 2]>,
    pub(super) normals: Vec<[f32; 3]>,
}

/// The colour of a position that has none, while colours are read.
const NO_COLOUR: [f32; 3] = [f32::NAN; 3];

/// Largest colour of a file whose colours are 0 to 1. Some programs write 0 to 255 instead.
const LARGEST_FRACTION: f32 = 2.0;

impl Numbers {
    pub(super) fn read(bytes: &[u8], counts: Counts, extent: Extent) -> Result<Self, AssetProblem> {
        if u32::try_from(bytes.len()).is_err() {
            return Err(AssetProblem::malformed("has more vertices than 32 bits can number"));
        }
        let mut numbers = Self {
            extent,
            positions: Vec::with_capacity(counts.positions),
            colours: Vec::new(),
            texture_coordinates: Vec::with_capacity(counts.texture_coordinates),
            normals: Vec::with_capacity(counts.normals),
        };
        let mut statements = Statements::new(bytes);
        while let Some(statement) = statements.next() {
            match statement.kind {
                Kind::Position => {
                    let (position, colour) = position(&statement, extent)?;
                    if extent == Extent::Parts
                        && let Some(colour) = colour
                    {
                        numbers.colours.reserve_exact(counts.positions - numbers.colours.len());
                        numbers.colours.resize(numbers.positions.len(), NO_COLOUR);
                        numbers.colours.push(colour);
                    }
                    numbers.positions.push(position);
                }
                Kind::TextureCoordinate => numbers.texture_coordinates.push(texture_coordinate(&statement)?),
                Kind::Normal => numbers.normals.push(normal(&statement)?),
                _ => {}
            }
        }
        if !numbers.colours.is_empty() {
            numbers.colours.resize(numbers.positions.len(), NO_COLOUR);
            make_linear(&mut numbers.colours);
        }
        Ok(numbers)
    }
}

/// Makes sRGB colours linear, because programs write colours as screens show them. Positions without one are white.
fn make_linear(colours: &mut [[f32; 3]]) {
    // Of two numbers of which one is none, the maximum is the other.
    let largest = colours.iter().flatten().copied().fold(0.0, f32::max);
    let white = if largest > LARGEST_FRACTION { 255.0 } else { 1.0 };
    for channel in colours.iter_mut().flatten() {
        *channel = match channel.is_nan() {
            true => 1.0,
            false => srgb_to_linear((f64::from(*channel) / white).clamp(0.0, 1.0)),
        };
    }
}

impl Extent {
    /// A number in decimal notation; infinite when it is too large.
    fn decimal(self, word: &[u8]) -> Option<f64> {
        match self {
            Self::OneMesh => decimal::<f32>(word).map(f64::from),
            Self::Parts => decimal(word),
        }
    }

    fn round(self, number: f64) -> f64 {
        match self {
            Self::OneMesh => f64::from(number as f32),
            Self::Parts => number,
        }
    }
}

/// The numbers of a statement, at most `MOST`, and how many they are.
fn numbers<const MOST: usize>(statement: &Statement<'_>, extent: Extent) -> Result<([f64; MOST], usize), AssetProblem> {
    let mut numbers = [0.0; MOST];
    let mut count = 0;
    for word in Words(statement.arguments) {
        // Blender writes normals of faces without an area as nan. They matter only where normals do.
        let number = match extent.decimal(word) {
            None if statement.kind != Kind::Position && is_not_finite(word) => f64::NAN,
            Some(number) if number.is_finite() => number,
            _ => {
                let message = format!("\"{}\" {}", quoted(word), expected_number(word));
                return Err(statement.problem(message));
            }
        };
        if let Some(place) = numbers.get_mut(count) {
            *place = number;
        }
        count += 1;
    }
    Ok((numbers, count))
}

/// The numbers of a statement with 32 bits.
fn short_numbers<const MOST: usize>(statement: &Statement<'_>) -> Result<([f32; MOST], usize), AssetProblem> {
    let (numbers, count) = numbers::<MOST>(statement, Extent::OneMesh)?;
    Ok((numbers.map(|number| number as f32), count))
}

/// A position, and its colour as it is written.
fn position(statement: &Statement<'_>, extent: Extent) -> Result<(DVec3, Option<[f32; 3]>), AssetProblem> {
    let ([x, y, z, fourth, fifth, sixth, _], count) = numbers::<7>(statement, extent)?;
    match count {
        3 => Ok((DVec3::new(x, y, z), None)),
        // A seventh number is the opacity.
        6 | 7 => Ok((DVec3::new(x, y, z), Some([fourth, fifth, sixth].map(|channel| channel as f32)))),
        4 => {
            let position = [x, y, z].map(|coordinate| extent.round(coordinate / fourth));
            if position.into_iter().all(f64::is_finite) {
                return Ok((DVec3::from(position), None));
            }
            Err(statement.problem(format_args!("the weight {fourth:?} must not be 0")))
        }
        _ => Err(statement.problem(format_args!(
            "has {count} numbers, must have 3 (x y z), 4 (and a weight), 6 or 7 (and a colour)"
        ))),
    }
}

fn texture_coordinate(statement: &Statement<'_>) -> Result<[f32; 2], AssetProblem> {
    match short_numbers::<3>(statement)? {
        ([u, v, _], 1..=3) => Ok([u, v]),
        (_, count) => Err(statement.problem(format_args!("has {count} numbers, must have 1 to 3 (u v w)"))),
    }
}

fn normal(statement: &Statement<'_>) -> Result<[f32; 3], AssetProblem> {
    match short_numbers::<3>(statement)? {
        (normal, 3) => Ok(normal),
        (_, count) => Err(statement.problem(format_args!("has {count} numbers, must have 3 (x y z)"))),
    }
}
