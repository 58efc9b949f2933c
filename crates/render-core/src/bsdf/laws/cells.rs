//! The directions on one side of a surface, cut into cells that are small where a lobe is narrow, and integrals over
//! them.

use std::f64::consts::PI;

use glam::DVec3;

use crate::geometry::Frame;

/// Cells from the axis to its opposite, and around it.
const RINGS: usize = 12;
const SECTORS: usize = 16;

/// Integrals of cells are refined until they change by less than this, or so often.
const TOLERANCE: f64 = 2e-6;
const MOST_REFINEMENTS: u32 = 9;

/// Places and weights of Gauss's rule of three points on [0, 1].
const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// Cells around the axis of a lobe.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    /// Its z axis is the lobe's.
    frame: Frame,
    /// Half of the rings lie within about this angle of the axis, radians.
    width: f64,
    /// The directions are those that have a positive cosine to this normal.
    side: DVec3,
}

/// A rectangle of the unit square: from the axis to its opposite, and around it.
#[derive(Clone, Copy, Debug)]
struct Patch {
    min: [f64; 2],
    size: [f64; 2],
}

impl Cells {
    pub(super) const COUNT: usize = RINGS * SECTORS;

    pub(super) fn new(axis: DVec3, width: f64, side: DVec3) -> Self {
        Self { frame: Frame::around(axis), width, side }
    }

    /// The cell of a direction; `None` on the other side.
    pub(super) fn cell_of(&self, direction: DVec3) -> Option<usize> {
        if direction.dot(self.side) <= 0.0 {
            return None;
        }
        let local = self.frame.vector_to_local(direction);
        let tangent = (local.x * local.x + local.y * local.y).sqrt() / (1.0 + local.z).max(1e-300);
        let along = tangent / (tangent + 0.5 * self.width);
        let around = libm::atan2(local.y, local.x) / (2.0 * PI);
        let index = |place: f64, count: usize| ((place * count as f64) as usize).min(count - 1);
        Some(index(along, RINGS) * SECTORS + index(around - around.floor(), SECTORS))
    }

    /// The integral over solid angle in each cell.
    pub(super) fn integrals<const N: usize>(&self, function: &impl Fn(DVec3) -> [f64; N]) -> Vec<[f64; N]> {
        let size = [1.0 / RINGS as f64, 1.0 / SECTORS as f64];
        let patches = (0..Self::COUNT)
            .map(|cell| Patch { min: [(cell / SECTORS) as f64 * size[0], (cell % SECTORS) as f64 * size[1]], size });
        patches.map(|patch| self.refined(function, patch, self.rule(function, patch), 0)).collect()
    }

    /// The integral over all cells.
    pub(super) fn integral<const N: usize>(&self, function: &impl Fn(DVec3) -> [f64; N]) -> [f64; N] {
        self.integrals(function).into_iter().fold([0.0; N], plus)
    }

    fn refined<const N: usize>(
        &self,
        function: &impl Fn(DVec3) -> [f64; N],
        patch: Patch,
        coarse: [f64; N],
        refinements: u32,
    ) -> [f64; N] {
        let size = patch.size.map(|size| 0.5 * size);
        let quarters = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[along, around]| {
            let min = [patch.min[0] + along * size[0], patch.min[1] + around * size[1]];
            let quarter = Patch { min, size };
            (quarter, self.rule(function, quarter))
        });
        let fine = quarters.iter().fold([0.0; N], |sum, (_, integral)| plus(sum, *integral));
        let change = (0..N).map(|k| (fine[k] - coarse[k]).abs()).fold(0.0, f64::max);
        if change < TOLERANCE || refinements == MOST_REFINEMENTS {
            return fine;
        }
        let parts = quarters.map(|(quarter, integral)| self.refined(function, quarter, integral, refinements + 1));
        parts.into_iter().fold([0.0; N], plus)
    }

    /// Gauss's rule over a patch.
    fn rule<const N: usize>(&self, function: &impl Fn(DVec3) -> [f64; N], patch: Patch) -> [f64; N] {
        let mut sum = [0.0; N];
        for (along, along_weight) in GAUSS {
            for (around, around_weight) in GAUSS {
                // The stereographic projection from the opposite of the axis, stretched to fill the plane.
                let place = patch.min[0] + along * patch.size[0];
                let half_width = 0.5 * self.width;
                let tangent = half_width * place / (1.0 - place);
                let by_place = half_width / ((1.0 - place) * (1.0 - place));
                let squared = 1.0 + tangent * tangent;
                let turn = 2.0 * PI * (patch.min[1] + around * patch.size[1]);
                let radius = 2.0 * tangent / squared;
                let (sin, cos) = libm::sincos(turn);
                let local = DVec3::new(radius * cos, radius * sin, (1.0 - tangent * tangent) / squared);
                let direction = self.frame.vector_to_world(local);
                if direction.dot(self.side) <= 0.0 {
                    continue;
                }
                let solid_angle = 4.0 * tangent * by_place / (squared * squared) * 2.0 * PI;
                let weight = solid_angle * along_weight * around_weight * patch.size[0] * patch.size[1];
                let values = function(direction);
                for (sum, value) in sum.iter_mut().zip(values) {
                    *sum += weight * value;
                }
            }
        }
        sum
    }
}

fn plus<const N: usize>(one: [f64; N], other: [f64; N]) -> [f64; N] {
    std::array::from_fn(|k| one[k] + other[k])
}

#[test]
fn cells_fill_their_side_and_hold_the_directions_that_are_integrated_over_them() {
    let side = DVec3::new(0.3, -0.2, 0.9).normalize();
    let cells = Cells::new(DVec3::new(0.8, 0.1, 0.4).normalize(), 0.1, side);
    let [area, cosine] = cells.integral(&|direction| [1.0, direction.dot(side)]);
    assert!((area / (2.0 * PI) - 1.0).abs() < 1e-4 && (cosine / PI - 1.0).abs() < 1e-4, "{area}, {cosine}");
    let hits = cells.integrals(&|direction| [1.0, cells.cell_of(direction).unwrap() as f64]);
    for (cell, [area, weighted]) in hits.into_iter().enumerate().filter(|(_, [area, _])| *area > 0.0) {
        assert!((weighted / area - cell as f64).abs() < 1e-6, "{cell}");
    }
}
