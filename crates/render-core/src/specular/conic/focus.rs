//! Rays to where waves focus the light of a whole light.
//!
//! The light of a point of a light is infinite on the folds of its caustic. Rays through the triangles that may focus a
//! light with an extent find some of its light, and more where the focus is stronger. The balance heuristic (Veach and
//! Guibas 1995) weights paths that both ways find, so no weight is large.

use glam::{DVec2, DVec3};

use super::{ends::Ends, facet::Facet};

/// Triangles behind which light may be this many times as bright as behind a plane get rays.
pub(super) const STRONG: f64 = 16.0;

/// Triangles through which a ray is sent.
#[derive(Debug, Default)]
pub(super) struct Focus {
    /// Their numbers, and solid angles at which the point sees them, summed up to each.
    triangles: Vec<(u32, f64)>,
}

impl Focus {
    /// Adds a triangle if it focuses light of `ends`, a whole light.
    pub(super) fn consider(&mut self, triangle: u32, facet: &Facet, ends: &Ends) {
        if facet.focus(ends) > STRONG {
            self.add(triangle, facet, ends.point);
        }
    }

    fn add(&mut self, triangle: u32, facet: &Facet, point: DVec3) {
        let offset = point - facet.place(DVec2::splat(1.0 / 3.0));
        let solid_angle = facet.area().dot(offset).abs() / offset.length().powi(3);
        let sum = self.triangles.last().map_or(0.0, |(_, sum)| *sum);
        if solid_angle > 0.0 && solid_angle.is_finite() {
            self.triangles.push((triangle, sum + solid_angle));
        }
    }

    /// A triangle, and the weights of a place on it, by three numbers in [0, 1); `None` when there are none.
    pub(super) fn draw(&self, choice: f64, place: DVec2) -> Option<(u32, DVec2)> {
        let (_, all) = self.triangles.last()?;
        let index = self.triangles.partition_point(|(_, sum)| *sum <= choice * all);
        let (triangle, _) = self.triangles.get(index)?;
        let across = place.x.sqrt();
        Some((*triangle, DVec2::new(across * (1.0 - place.y), across * place.y)))
    }

    /// How likely a triangle is drawn.
    pub(super) fn share(&self, triangle: u32) -> f64 {
        // A triangle that may refract light both ways is drawn for either.
        let (mut before, mut own) = (0.0, 0.0);
        for &(other, sum) in &self.triangles {
            if other == triangle {
                own += sum - before;
            }
            before = sum;
        }
        if own > 0.0 { own / before } else { 0.0 }
    }
}

/// Density per solid angle at `point` with which the direction to a place of a triangle is drawn, once that is.
pub(super) fn density(facet: &Facet, point: DVec3, place: DVec3) -> f64 {
    let offset = place - point;
    offset.length().powi(3) / facet.area().dot(offset).abs()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::{Focus, density};
    use crate::specular::{
        conic::facet::Facet,
        testing::{pair, random},
    };

    /// The solid angle of a triangle seen from the origin (Van Oosterom and Strackee 1983).
    fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
        let [x, y, z] = [a, b, c].map(DVec3::length);
        let below = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
        2.0 * libm::atan2(a.dot(b.cross(c)).abs(), below)
    }

    #[test]
    fn directions_are_drawn_with_the_density_that_is_said() {
        let corners = [
            [DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.5, 0.0, 1.1), DVec3::new(0.0, 0.4, 0.9)],
            [DVec3::new(-1.0, 0.0, 1.0), DVec3::new(-0.5, 0.0, 1.5), DVec3::new(-0.8, 0.9, 2.0)],
            [DVec3::new(0.1, -2.0, 1.0), DVec3::new(0.4, -1.0, 1.0), DVec3::new(-0.3, -1.1, 1.4)],
        ];
        let facets = corners.map(|corners| Facet { corners, normals: [DVec3::Z; 3] });
        let mut focus = Focus::default();
        // One refracts light both ways, and is there twice.
        for triangle in [0, 1, 2, 1] {
            focus.add(triangle, &facets[triangle as usize], DVec3::ZERO);
        }
        const DRAWS: u32 = 100_000;
        let mut random = random(9);
        let (mut sums, mut squares) = ([0.0; 3], [0.0; 3]);
        for _ in 0..DRAWS {
            let (triangle, weights) = focus.draw(random.next_f64(), pair(&mut random)).unwrap();
            let facet = &facets[triangle as usize];
            let inverse = 1.0 / (focus.share(triangle) * density(facet, DVec3::ZERO, facet.place(weights)));
            sums[triangle as usize] += inverse;
            squares[triangle as usize] += inverse * inverse;
        }
        // The mean of one over the density is the solid angle, for each triangle.
        for (k, corners) in corners.into_iter().enumerate() {
            let mean = sums[k] / f64::from(DRAWS);
            let error = ((squares[k] / f64::from(DRAWS) - mean * mean) / f64::from(DRAWS)).sqrt();
            let expected = solid_angle(corners);
            assert!((mean - expected).abs() < 5.0 * error && error < 0.02 * expected, "{k}: {mean} {expected} {error}");
        }
    }
}
