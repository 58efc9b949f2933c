//! Flat lights as placements of a unit shape: the square from -1 to 1, or the unit disk, that shines along z.

use clerestory_render_core::geometry::Frame;
use clerestory_render_core::settings::Triple;
use glam::{DMat4, DVec3};

/// Places the square from -1 to 1 as a rectangle.
pub(crate) fn rectangle(centre: Triple, edge_u: Triple, edge_v: Triple) -> DMat4 {
    let (u, v) = (DVec3::from(edge_u), DVec3::from(edge_v));
    let normal = u.cross(v).normalize();
    let x = u.normalize();
    placement(centre, [x * (u.length() / 2.0), normal.cross(x) * (v.length() / 2.0), normal])
}

/// Places the unit disk.
pub(crate) fn disk(centre: Triple, normal: Triple, radius: f64) -> DMat4 {
    let axes = Frame::around(normal.into()).axes;
    placement(centre, [axes.x_axis * radius, axes.y_axis * radius, axes.z_axis])
}

fn placement(centre: Triple, [x, y, z]: [DVec3; 3]) -> DMat4 {
    DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), DVec3::from(centre).extend(1.0))
}
