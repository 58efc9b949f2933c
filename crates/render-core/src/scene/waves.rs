//! Meshes of waves: the surface of moving water, or the ripples that it leaves in sand.
//!
//! The surface is a sum of plane waves of equal height in all directions. They move as waves on deep water do: their
//! angular frequency is the root of the acceleration of gravity times their wave number. So the same waves at another
//! time, or cut into other triangles, are the same water.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::description::WaveDescription;
use super::mesh::TriangleMesh;
use super::random::Random;

/// Most cells along an edge.
pub(super) const MAX_CELLS: u32 = 4096;

/// Number of waves: enough for heights that are nearly normally distributed.
const WAVES: usize = 16;

/// Acceleration of gravity, m/s2.
const GRAVITY: f64 = 9.81;

/// A plane wave: `amplitude cos(k . p + phase)`.
struct Wave {
    k: DVec2,
    phase: f64,
}

/// Along a row or a column of corners: sines and cosines of a wave's part that varies there.
type Turns = Vec<(f64, f64)>;

impl WaveDescription {
    /// Number of triangles.
    pub(super) fn triangles(&self) -> usize {
        2 * self.cells[0] as usize * self.cells[1] as usize
    }

    /// The triangles, counterclockwise as seen from above (z), with unit normals, and texture coordinates from 0 to 1
    /// along x and y.
    pub(super) fn mesh(&self) -> TriangleMesh {
        let [columns, rows] = self.cells.map(|cells| cells as usize + 1);
        let unit = |index: usize, count: usize| index as f64 / (count - 1) as f64;
        let [x, y] = [(0, columns), (1, rows)]
            .map(|(axis, count)| (0..count).map(|k| (unit(k, count) - 0.5) * self.size[axis]).collect::<Vec<_>>());
        let amplitude = self.height * (2.0 / WAVES as f64).sqrt();
        let mut heights = vec![0.0; columns * rows];
        let mut slopes = vec![DVec2::ZERO; columns * rows];
        for Wave { k, phase } in self.waves() {
            let turns = |along: &[f64], k: f64, phase: f64| -> Turns {
                along.iter().map(|place| libm::sincos(k * place + phase)).collect()
            };
            let (along_x, along_y) = (turns(&x, k.x, 0.0), turns(&y, k.y, phase));
            for (row, (sine_y, cosine_y)) in along_y.into_iter().enumerate() {
                let corners = row * columns..(row + 1) * columns;
                let row = heights[corners.clone()].iter_mut().zip(&mut slopes[corners]);
                for ((height, slope), (sine_x, cosine_x)) in row.zip(&along_x) {
                    *height += amplitude * (cosine_x * cosine_y - sine_x * sine_y);
                    *slope -= k * (amplitude * (sine_x * cosine_y + cosine_x * sine_y));
                }
            }
        }
        let places = (0..columns * rows).map(|corner| DVec2::new(x[corner % columns], y[corner / columns]));
        let corner = |row: usize, column: usize| (row * columns + column) as u32;
        let triangles = (0..rows - 1).flat_map(|row| {
            (0..columns - 1).flat_map(move |column| {
                let [a, b] = [corner(row, column), corner(row, column + 1)];
                let [c, d] = [corner(row + 1, column + 1), corner(row + 1, column)];
                [[a, b, c], [a, c, d]]
            })
        });
        TriangleMesh {
            positions: places.zip(heights).map(|(place, height)| place.extend(height)).collect(),
            triangles: triangles.collect(),
            texture_coordinates: (0..columns * rows)
                .map(|corner| DVec2::new(unit(corner % columns, columns), unit(corner / columns, rows)))
                .collect(),
            normals: slopes.into_iter().map(|slope| DVec3::new(-slope.x, -slope.y, 1.0).normalize()).collect(),
            ..TriangleMesh::default()
        }
    }

    /// The waves at the described time.
    fn waves(&self) -> impl Iterator<Item = Wave> {
        let mut random = Random::new(self.seed, 0);
        let [shortest, longest] = self.wavelengths;
        let time = self.time;
        (0..WAVES).map(move |_| {
            let (sin, cos) = libm::sincos(random.phase());
            let number = TAU / random.between(shortest, longest);
            let frequency = (GRAVITY * number).sqrt();
            Wave { k: DVec2::new(cos, sin) * number, phase: random.phase() - frequency * time }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POOL: WaveDescription = WaveDescription {
        size: [2.0, 3.0],
        cells: [80, 120],
        wavelengths: [0.3, 0.7],
        height: 0.015,
        seed: 4,
        time: 0.0,
    };

    #[test]
    fn waves_are_as_high_as_asked_for() {
        let wide = WaveDescription { size: [40.0, 40.0], cells: [400, 400], ..POOL };
        let mesh = wide.mesh();
        let squares: f64 = mesh.positions.iter().map(|position| position.z * position.z).sum();
        let height = (squares / mesh.positions.len() as f64).sqrt();
        // Waves whose lengths do not divide the edge leave a few percent.
        assert!((height / 0.015 - 1.0).abs() < 0.03, "{height}");
    }

    #[test]
    fn normals_are_those_of_the_surface() {
        // Between neighbours, at a distance s, differences miss the slope by s^2 k^3 / 6 of the amplitude, here 2
        // percent.
        let mesh = POOL.mesh();
        let columns = 81;
        for corner in [5 * columns + 7, 60 * columns + 40, 100 * columns + 70] {
            let rise = |step: usize| {
                let [before, after] = [corner - step, corner + step].map(|corner| mesh.positions[corner]);
                let run = (after - before).truncate().length();
                (after.z - before.z) / run
            };
            let normal = mesh.normals[corner];
            let slope = -normal.truncate() / normal.z;
            assert!((slope - DVec2::new(rise(1), rise(columns))).length() < 0.02 * (1.0 + slope.length()), "{slope}");
            assert!((normal.length() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_same_water_is_cut_into_few_and_many_triangles() {
        let (coarse, fine) = (POOL.mesh(), WaveDescription { cells: [160, 240], ..POOL }.mesh());
        assert_eq!(coarse.triangles.len(), POOL.triangles());
        for (corner, position) in coarse.positions.iter().enumerate() {
            let (column, row) = (corner % 81, corner / 81);
            let same = fine.positions[2 * row * 161 + 2 * column];
            assert!((*position - same).length() < 1e-12, "{position} {same}");
        }
    }

    #[test]
    fn triangles_are_seen_counterclockwise_from_above_and_cover_the_rectangle() {
        let mesh = POOL.mesh();
        let areas = mesh.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].truncate());
            0.5 * (b - a).perp_dot(c - a)
        });
        let areas: Vec<f64> = areas.collect();
        assert!(areas.iter().all(|area| *area > 0.0));
        assert!((areas.iter().sum::<f64>() - 6.0).abs() < 1e-9);
    }

    #[test]
    fn water_moves_as_waves_on_deep_water_do() {
        // One wavelength alone: after its period everything is as before, and half of it later upside down.
        let one = WaveDescription { wavelengths: [0.5, 0.5], ..POOL };
        let period = TAU / (GRAVITY * TAU / 0.5).sqrt();
        let at = |time: f64| WaveDescription { time, ..one.clone() }.mesh();
        let (start, half, whole) = (at(0.0), at(0.5 * period), at(period));
        for ((start, half), whole) in start.positions.iter().zip(&half.positions).zip(&whole.positions) {
            assert!((start.z + half.z).abs() < 1e-12 && (start.z - whole.z).abs() < 1e-12);
        }
        assert!(at(0.1 * period).positions != start.positions);
    }
}
