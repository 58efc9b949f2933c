//! What specular manifold sampling asks of a vertex, with derivatives (Zeltner et al. 2020, sections 4.1 and 4.2).
//!
//! Both constraints have two components, which vanish where the vertex obeys Snell's law. With `wi` and `wo` the unit
//! directions from the vertex to its neighbours, and `eta` the index of refraction on the side of `wo` over that on the
//! side of `wi`:
//!
//! - **half vector**: the tangential components, in the shading frame, of `(wi + eta wo) / |wi + eta wo|`;
//! - **angle difference**: how far `wo` is from `wi` refracted. The paper takes differences of spherical angles, which are
//!   singular where `wo` points to a pole; this is the chord between the two directions, across `wo`, of the same first
//!   order. Where `wi` is totally reflected, the two change places.

use glam::{DMat2, DVec2, DVec3};

use crate::{geometry::SurfaceJet, optics::dielectric::refract, scene::description::ManifoldConstraint};

/// A vertex of a chain, in the frame of its height field.
pub(super) struct Vertex<'a> {
    /// The surface there.
    pub(super) jet: &'a SurfaceJet,
    /// Unit direction to the previous vertex.
    pub(super) to_previous: DVec3,
    /// Unit direction to the next vertex.
    pub(super) to_next: DVec3,
    /// Index of refraction on the side of the next vertex over that on the side of the previous one.
    pub(super) ratio: f64,
}

/// The constraint at a vertex, and its first derivatives.
pub(super) struct Residual {
    /// Both components; dimensionless.
    pub(super) value: DVec2,
    /// Gradients of the components with respect to the direction to the previous vertex.
    pub(super) by_previous: [DVec3; 2],
    /// Gradients of the components with respect to the direction to the next vertex.
    pub(super) by_next: [DVec3; 2],
    /// Derivatives of the components (rows) with respect to the vertex (columns: x, y), by the normal alone.
    pub(super) by_normal: DMat2,
}

impl Vertex<'_> {
    /// The constraint; `None` where light is totally reflected both ways.
    pub(super) fn residual(&self, constraint: ManifoldConstraint) -> Option<Residual> {
        match constraint {
            ManifoldConstraint::HalfVector => self.half_vector(),
            ManifoldConstraint::AngleDifference => self.angle_difference().or_else(|| {
                let Self { jet, to_previous, to_next, ratio } = *self;
                let swapped = Vertex { jet, to_previous: to_next, to_next: to_previous, ratio: 1.0 / ratio };
                let residual = swapped.angle_difference()?;
                Some(Residual { by_previous: residual.by_next, by_next: residual.by_previous, ..residual })
            }),
        }
    }

    fn half_vector(&self) -> Option<Residual> {
        let sum = self.to_previous + self.to_next * self.ratio;
        let length = sum.length();
        let half = sum / length;
        let (normal, normal_by) = unit_normal(self.jet);
        let tangent = DVec3::new(1.0, 0.0, self.jet.gradient.x);
        let s = tangent.normalize();
        let t = normal.cross(s);
        let across = |e: DVec3| (e - half * half.dot(e)) / length;
        let by_sum = [across(s), across(t)];
        let columns = [0, 1].map(|axis| {
            let bent = DVec3::new(0.0, 0.0, self.jet.hessian[axis]);
            let s_by = (bent - s * s.dot(bent)) / tangent.length();
            let t_by = normal_by[axis].cross(s) + normal.cross(s_by);
            DVec2::new(s_by.dot(half), t_by.dot(half))
        });
        half.is_finite().then(|| Residual {
            value: DVec2::new(s.dot(half), t.dot(half)),
            by_previous: by_sum,
            by_next: by_sum.map(|gradient| gradient * self.ratio),
            by_normal: DMat2::from_cols(columns[0], columns[1]),
        })
    }

    fn angle_difference(&self) -> Option<Residual> {
        let (normal, normal_by) = unit_normal(self.jet);
        let towards = self.to_previous.dot(normal).signum();
        let (normal, normal_by) = (normal * towards, normal_by.map(|by| by * towards));
        let refracted = refract(-self.to_previous, normal, 1.0, self.ratio)?.direction;
        let contraction = 1.0 / self.ratio;
        let cos_in = self.to_previous.dot(normal);
        let cos_out = -refracted.dot(normal);
        // refracted = -contraction to_previous + along normal
        let along = contraction * cos_in - cos_out;
        let along_by_cos = contraction - contraction * contraction * cos_in / cos_out;
        let apart = refracted - self.to_next;
        // How these turn with `to_next` matters in second order only.
        let (first, second) = self.to_next.any_orthonormal_pair();
        let axes = [first, second];
        let rows = axes.map(|axis| {
            let by = |axis_of: usize| {
                let turned = normal_by[axis_of];
                along_by_cos * self.to_previous.dot(turned) * axis.dot(normal) + along * axis.dot(turned)
            };
            DVec2::new(by(0), by(1))
        });
        Some(Residual {
            value: DVec2::new(first.dot(apart), second.dot(apart)),
            by_previous: axes.map(|axis| normal * (along_by_cos * axis.dot(normal)) - axis * contraction),
            by_next: axes.map(|axis| -axis),
            by_normal: DMat2::from_cols(rows[0], rows[1]).transpose(),
        })
    }
}

/// The unit normal towards +z, and its derivatives by x and y.
fn unit_normal(jet: &SurfaceJet) -> (DVec3, [DVec3; 2]) {
    let raw = DVec3::new(-jet.gradient.x, -jet.gradient.y, 1.0);
    let normal = raw.normalize();
    let [xx, xy, yy] = jet.hessian;
    let by =
        [DVec3::new(-xx, -xy, 0.0), DVec3::new(-xy, -yy, 0.0)].map(|by| (by - normal * normal.dot(by)) / raw.length());
    (normal, by)
}
