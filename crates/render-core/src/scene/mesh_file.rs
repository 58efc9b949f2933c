//! The mesh files that a scene names. They are opened before they are decoded, so that their size is known before
//! memory is taken. Each is opened once, however many meshes come from it.

use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;

use glam::DVec2;

use super::assets::{Assets, asset_bytes, beside};
use super::import::gltf::{GltfFile, Primitive};
use super::mesh::TriangleMesh;
use super::mesh_format::{FileMesh, MeshFormat, MeshPart};
use super::obj::{ObjFile, ObjPart};
use super::ply::PlyFile;
use crate::settings::AssetProblem;

/// A file of which no triangle is decoded yet.
pub(super) enum MeshFile<'a> {
    Obj(OpenObj<'a>),
    Ply(PlyFile<'a>),
    Gltf(Box<GltfFile<'a>>),
}

impl<'a> MeshFile<'a> {
    /// Opens a file.
    fn open(format: MeshFormat, file: &'a str, assets: &'a Assets) -> Result<Self, AssetProblem> {
        let bytes = asset_bytes(assets, file)?;
        match format {
            MeshFormat::Obj => ObjFile::open(bytes).map(|file| Self::Obj(OpenObj::new(file))),
            MeshFormat::Ply => PlyFile::open(bytes).map(Self::Ply),
            MeshFormat::Gltf => {
                GltfFile::open(bytes, &|uri| beside(assets, file, uri)).map(|file| Self::Gltf(Box::new(file)))
            }
        }
    }

    /// Vertices and triangles that a part of it will have, about, at the most, with triangles that have no area.
    pub(super) fn size(&self, part: MeshPart) -> Result<[usize; 2], AssetProblem> {
        match (self, part) {
            (Self::Obj(OpenObj { file, .. }), None) => Ok([file.vertices(), file.triangles()]),
            (Self::Obj(file), Some([number, _])) => {
                let parts = file.parts()?;
                let part = parts.get(number as usize);
                let missing = || AssetProblem::malformed(format_args!("has {} parts, no part {number}", parts.len()));
                part.map(|part| [part.vertices, part.triangles]).ok_or_else(missing)
            }
            (Self::Ply(file), _) => Ok([file.vertices(), file.triangles()]),
            (Self::Gltf(file), part) => {
                let [mesh, number] = part.unwrap_or_default().map(|number| number as usize);
                let primitive = file.meshes().nth(mesh).and_then(|mesh| mesh.primitives.get(number));
                let missing = || AssetProblem::malformed(format_args!("has no primitive {number} of a mesh {mesh}"));
                primitive.map(|info| [info.vertices, info.triangles]).ok_or_else(missing)
            }
        }
    }

    /// Decodes a part of it.
    pub(super) fn decode(&self, part: MeshPart) -> Result<TriangleMesh, AssetProblem> {
        match (self, part) {
            (Self::Obj(OpenObj { file, .. }), None) => file.decode(),
            (Self::Obj(file), Some([part, _])) => {
                let mut mesh = file.decode_part(part as usize)?;
                if mesh.texture_coordinates.is_empty() {
                    mesh.texture_coordinates = vec![DVec2::ZERO; mesh.positions.len()];
                }
                Ok(mesh)
            }
            (Self::Ply(file), _) => file.decode(),
            (Self::Gltf(file), part) => {
                let [mesh, primitive] = part.unwrap_or_default();
                file.decode(mesh as usize, primitive as usize).map(TriangleMesh::from)
            }
        }
    }
}

/// An OBJ file of whose parts many meshes are made. Each step reads the whole file, so it is taken once for all parts.
pub(super) struct OpenObj<'a> {
    file: ObjFile<'a>,
    parts: OnceCell<Vec<ObjPart>>,
    /// Parts that are decoded and not taken yet; `None` before the first is asked for.
    decoded: RefCell<Option<BTreeMap<usize, TriangleMesh>>>,
}

impl<'a> OpenObj<'a> {
    fn new(file: ObjFile<'a>) -> Self {
        Self { file, parts: OnceCell::new(), decoded: RefCell::new(None) }
    }

    fn parts(&self) -> Result<&[ObjPart], AssetProblem> {
        if self.parts.get().is_none() {
            let _ = self.parts.set(self.file.parts()?);
        }
        Ok(self.parts.get().map_or(&[], Vec::as_slice))
    }

    fn decode_part(&self, part: usize) -> Result<TriangleMesh, AssetProblem> {
        let mut decoded = self.decoded.borrow_mut();
        if decoded.is_none() {
            *decoded = Some(self.file.decode_parts()?.into_iter().enumerate().collect());
        }
        match decoded.as_mut().and_then(|meshes| meshes.remove(&part)) {
            Some(mesh) => Ok(mesh),
            None => self.file.decode_part(part),
        }
    }
}

impl From<Primitive> for TriangleMesh {
    /// In a glTF file v = 0 is the top of a picture. Vertices without texture coordinates have zeros.
    fn from(primitive: Primitive) -> Self {
        let vertices = primitive.positions.len();
        let [first, second] = primitive.texture_coordinates.map(|coordinates| match coordinates.is_empty() {
            true => vec![DVec2::ZERO; vertices],
            false => coordinates.into_iter().map(|DVec2 { x, y }| DVec2::new(x, 1.0 - y)).collect(),
        });
        Self {
            positions: primitive.positions,
            triangles: primitive.triangles,
            texture_coordinates: first,
            second_texture_coordinates: second,
            normals: primitive.normals,
            tangents: primitive.tangents,
            colours: primitive.colours,
        }
    }
}

/// The files that are open.
pub(super) struct MeshFiles<'a> {
    assets: &'a Assets,
    open: BTreeMap<(MeshFormat, &'a str), MeshFile<'a>>,
}

impl<'a> MeshFiles<'a> {
    /// No file yet.
    pub(super) fn new(assets: &'a Assets) -> Self {
        Self { assets, open: BTreeMap::new() }
    }

    /// The file of a mesh.
    pub(super) fn file(&mut self, mesh: FileMesh<'a>) -> Result<&MeshFile<'a>, AssetProblem> {
        let key = (mesh.format, mesh.file);
        if !self.open.contains_key(&key) {
            self.open.insert(key, MeshFile::open(mesh.format, mesh.file, self.assets)?);
        }
        Ok(&self.open[&key])
    }
}
