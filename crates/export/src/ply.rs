//! Triangle meshes as binary PLY files of 32-bit floats.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

/// What a corner of a triangle has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    pub(crate) position: DVec3,
    /// Unit vector.
    pub(crate) normal: Option<DVec3>,
    /// From the bottom left corner of the picture.
    pub(crate) texture: Option<DVec2>,
}

/// A mesh that is being written. Corners that are alike share a vertex.
#[derive(Debug, Default)]
pub(crate) struct PlyMesh {
    has_normals: bool,
    has_texture: bool,
    /// The numbers of the vertices by the bits of all that they have.
    known: BTreeMap<[u32; 8], u32>,
    vertices: Vec<u8>,
    triangles: Vec<u8>,
    omitted: u64,
}

/// Bytes of a triangle.
const TRIANGLE_BYTES: usize = 13;

impl PlyMesh {
    /// A mesh without triangles, whose corners will have these.
    pub(crate) fn new(has_normals: bool, has_texture: bool) -> Self {
        Self { has_normals, has_texture, ..Self::default() }
    }

    /// Adds a triangle, unless single precision leaves it no area.
    pub(crate) fn add(&mut self, corners: [Corner; 3]) {
        let vertices = corners.map(|corner| self.vertex(&corner));
        let [a, b, c] = vertices;
        if a == b || b == c || c == a {
            self.omitted += 1;
            return;
        }
        self.triangles.push(3);
        self.triangles.extend(vertices.into_iter().flat_map(u32::to_le_bytes));
    }

    /// The number of a vertex.
    fn vertex(&mut self, corner: &Corner) -> u32 {
        // Negative zero is another number than zero by its bits.
        let single = |value: f64| value as f32 + 0.0;
        let [x, y, z] = corner.position.to_array().map(single);
        let [nx, ny, nz] = corner.normal.unwrap_or_default().to_array().map(single);
        // Others count v from the top of the picture.
        let [u, v] = corner.texture.map_or([0.0; 2], |at| [single(at.x), single(1.0 - at.y)]);
        let values = [x, y, z, nx, ny, nz, u, v];
        let next = self.known.len() as u32;
        let number = *self.known.entry(values.map(f32::to_bits)).or_insert(next);
        if number == next {
            let written = [(true, 0..3), (self.has_normals, 3..6), (self.has_texture, 6..8)];
            for (_, range) in written.into_iter().filter(|(is_written, _)| *is_written) {
                self.vertices.extend(values[range].iter().flat_map(|value| value.to_le_bytes()));
            }
        }
        number
    }

    /// Triangles in the file.
    pub(crate) fn triangles(&self) -> u64 {
        (self.triangles.len() / TRIANGLE_BYTES) as u64
    }

    /// Triangles that single precision leaves no area.
    pub(crate) fn omitted(&self) -> u64 {
        self.omitted
    }

    /// The file.
    pub(crate) fn encode(&self) -> Vec<u8> {
        let names = [(true, "x y z"), (self.has_normals, "nx ny nz"), (self.has_texture, "u v")];
        let names = names.into_iter().filter(|(is_written, _)| *is_written).flat_map(|(_, names)| names.split(' '));
        let properties: String = names.map(|name| format!("property float {name}\n")).collect();
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}element face {}\n\
             property list uchar int vertex_indices\nend_header\n",
            self.known.len(),
            self.triangles()
        );
        [header.as_bytes(), &self.vertices, &self.triangles].concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner(x: f64, y: f64) -> Corner {
        Corner { position: DVec3::new(x, y, 0.0), normal: Some(DVec3::Z), texture: Some(DVec2::new(x, y)) }
    }

    #[test]
    fn corners_that_are_alike_share_a_vertex_and_v_is_counted_from_the_top() {
        let mut mesh = PlyMesh::new(false, true);
        mesh.add([corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 0.25)]);
        mesh.add([corner(0.0, 0.0), corner(1.0, 0.25), corner(-0.0, 1.0)]);
        // Apart in double precision only.
        mesh.add([corner(0.0, 0.0), corner(1.0, 0.25), corner(1.0, 0.25 + 1e-12)]);
        assert_eq!((mesh.triangles(), mesh.omitted()), (2, 1));
        let file = mesh.encode();
        let end = b"end_header\n";
        let body = file.windows(end.len()).position(|window| window == end).unwrap() + end.len();
        let header = String::from_utf8(file[..body].to_vec()).unwrap();
        assert!(header.contains("element vertex 4\n") && header.contains("element face 2\n"), "{header}");
        assert!(header.contains("float u\n") && !header.contains("nx"), "{header}");
        assert_eq!(file.len() - body, 4 * 5 * 4 + 2 * TRIANGLE_BYTES);
        let third: Vec<f32> =
            file[body + 40..body + 60].chunks(4).map(|value| f32::from_le_bytes(value.try_into().unwrap())).collect();
        assert_eq!(third, [1.0, 0.25, 0.0, 1.0, 0.75]);
    }
}
