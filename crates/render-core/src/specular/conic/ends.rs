//! The two ends of a path over one interface, and what the interface does to light.

use glam::DVec3;

use crate::light::Source;

/// A shading point and a point of a light on the two sides of an interface, or on one side of a mirror.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ends {
    /// The shading point P, metres.
    pub(super) point: DVec3,
    /// The light's point L, metres, or the unit direction to it.
    pub(super) light: DVec3,
    /// One for a light at a point, zero for one at infinity: the vector from a place M to the light is
    /// `light - near M`.
    pub(super) near: f64,
    /// Indices of refraction where the shading point and where the light is; one for a mirror.
    pub(super) indices: [f64; 2],
    /// One where normals point to the shading point's side of the interface, minus one where they point to the other,
    /// zero for a mirror, whose sides are alike.
    pub(super) side: f64,
    /// How far points of the light are from L at the most, metres, or the chord between unit directions.
    pub(super) spread: f64,
}

impl Ends {
    /// The ends of paths that are refracted at the boundary between air, on the side to which normals point, and
    /// something with this index of refraction; `outside` says whether the shading point is in the air.
    pub(super) fn refracted(point: DVec3, source: Source, index: f64, outside: bool) -> Self {
        if outside { Self::new(point, source, [1.0, index], 1.0) } else { Self::new(point, source, [index, 1.0], -1.0) }
    }

    /// The ends of paths by a mirror.
    pub(super) fn mirrored(point: DVec3, source: Source) -> Self {
        Self::new(point, source, [1.0; 2], 0.0)
    }

    fn new(point: DVec3, source: Source, indices: [f64; 2], side: f64) -> Self {
        let (light, near) = match source {
            Source::Point(position) => (position, 1.0),
            Source::Direction(direction) => (direction, 0.0),
        };
        Self { point, light, near, indices, side, spread: 0.0 }
    }

    /// The same for all points of a light as far as `spread` from this one, metres, or the chord between unit
    /// directions.
    pub(super) fn spread(self, spread: f64) -> Self {
        Self { spread, ..self }
    }

    /// Whether the interface is a mirror.
    pub(super) fn is_mirrored(&self) -> bool {
        self.side == 0.0
    }

    /// Whether the shading point may be on the right side of a plane above which it lies so high, give or take `slack`.
    pub(super) fn may_see(&self, point: f64, slack: f64) -> bool {
        self.is_mirrored() || point * self.side > -slack
    }

    /// Whether the ends are on the right sides of a plane, given by how high they lie above it.
    pub(super) fn take_sides(&self, point: f64, light: f64) -> bool {
        if self.is_mirrored() { point * light > 0.0 } else { point * self.side > 0.0 && light * self.side < 0.0 }
    }

    /// The vector from a place to the light, of any length.
    pub(super) fn offset_to_light(&self, place: DVec3) -> DVec3 {
        self.light - place * self.near
    }

    /// The direction of the straight line from the shading point to the light, of any length: with it, the places M
    /// with `n . (across x PM) = 0` are those at which P, L and the normal are coplanar (Granizo-Hidalgo and Holzschuch
    /// 2024, equation 9).
    pub(super) fn across(&self) -> DVec3 {
        self.offset_to_light(self.point)
    }
}
