//! A density of directions that is constant in each cell of a grid of longitudes and latitudes.
//!
//! A cell is chosen by its row and then by its column, each from a cumulative sum. So evenly spread numbers give evenly
//! spread directions. Within the cell directions are uniform in solid angle.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

/// The largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// A density over the sphere. Rows run from +z to -z, columns from -x by +y, +x and -y back to -x.
#[derive(Clone, Debug)]
pub(super) struct SphereDensity {
    columns: usize,
    /// Cosines of the latitudes between rows, from 1 to -1.
    edges: Vec<f64>,
    /// Cumulative probability of the rows, and of the columns of each.
    marginal: Vec<f64>,
    conditional: Vec<f64>,
}

impl SphereDensity {
    /// The density that is proportional to `weights` in the cells of a grid; uniform where all are zero.
    pub(super) fn new([columns, rows]: [usize; 2], weights: &[f64]) -> Self {
        let edges = row_edges(rows);
        let mut conditional = Vec::with_capacity(weights.len());
        let mut marginal = Vec::with_capacity(rows);
        let mut total = 0.0;
        for (row, weights) in weights.chunks_exact(columns).enumerate() {
            total += accumulate(weights, &mut conditional) * (edges[row] - edges[row + 1]);
            marginal.push(total);
        }
        if total > 0.0 {
            normalise(&mut marginal);
        } else {
            marginal = edges[1..].iter().map(|edge| 0.5 * (1.0 - edge)).collect();
        }
        Self { columns, edges, marginal, conditional }
    }

    /// Draws a direction.
    pub(super) fn sample(&self, random: DVec2) -> DVec3 {
        let (row, down) = choose(&self.marginal, random.y);
        let (column, across) = choose(self.columns_of(row), random.x);
        let height = self.edges[row] + (self.edges[row + 1] - self.edges[row]) * down;
        let longitude = longitude_of((column as f64 + across) / self.columns as f64);
        let (sin, cos) = libm::sincos(longitude);
        let radius = ((1.0 - height) * (1.0 + height)).max(0.0).sqrt();
        DVec3::new(radius * cos, radius * sin, height)
    }

    /// The density, per solid angle, at a place of the unit square.
    pub(super) fn at(&self, place: DVec2) -> f64 {
        let row = cell(place.y, self.marginal.len());
        let column = cell(place.x, self.columns);
        let probability = share(&self.marginal, row) * share(self.columns_of(row), column);
        let solid_angle = (self.edges[row] - self.edges[row + 1]) * 2.0 * PI / self.columns as f64;
        probability / solid_angle
    }

    fn columns_of(&self, row: usize) -> &[f64] {
        &self.conditional[row * self.columns..(row + 1) * self.columns]
    }
}

/// Cosines of the latitudes between rows of equal angle, from 1 to -1.
pub(super) fn row_edges(rows: usize) -> Vec<f64> {
    (0..=rows).map(|row| libm::cos(PI * row as f64 / rows as f64)).collect()
}

/// The place of a unit vector in the unit square: x by longitude, from -x by +y, +x and -y back to -x; y by latitude,
/// from +z to -z.
pub(super) fn place_of(direction: DVec3) -> DVec2 {
    let across = 0.5 - libm::atan2(direction.y, direction.x) / (2.0 * PI);
    let down = libm::atan2(direction.truncate().length(), direction.z) / PI;
    DVec2::new(across, down)
}

/// The unit vector of a place in the unit square.
pub(super) fn direction_of(place: DVec2) -> DVec3 {
    let (sin, cos) = libm::sincos(longitude_of(place.x));
    let (radius, height) = libm::sincos(PI * place.y);
    DVec3::new(radius * cos, radius * sin, height)
}

fn longitude_of(across: f64) -> f64 {
    2.0 * PI * (0.5 - across)
}

/// The cell in which a number from 0 to 1 lies.
fn cell(place: f64, count: usize) -> usize {
    ((place * count as f64) as usize).min(count - 1)
}

/// Appends cumulative parts of the sum of `weights`, which it returns. Where all are zero, the parts are equal.
fn accumulate(weights: &[f64], sums: &mut Vec<f64>) -> f64 {
    let (start, mut sum) = (sums.len(), 0.0);
    for weight in weights {
        sum += weight;
        sums.push(sum);
    }
    if sum > 0.0 {
        normalise(&mut sums[start..]);
    } else {
        for (number, part) in (1..).zip(&mut sums[start..]) {
            *part = f64::from(number) / weights.len() as f64;
        }
    }
    sum / weights.len() as f64
}

fn normalise(sums: &mut [f64]) {
    let Some(&total) = sums.last() else { return };
    sums.iter_mut().for_each(|sum| *sum /= total);
}

/// The probability of one of several things.
fn share(cumulative: &[f64], index: usize) -> f64 {
    cumulative[index] - if index > 0 { cumulative[index - 1] } else { 0.0 }
}

/// Chooses one of several things by a random number, and returns what is left of the number.
fn choose(cumulative: &[f64], random: f64) -> (usize, f64) {
    let index = cumulative.partition_point(|sum| *sum <= random).min(cumulative.len() - 1);
    let before = if index > 0 { cumulative[index - 1] } else { 0.0 };
    (index, ((random - before) / share(cumulative, index)).clamp(0.0, BELOW_ONE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_directions_belong_together() {
        for (direction, place) in [
            (DVec3::X, [0.5, 0.5]),
            (DVec3::Y, [0.25, 0.5]),
            (DVec3::NEG_Y, [0.75, 0.5]),
            (DVec3::new(0.0, 0.6, 0.8), [0.25, libm::acos(0.8) / PI]),
        ] {
            assert!((place_of(direction) - DVec2::from(place)).length() < 1e-15, "{direction}");
        }
        assert_eq!(place_of(DVec3::Z).y, 0.0);
        assert_eq!(place_of(DVec3::NEG_Z).y, 1.0);
        // A single cell draws that cell alone.
        let mut weights = vec![0.0; 8];
        weights[5] = 3.0;
        let density = SphereDensity::new([4, 2], &weights);
        for random in [[0.0, 0.0], [0.3, 0.9], [BELOW_ONE; 2]] {
            let place = place_of(density.sample(random.into()));
            assert!((0.25..=0.5).contains(&place.x) && (0.5..=1.0).contains(&place.y), "{place}");
        }
        assert!((density.at(DVec2::new(0.3, 0.7)) - 2.0 / PI).abs() < 1e-12);
        assert_eq!(density.at(DVec2::new(0.3, 0.3)), 0.0);
    }

    #[test]
    fn where_nothing_has_a_weight_all_directions_are_alike() {
        let density = SphereDensity::new([4, 3], &[0.0; 12]);
        for place in [[0.1, 0.05], [0.9, 0.5], [0.5, 0.99]] {
            assert!((density.at(place.into()) * 4.0 * PI - 1.0).abs() < 1e-12, "{place:?}");
        }
    }
}
