//! Triangle meshes from Wavefront OBJ files. Groups become one mesh; materials, lines, points, curves and free-form
//! surfaces are left out.
//!
//! A file is read three times. The first counts, so that the size is known before memory is allocated. The second reads
//! the numbers. The third reads the faces, which may name later vertices.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::mesh::TriangleMesh;
use super::mesh_format::refuse_other_formats;
use super::polygon::Cutter;
use super::text::{Lines, Words, decimal, expected_number, is_not_finite, quoted};
use crate::settings::AssetProblem;
use clerestory_film::file_format::without_byte_order_mark;

/// A file of which only the statements are counted.
pub(super) struct ObjFile<'a> {
    bytes: &'a [u8],
    counts: Counts,
}

impl<'a> ObjFile<'a> {
    /// Counts what a file holds.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, AssetProblem> {
        refuse_other_formats(bytes, "OBJ")?;
        Ok(Self { bytes, counts: Counts::of(bytes) })
    }

    /// Triangles that its faces make.
    pub(super) fn triangles(&self) -> usize {
        self.counts.triangles
    }

    /// A vertex is a position with a texture coordinate and a normal, as corners in one group name them. In each group
    /// there are no more than of these together, but in files that mix a few of each in all ways.
    pub(super) fn vertices(&self) -> usize {
        let Counts { positions, texture_coordinates, normals, triangles, groups } = self.counts;
        let named = positions + texture_coordinates + normals;
        positions.max((3 * triangles).min(named.saturating_mul(groups)))
    }

    /// Decodes it.
    pub(super) fn decode(&self) -> Result<TriangleMesh, AssetProblem> {
        let numbers = Numbers::read(self.bytes, self.counts)?;
        let mut faces = Faces::new(&numbers, self.counts.triangles);
        faces.read(self.bytes)?;
        Ok(faces.into_mesh())
    }
}

/// What a file holds.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    positions: usize,
    texture_coordinates: usize,
    normals: usize,
    triangles: usize,
    /// Groups with faces.
    groups: usize,
}

impl Counts {
    fn of(bytes: &[u8]) -> Self {
        let mut counts = Self::default();
        let mut is_new_group = true;
        let mut statements = Statements::new(bytes);
        while let Some(statement) = statements.next() {
            match statement.kind {
                Kind::Position => counts.positions += 1,
                Kind::TextureCoordinate => counts.texture_coordinates += 1,
                Kind::Normal => counts.normals += 1,
                Kind::Face => {
                    counts.triangles += Words(statement.arguments).count().saturating_sub(2);
                    counts.groups += usize::from(is_new_group);
                    is_new_group = false;
                }
                Kind::Group => is_new_group = true,
            }
        }
        counts
    }
}

/// What a statement adds to the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Position,
    TextureCoordinate,
    Normal,
    Face,
    /// The beginning of an object or a group.
    Group,
}

/// A statement that counts.
#[derive(Clone, Copy, Debug)]
struct Statement<'a> {
    kind: Kind,
    arguments: &'a [u8],
    /// The number of its first line.
    line: usize,
    text: &'a [u8],
}

impl Statement<'_> {
    /// What is wrong with it.
    fn problem(&self, message: impl std::fmt::Display) -> AssetProblem {
        let (line, text) = (self.line, quoted(self.text));
        AssetProblem::malformed(format_args!("is not a readable OBJ file: line {line}, \"{text}\": {message}"))
    }
}

/// The statements of a file that count.
struct Statements<'a> {
    lines: Lines<'a>,
    /// A statement of several lines.
    joined: Vec<u8>,
}

