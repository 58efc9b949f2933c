//! Lights in the terms of Mitsuba. Flat ones are placements of a unit shape: the square from -1 to 1, or the unit disk,
//! that shines along z.

use clerestory_render_core::geometry::Frame;
use clerestory_render_core::settings::Triple;
use glam::{DMat4, DVec3};

/// Places the square from -1 to 1 as a rectangle.
pub(super) fn rectangle(centre: Triple, edge_u: Triple, edge_v: Triple) -> DMat4 {
    let (u, v) = (DVec3::from(edge_u), DVec3::from(edge_v));
    let normal = u.cross(v).normalize();
    let x = u.normalize();
    placement(centre, [x * (u.length() / 2.0), normal.cross(x) * (v.length() / 2.0), normal])
}

/// Places the unit disk.
pub(super) fn disk(centre: Triple, normal: Triple, radius: f64) -> DMat4 {
    let axes = Frame::around(normal.into()).axes;
    placement(centre, [axes.x_axis * radius, axes.y_axis * radius, axes.z_axis])
}

fn placement(centre: Triple, [x, y, z]: [DVec3; 3]) -> DMat4 {
    DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), DVec3::from(centre).extend(1.0))
}

/// The angle from which a spot dims linearly in the angle up to `outer`, so that its power is that of a spot that dims
/// by the square of a linear function of the cosine from `inner` on. Degrees.
pub(super) fn linear_beam(inner: f64, outer: f64) -> f64 {
    if inner >= outer {
        return outer;
    }
    let [inner, outer] = [inner, outer].map(f64::to_radians);
    let (full, all) = (1.0 - libm::cos(inner), 1.0 - libm::cos(outer));
    let power = full + (all - full) / 3.0;
    // Power over 2 pi where dimming begins at an angle; it grows with the angle.
    let linear = |beam: f64| 1.0 - (libm::sin(outer) - libm::sin(beam)) / (outer - beam);
    let (mut low, mut high) = (0.0, outer);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if linear(middle) < power { low = middle } else { high = middle }
    }
    low.to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_spot_has_the_power_of_the_one_that_it_stands_for() {
        for (inner, outer) in [(10.0, 30.0), (40.0, 70.0), (5.0, 5.5)] {
            let beam = linear_beam(inner, outer);
            assert!(beam >= 0.0 && beam < outer, "{beam}");
            let power = |falloff: &dyn Fn(f64) -> f64| -> f64 {
                let step = outer / 20_000.0;
                (0..20_000)
                    .map(|index| (f64::from(index) + 0.5) * step)
                    .fold(0.0, |sum, angle| sum + falloff(angle) * libm::sin(angle.to_radians()))
            };
            let cosine = |angle: f64| libm::cos(angle.to_radians());
            let ours = power(&|angle| {
                ((cosine(angle) - cosine(outer)) / (cosine(inner) - cosine(outer))).clamp(0.0, 1.0).powi(2)
            });
            let theirs = power(&|angle| ((outer - angle) / (outer - beam)).clamp(0.0, 1.0));
            assert!((ours / theirs - 1.0).abs() < 1e-3, "{ours} {theirs}");
        }
        assert_eq!(linear_beam(20.0, 20.0), 20.0);
    }
}
