//! What specular manifold sampling asks of a vertex, with derivatives (Zeltner et al. 2020, sections 4.1 and 4.2).
//!
//! Both constraints have two components, which vanish where the vertex obeys the law of reflection or Snell's law. Here
//! `wi` and `wo` are the unit directions from the vertex to its neighbours. `eta` is the index of refraction on the
//! side of `wo` over that on the side of `wi`, 1 for a reflection.
//!
//! - **half vector**: the tangential components, in the shading frame, of `(wi + eta wo) / |wi + eta wo|`;
//! - **angle difference**: how far `wo` is from `wi` refracted or reflected. The paper takes differences of spherical
//!   angles, which are singular where `wo` points to a pole. This is the chord between the two directions, across `wo`,
//!   of the same first order. Where `wi` is totally reflected, the two change places.

use glam::{DMat2, DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{bsdf::fresnel::refract, geometry::SurfaceDifferential};

/// How a manifold walk writes Snell's law at a vertex (Zeltner et al. 2020, section 4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ManifoldConstraint {
    /// The outgoing direction is that of the refracted ray.
    #[default]
    AngleDifference,
    /// The half vector is the normal.
    HalfVector,
}

/// What happens at a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Bend {
    /// Light is mirrored.
    Reflection,
    /// Light is refracted.
    Transmission {
        /// Index of refraction on the side of the next vertex over that on the side of the previous one.
        ratio: f64,
    },
}

/// A vertex of a chain with the directions to its neighbours.
pub(super) struct Vertex<'a> {
    /// The surface there.
    pub(super) surface: &'a SurfaceDifferential,
    /// Unit direction to the previous vertex.
    pub(super) to_previous: DVec3,
    /// Unit direction to the next vertex.
    pub(super) to_next: DVec3,
    /// What happens.
    pub(super) bend: Bend,
}

/// The constraint at a vertex, and its first derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Residual {
    /// Both components; dimensionless.
    pub(super) value: DVec2,
    /// Gradients of the components with respect to the direction to the previous vertex.
    pub(super) by_previous: [DVec3; 2],
    /// Gradients of the components with respect to the direction to the next vertex.
    pub(super) by_next: [DVec3; 2],
    /// Derivatives of the components (rows) with respect to the vertex (columns: its coordinates), by the normal alone.
    pub(super) by_normal: DMat2,
}

/// Where the indices of both sides differ by less than this part, light goes straight on, and the half vector is
/// rounding noise: the angle difference is used whatever the constraint.
const UNBENT: f64 = 1e-6;

