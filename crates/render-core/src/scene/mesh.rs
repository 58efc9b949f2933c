//! Triangle meshes as they come out of a scene file, a PLY file or an OBJ file.

use glam::{DMat3, DVec2, DVec3};

use super::description::MeshDescription;
use crate::geometry::rotation::rotation;

/// Triangles with shared vertices, in the coordinates of their file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct TriangleMesh {
    /// Positions of the vertices.
    pub(super) positions: Vec<DVec3>,
    /// Three vertices for each triangle.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Texture coordinates, one for each vertex; empty when there are none.
    pub(super) texture_coordinates: Vec<DVec2>,
    /// A second set of texture coordinates; empty when there is none.
    pub(super) second_texture_coordinates: Vec<DVec2>,
    /// Normals of any length, one for each vertex; empty when there are none.
    pub(super) normals: Vec<DVec3>,
    /// Colours by which a material may be multiplied, linear, one for each vertex; empty when there are none.
    pub(super) colours: Vec<[f32; 4]>,
}

/// Whether three points lie on one line, as far as double precision can tell.
pub(super) fn is_degenerate([a, b, c]: [DVec3; 3]) -> bool {
    let longest_squared = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    let doubled_area = (b - a).cross(c - a).length();
    // Written so that a number that is not finite counts as degenerate.
    !(doubled_area > longest_squared * 1e-12 && doubled_area.is_finite())
}

/// How a mesh is placed in the scene: by its matrix, then scaled, then rotated, then moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    matrix: Option<Matrix>,
    rotation: DMat3,
    scale: f64,
    translate: DVec3,
}

impl Placement {
    /// The placement that a scene file describes.
    pub(super) fn of(mesh: &MeshDescription) -> Self {
        Self {
            matrix: mesh.matrix.map(Matrix::new),
            rotation: rotation(mesh.rotate),
            scale: mesh.scale,
            translate: DVec3::from(mesh.translate),
        }
    }

    /// Where a point of the file lies in the scene.
    pub(super) fn apply(&self, point: DVec3) -> DVec3 {
        let point = self.matrix.map_or(point, |matrix| matrix.linear * point + matrix.translation);
        self.rotation * self.scale * point + self.translate
    }

    /// Where a normal of the file points in the scene.
    pub(super) fn turn(&self, normal: DVec3) -> DVec3 {
        self.rotation * self.matrix.map_or(normal, |matrix| matrix.of_normals * normal)
    }

    /// Whether a triangle whose corners are seen counterclockwise is seen clockwise in the scene.
    pub(super) fn mirrors(&self) -> bool {
        self.matrix.is_some_and(|matrix| matrix.linear.determinant() < 0.0)
    }
}

/// An affine map.
#[derive(Clone, Copy, Debug)]
struct Matrix {
    linear: DMat3,
    translation: DVec3,
    /// What normals are multiplied by: the cofactors, which are the inverse transpose up to a factor, and exist where
    /// there is no inverse. They turn a normal to the other side where the map mirrors.
    of_normals: DMat3,
}

impl Matrix {
    fn new(rows: [[f64; 4]; 3]) -> Self {
        let [x, y, z, translation] = [0, 1, 2, 3].map(|column| DVec3::from(rows.map(|row| row[column])));
        let linear = DMat3::from_cols(x, y, z);
        let sign = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
        Self { linear, translation, of_normals: DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slivers_are_triangles_and_lines_are_not() {
        let line = [DVec3::ZERO, DVec3::new(1.0, 1.0, 1.0), DVec3::new(0.3, 0.3, 0.3)];
        assert!(is_degenerate(line));
        assert!(is_degenerate([DVec3::ZERO; 3]));
        assert!(is_degenerate([DVec3::ZERO, DVec3::X, DVec3::splat(f64::NAN)]));
        assert!(!is_degenerate([DVec3::ZERO, DVec3::X, DVec3::new(0.5, 1e-6, 0.0)]));
    }
}
