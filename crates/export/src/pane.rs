//! Panes as triangles: both faces with the normals of their height fields, and the black edge around them.
//!
//! Both faces have the same grid of cells, each cut into two right triangles. Lengths are counted in units of their
//! legs. By Taylor's theorem, a function deviates from its linear interpolation by at most half the norm of its Hessian
//! times a mean. That is the mean of the squared distances to the corners, weighted as in the interpolation, and it is
//! 1/2 at most. Bounds of the Hessians over the whole faces decide on the number of cells.

use clerestory_render_core::geometry::{Face, JetBounds, Pane};
use glam::{DVec2, DVec3};

use crate::error::ExportError;
use crate::ply::{Corner, PlyMesh};

/// Most cells along an edge: faces of 2^23 triangles.
const MOST_CELLS: u32 = 2048;

/// The part of the thickness by which faces may be off.
const LARGEST_TOLERANCE: f64 = 0.05;

/// Growth of a grid that is too coarse.
const GROWTH: f64 = 1.1;

/// How a pane is cut into triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tessellation {
    /// Cells along x and y.
    pub(crate) cells: [u32; 2],
    /// Largest distance of a triangle from its face along the pane's z axis, metres.
    pub(crate) error: f64,
}

impl Tessellation {
    /// The coarsest grid that deviates from a pane by no more than a tolerance, metres.
    pub(crate) fn of(pane: &Pane, tolerance: f64) -> Result<Self, ExportError> {
        let refused = |expected: String| {
            Err(ExportError::Tolerance { pane: pane.name.clone(), found: tolerance.to_string(), expected })
        };
        let largest = pane.thickness * LARGEST_TOLERANCE;
        if !(tolerance > 0.0 && tolerance <= largest) {
            return refused(format!("more than 0 and at most {largest} m, a twentieth of its thickness,"));
        }
        let bounds = [Face::Front, Face::Back].map(|face| *pane.bounds(face));
        let mut cells = [0, 2].map(|axis| {
            let steepest = bounds.iter().map(|bounds| bounds.hessian[axis].magnitude()).fold(0.0, f64::max);
            // A leg of this length alone makes half of the tolerance.
            pane.size()[axis / 2] * (steepest / (2.0 * tolerance)).sqrt()
        });
        loop {
            let whole = cells.map(|cells: f64| cells.ceil().max(1.0));
            let error = bounds.iter().map(|bounds| error(bounds, pane.size() / DVec2::from(whole))).fold(0.0, f64::max);
            if whole.iter().any(|cells| *cells > f64::from(MOST_CELLS)) {
                let [columns, rows] = whole;
                let most = format!("at most {MOST_CELLS} along an edge");
                return refused(format!(
                    "more than that, which takes {columns} x {rows} cells where {most} are written,"
                ));
            }
            if error <= tolerance {
                return Ok(Self { cells: whole.map(|cells| cells as u32), error });
            }
            cells = whole.map(|cells| (cells * GROWTH).max(cells + 1.0));
        }
    }

    /// Both faces of a pane, seen from an origin. Normals point into the air.
    pub(crate) fn faces(&self, pane: &Pane, origin: DVec3) -> PlyMesh {
        let mut mesh = PlyMesh::new(true, false);
        for face in [Face::Front, Face::Back] {
            for row in 0..self.cells[1] {
                for column in 0..self.cells[0] {
                    let [a, b, c, d] =
                        [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[x, y]| self.place(pane, [column + x, row + y]));
                    for triangle in [[a, b, c], [a, c, d]] {
                        let left = pane.outline.clipped(&triangle);
                        let corners: Vec<Corner> =
                            left.iter().map(|place| corner(pane, face, *place, origin)).collect();
                        for pair in corners.get(1..).unwrap_or_default().windows(2) {
                            let [first, second, third] = [corners[0], pair[0], pair[1]];
                            // Counterclockwise from the air.
                            mesh.add(if face == Face::Back { [first, second, third] } else { [first, third, second] });
                        }
                    }
                }
            }
        }
        mesh
    }

    /// The edge of a pane, seen from an origin: the walls between the borders of the faces.
    pub(crate) fn edge(&self, pane: &Pane, origin: DVec3) -> PlyMesh {
        let mut mesh = PlyMesh::new(false, false);
        let corners = pane.outline.corners();
        let cell = pane.size() / DVec2::new(f64::from(self.cells[0]), f64::from(self.cells[1]));
        let border: Vec<DVec2> = corners
            .iter()
            .zip(corners.iter().cycle().skip(1))
            .flat_map(|(from, to)| {
                // As many parts as the side crosses cells, along the axis on which these are more.
                let parts = ((*to - *from).abs() / cell - 1e-9).max_element().ceil().max(1.0);
                (0..parts as u32).map(move |part| from.lerp(*to, f64::from(part) / parts))
            })
            .collect();
        for (place, next) in border.iter().zip(border.iter().cycle().skip(1)) {
            let corner = |face, place: &DVec2| Corner { normal: None, ..corner(pane, face, *place, origin) };
            let (a, b) = (corner(Face::Front, place), corner(Face::Front, next));
            let (c, d) = (corner(Face::Back, next), corner(Face::Back, place));
            mesh.add([a, b, c]);
            mesh.add([a, c, d]);
        }
        mesh
    }

