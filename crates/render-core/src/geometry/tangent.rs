//! The frame of a normal map at a place of a triangle.
//!
//! A normal map stores normals in a frame that follows the texture coordinates (u, v). Its x axis lies along growing u,
//! y along growing v, and z along the normal of the surface. Maps are made for the tangents of Mikkelsen 2008,
//! "Simulation of Wrinkled Surfaces Revisited", which all programs share.

use bevy_mikktspace::{Geometry, Ops, TangentSpace, generate_tangents};
use glam::{DVec2, DVec3};

/// The direction of growing u at a corner, and 1 or -1: what growing v is turned by from the normal cross that.
pub type Tangent = [f32; 4];

/// Triangles over which (u, v) are given, one by one.
pub struct MappedTriangles<'a> {
    /// Positions of their corners.
    pub corners: &'a dyn Fn(usize) -> [DVec3; 3],
    /// Unit normals of their corners.
    pub normals: &'a dyn Fn(usize) -> [DVec3; 3],
    /// Texture coordinates of their corners.
    pub coordinates: &'a [[DVec2; 3]],
}

impl MappedTriangles<'_> {
    /// The tangents at the corners of each triangle. They are zero where (u, v) grow in no direction.
    pub fn tangents(&self) -> Vec<[Tangent; 3]> {
        let Some([origin, ..]) = (!self.coordinates.is_empty()).then(|| (self.corners)(0)) else { return Vec::new() };
        let mut written =
            Written { triangles: self, origin, tangents: vec![[Tangent::default(); 3]; self.coordinates.len()] };
        match generate_tangents::<_, Portable>(&mut written) {
            Ok(()) => written.tangents,
            // There is no error yet; zero means none.
            Err(_) => vec![[Tangent::default(); 3]; self.coordinates.len()],
        }
    }
}

/// Functions with the same result on every machine.
struct Portable;

impl Ops for Portable {
    fn sqrt(x: f32) -> f32 {
        x.sqrt()
    }

    fn acos(x: f32) -> f32 {
        libm::acos(f64::from(x)) as f32
    }
}

struct Written<'a> {
    triangles: &'a MappedTriangles<'a>,
    /// Positions are relative to this, so that single precision is enough.
    origin: DVec3,
    tangents: Vec<[Tangent; 3]>,
}

impl Geometry<Portable> for Written<'_> {
    fn num_faces(&self) -> usize {
        self.tangents.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        ((self.triangles.corners)(face)[corner] - self.origin).as_vec3().to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        (self.triangles.normals)(face)[corner].as_vec3().to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.triangles.coordinates[face][corner].as_vec2().to_array()
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, corner: usize) {
        self.tangents[face][corner] = tangent.map_or(Tangent::default(), |tangent| tangent.tangent_encoded());
    }
}

/// The unit normal in the world that a map says at a point of a triangle with these tangents. `normal` is that of the
/// surface there, a unit vector, which is also the answer where there is no frame. The weights of the second and third
/// corner are `barycentric`.
pub fn mapped_normal(normal: DVec3, tangents: &[Tangent; 3], [v, w]: [f64; 2], stored: DVec3) -> DVec3 {
    let [a, b, c] = tangents.map(|[x, y, z, _]| DVec3::new(f64::from(x), f64::from(y), f64::from(z)));
    let along_u = a * (1.0 - v - w) + b * v + c * w;
    let Some(tangent) = (along_u - normal * normal.dot(along_u)).try_normalize() else { return normal };
    let bitangent = normal.cross(tangent) * f64::from(tangents[0][3]);
    (tangent * stored.x + bitangent * stored.y + normal * stored.z).normalize_or(normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Frame;

    const COORDINATES: [DVec2; 3] = [DVec2::new(0.2, 0.7), DVec2::new(1.1, 0.5), DVec2::new(0.4, 1.6)];

    /// A triangle over which (u, v) grow along these edges, its normal, and its tangents.
    fn triangle(along_u: DVec3, along_v: DVec3) -> (DVec3, [Tangent; 3]) {
        let corners = COORDINATES.map(|DVec2 { x, y }| DVec3::new(3e5, -2.0, 5.0) + along_u * x + along_v * y);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let triangles = MappedTriangles {
            corners: &|_| corners,
            normals: &|_| [normal; 3],
            coordinates: std::slice::from_ref(&COORDINATES),
        };
        (normal, triangles.tangents()[0])
    }

    #[test]
    fn components_follow_the_texture_coordinates_however_the_triangle_is_placed() {
        let turn = Frame::around(DVec3::new(1.0, -2.0, 0.5).normalize()).axes;
        for (u, v) in [(DVec3::X, DVec3::Y), (DVec3::X * 3.0, DVec3::Y * 0.1), (-DVec3::X, DVec3::Y)] {
            let (u, v) = (turn * u, turn * v);
            let (normal, tangents) = triangle(u, v);
            let mapped = |stored| mapped_normal(normal, &tangents, [0.3, 0.2], stored);
            assert!((mapped(DVec3::Z) - normal).length() < 1e-12);
            assert!((mapped(DVec3::X) - u.normalize()).length() < 1e-5, "{u}, {v}");
            assert!((mapped(DVec3::Y) - v.normalize()).length() < 1e-5, "{u}, {v}");
            let bump = DVec3::new(0.3, -0.2, 0.9).normalize();
            let expected = u.normalize() * bump.x + v.normalize() * bump.y + normal * bump.z;
            assert!((mapped(bump) - expected).length() < 1e-5, "{u}, {v}");
        }
    }

    #[test]
    fn around_an_interpolated_normal_the_frame_stays_orthonormal() {
        let (_, tangents) = triangle(DVec3::new(1.0, 0.5, 0.0), DVec3::new(0.2, 1.0, 0.0));
        let normal = DVec3::new(0.4, -0.3, 0.8).normalize();
        let [x, y] = [DVec3::X, DVec3::Y].map(|axis| mapped_normal(normal, &tangents, [0.2, 0.2], axis));
        for product in [x.dot(y), x.dot(normal), y.dot(normal)] {
            assert!(product.abs() < 1e-12, "{product}");
        }
    }

    #[test]
    fn where_texture_coordinates_do_not_grow_the_normal_stays() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let flat = [[DVec2::ZERO; 3]];
        let triangles = MappedTriangles { corners: &|_| corners, normals: &|_| [DVec3::Z; 3], coordinates: &flat };
        let tangents = triangles.tangents()[0];
        let mapped = mapped_normal(DVec3::Z, &tangents, [0.1, 0.1], DVec3::new(0.5, 0.5, 0.7));
        assert!(mapped.is_finite() && (mapped.length() - 1.0).abs() < 1e-12);
        let none = mapped_normal(DVec3::Z, &[Tangent::default(); 3], [0.1, 0.1], DVec3::new(0.5, 0.5, 0.7));
        assert_eq!(none, DVec3::Z);
    }
}
