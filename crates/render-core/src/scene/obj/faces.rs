//! The faces of an OBJ file: their corners become the vertices of triangles.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::numbers::{Extent, Numbers};
use super::parts::{Run, Sorting, Step};
use super::statements::{Kind, Statement, Statements};
use crate::scene::mesh::TriangleMesh;
use crate::scene::polygon::Cutter;
use crate::scene::text::{Words, quoted};
use crate::settings::AssetProblem;

/// The number of a texture coordinate or normal that a corner does not have.
const NONE: u32 = u32::MAX;

/// The corner of a face: the numbers of its position, texture coordinate and normal.
type Corner = [u32; 3];

/// The faces of a file.
pub(super) struct Faces<'a> {
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
    pub(super) fn new(numbers: &'a Numbers, triangles: usize) -> Self {
        Self {
            numbers,
            triangles: Vec::with_capacity(triangles),
            vertices: Vec::new(),
            first: vec![NONE; numbers.positions.len()],
            others: BTreeMap::new(),
            group: 0,
        }
    }

    /// Reads the faces of a file, sorted into parts if that is asked for.
    pub(super) fn read(&mut self, bytes: &[u8], mut sorting: Option<&mut Sorting>) -> Result<(), AssetProblem> {
        let mut cutter = Cutter::new();
        let (mut polygon, mut places) = (Vec::new(), Vec::new());
        let mut so_far = [0; 3];
        let mut statements = Statements::new(bytes);
        while let Some(statement) = statements.next() {
            if let Some(sorting) = &mut sorting {
                sorting.see(&statement);
            }
            match statement.kind {
                Kind::Position => so_far[0] += 1,
                Kind::TextureCoordinate => so_far[1] += 1,
                Kind::Normal => so_far[2] += 1,
                Kind::Object | Kind::Group => self.begin_group(),
                Kind::Material | Kind::Libraries => {}
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
                    let step = match &mut sorting {
                        Some(sorting) => sorting.next_face(self.vertices.len(), self.triangles.len())?,
                        None => Step::Continue,
                    };
                    match step {
                        Step::Skip => continue,
                        Step::Begin => self.begin_group(),
                        Step::Continue => {}
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

    /// Begins a group: it shares no vertex with those before.
    fn begin_group(&mut self) {
        self.group = self.vertices.len() as u32;
        self.others.clear();
    }

    /// The corner that a word names: `position`, `position/texture`, `position//normal` or `position/texture/normal`.
    fn corner(&self, statement: &Statement<'_>, word: &[u8], so_far: [usize; 3]) -> Result<Corner, AssetProblem> {
        let Numbers { positions, texture_coordinates, normals, .. } = self.numbers;
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
        self.numbers.positions[number as usize]
    }

    /// The mesh of all faces.
    pub(super) fn into_mesh(self) -> TriangleMesh {
        self.numbers.mesh(&self.vertices, self.triangles)
    }

    /// The meshes of `parts` parts, whose runs these are.
    pub(super) fn into_parts(self, runs: &[Run], parts: usize) -> Vec<TriangleMesh> {
        let mut sorted: Vec<(Vec<Corner>, Vec<[u32; 3]>)> = vec![Default::default(); parts];
        let end = Run { part: 0, vertex: self.vertices.len(), triangle: self.triangles.len() };
        for (run, next) in runs.iter().zip(runs.iter().skip(1).chain([&end])) {
            let Some((vertices, triangles)) = sorted.get_mut(run.part) else { continue };
            // The faces of a run name vertices of the run alone.
            let moved = |vertex: u32| vertex - run.vertex as u32 + vertices.len() as u32;
            triangles.extend(self.triangles[run.triangle..next.triangle].iter().map(|corners| corners.map(moved)));
            vertices.extend(&self.vertices[run.vertex..next.vertex]);
        }
        sorted.into_iter().map(|(vertices, triangles)| self.numbers.mesh(&vertices, triangles)).collect()
    }
}

impl Numbers {
    /// A mesh of these vertices. One mesh of a whole file has texture coordinates or normals where every vertex has.
    /// Parts have them where any vertex has. The others have zeros; a normal of no length becomes that of the triangle.
    fn mesh(&self, vertices: &[Corner], triangles: Vec<[u32; 3]>) -> TriangleMesh {
        let have = |place: usize| {
            let mut is_there = vertices.iter().map(|corner| corner[place] != NONE);
            match self.extent {
                Extent::OneMesh => is_there.all(|is_there| is_there),
                Extent::Parts => is_there.any(|is_there| is_there),
            }
        };
        let position = |corner: &Corner| self.positions[corner[0] as usize];
        // `NONE` is beyond the end of either list.
        let texture_coordinate = |corner: &Corner| {
            let found = self.texture_coordinates.get(corner[1] as usize);
            found.map_or(DVec2::ZERO, |pair| DVec2::from(pair.map(f64::from)))
        };
        let normal = |corner: &Corner| {
            let found = self.normals.get(corner[2] as usize);
            found.map_or(DVec3::ZERO, |normal| DVec3::from(normal.map(f64::from)))
        };
        let colour = |corner: &Corner| {
            let [red, green, blue] = self.colours[corner[0] as usize];
            [red, green, blue, 1.0]
        };
        TriangleMesh {
            positions: vertices.iter().map(position).collect(),
            texture_coordinates: if have(1) { vertices.iter().map(texture_coordinate).collect() } else { Vec::new() },
            normals: if have(2) { vertices.iter().map(normal).collect() } else { Vec::new() },
            colours: if self.colours.is_empty() { Vec::new() } else { vertices.iter().map(colour).collect() },
            triangles,
            ..TriangleMesh::default()
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
