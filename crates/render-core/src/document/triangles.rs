//! A mesh in the making: rectangles, boxes and balls.

use std::f64::consts::PI;

use glam::DVec3;

use crate::scene::description::{MeshDescription, MeshSource};
use crate::settings::Triple;

/// Positions and triangles.
#[derive(Default)]
pub(super) struct Triangles {
    positions: Vec<Triple>,
    triangles: Vec<[u32; 3]>,
    /// One for each position, or none at all.
    texture_coordinates: Vec<[f64; 2]>,
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

    /// Adds an ellipsoid with the half axes `radii`, of triangles between `rings` circles of latitude from pole to
    /// pole, with twice as many corners on each.
    pub(super) fn add_ellipsoid(&mut self, centre: Triple, radii: Triple, rings: u32) {
        let first = self.positions.len() as u32;
        let around = 2 * rings;
        let place = |unit: Triple| [0, 1, 2].map(|axis| centre[axis] + radii[axis] * unit[axis]);
        self.positions.extend([place([0.0, 0.0, -1.0]), place([0.0, 0.0, 1.0])]);
        for ring in 0..rings {
            let (sin_latitude, cos_latitude) = libm::sincos(PI * (f64::from(ring + 1) / f64::from(rings + 1) - 0.5));
            for step in 0..around {
                let (sin, cos) = libm::sincos(2.0 * PI * f64::from(step) / f64::from(around));
                self.positions.push(place([cos * cos_latitude, sin * cos_latitude, sin_latitude]));
            }
        }
        let corner = |ring: u32, step: u32| first + 2 + ring * around + step % around;
        for step in 0..around {
            self.triangles.push([first, corner(0, step + 1), corner(0, step)]);
            self.triangles.push([first + 1, corner(rings - 1, step), corner(rings - 1, step + 1)]);
            for ring in 1..rings {
                let [below, above] = [ring - 1, ring];
                self.add_face([
                    corner(below, step),
                    corner(below, step + 1),
                    corner(above, step + 1),
                    corner(above, step),
                ]);
            }
        }
    }

    /// The same with texture coordinates in units of `extent` metres: along y and z on what faces x, along x and z on
    /// what faces y, and along x and y on what faces z.
    pub(super) fn projected(self, extent: f64) -> Self {
        let mut projected = Self::default();
        for corners in self.triangles.iter().map(|triangle| triangle.map(|corner| self.positions[corner as usize])) {
            let [a, b, c] = corners.map(DVec3::from);
            let axes = match (b - a).cross(c - a).abs().max_position() {
                0 => [1, 2],
                1 => [0, 2],
                _ => [0, 1],
            };
            let first = projected.positions.len() as u32;
            projected.positions.extend(corners);
            projected.texture_coordinates.extend(corners.map(|corner| axes.map(|axis| corner[axis] / extent)));
            projected.triangles.push([first, first + 1, first + 2]);
        }
        projected
    }

    /// The mesh.
    pub(super) fn into_mesh(self, name: &str, material: &str) -> MeshDescription {
        MeshDescription {
            name: name.to_owned(),
            material: material.to_owned(),
            matrix: None,
            source: MeshSource::Inline {
                positions: self.positions.into_iter().map(|position| position.map(rounded)).collect(),
                triangles: self.triangles,
                texture_coordinates: self.texture_coordinates.into_iter().map(|pair| pair.map(rounded)).collect(),
                normals: Vec::new(),
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

/// A number rounded to micrometres, so that sums of decimals are written as decimals.
pub(super) fn rounded(number: f64) -> f64 {
    (number * 1e6).round() / 1e6
}
