//! Triangle meshes from PLY files: text and binary, either byte order. Elements and properties other than positions,
//! normals, texture coordinates and faces are left out.

mod body;
mod header;

use glam::{DVec2, DVec3};

use self::body::{Body, Record};
use self::header::{Header, Property, malformed};
use super::mesh::TriangleMesh;
use super::polygon::Cutter;
use crate::settings::AssetProblem;

/// What programs call the first texture coordinate.
const U_NAMES: [&str; 3] = ["u", "s", "texture_u"];
/// What programs call the second texture coordinate.
const V_NAMES: [&str; 3] = ["v", "t", "texture_v"];

/// What programs call the corners of a face.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// A file whose elements have been found.
pub(super) struct PlyFile<'a> {
    header: Header<'a>,
    /// The number of the property of faces that lists their corners.
    corners: usize,
    /// Where the vertices and the faces begin.
    vertices: Body<'a>,
    faces: Body<'a>,
    triangles: usize,
}

impl<'a> PlyFile<'a> {
    /// Finds the elements of a file, and checks that it holds all that its header claims.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, AssetProblem> {
        let header = Header::read(bytes)?;
        let corners = check_elements(&header)?;
        let mut body = Body::of(&header);
        let (mut vertices, mut faces) = (body.clone(), body.clone());
        let mut triangles = 0;
        for element in &header.elements {
            body.check_count(element)?;
            match element.name.as_str() {
                "vertex" => vertices = body.clone(),
                "face" => faces = body.clone(),
                _ => {}
            }
            if body.skip_all(element)? {
                continue;
            }
            for index in 0..element.count {
                let record = Record { element, index };
                body.begin(record)?;
                for (number, property) in element.properties.iter().enumerate() {
                    let length = skip(&mut body, property, record)?;
                    if element.name == "face" && number == corners {
                        triangles += length.saturating_sub(2);
                    }
                }
                body.end(record)?;
            }
        }
        Ok(Self { header, corners, vertices, faces, triangles })
    }

    /// Triangles that its faces make.
    pub(super) fn triangles(&self) -> usize {
        self.triangles
    }

    /// Vertices that it has.
    pub(super) fn vertices(&self) -> usize {
        self.header.element("vertex").map_or(0, |element| element.count)
    }

    /// Decodes it.
    pub(super) fn decode(&self) -> Result<TriangleMesh, AssetProblem> {
        let mut mesh = TriangleMesh::default();
        self.read_vertices(&mut mesh)?;
        self.read_faces(&mut mesh)?;
        Ok(mesh)
    }

    fn read_vertices(&self, mesh: &mut TriangleMesh) -> Result<(), AssetProblem> {
        let Some(element) = self.header.element("vertex") else { return Ok(()) };
        // Which component of the vertex a property is.
        let components: Vec<Option<usize>> =
            element.properties.iter().map(|property| component(&property.name)).collect();
        let has = |component: usize| components.contains(&Some(component));
        let has_normals = (NORMAL..NORMAL + 3).all(has);
        let has_texture_coordinates = (TEXTURE..TEXTURE + 2).all(has);
        mesh.positions.reserve_exact(element.count);
        mesh.normals.reserve_exact(if has_normals { element.count } else { 0 });
        mesh.texture_coordinates.reserve_exact(if has_texture_coordinates { element.count } else { 0 });
        let mut body = self.vertices.clone();
        for index in 0..element.count {
            let record = Record { element, index };
            body.begin(record)?;
            let mut vertex = [0.0; COMPONENTS];
            for (property, component) in element.properties.iter().zip(&components) {
                match component {
                    Some(component) => vertex[*component] = body.number(property.scalar, record)?,
                    None => _ = skip(&mut body, property, record)?,
                }
            }
            let [x, y, z, normal_x, normal_y, normal_z, u, v] = vertex;
            let position = DVec3::new(x, y, z);
            if !position.is_finite() {
                return Err(body.problem(record, format_args!("is at {position}, must have finite coordinates")));
            }
            mesh.positions.push(position);
            if has_normals {
                mesh.normals.push(DVec3::new(normal_x, normal_y, normal_z));
            }
            if has_texture_coordinates {
                mesh.texture_coordinates.push(DVec2::new(u, v));
            }
        }
        Ok(())
    }

    fn read_faces(&self, mesh: &mut TriangleMesh) -> Result<(), AssetProblem> {
        let Some(element) = self.header.element("face") else { return Ok(()) };
        let mut body = self.faces.clone();
        let mut cutter = Cutter::new();
        let (mut polygon, mut places) = (Vec::<u32>::new(), Vec::new());
        mesh.triangles.reserve_exact(self.triangles);
        for index in 0..element.count {
            let record = Record { element, index };
            body.begin(record)?;
            for (number, property) in element.properties.iter().enumerate() {
                if number != self.corners {
                    skip(&mut body, property, record)?;
                    continue;
                }
                polygon.clear();
                places.clear();
                for _ in 0..length(&mut body, property, record)? {
                    let vertex = body.integer(property.scalar, record)?;
                    let found = usize::try_from(vertex).ok().and_then(|vertex| mesh.positions.get(vertex));
                    let Some(place) = found else {
                        let expected = format_args!("must have indices below {}", mesh.positions.len());
                        return Err(body.problem(record, format_args!("has the vertex {vertex}, {expected}")));
                    };
                    polygon.push(vertex as u32);
                    places.push(*place);
                }
                cutter.cut(&places, |corners| mesh.triangles.push(corners.map(|corner| polygon[corner])))?;
            }
        }
        Ok(())
    }
}

