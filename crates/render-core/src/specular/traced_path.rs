//! Four traced paths: they obey Snell's law at both faces of a pane and need not meet the source.

use super::fermat::{Connection, Theta};
use crate::geometry::FacePoints;
use crate::light::Source;
use crate::math::simd::{Instructions, LANES, Lanes, Lanes2, Lanes3, Mask};
use clerestory_film::counters::Counters;

/// Four traced paths.
#[derive(Clone, Copy, Debug)]
pub(super) struct TracedPaths<S> {
    /// Their vertices.
    vertices: [Lanes2<S>; 2],
    /// Where the lines of their first segments cross the plane of the undisplaced near face.
    pub(super) place: Lanes2<S>,
    /// By how far they miss the source, on the scale of that plane: without relief, moving `place` by as much would
    /// mend it.
    pub(super) miss: Lanes2<S>,
}

/// A traced path has found its second vertex when its way in the glass ends less than this part of the pane's thickness
/// beside it.
const FOUND: f64 = 1e-5;

/// Most rounds until then. Where slopes are so steep that these are too few, Newton's method decides.
const MOST_ROUNDS: usize = 8;

impl<S: Instructions> TracedPaths<S> {
    /// About the vertices of the traced paths that cross the near plane at these places.
    #[inline(always)]
    pub(super) fn moved(&self, place: Lanes2<S>) -> [Theta; LANES] {
        let by = place - self.place;
        let ([a, b, c, d], [e, f, g, h]) = ((self.vertices[0] + by).to_array(), (self.vertices[1] + by).to_array());
        [[a, e], [b, f], [c, g], [d, h]]
    }
}

impl Connection<'_> {
    /// The `live` ones of four paths from the shading point through points of the near face and on by Snell's law, with
    /// points near which they may meet the far face; and which were neither totally reflected nor left away from the
    /// source.
    #[inline(always)]
    pub(super) fn trace_four<S: Instructions>(
        &self,
        near: &FacePoints<S>,
        far: &FacePoints<S>,
        live: Mask<S>,
        counters: &mut Counters,
    ) -> (TracedPaths<S>, Mask<S>) {
        let [near_base, far_base] = self.bases;
        let z = near.height + near_base;
        let first = Lanes3 { x: near.place.x - self.origin.x, y: near.place.y - self.origin.y, z: z - self.origin.z };
        let (inner, entered) = refracted(first.normalised(), near.gradient, 1.0, self.index);
        let tangent = inner.truncated().scaled(inner.z.recip());
        let flat = near.place + tangent.scaled(-z + far_base);
        let found = FOUND * (far_base - near_base).abs();
        let mut open = live.and(entered);
        let mut place = met(flat, tangent, far);
        let mut rounds = 0;
        let far = loop {
            counters.height_evaluations += open.count();
            let far = self.surfaces[1].points(place);
            rounds += 1;
            let off = (flat + tangent.scaled(far.height) - place).abs().max_element();
            open = open.and_not(off.less_than(Lanes::splat(off.simd(), found)));
            if rounds == MOST_ROUNDS || !open.any() {
                break far;
            }
            // A vertex that is found stays where it is.
            place = open.select2(met(flat, tangent, &far), place);
        };
        let (last, left) = refracted(inner, far.gradient, self.index, 1.0);
        let last_tangent = last.truncated().scaled(last.z.recip());
        let distance = near_base - self.origin.z;
        let miss = match self.source {
            Source::Point(point) => {
                let above = -far.height + (point.z - far_base);
                let deflection = far.place + last_tangent.scaled(above);
                let scale = (first.z + above).abs().recip() * distance.abs();
                Lanes2 { x: -deflection.x + point.x, y: -deflection.y + point.y }.scaled(scale)
            }
            Source::Direction(direction) => {
                let scale = direction.z.signum() * distance.abs();
                let tangent = direction.truncate() / direction.z;
                Lanes2 { x: (-last_tangent.x + tangent.x) * scale, y: (-last_tangent.y + tangent.y) * scale }
            }
        };
        let crossing = first.truncated().scaled(first.z.recip() * distance) + self.origin.truncate();
        let zero = Lanes::splat(z.simd(), 0.0);
        let onwards = zero.less_than(last.z * first.z);
        let arrived = live.and(entered).and(left).and(onwards).and(miss.is_finite());
        (TracedPaths { vertices: [near.place, far.place], place: crossing, miss }, arrived)
    }
}

/// Where rays that cross the undisplaced plane at `flat`, with such tangents, meet the planes through points of a face
/// along its slopes.
#[inline(always)]
fn met<S: Instructions>(flat: Lanes2<S>, tangent: Lanes2<S>, point: &FacePoints<S>) -> Lanes2<S> {
    let height = point.height + point.gradient.dot(flat - point.place);
    let rise = -point.gradient.dot(tangent) + 1.0;
    flat + tangent.scaled(height * rise.recip())
}

/// Unit directions refracted where a surface `z = h(x, y)` has the given gradients, from a medium of index `index_in`
/// into one of index `index_out`, as [`refract`](crate::bsdf::fresnel::refract) does; and which are not totally
/// reflected.
#[inline(always)]
fn refracted<S: Instructions>(
    direction: Lanes3<S>,
    gradient: Lanes2<S>,
    index_in: f64,
    index_out: f64,
) -> (Lanes3<S>, Mask<S>) {
    let simd = gradient.x.simd();
    let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
    let normal = Lanes3 { x: -gradient.x, y: -gradient.y, z: one }.normalised();
    let along = direction.dot(normal);
    let (ratio, cos_in) = (index_in / index_out, along.abs());
    let cos_out_squared = -(-(cos_in * cos_in) + 1.0) * (ratio * ratio) + 1.0;
    // Against the normal, what is added to the direction points along it.
    let added = cos_in * ratio - cos_out_squared.sqrt();
    let added = zero.less_than(along).select(-added, added);
    (direction.scaled(Lanes::splat(simd, ratio)).plus(normal.scaled(added)), zero.less_than(cos_out_squared))
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};
    use pulp::Scalar256b;

    use super::*;
    use crate::{
        bsdf::fresnel::refract,
        specular::{
            side::unit_normal,
            testing::{pair, random},
        },
    };

    #[test]
    fn four_directions_are_refracted_as_one_is() {
        let mut random = random(4);
        let mut reflected = 0;
        for case in 0..500 {
            let (indices, towards) = ([[1.0, 1.52], [1.52, 1.0]][case % 2], [1.0, -1.0][case / 2 % 2]);
            let direction = ((pair(&mut random) - 0.5) * 3.0).extend(towards).normalize();
            let gradients: [DVec2; LANES] = std::array::from_fn(|_| pair(&mut random) - 0.5);
            let same = |value: f64| Lanes::splat(Scalar256b, value);
            let directions = Lanes3 { x: same(direction.x), y: same(direction.y), z: same(direction.z) };
            let (found, goes_on) = refracted(directions, Lanes2::new(Scalar256b, gradients), indices[0], indices[1]);
            for (lane, gradient) in gradients.into_iter().enumerate() {
                let expected = refract(direction, unit_normal(gradient), indices[0], indices[1]);
                assert_eq!(goes_on.to_array()[lane], expected.is_some(), "{direction} {gradient}");
                let found = [found.x, found.y, found.z].map(|component| component.to_array()[lane]);
                match expected {
                    Some(expected) => assert!((DVec3::from(found) - expected.direction).length() < 1e-14),
                    None => reflected += 1,
                }
            }
        }
        assert!(reflected > 100, "{reflected}");
    }
}
