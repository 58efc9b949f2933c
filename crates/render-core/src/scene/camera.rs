//! Cameras: from a point of the picture to a ray.

use glam::{DVec2, DVec3};

use super::description::{CameraDescription, FilmDescription};
use crate::exchange::{CameraModel, ProjectionModel};
use crate::geometry::{Frame, Ray};
use crate::settings::Triple;

/// A camera with square pixels; row 0 is the top of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// x points right in the picture, y up, z against the line of sight. The origin is the pinhole, or the middle of
    /// the plane from which parallel rays start.
    frame: Frame,
    projection: Projection,
    /// Half the picture's size in pixels.
    half_size: DVec2,
    /// Edge of a pixel, in metres: on a plane at a distance of 1 m, or in the scene when rays are parallel.
    pixel_edge: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Projection {
    Perspective,
    Orthographic,
}

impl Camera {
    /// The camera of a valid description.
    pub fn new(description: &CameraDescription, film: FilmDescription) -> Self {
        let half_size = DVec2::new(f64::from(film.width), f64::from(film.height)) / 2.0;
        let (frame, projection, half_height) = match description {
            CameraDescription::Perspective { position, look_at, up, vertical_field_of_view } => {
                let half_height = libm::tan(vertical_field_of_view.to_radians() / 2.0);
                (frame(*position, *look_at, *up), Projection::Perspective, half_height)
            }
            CameraDescription::Orthographic { position, look_at, up, height } => {
                (frame(*position, *look_at, *up), Projection::Orthographic, height / 2.0)
            }
        };
        Self { frame, projection, half_size, pixel_edge: half_height / half_size.y }
    }

    /// The ray through a point of the picture, in pixels to the right of and down from its top left corner: the
    /// centre of the first pixel is (0.5, 0.5).
    pub fn ray(&self, pixel: DVec2) -> Ray {
        let x = (pixel.x - self.half_size.x) * self.pixel_edge;
        let y = (self.half_size.y - pixel.y) * self.pixel_edge;
        match self.projection {
            Projection::Perspective => {
                let direction = self.frame.vector_to_world(DVec3::new(x, y, -1.0));
                Ray::new(self.frame.origin, direction.normalize())
            }
            Projection::Orthographic => {
                Ray::new(self.frame.point_to_world(DVec3::new(x, y, 0.0)), -self.frame.axes.z_axis)
            }
        }
    }
}

impl Camera {
    /// The corners of where its rays start: one point, or a rectangle.
    pub fn aperture(&self) -> Vec<DVec3> {
        match self.projection {
            Projection::Perspective => vec![self.frame.origin],
            Projection::Orthographic => [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
                .map(|[x, y]| self.ray(self.half_size * DVec2::new(x, y)).origin)
                .to_vec(),
        }
    }
}

impl CameraDescription {
    /// What it is for other programs.
    pub fn model(&self) -> CameraModel {
        let (position, look_at, up, projection) = match *self {
            Self::Perspective { position, look_at, up, vertical_field_of_view } => {
                (position, look_at, up, ProjectionModel::Perspective { vertical_field_of_view })
            }
            Self::Orthographic { position, look_at, up, height } => {
                (position, look_at, up, ProjectionModel::Orthographic { height })
            }
        };
        CameraModel { position, look_at, up, projection }
    }
}

fn frame(position: Triple, look_at: Triple, up: Triple) -> Frame {
    let position = DVec3::from(position);
    let forward = (DVec3::from(look_at) - position).normalize();
    let right = forward.cross(DVec3::from(up).normalize()).normalize();
    Frame::new(position, right, right.cross(forward))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILM: FilmDescription = FilmDescription { width: 40, height: 20 };

    fn perspective() -> Camera {
        let description = CameraDescription::Perspective {
            position: [1.0, 2.0, 3.0],
            look_at: [1.0, 2.0, -7.0],
            up: [0.0, 2.0, 1.0],
            vertical_field_of_view: 90.0,
        };
        Camera::new(&description, FILM)
    }

    #[test]
    fn the_middle_of_the_picture_is_the_point_looked_at() {
        let ray = perspective().ray(DVec2::new(20.0, 10.0));
        assert_eq!(ray, Ray::new(DVec3::new(1.0, 2.0, 3.0), DVec3::NEG_Z));
    }

    #[test]
    fn the_top_left_corner_is_left_and_up_and_pixels_are_square() {
        let ray = perspective().ray(DVec2::ZERO);
        let at_unit_distance = ray.direction / -ray.direction.z;
        assert!((at_unit_distance - DVec3::new(-2.0, 1.0, -1.0)).length() < 1e-12);
    }

    #[test]
    fn parallel_rays_start_on_the_picture_plane() {
        let description = CameraDescription::Orthographic {
            position: [0.0, 0.0, 5.0],
            look_at: [0.0, 0.0, 0.0],
            up: [0.0, 1.0, 0.0],
            height: 2.0,
        };
        let ray = Camera::new(&description, FILM).ray(DVec2::new(40.0, 20.0));
        assert!((ray.origin - DVec3::new(2.0, -1.0, 5.0)).length() < 1e-12);
        assert_eq!(ray.direction, DVec3::NEG_Z);
    }
}
