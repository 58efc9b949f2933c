//! The mesh files that a scene names. They are opened before they are decoded, so that their size is known before
//! memory is taken.

use super::mesh::TriangleMesh;
use super::mesh_format::MeshFormat;
use super::obj::ObjFile;
use super::ply::PlyFile;
use crate::settings::AssetProblem;

/// A file of which no triangle is decoded yet.
pub(super) enum MeshFile<'a> {
    Obj(ObjFile<'a>),
    Ply(PlyFile<'a>),
}

impl<'a> MeshFile<'a> {
    /// Opens a file.
    pub(super) fn open(format: MeshFormat, bytes: &'a [u8]) -> Result<Self, AssetProblem> {
        match format {
            MeshFormat::Obj => ObjFile::open(bytes).map(Self::Obj),
            MeshFormat::Ply => PlyFile::open(bytes).map(Self::Ply),
        }
    }

    /// Triangles that it will have, with those that have no area.
    pub(super) fn triangles(&self) -> usize {
        match self {
            Self::Obj(file) => file.triangles(),
            Self::Ply(file) => file.triangles(),
        }
    }

    /// Vertices that it will have, about, at the most.
    pub(super) fn vertices(&self) -> usize {
        match self {
            Self::Obj(file) => file.vertices(),
            Self::Ply(file) => file.vertices(),
        }
    }

    /// Decodes it.
    pub(super) fn decode(&self) -> Result<TriangleMesh, AssetProblem> {
        match self {
            Self::Obj(file) => file.decode(),
            Self::Ply(file) => file.decode(),
        }
    }
}