impl<'a> Statements<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { lines: Lines::new(without_byte_order_mark(bytes), 1), joined: Vec::new() }
    }

    fn next(&mut self) -> Option<Statement<'_>> {
        loop {
            let text = self.lines.next()?;
            let mut words = Words(text);
            let kind = match words.next() {
                Some(b"v") => Kind::Position,
                Some(b"vt") => Kind::TextureCoordinate,
                Some(b"vn") => Kind::Normal,
                Some(b"f") => Kind::Face,
                // Names may end with a backslash that continues nothing, as folders do on Windows.
                Some(b"o" | b"g") => return Some(Statement { kind: Kind::Group, arguments: b"", line: 0, text }),
                // More lines of other statements are none of these either, except with numbers in other places.
                Some(b"l" | b"p") => {
                    self.skip_continuation(text);
                    continue;
                }
                _ => continue,
            };
            let line = self.lines.number();
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

/// The numbers of a file, which faces name.
struct Numbers {
    positions: Vec<[f32; 3]>,
    texture_coordinates: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
}

impl Numbers {
    fn read(bytes: &[u8], counts: Counts) -> Result<Self, AssetProblem> {
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
                Kind::Face | Kind::Group => {}
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

/// The number of a texture coordinate or normal that a corner does not have.
const NONE: u32 = u32::MAX;

/// The corner of a face: the numbers of its position, texture coordinate and normal.
type Corner = [u32; 3];

/// The faces of a file.
struct Faces<'a> {
    numbers: &'a Numbers,
    triangles: Vec<[u32; 3]>,
    /// The different corners of each group, which become the vertices of the mesh.
    vertices: Vec<Corner>,
    /// The first vertex of each position in this group, or one of another group.
    first: Vec<u32>,
    /// The other vertices of this group.
    others: BTreeMap<Corner, u32>,
    /// The first vertex of this group.
    group: u32,
}

impl<'a> Faces<'a> {
    fn new(numbers: &'a Numbers, triangles: usize) -> Self {
        Self {
            numbers,
            triangles: Vec::with_capacity(triangles),
            vertices: Vec::new(),
            first: vec![NONE; numbers.positions.len()],
            others: BTreeMap::new(),
            group: 0,
        }
    }

    fn read(&mut self, bytes: &[u8]) -> Result<(), AssetProblem> {
        let mut cutter = Cutter::new();
        let (mut polygon, mut places) = (Vec::new(), Vec::new());
        let mut so_far = [0; 3];
        let mut statements = Statements::new(bytes);
        while let Some(statement) = statements.next() {
            match statement.kind {
                Kind::Position => so_far[0] += 1,
                Kind::TextureCoordinate => so_far[1] += 1,
                Kind::Normal => so_far[2] += 1,
                Kind::Group => {
                    self.group = self.vertices.len() as u32;
                    self.others.clear();
                }
                Kind::Face => {
                    polygon.clear();
                    for word in Words(statement.arguments) {
                        polygon.push(self.corner(&statement, word, so_far)?);
                    }
                    if polygon.is_empty() {
                        return Err(statement.problem("a face must have corners"));
                    }
                    if polygon.len() < 3 {
                        continue;
                    }
                    places.clear();
                    places.extend(polygon.iter().map(|[position, ..]| self.position(*position)));
                    for corner in &mut polygon {
                        corner[0] = self.vertex(*corner);
                    }
                    cutter.cut(&places, |corners| self.triangles.push(corners.map(|corner| polygon[corner][0])))?;
                }
            }
        }
        Ok(())
    }

    /// The corner that a word names: `position`, `position/texture`, `position//normal` or `position/texture/normal`.
    fn corner(&self, statement: &Statement<'_>, word: &[u8], so_far: [usize; 3]) -> Result<Corner, AssetProblem> {
        let Numbers { positions, texture_coordinates, normals } = self.numbers;
        let kinds = [
            (positions.len(), "v", "vertices"),
            (texture_coordinates.len(), "vt", "texture coordinates"),
            (normals.len(), "vn", "normals"),
        ];
        let mut corner = [NONE; 3];
        for (place, index) in word.split(|byte| *byte == b'/').enumerate() {
            let refuse = |what: &str| Err(statement.problem(format_args!("\"{}\" {what}", quoted(word))));
            let Some(&(total, keyword, name)) = kinds.get(place) else {
                return refuse("must be one to three indices with \"/\" between them");
            };
            // Some programs name texture coordinates and normals that they did not write.
            if place > 0 && (index.is_empty() || total == 0) {
                continue;
            }
            let Some(number) = integer(index) else {
                return refuse("must be of whole numbers, such as 3, 3/1, 3//2 or 3/1/2");
            };
            let before = so_far[place];
            let found = match usize::try_from(number.unsigned_abs()) {
                Ok(distance @ 1..) if number < 0 => before.checked_sub(distance),
                Ok(distance @ 1..) if distance <= total => Some(distance - 1),
                _ => None,
            };
            let Some(found) = found else {
                return refuse(&format!(
                    "names {name} that are not there: the file has {total} ({keyword}), so an index must be 1 to \
                     {total}, or -1 to -{before} from here back"
                ));
            };
            corner[place] = found as u32;
        }
        Ok(corner)
    }

    /// The vertex of the mesh that a corner is.
    fn vertex(&mut self, corner: Corner) -> u32 {
        let first = &mut self.first[corner[0] as usize];
        let new = self.vertices.len() as u32;
        if *first == NONE || *first < self.group {
            *first = new;
        } else if self.vertices[*first as usize] == corner {
            return *first;
        } else {
            let vertex = *self.others.entry(corner).or_insert(new);
            if vertex != new {
                return vertex;
            }
        }
        self.vertices.push(corner);
        new
    }

    fn position(&self, number: u32) -> DVec3 {
        DVec3::from(self.numbers.positions[number as usize].map(f64::from))
    }

    /// The mesh. It has texture coordinates or normals where every corner has.
    fn into_mesh(self) -> TriangleMesh {
        let Numbers { texture_coordinates, normals, .. } = self.numbers;
        let have = |place: usize| self.vertices.iter().all(|corner| corner[place] != NONE);
        let texture_coordinate = |corner: &Corner| DVec2::from(texture_coordinates[corner[1] as usize].map(f64::from));
        let normal = |corner: &Corner| DVec3::from(normals[corner[2] as usize].map(f64::from));
        TriangleMesh {
            positions: self.vertices.iter().map(|corner| self.position(corner[0])).collect(),
            texture_coordinates: if have(1) {
                self.vertices.iter().map(texture_coordinate).collect()
            } else {
                Vec::new()
            },
            normals: if have(2) { self.vertices.iter().map(normal).collect() } else { Vec::new() },
            triangles: self.triangles,
        }
    }
}

/// A whole number; one that is too large is the largest.
fn integer(word: &[u8]) -> Option<i64> {
    let (sign, digits) = match word {
        [b'-', digits @ ..] => (-1, digits),
        [b'+', digits @ ..] | digits => (1, digits),
    };
    if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let digit = |number: i64, digit: &u8| number.saturating_mul(10).saturating_add(i64::from(digit - b'0'));
    Some(sign * digits.iter().fold(0, digit))
}

#[cfg(test)]
mod tests;