/// Checks that a file is a mesh, and that nothing of its shape is in elements that are not read. Answers which property
/// of its faces lists their corners.
fn check_elements(header: &Header<'_>) -> Result<usize, AssetProblem> {
    if let Some(strips) = header.element("tristrips").filter(|strips| strips.count > 0) {
        let count = strips.count;
        return Err(malformed(format_args!(
            "it has {count} elements \"tristrips\", which are not read: export the mesh with faces"
        )));
    }
    let names = || header.elements.iter().map(|element| format!("\"{}\"", element.name)).collect::<Vec<_>>().join(", ");
    let Some(vertex) = header.element("vertex") else {
        return Err(malformed(format_args!("it has no element \"vertex\", only {}", names())));
    };
    let Some(face) = header.element("face") else {
        return Err(malformed(format_args!(
            "it has no element \"face\", only {}: points without faces are no mesh",
            names()
        )));
    };
    if let Some(axis) =
        ["x", "y", "z"].into_iter().find(|axis| vertex.properties.iter().all(|found| found.name != *axis))
    {
        return Err(malformed(format_args!("its vertices are without the property \"{axis}\"")));
    }
    if let Some(list) = vertex.properties.iter().find(|list| list.length.is_some() && component(&list.name).is_some()) {
        return Err(malformed(format_args!("the property \"{}\" of its vertices must not be a list", list.name)));
    }
    let is_corners = |list: &Property| list.length.is_some() && CORNERS.contains(&list.name.as_str());
    let Some(corners) = face.properties.iter().position(is_corners) else {
        return Err(malformed("its faces have no list \"vertex_indices\" or \"vertex_index\""));
    };
    let Property { name, scalar, .. } = &face.properties[corners];
    if !scalar.is_integer() {
        return Err(malformed(format_args!("the list \"{name}\" of its faces must be of whole numbers")));
    }
    if u32::try_from(vertex.count).is_err() {
        return Err(malformed("it has more vertices than 32 bits can number"));
    }
    Ok(corners)
}

/// Components of a vertex: position, normal, texture coordinate.
const COMPONENTS: usize = 8;
const NORMAL: usize = 3;
const TEXTURE: usize = 6;

/// Which component of a vertex a property is.
fn component(name: &str) -> Option<usize> {
    match name {
        "x" => Some(0),
        "y" => Some(1),
        "z" => Some(2),
        "nx" => Some(NORMAL),
        "ny" => Some(NORMAL + 1),
        "nz" => Some(NORMAL + 2),
        name if U_NAMES.contains(&name) => Some(TEXTURE),
        name if V_NAMES.contains(&name) => Some(TEXTURE + 1),
        _ => None,
    }
}

/// Leaves a property out, and answers how many numbers it has.
fn skip(body: &mut Body<'_>, property: &Property, record: Record<'_>) -> Result<usize, AssetProblem> {
    let length = length(body, property, record)?;
    body.skip(property.scalar, length, record)?;
    Ok(length)
}

/// How many numbers the next property has: 1, or as many as the length of the list says.
fn length(body: &mut Body<'_>, property: &Property, record: Record<'_>) -> Result<usize, AssetProblem> {
    let Some(length) = property.length else { return Ok(1) };
    let length = body.integer(length, record)?;
    usize::try_from(length).map_err(|_| body.problem(record, format_args!("has a list of {length} numbers")))
}

#[cfg(test)]
mod tests;
