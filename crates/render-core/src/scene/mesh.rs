//! Triangle meshes as they come out of a scene file, a PLY file or an OBJ file.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::{DMat3, DVec2, DVec3, DVec4};

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
    /// Directions in which the first texture coordinate grows, of any length, and the sign of the bitangent; empty when
    /// there are none.
    pub(super) tangents: Vec<DVec4>,
    /// Colours by which a material may be multiplied, linear, one for each vertex; empty when there are none.
    pub(super) colours: Vec<[f32; 4]>,
}

impl TriangleMesh {
    /// The mesh without folds: pairs of triangles with the same corners that face opposite ways. Between them is
    /// nothing. A mesh that is all folds stays as it is.
    pub(super) fn without_folds(&self) -> Cow<'_, Self> {
        let corner = |vertex: u32| {
            let position = self.positions.get(vertex as usize).copied().unwrap_or_default();
            position.to_array().map(|x| (x + 0.0).to_bits())
        };
        // Triangles with the same corners, by whether their order is even.
        let mut alike: BTreeMap<[[u64; 3]; 3], [Vec<usize>; 2]> = BTreeMap::new();
        for (number, triangle) in self.triangles.iter().enumerate() {
            let [mut a, mut b, mut c] = triangle.map(corner);
            let mut is_odd = swap_into_order(&mut a, &mut b);
            is_odd ^= swap_into_order(&mut b, &mut c);
            is_odd ^= swap_into_order(&mut a, &mut b);
            alike.entry([a, b, c]).or_default()[usize::from(is_odd)].push(number);
        }
        let mut is_fold = vec![false; self.triangles.len()];
        for [even, odd] in alike.values() {
            even.iter().zip(odd).flat_map(|(even, odd)| [even, odd]).for_each(|number| is_fold[*number] = true);
        }
        if !is_fold.contains(&true) || !is_fold.contains(&false) {
            return Cow::Borrowed(self);
        }
        let kept = self.triangles.iter().zip(is_fold).filter(|(_, is_fold)| !is_fold);
        Cow::Owned(Self { triangles: kept.map(|(triangle, _)| *triangle).collect(), ..self.clone() })
    }
}

/// Puts two things into order. Returns whether they were not.
fn swap_into_order<T: Ord>(first: &mut T, second: &mut T) -> bool {
    let is_swapped = *first > *second;
    if is_swapped {
        std::mem::swap(first, second);
    }
    is_swapped
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

    /// A tangent of the file in the scene. It is turned as positions are, and a map that mirrors turns the bitangent.
    pub(super) fn turn_tangent(&self, tangent: DVec4) -> DVec4 {
        let along = tangent.truncate();
        let turned = self.rotation * self.matrix.map_or(along, |matrix| matrix.linear * along);
        turned.normalize_or_zero().extend(if self.mirrors() { -tangent.w } else { tangent.w })
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
    fn a_fold_goes_and_what_is_twice_or_all_folds_stays() {
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::X];
        let mesh = |triangles: &[[u32; 3]]| TriangleMesh {
            positions: positions.clone(),
            triangles: triangles.to_vec(),
            ..TriangleMesh::default()
        };
        // Vertex 4 lies where vertex 1 does.
        let folded = mesh(&[[0, 1, 2], [0, 1, 3], [2, 4, 0]]);
        assert_eq!(folded.without_folds().triangles, [[0, 1, 3]]);
        for whole in [mesh(&[[0, 1, 2], [1, 2, 0], [0, 1, 3]]), mesh(&[[0, 1, 2], [0, 2, 1]])] {
            assert_eq!(*whole.without_folds(), whole);
        }
    }

    #[test]
    fn slivers_are_triangles_and_lines_are_not() {
        let line = [DVec3::ZERO, DVec3::new(1.0, 1.0, 1.0), DVec3::new(0.3, 0.3, 0.3)];
        assert!(is_degenerate(line));
        assert!(is_degenerate([DVec3::ZERO; 3]));
        assert!(is_degenerate([DVec3::ZERO, DVec3::X, DVec3::splat(f64::NAN)]));
        assert!(!is_degenerate([DVec3::ZERO, DVec3::X, DVec3::new(0.5, 1e-6, 0.0)]));
    }
}
