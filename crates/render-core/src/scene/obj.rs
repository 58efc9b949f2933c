//! Triangle meshes from Wavefront OBJ files. Groups become one mesh, polygons become fans of triangles; materials,
//! lines and points are left out.

use glam::{DVec2, DVec3};

use super::error::AssetProblem;
use super::mesh::TriangleMesh;

/// Decodes an OBJ file.
pub(super) fn decode_obj(mut bytes: &[u8]) -> Result<TriangleMesh, AssetProblem> {
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    let without_materials = |_: &std::path::Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut bytes, &options, without_materials)
        .map_err(|error| AssetProblem::malformed(format_args!("is not a readable OBJ file: {error}")))?;

    let mut mesh = TriangleMesh::default();
    let mut all_have_texture_coordinates = true;
    let mut all_have_normals = true;
    for part in models.iter().map(|model| &model.mesh) {
        let first = mesh.positions.len();
        let (positions, _) = part.positions.as_chunks::<3>();
        let (texture_coordinates, _) = part.texcoords.as_chunks::<2>();
        let (normals, _) = part.normals.as_chunks::<3>();
        let (triangles, _) = part.indices.as_chunks::<3>();
        let vertex = |index: u32| u32::try_from(first + index as usize);
        for triangle in triangles {
            let [a, b, c] = triangle.map(vertex);
            let (Ok(a), Ok(b), Ok(c)) = (a, b, c) else {
                return Err(AssetProblem::malformed("has more vertices than 32 bits can number"));
            };
            mesh.triangles.push([a, b, c]);
        }
        mesh.positions.extend(positions.iter().map(|position| DVec3::from(position.map(f64::from))));
        mesh.texture_coordinates.extend(texture_coordinates.iter().map(|pair| DVec2::from(pair.map(f64::from))));
        mesh.normals.extend(normals.iter().map(|normal| DVec3::from(normal.map(f64::from))));
        all_have_texture_coordinates &= texture_coordinates.len() == positions.len();
        all_have_normals &= normals.len() == positions.len();
    }
    if !all_have_normals {
        mesh.normals.clear();
    }
    if !all_have_texture_coordinates {
        mesh.texture_coordinates.clear();
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_become_fans_and_groups_one_mesh() {
        let text = "mtllib wood.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0.5 1.5 0\nv 0 1 0\ng frame\nusemtl wood\nf 1 2 3 4 5\n\
                    g bar\nusemtl lead\nf -5 -4 -3\n";
        let mesh = decode_obj(text.as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [5, 6, 7]]);
        assert_eq!(mesh.positions[3], DVec3::new(0.5, 1.5, 0.0));
        assert_eq!(mesh.positions[5..8], mesh.positions[0..3]);
        assert!(mesh.texture_coordinates.is_empty());
    }

    #[test]
    fn texture_coordinates_follow_their_vertices() {
        let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0.25 0.5\nvt 1 0\nvt 0 1\nf 1/2 2/1 3/3\n";
        let mesh = decode_obj(text.as_bytes()).unwrap();
        assert_eq!(mesh.texture_coordinates, [DVec2::new(1.0, 0.0), DVec2::new(0.25, 0.5), DVec2::new(0.0, 1.0)]);
    }

    #[test]
    fn broken_files_are_errors() {
        for text in ["v 0 0\n", "v 0 0 0\nf 1 2 3\n", "v 0 0 0\nf 1 1 99999999999999999999\n", "f\n"] {
            let message = decode_obj(text.as_bytes()).unwrap_err().to_string();
            assert!(message.contains("is not a readable OBJ file"), "{message}");
        }
        assert!(decode_obj(b"\xff\xfe").is_err());
    }
}
