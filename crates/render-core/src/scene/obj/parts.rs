//! The parts of an OBJ file: faces of one object or group with one material.

use std::collections::BTreeMap;

use super::counts::Counts;
use super::statements::{Kind, Statement, Statements};
use crate::scene::text::{Words, name};
use crate::settings::AssetProblem;

/// Faces of one name and one material, wherever they stand in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ObjPart {
    /// The name of the group, or of the object; empty without both.
    pub(crate) name: String,
    /// The name of the material, if the file says one.
    pub(crate) material: Option<String>,
    /// Triangles that its faces make.
    pub(crate) triangles: usize,
    /// Vertices that it will have, about, at the most.
    pub(crate) vertices: usize,
    /// Which of its faces have texture coordinates.
    pub(crate) texture_coordinates: Coverage,
    /// Which of its faces have normals.
    pub(crate) normals: Coverage,
}

/// Which faces of a part have texture coordinates, or normals, in all corners.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Coverage {
    /// Whether any corner has.
    pub(crate) is_any: bool,
    /// Faces with a corner that has none.
    pub(crate) faces_without: usize,
}

impl Coverage {
    /// Adds a face whose corners are these words, in which the index stands at `place`.
    fn add(&mut self, corners: &[u8], place: usize) {
        let is_there = |word: &[u8]| word.split(|byte| *byte == b'/').nth(place).is_some_and(|index| !index.is_empty());
        let mut is_whole = true;
        for corner in Words(corners) {
            let is_there = is_there(corner);
            self.is_any |= is_there;
            is_whole &= is_there;
        }
        self.faces_without += usize::from(!is_whole);
    }

    /// The same in a file that has this many texture coordinates, or normals. Indices of what is not there do not
    /// count.
    fn of_file(self, numbers: usize) -> Self {
        Self { is_any: self.is_any && numbers > 0, ..self }
    }
}

/// The most parts of a file.
const MAX_PARTS: usize = 1 << 17;

/// Finds the part of each face.
#[derive(Debug, Default)]
pub(super) struct PartNames {
    object: String,
    group: String,
    material: String,
    numbers: BTreeMap<(String, String), usize>,
    /// The part of the next face, while no statement has changed it.
    current: Option<usize>,
}

impl PartNames {
    /// Takes note of a statement that names what follows.
    pub(super) fn see(&mut self, statement: &Statement<'_>) {
        let place = match statement.kind {
            Kind::Object => {
                self.group.clear();
                &mut self.object
            }
            Kind::Group => &mut self.group,
            Kind::Material => &mut self.material,
            _ => return,
        };
        *place = name(statement.arguments);
        self.current = None;
    }

    /// The part of the next face: parts are numbered in the order in which they appear.
    pub(super) fn current(&mut self) -> Result<usize, AssetProblem> {
        if let Some(part) = self.current {
            return Ok(part);
        }
        let name = if self.group.is_empty() { &self.object } else { &self.group };
        let next = self.numbers.len();
        let part = *self.numbers.entry((name.clone(), self.material.clone())).or_insert(next);
        if self.numbers.len() > MAX_PARTS {
            return Err(AssetProblem::TooLarge {
                found: format!("more than {MAX_PARTS} parts with names or materials of their own"),
                limit: MAX_PARTS.to_string(),
            });
        }
        self.current = Some(part);
        Ok(part)
    }

    /// Names and materials of the parts, in order.
    fn into_parts(self) -> Vec<(String, String)> {
        let mut parts: Vec<_> = self.numbers.into_iter().collect();
        parts.sort_unstable_by_key(|(_, number)| *number);
        parts.into_iter().map(|(part, _)| part).collect()
    }
}

/// What is counted of a part.
#[derive(Clone, Copy, Debug, Default)]
struct Size {
    triangles: usize,
    /// Runs of faces without faces of other parts or groups among them.
    runs: usize,
    texture_coordinates: Coverage,
    normals: Coverage,
}

/// Finds the parts of a file of which these are the counts.
pub(super) fn find(bytes: &[u8], counts: &Counts) -> Result<Vec<ObjPart>, AssetProblem> {
    let mut names = PartNames::default();
    let mut sizes: Vec<Size> = Vec::new();
    let mut last = None;
    let mut statements = Statements::new(bytes);
    while let Some(statement) = statements.next() {
        if matches!(statement.kind, Kind::Object | Kind::Group) {
            last = None;
        }
        names.see(&statement);
        if statement.kind != Kind::Face {
            continue;
        }
        let triangles = Words(statement.arguments).count().saturating_sub(2);
        if triangles == 0 {
            continue;
        }
        let part = names.current()?;
        if part == sizes.len() {
            sizes.push(Size::default());
        }
        sizes[part].triangles += triangles;
        sizes[part].runs += usize::from(last.replace(part) != Some(part));
        sizes[part].texture_coordinates.add(statement.arguments, 1);
        sizes[part].normals.add(statement.arguments, 2);
    }
    let of_part = |((name, material), size): ((String, String), Size)| ObjPart {
        name,
        material: (!material.is_empty()).then_some(material),
        triangles: size.triangles,
        vertices: (3 * size.triangles).min(counts.named().saturating_mul(size.runs)),
        texture_coordinates: size.texture_coordinates.of_file(counts.texture_coordinates),
        normals: size.normals.of_file(counts.normals),
    };
    Ok(names.into_parts().into_iter().zip(sizes).map(of_part).collect())
}

/// Sorts the faces of a file into parts while they are read.
#[derive(Debug)]
pub(super) struct Sorting {
    names: PartNames,
    /// The part that alone is read.
    wanted: Option<usize>,
    last: Option<usize>,
    /// Faces of one part that follow each other.
    pub(super) runs: Vec<Run>,
}

/// Where faces of a part begin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub(super) part: usize,
    pub(super) vertex: usize,
    pub(super) triangle: usize,
}

/// What the reader does with a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// It belongs to a part that is not wanted.
    Skip,
    /// It belongs to the part of the last face.
    Continue,
    /// It begins a run.
    Begin,
}

impl Sorting {
    /// Sorts into all parts, or reads one alone.
    pub(super) fn new(wanted: Option<usize>) -> Self {
        Self { names: PartNames::default(), wanted, last: None, runs: Vec::new() }
    }

    /// Takes note of a statement that names what follows.
    pub(super) fn see(&mut self, statement: &Statement<'_>) {
        self.names.see(statement);
    }

    /// What the reader does with the next face. It has read this many vertices and triangles so far.
    pub(super) fn next_face(&mut self, vertex: usize, triangle: usize) -> Result<Step, AssetProblem> {
        let part = self.names.current()?;
        let is_same = self.last.replace(part) == Some(part);
        Ok(match () {
            () if self.wanted.is_some_and(|wanted| wanted != part) => Step::Skip,
            () if is_same => Step::Continue,
            () => {
                self.runs.push(Run { part, vertex, triangle });
                Step::Begin
            }
        })
    }
}
