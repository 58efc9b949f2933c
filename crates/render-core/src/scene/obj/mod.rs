//! Triangle meshes from Wavefront OBJ files, whole or in parts, and the materials beside them (MTL). Lines, points,
//! curves and free-form surfaces are left out.
//!
//! A file is read three times. The first counts, so that the size is known before memory is allocated. The second reads
//! the numbers. The third reads the faces, which may name later vertices.

mod counts;
mod faces;
mod file_name;
mod mtl;
mod numbers;
mod parts;
mod statements;

use self::counts::Counts;
use self::faces::Faces;
use self::file_name::file_beside;
pub(crate) use self::mtl::{MtlFile, MtlMap, MtlMaterial};
use self::numbers::{Extent, Numbers};
pub(crate) use self::parts::ObjPart;
use self::parts::Sorting;
use self::statements::{Kind, Statements};
use super::mesh::TriangleMesh;
use super::mesh_format::refuse_other_formats;
use super::text::{Lines, Words, name};
use crate::settings::AssetProblem;

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
        let Counts { positions, triangles, groups, .. } = self.counts;
        positions.max((3 * triangles).min(self.counts.named().saturating_mul(groups)))
    }

    /// Decodes it as one mesh, with less detail than its parts have.
    pub(super) fn decode(&self) -> Result<TriangleMesh, AssetProblem> {
        let numbers = Numbers::read(self.bytes, self.counts, Extent::OneMesh)?;
        let mut faces = Faces::new(&numbers, self.counts.triangles);
        faces.read(self.bytes, None)?;
        Ok(faces.into_mesh())
    }

    /// Its statements of lines and points, which are left out.
    pub(super) fn lines_and_points(&self) -> usize {
        Lines::new(self.bytes, 1).filter(|line| matches!(Words(line).next(), Some(b"l" | b"p"))).count()
    }

    /// Whether any of its vertices has a colour.
    pub(super) fn has_colours(&self) -> bool {
        let mut statements = Statements::new(self.bytes);
        while let Some(statement) = statements.next() {
            if statement.kind == Kind::Position && Words(statement.arguments).nth(5).is_some() {
                return true;
            }
        }
        false
    }

    /// Its parts that have triangles, in the order in which they appear.
    pub(super) fn parts(&self) -> Result<Vec<ObjPart>, AssetProblem> {
        parts::find(self.bytes, &self.counts)
    }

    /// Decodes all parts, in the order of [`ObjFile::parts`].
    pub(super) fn decode_parts(&self) -> Result<Vec<TriangleMesh>, AssetProblem> {
        self.decode_sorted(None, &self.parts()?)
    }

    /// Decodes one part. It reads the whole file; of many parts [`ObjFile::decode_parts`] is quicker.
    pub(super) fn decode_part(&self, part: usize) -> Result<TriangleMesh, AssetProblem> {
        let parts = self.parts()?;
        let missing = || {
            let found = parts.len();
            AssetProblem::malformed(format_args!("has {found} parts of triangles, so a part must be below {found}"))
        };
        let mut meshes = if part < parts.len() { self.decode_sorted(Some(part), &parts)? } else { Vec::new() };
        (part < meshes.len()).then(|| meshes.swap_remove(part)).ok_or_else(missing)
    }

    fn decode_sorted(&self, wanted: Option<usize>, parts: &[ObjPart]) -> Result<Vec<TriangleMesh>, AssetProblem> {
        let numbers = Numbers::read(self.bytes, self.counts, Extent::Parts)?;
        let triangles = wanted.and_then(|part| parts.get(part)).map_or(self.counts.triangles, |part| part.triangles);
        let mut faces = Faces::new(&numbers, triangles);
        let mut sorting = Sorting::new(wanted);
        faces.read(self.bytes, Some(&mut sorting))?;
        Ok(faces.into_parts(&sorting.runs, parts.len()))
    }

    /// The names of the files that describe its materials, relative to it, each once.
    ///
    /// # Errors
    ///
    /// When a name cannot be that of a file beside it.
    pub(super) fn material_libraries(&self) -> Result<Vec<String>, AssetProblem> {
        let mut libraries = Vec::new();
        let mut statements = Statements::new(self.bytes);
        while let Some(statement) = statements.next() {
            if statement.kind != Kind::Libraries {
                continue;
            }
            let is_library = |word: &[u8]| word.to_ascii_lowercase().ends_with(b".mtl");
            // Names may have blanks in them, or there may be several.
            let whole = [statement.arguments.trim_ascii()];
            let words: Vec<&[u8]> = Words(statement.arguments).collect();
            let names = if words.iter().all(|word| is_library(word)) { &words[..] } else { &whole[..] };
            for &library in names {
                let library = name(library);
                let Some(file) = file_beside(&library) else {
                    return Err(statement.problem("must name a file beside this one"));
                };
                if !libraries.contains(&file) {
                    libraries.push(file);
                }
            }
        }
        Ok(libraries)
    }
}

#[cfg(test)]
mod tests;
