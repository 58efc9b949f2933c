//! Triangle meshes from PLY files: text and binary, either byte order. Polygons become fans of triangles; elements and
//! properties other than positions, normals, texture coordinates and faces are left out.

use glam::{DVec2, DVec3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

use super::error::AssetProblem;
use super::mesh::TriangleMesh;

/// Decodes a PLY file.
pub(super) fn decode_ply(bytes: &[u8]) -> Result<TriangleMesh, AssetProblem> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(malformed)?;
    let mut mesh = TriangleMesh::default();
    for element in header.elements.values() {
        check_count(element, header.encoding, reader.get_ref().len())?;
        match element.name.as_str() {
            "vertex" => read_vertices(&mut reader, element, &header, &mut mesh)?,
            "face" => read_faces(&mut reader, element, &header, &mut mesh)?,
            _ => drop(read_elements::<Skipped>(&mut reader, element, &header)?),
        }
    }
    Ok(mesh)
}

/// Checks that the rest of the file can hold as many elements as the header claims.
fn check_count(element: &ElementDef, encoding: Encoding, remaining_bytes: usize) -> Result<(), AssetProblem> {
    let smallest = match encoding {
        // One digit and white space for each number.
        Encoding::Ascii => element.properties.len(),
        Encoding::BinaryBigEndian | Encoding::BinaryLittleEndian => {
            let least = |data_type: &PropertyType| match data_type {
                PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => bytes_of(scalar),
            };
            element.properties.values().map(|property| least(&property.data_type)).sum()
        }
    };
    if element.count <= remaining_bytes / smallest.max(1) && (smallest > 0 || element.count == 0) {
        return Ok(());
    }
    let ElementDef { name, count, .. } = element;
    Err(AssetProblem::malformed(format_args!("claims {count} elements \"{name}\", which it is too short to hold")))
}

