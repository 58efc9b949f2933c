//! Cones of directions into which lights emit. The bounds are those of pbrt-v4 (Conty Estevez and Kulla 2018,
//! "Importance Sampling of Many Lights with Adaptive Tree Splitting").

use std::f64::consts::PI;

use glam::DVec3;

/// Axes are taken for opposite within this angle.
const NEARLY_OPPOSITE: f64 = 1e-4;

/// Emission goes to within `emission` of a normal that is within `normals` of the axis. Angles are given by their
/// cosines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionCone {
    /// Unit vector.
    pub axis: DVec3,
    /// Cosine of the largest angle between the axis and a normal.
    pub cos_normals: f64,
    /// Cosine of the largest angle between a normal and light that leaves.
    pub cos_emission: f64,
    /// Whether surfaces emit to both sides: around the axis, and around its opposite.
    pub has_both_sides: bool,
}

impl EmissionCone {
    /// Emission everywhere.
    pub const EVERYWHERE: Self = Self { axis: DVec3::Z, cos_normals: -1.0, cos_emission: 0.0, has_both_sides: false };

    /// Emission to one side of a plane.
    pub fn from_plane(normal: DVec3) -> Self {
        Self { axis: normal, cos_normals: 1.0, cos_emission: 0.0, has_both_sides: false }
    }

    /// Emission to both sides of a plane.
    pub fn from_both_sides(normal: DVec3) -> Self {
        Self { has_both_sides: true, ..Self::from_plane(normal) }
    }

    /// A cone around both.
    pub(super) fn union(self, other: Self) -> Self {
        let cos_emission = self.cos_emission.min(other.cos_emission);
        let angle = |cosine: f64| libm::acos(cosine.clamp(-1.0, 1.0));
        let (wide, narrow) = if self.cos_normals <= other.cos_normals { (self, other) } else { (other, self) };
        let has_both_sides = wide.has_both_sides || narrow.has_both_sides;
        let is_turned = has_both_sides && wide.axis.dot(narrow.axis) < 0.0;
        let narrow = if is_turned { Self { axis: -narrow.axis, ..narrow } } else { narrow };
        let (theta_a, theta_b) = (angle(wide.cos_normals), angle(narrow.cos_normals));
        let between = angle(wide.axis.dot(narrow.axis));
        // Nearly opposite axes have no plane in which to turn that rounding does not decide.
        if between > PI - NEARLY_OPPOSITE {
            return Self { cos_emission, ..Self::EVERYWHERE };
        }
        if (between + theta_b).min(PI) <= theta_a {
            return Self { cos_emission, has_both_sides, ..wide };
        }
        let theta = 0.5 * (theta_a + between + theta_b);
        if theta >= PI {
            return Self { cos_emission, ..Self::EVERYWHERE };
        }
        let Some(across) = wide.axis.cross(narrow.axis).try_normalize().map(|turn| turn.cross(wide.axis)) else {
            return Self { cos_emission, ..Self::EVERYWHERE };
        };
        let turned = theta - theta_a;
        let axis = (wide.axis * libm::cos(turned) + across * libm::sin(turned)).normalize();
        Self { axis, cos_normals: libm::cos(theta), cos_emission, has_both_sides }
    }

    /// The measure of orientation in the cost of a split (equation 1 of the paper).
    pub(super) fn measure(&self) -> f64 {
        let theta_o = libm::acos(self.cos_normals.clamp(-1.0, 1.0));
        let theta_e = libm::acos(self.cos_emission.clamp(-1.0, 1.0));
        let theta_w = (theta_o + theta_e).min(PI);
        let (sin_o, cos_o) = libm::sincos(theta_o);
        2.0 * PI * (1.0 - cos_o)
            + 0.5 * PI * (2.0 * theta_w * sin_o - libm::cos(theta_o - 2.0 * theta_w) - 2.0 * theta_o * sin_o + cos_o)
    }

    /// Upper bound of the cosine between a normal in the cone and the direction to a point, at an angle of `cos_axis`
    /// to the axis, from a region that is seen under `cos_region`. Zero where no light leaves towards the point.
    pub(super) fn largest_cosine(&self, cos_axis: f64, cos_region: f64) -> f64 {
        let cos_axis = if self.has_both_sides { cos_axis.abs() } else { cos_axis };
        let sine = |cosine: f64| (1.0 - cosine * cosine).max(0.0).sqrt();
        // cos(max(0, a - b)), from cosines.
        let cos_difference = |[sin_a, cos_a]: [f64; 2], [sin_b, cos_b]: [f64; 2]| {
            if cos_a > cos_b { 1.0 } else { cos_a * cos_b + sin_a * sin_b }
        };
        let sin_difference = |[sin_a, cos_a]: [f64; 2], [sin_b, cos_b]: [f64; 2]| {
            if cos_a > cos_b { 0.0 } else { sin_a * cos_b - cos_a * sin_b }
        };
        let axis = [sine(cos_axis), cos_axis];
        let normals = [sine(self.cos_normals), self.cos_normals];
        let region = [sine(cos_region), cos_region];
        let off_normals = [sin_difference(axis, normals), cos_difference(axis, normals)];
        let cosine = cos_difference(off_normals, region);
        if cosine <= self.cos_emission { 0.0 } else { cosine }
    }
}