impl Vertex<'_> {
    /// The constraint; `None` where light is totally reflected both ways.
    pub(super) fn residual(&self, constraint: ManifoldConstraint) -> Option<Residual> {
        match (constraint, self.bend) {
            (ManifoldConstraint::HalfVector, Bend::Reflection) => self.half_vector(1.0),
            (ManifoldConstraint::HalfVector, Bend::Transmission { ratio }) if (ratio - 1.0).abs() > UNBENT => {
                self.half_vector(ratio)
            }
            (ManifoldConstraint::AngleDifference, Bend::Reflection) => Some(self.angle_from_mirrored()),
            (_, Bend::Transmission { ratio }) => self.angle_from_refracted(ratio).or_else(|| {
                let swapped = Vertex { to_previous: self.to_next, to_next: self.to_previous, ..*self };
                let residual = swapped.angle_from_refracted(1.0 / ratio)?;
                Some(Residual { by_previous: residual.by_next, by_next: residual.by_previous, ..residual })
            }),
        }
    }

    fn half_vector(&self, ratio: f64) -> Option<Residual> {
        let sum = self.to_previous + self.to_next * ratio;
        let length = sum.length();
        let half = sum / length;
        let SurfaceDifferential { normal, normal_by, tangents, .. } = *self.surface;
        // The shading frame: the first tangent made perpendicular to the normal, and the direction across both.
        let raw = tangents[0] - normal * normal.dot(tangents[0]);
        let s = raw.normalize();
        let t = normal.cross(s);
        let across = |e: DVec3| (e - half * half.dot(e)) / length;
        let by_sum = [across(s), across(t)];
        let columns = normal_by.map(|turned| {
            let raw_by = -(turned * normal.dot(tangents[0]) + normal * turned.dot(tangents[0]));
            let s_by = (raw_by - s * s.dot(raw_by)) / raw.length();
            let t_by = turned.cross(s) + normal.cross(s_by);
            DVec2::new(s_by.dot(half), t_by.dot(half))
        });
        half.is_finite().then(|| Residual {
            value: DVec2::new(s.dot(half), t.dot(half)),
            by_previous: by_sum,
            by_next: by_sum.map(|gradient| gradient * ratio),
            by_normal: DMat2::from_cols(columns[0], columns[1]),
        })
    }

    fn angle_from_refracted(&self, ratio: f64) -> Option<Residual> {
        let towards = self.to_previous.dot(self.surface.normal).signum();
        let normal = self.surface.normal * towards;
        let refracted = refract(-self.to_previous, normal, 1.0, ratio)?.direction;
        let contraction = 1.0 / ratio;
        let cos_in = self.to_previous.dot(normal);
        let cos_out = -refracted.dot(normal);
        // refracted = -contraction to_previous + along normal
        let along = contraction * cos_in - cos_out;
        let along_by_cos = contraction - contraction * contraction * cos_in / cos_out;
        Some(self.angle_from(refracted, -contraction, along, along_by_cos, towards))
    }

    fn angle_from_mirrored(&self) -> Residual {
        // mirrored = -to_previous + 2 cos normal
        let cosine = self.to_previous.dot(self.surface.normal);
        let mirrored = self.surface.normal * (2.0 * cosine) - self.to_previous;
        self.angle_from(mirrored, -1.0, 2.0 * cosine, 2.0, 1.0)
    }

    /// The chord to `target = scale to_previous + along normal`, where `along` varies with the cosine of `to_previous`
    /// by `along_by_cos`, and the normal is the surface's times `towards`.
    fn angle_from(&self, target: DVec3, scale: f64, along: f64, along_by_cos: f64, towards: f64) -> Residual {
        let normal = self.surface.normal * towards;
        let apart = target - self.to_next;
        // How these turn with `to_next` matters in second order only.
        let (first, second) = self.to_next.any_orthonormal_pair();
        let axes = [first, second];
        let columns = self.surface.normal_by.map(|turned| {
            let turned = turned * towards;
            let by =
                |axis: DVec3| along_by_cos * self.to_previous.dot(turned) * axis.dot(normal) + along * axis.dot(turned);
            DVec2::new(by(first), by(second))
        });
        Residual {
            value: DVec2::new(first.dot(apart), second.dot(apart)),
            by_previous: axes.map(|axis| normal * (along_by_cos * axis.dot(normal)) + axis * scale),
            by_next: axes.map(|axis| -axis),
            by_normal: DMat2::from_cols(columns[0], columns[1]),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::{
        geometry::{Frame, SurfaceJet},
        specular::testing::{between, pair, random},
    };

    const CONSTRAINTS: [ManifoldConstraint; 2] = [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector];

    /// A curved surface around (x, y), with terms of third order.
    fn surface(frame: &Frame, [x, y]: [f64; 2]) -> SurfaceDifferential {
        let jet = SurfaceJet {
            height: 0.3 * x * x - 0.2 * x * y + 0.1 * y * y * y,
            gradient: DVec2::new(0.6 * x - 0.2 * y, -0.2 * x + 0.3 * y * y),
            hessian: [0.6, -0.2, 0.6 * y],
        };
        SurfaceDifferential::of_face(frame, frame.point_to_world(dvec3(x, y, jet.height)), &jet)
    }

    /// Where the next vertex has to be for the vertex to obey its law.
    fn obedient(surface: &SurfaceDifferential, previous: DVec3, bend: Bend) -> Option<DVec3> {
        let incident = (surface.position - previous).normalize();
        match bend {
            Bend::Reflection => Some(crate::bsdf::fresnel::reflect(incident, surface.normal)),
            Bend::Transmission { ratio } => {
                refract(incident, surface.normal, 1.0, ratio).map(|refraction| refraction.direction)
            }
        }
    }

    fn at(
        surface: &SurfaceDifferential,
        previous: DVec3,
        next: DVec3,
        bend: Bend,
        constraint: ManifoldConstraint,
    ) -> Residual {
        let to_previous = (previous - surface.position).normalize();
        let to_next = (next - surface.position).normalize();
        Vertex { surface, to_previous, to_next, bend }.residual(constraint).unwrap()
    }

    #[test]
    fn residuals_vanish_where_the_vertex_obeys_its_law_and_change_as_their_derivatives_say() {
        let frame = Frame::new(dvec3(0.3, -0.2, 0.5), dvec3(0.6, 0.8, 0.0), dvec3(-0.8, 0.6, 0.0));
        let mut random = random(31);
        let mut checked = 0;
        let refraction = [1.5, 1.0 / 1.33, 1.0].map(|ratio| Bend::Transmission { ratio });
        for bend in [Bend::Reflection].into_iter().chain(refraction) {
            for case in 0..50 {
                let side = if case % 2 == 0 { 1.0 } else { -1.0 };
                let place = ((pair(&mut random) - 0.5) * 0.6).to_array();
                let previous =
                    frame.point_to_world((pair(&mut random) - 0.5).extend(side * between(&mut random, 0.8, 2.0)));
                let here = surface(&frame, place);
                let Some(next_direction) = obedient(&here, previous, bend) else { continue };
                let next = here.position + next_direction * between(&mut random, 0.5, 2.0);
                for constraint in CONSTRAINTS {
                    checked += 1;
                    let residual = at(&here, previous, next, bend, constraint);
                    assert!(residual.value.length() < 1e-14, "{bend:?} {constraint:?}: {}", residual.value);
                    let step = 1e-6;
                    // Each neighbour moves.
                    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                        let turned = |end: DVec3| {
                            let offset = end - here.position;
                            let direction = offset.normalize();
                            (axis - direction * direction.dot(axis)) / offset.length()
                        };
                        let by = |gradients: &[DVec3; 2], turned: DVec3| {
                            DVec2::new(gradients[0].dot(turned), gradients[1].dot(turned))
                        };
                        let move_previous = (at(&here, previous + axis * step, next, bend, constraint).value
                            - at(&here, previous - axis * step, next, bend, constraint).value)
                            / (2.0 * step);
                        let expected = by(&residual.by_previous, turned(previous));
                        assert!((move_previous - expected).length() < 1e-8, "{bend:?} {constraint:?}: previous");
                        let move_next = (at(&here, previous, next + axis * step, bend, constraint).value
                            - at(&here, previous, next - axis * step, bend, constraint).value)
                            / (2.0 * step);
                        let expected = by(&residual.by_next, turned(next));
                        assert!((move_next - expected).length() < 1e-8, "{bend:?} {constraint:?}: next");
                    }
                    // The vertex moves along its surface, and its neighbours with it: only the normal turns.
                    for (index, moved) in [[step, 0.0], [0.0, step]].into_iter().enumerate() {
                        let beside = |sign: f64| {
                            let there = surface(&frame, [place[0] + sign * moved[0], place[1] + sign * moved[1]]);
                            let shift = there.position - here.position;
                            at(&there, previous + shift, next + shift, bend, constraint).value
                        };
                        let difference = (beside(1.0) - beside(-1.0)) / (2.0 * step);
                        let expected = residual.by_normal.col(index);
                        assert!(
                            (difference - expected).length() < 1e-8,
                            "{bend:?} {constraint:?}: {difference} {expected}"
                        );
                    }
                }
            }
        }
        assert!(checked > 200, "{checked} problems only");
    }
}
