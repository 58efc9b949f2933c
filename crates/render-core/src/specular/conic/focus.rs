//! Rays to where waves focus the light of a whole light.
//!
//! The light of a point of a light is infinite on the folds of its caustic. Of a light that has an extent, rays through the
//! triangles that may focus it find some, the more the stronger the focus is: what both ways find is weighted by how likely
//! each is to find it (the balance heuristic, Veach and Guibas 1995), and no weight is large.

use glam::{DVec2, DVec3};

use super::{ends::Ends, facet::Facet};

/// Triangles behind which light may be this many times as bright as behind a plane get rays.
const STRONG: f64 = 16.0;

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
            let offset = ends.point - facet.place(DVec2::splat(1.0 / 3.0));
            let solid_angle = facet.area().dot(offset).abs() / offset.length().powi(3);
            let sum = self.triangles.last().map_or(0.0, |(_, sum)| *sum);
            if solid_angle > 0.0 && solid_angle.is_finite() {
                self.triangles.push((triangle, sum + solid_angle));
            }
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

    /// Density per solid angle at `point` with which the direction to a place of a triangle is drawn; zero where none is.
    pub(super) fn density(&self, triangle: u32, facet: &Facet, point: DVec3, place: DVec3) -> f64 {
        // A triangle that may refract light both ways is drawn for either.
        let (mut before, mut own) = (0.0, 0.0);
        for &(other, sum) in &self.triangles {
            if other == triangle {
                own += sum - before;
            }
            before = sum;
        }
        if own == 0.0 {
            return 0.0;
        }
        let offset = place - point;
        own / before * offset.length().powi(3) / facet.area().dot(offset).abs()
    }
}
