//! A mesh in the making: rectangles and boxes.

use super::rounded;
use crate::scene::description::{MeshDescription, MeshSource, Triple};

/// Positions and triangles.
#[derive(Default)]
pub(super) struct Triangles {
    positions: Vec<Triple>,
    triangles: Vec<[u32; 3]>,
}

/// The corners of a box in the order of their bits: x changes fastest.
const BOX_FACES: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

impl Triangles {
    /// Adds a quadrilateral, whose corners are given in order around it.
    pub(super) fn add_quadrilateral(&mut self, corners: [Triple; 4]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.add_face([0, 1, 2, 3].map(|corner| first + corner));
    }

    /// Adds a closed box between two opposite corners.
    pub(super) fn add_box(&mut self, from: Triple, to: Triple) {
        let corner = |index: usize| [0, 1, 2].map(|axis| if index >> axis & 1 == 0 { from[axis] } else { to[axis] });
        let first = self.positions.len() as u32;
        self.positions.extend((0..8).map(corner));
        BOX_FACES.iter().for_each(|face| self.add_face(face.map(|corner| first + corner)));
    }

    /// Adds the plane at `x` between the outermost lines of a grid along y and z, without the cells that are `open`, of
    /// which this gets the column and the row.
    pub(super) fn add_pierced_plane(&mut self, x: f64, [y, z]: [&[f64]; 2], open: impl Fn(usize, usize) -> bool) {
        let first = self.positions.len() as u32;
        for &z in z {
            self.positions.extend(y.iter().map(|&y| [x, y, z]));
        }
        let across = y.len() as u32;
        for row in 0..z.len() - 1 {
            for column in (0..y.len() - 1).filter(|&column| !open(column, row)) {
                let corner = first + row as u32 * across + column as u32;
                self.add_face([corner, corner + 1, corner + 1 + across, corner + across]);
            }
        }
    }

    /// The mesh.
    pub(super) fn into_mesh(self, name: &str, material: &str) -> MeshDescription {
        MeshDescription {
            name: name.to_owned(),
            material: material.to_owned(),
            source: MeshSource::Inline {
                positions: self.positions.into_iter().map(|position| position.map(rounded)).collect(),
                triangles: self.triangles,
                texture_coordinates: Vec::new(),
            },
            scale: 1.0,
            rotate: [0.0; 3],
            translate: [0.0; 3],
        }
    }

    fn add_face(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }
}