    /// A place of the grid.
    fn place(&self, pane: &Pane, [column, row]: [u32; 2]) -> DVec2 {
        let part = DVec2::new(f64::from(column) / f64::from(self.cells[0]), f64::from(row) / f64::from(self.cells[1]));
        let bounds = pane.outline.bounds();
        bounds.min.lerp(bounds.max, part.x).with_y(bounds.min.lerp(bounds.max, part.y).y)
    }
}

/// A place on a face.
fn corner(pane: &Pane, face: Face, place: DVec2, origin: DVec3) -> Corner {
    let jet = pane.surface(face).jet(place);
    let local = place.extend(pane.base_height(face) + jet.height);
    let upwards = DVec3::new(-jet.gradient.x, -jet.gradient.y, 1.0).normalize();
    let outwards = if face == Face::Back { upwards } else { -upwards };
    Corner {
        position: pane.frame.point_to_world(local) - origin,
        normal: Some(pane.frame.vector_to_world(outwards)),
        texture: None,
    }
}

/// Bound of the deviation of triangles with the given legs.
fn error(bounds: &JetBounds, legs: DVec2) -> f64 {
    let [xx, xy, yy] = bounds.hessian.map(|second| second.magnitude());
    let mixed = legs.x * legs.y * xy;
    // The largest sum of a row is no less than the norm.
    0.25 * (legs.x * legs.x * xx + mixed).max(legs.y * legs.y * yy + mixed)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use clerestory_render_core::geometry::{Frame, HeightField, Outline, PaneParts};

    use super::*;

    /// A pane of irregular relief.
    fn pane(amplitude: f32) -> Pane {
        let size = DVec2::new(0.3, 0.2);
        let field = |shift: usize| {
            let value = |index: usize| amplitude * ((index * 37 + shift) % 23) as f32 / 23.0;
            HeightField::new((0..12 * 9).map(value).collect(), 12, 9, size).unwrap()
        };
        let frame = Frame::new(DVec3::new(2.0, -1.0, 3.0), DVec3::Y, DVec3::Z);
        let (outline, faces) = (Outline::centred(size), [Arc::new(field(0)), Arc::new(field(11))]);
        let (name, thickness, index_of_refraction, absorption) = ("pane".into(), 0.004, 1.5, DVec3::ZERO);
        Pane::new(PaneParts {
            name,
            frame,
            outline,
            thickness,
            index_of_refraction,
            absorption,
            layers: [DVec3::ZERO; 2],
            faces,
        })
        .unwrap()
    }

    #[test]
    fn triangles_keep_the_error_that_is_stated() {
        let pane = pane(5e-4);
        for tolerance in [1e-4, 1e-5, 1e-6] {
            let tessellation = Tessellation::of(&pane, tolerance).unwrap();
            assert!(tessellation.error <= tolerance);
            let [columns, rows] = tessellation.cells;
            let mut largest: f64 = 0.0;
            for face in [Face::Front, Face::Back] {
                for index in 0..20_000_u32 {
                    // Points of the lower right triangle of a cell.
                    let (cell, inner) = (index / 16 % (columns * rows), index % 16);
                    let (u, v) = (f64::from(inner / 4 + 1) / 5.0, f64::from(inner % 4 + 1) / 5.0);
                    let (x, y) = (u.max(v), u.min(v));
                    let height = |[i, j]: [f64; 2]| {
                        let at = [f64::from(cell % columns) + i, f64::from(cell / columns) + j];
                        let part = DVec2::from(at) / DVec2::new(f64::from(columns), f64::from(rows));
                        pane.surface(face).height((part - 0.5) * pane.size())
                    };
                    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]].map(height);
                    let linear = corners[0] * (1.0 - x) + corners[1] * (x - y) + corners[2] * y;
                    largest = largest.max((linear - height([x, y])).abs());
                }
            }
            assert!(largest <= tessellation.error, "{largest} of {}", tessellation.error);
            assert!(largest >= 0.02 * tessellation.error, "the bound is not far off: {largest}");
        }
    }

    #[test]
    fn a_flat_pane_is_a_box() {
        let tessellation = Tessellation::of(&pane(0.0), 1e-6).unwrap();
        assert_eq!(tessellation, Tessellation { cells: [1, 1], error: 0.0 });
        let [faces, edge] = [tessellation.faces(&pane(0.0), DVec3::ZERO), tessellation.edge(&pane(0.0), DVec3::ZERO)];
        assert_eq!((faces.triangles(), edge.triangles()), (4, 8));
    }

    #[test]
    fn a_tolerance_that_a_pane_does_not_allow_is_refused_with_one_that_it_does() {
        let check = |tolerance: f64, said: &str| {
            let error = Tessellation::of(&pane(5e-4), tolerance).unwrap_err().to_string();
            assert!(error.contains("--tolerance") && error.contains("\"pane\"") && error.contains(said), "{error}");
        };
        check(0.0, "more than 0 and at most 0.0002 m");
        check(0.001, "at most 0.0002 m");
        check(f64::NAN, "at most 0.0002 m");
        check(1e-12, "at most 2048 along an edge");
    }
}