fn bytes_of(scalar: &ScalarType) -> usize {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

fn read_elements<E: PropertyAccess>(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
) -> Result<Vec<E>, AssetProblem> {
    Parser::<E>::new().read_payload_for_element(reader, element, header).map_err(malformed)
}

fn read_vertices(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
    mesh: &mut TriangleMesh,
) -> Result<(), AssetProblem> {
    if let Some(axis) = ["x", "y", "z"].into_iter().find(|axis| !element.properties.contains_key(*axis)) {
        return Err(AssetProblem::malformed(format_args!("has vertices without the property \"{axis}\"")));
    }
    let has_texture_coordinates =
        [&U_NAMES, &V_NAMES].iter().all(|names| names.iter().any(|name| element.properties.contains_key(*name)));
    let has_normals = ["nx", "ny", "nz"].iter().all(|name| element.properties.contains_key(*name));
    for vertex in read_elements::<Vertex>(reader, element, header)? {
        mesh.positions.push(vertex.position);
        if has_texture_coordinates {
            mesh.texture_coordinates.push(vertex.texture_coordinate);
        }
        if has_normals {
            mesh.normals.push(vertex.normal);
        }
    }
    Ok(())
}

fn read_faces(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
    mesh: &mut TriangleMesh,
) -> Result<(), AssetProblem> {
    for (index, face) in read_elements::<Face>(reader, element, header)?.into_iter().enumerate() {
        let Some([first, rest @ ..]) = face.vertices.as_deref() else {
            return Err(AssetProblem::malformed(format_args!("has no list of vertices in face {index}")));
        };
        mesh.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
    }
    Ok(())
}

fn malformed(error: ParseError) -> AssetProblem {
    AssetProblem::malformed(format_args!("is not a readable PLY file: {error}"))
}

/// What programs call the first texture coordinate.
const U_NAMES: [&str; 3] = ["u", "s", "texture_u"];
/// What programs call the second texture coordinate.
const V_NAMES: [&str; 3] = ["v", "t", "texture_v"];

#[derive(Default)]
struct Vertex {
    position: DVec3,
    normal: DVec3,
    texture_coordinate: DVec2,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let component = match name {
            "x" => &mut self.position.x,
            "y" => &mut self.position.y,
            "z" => &mut self.position.z,
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            name if U_NAMES.contains(&name) => &mut self.texture_coordinate.x,
            name if V_NAMES.contains(&name) => &mut self.texture_coordinate.y,
            _ => return PropertyAccessResult::Ignored,
        };
        *component = match property {
            Property::Float(value) => f64::from(value),
            Property::Double(value) => value,
            Property::Char(value) => f64::from(value),
            Property::UChar(value) => f64::from(value),
            Property::Short(value) => f64::from(value),
            Property::UShort(value) => f64::from(value),
            Property::Int(value) => f64::from(value),
            Property::UInt(value) => f64::from(value),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

#[derive(Default)]
struct Face {
    vertices: Option<Vec<u32>>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !matches!(name, "vertex_indices" | "vertex_index") {
            return PropertyAccessResult::Ignored;
        }
        self.vertices = property.to_u32_list();
        // A list with a negative index is of the right type; that it is missing is found later.
        match (&self.vertices, property) {
            (Some(_), _) | (None, Property::ListChar(_) | Property::ListShort(_) | Property::ListInt(_)) => {
                PropertyAccessResult::Set
            }
            (None, _) => PropertyAccessResult::UnsupportedType,
        }
    }
}

/// An element of which nothing is kept.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "ply\nformat ascii 1.0\ncomment a square\nelement vertex 4\nproperty float x\nproperty float y\n\
                        property float z\nproperty uchar red\nproperty float s\nproperty float t\nelement face 1\n\
                        property list uchar int vertex_indices\nelement edge 1\nproperty int vertex1\nend_header\n\
                        0 0 0 255 0 0\n1 0 0 0 1 0\n1 1 0 0 1 1\n0 1 0.5 0 0 1\n4 0 1 2 3\n2\n";

    fn binary(big_endian: bool) -> Vec<u8> {
        let format = if big_endian { "binary_big_endian" } else { "binary_little_endian" };
        let mut bytes = format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty double x\nproperty float y\nproperty short z\n\
             element face 2\nproperty list uchar uint vertex_index\nproperty uchar flags\nend_header\n"
        )
        .into_bytes();
        let order = |mut value: Vec<u8>| {
            if !big_endian {
                value.reverse();
            }
            value
        };
        for (x, y, z) in [(0.0, 0.0, 0), (1.0, 0.0, 0), (1.0, 1.0, 0), (0.0, 1.0, -7)] {
            bytes.extend(order(f64::to_be_bytes(x).to_vec()));
            bytes.extend(order(f32::to_be_bytes(y).to_vec()));
            bytes.extend(order(i16::to_be_bytes(z).to_vec()));
        }
        for face in [[0, 1, 2], [0, 2, 3]] {
            bytes.push(3);
            face.into_iter().for_each(|index| bytes.extend(order(u32::to_be_bytes(index).to_vec())));
            bytes.push(9);
        }
        bytes
    }

    #[test]
    fn a_text_file_is_read_with_its_texture_coordinates_and_polygons() {
        let mesh = decode_ply(TEXT.as_bytes()).unwrap();
        assert_eq!(mesh.positions[3], DVec3::new(0.0, 1.0, 0.5));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.texture_coordinates[2], DVec2::ONE);
    }

    #[test]
    fn both_byte_orders_hold_the_same_mesh() {
        let big = decode_ply(&binary(true)).unwrap();
        assert_eq!(big.positions[3], DVec3::new(0.0, 1.0, -7.0));
        assert_eq!(big.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert!(big.texture_coordinates.is_empty());
        assert_eq!(decode_ply(&binary(false)).unwrap(), big);
    }

    #[test]
    fn counts_that_the_file_cannot_hold_are_refused_before_reading() {
        for (element, encoding) in [("vertex 4", "ascii"), ("face 1", "ascii"), ("face 1", "binary_little_endian")] {
            let (name, _) = element.split_once(' ').unwrap();
            let text = TEXT.replace(element, &format!("{name} 4000000000")).replace("ascii", encoding);
            let message = decode_ply(text.as_bytes()).unwrap_err().to_string();
            assert!(message.contains("too short to hold"), "{message}");
        }
        let nothing = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nend_header\n";
        assert!(decode_ply(nothing.as_bytes()).unwrap_err().to_string().contains("too short to hold"));
    }

    #[test]
    fn broken_files_are_errors() {
        let cases = [
            (TEXT.replace("ply\n", "plx\n"), "magic number"),
            (TEXT.replace("property float z\n", ""), "without the property \"z\""),
            (TEXT.replace("4 0 1 2 3", "4 0 1 2"), "found only 3"),
            (TEXT.replace("4 0 1 2 3", "4 0 1 2 -3"), "no list of vertices in face 0"),
            (TEXT.replace("vertex_indices", "corners"), "no list of vertices in face 0"),
            (TEXT.replace("list uchar int", "list uchar float"), "unsupported"),
            (TEXT[..TEXT.len() - 20].to_owned(), "not a readable PLY file"),
        ];
        for (text, fragment) in cases {
            let message = decode_ply(text.as_bytes()).unwrap_err().to_string();
            assert!(message.contains(fragment), "no {fragment:?} in: {message}");
        }
    }
}
