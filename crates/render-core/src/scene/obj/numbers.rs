//! The numbers of an OBJ file: positions, texture coordinates and normals.

use super::counts::Counts;
use super::statements::{Kind, Statement, Statements};
use crate::scene::text::{Words, decimal, expected_number, is_not_finite, quoted};
use crate::settings::AssetProblem;

/// The numbers of a file, which faces name.
pub(super) struct Numbers {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) texture_coordinates: Vec<[f32; 2]>,
    pub(super) normals: Vec<[f32; 3]>,
}

impl Numbers {
    pub(super) fn read(bytes: &[u8], counts: Counts) -> Result<Self, AssetProblem> {
        if u32::try_from(bytes.len()).is_err() {
            return Err(AssetProblem::malformed("has more vertices than 32 bits can number"));
        }
        let mut numbers = Self {
            positions: Vec::with_capacity(counts.positions),
            texture_coordinates: Vec::with_capacity(counts.texture_coordinates),
            normals: Vec::with_capacity(counts.normals),
        };
        let mut statements = Statements::new(bytes);
        while let Some(statement) = statements.next() {
            match statement.kind {
                Kind::Position => numbers.positions.push(position(&statement)?),
                Kind::TextureCoordinate => numbers.texture_coordinates.push(texture_coordinate(&statement)?),
                Kind::Normal => numbers.normals.push(normal(&statement)?),
                _ => {}
            }
        }
        Ok(numbers)
    }
}

/// The numbers of a statement, at most `MOST`, and how many they are.
fn numbers<const MOST: usize>(statement: &Statement<'_>) -> Result<([f32; MOST], usize), AssetProblem> {
    let mut numbers = [0.0; MOST];
    let mut count = 0;
    for word in Words(statement.arguments) {
        // Blender writes normals of faces without an area as nan. They matter only where normals do.
        let number = match decimal(word) {
            None if statement.kind != Kind::Position && is_not_finite(word) => f32::NAN,
            Some(number) if f32::is_finite(number) => number,
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

fn position(statement: &Statement<'_>) -> Result<[f32; 3], AssetProblem> {
    let ([x, y, z, weight, ..], count) = numbers::<7>(statement)?;
    match count {
        // The others are a colour.
        3 | 6 | 7 => Ok([x, y, z]),
        4 => {
            let position = [x, y, z].map(|coordinate| coordinate / weight);
            if position.into_iter().all(f32::is_finite) {
                return Ok(position);
            }
            Err(statement.problem(format_args!("the weight {weight:?} must not be 0")))
        }
        _ => Err(statement.problem(format_args!(
            "has {count} numbers, must have 3 (x y z), 4 (and a weight), 6 or 7 (and a colour)"
        ))),
    }
}

fn texture_coordinate(statement: &Statement<'_>) -> Result<[f32; 2], AssetProblem> {
    match numbers::<3>(statement)? {
        ([u, v, _], 1..=3) => Ok([u, v]),
        (_, count) => Err(statement.problem(format_args!("has {count} numbers, must have 1 to 3 (u v w)"))),
    }
}

fn normal(statement: &Statement<'_>) -> Result<[f32; 3], AssetProblem> {
    match numbers::<3>(statement)? {
        (normal, 3) => Ok(normal),
        (_, count) => Err(statement.problem(format_args!("has {count} numbers, must have 3 (x y z)"))),
    }
}
