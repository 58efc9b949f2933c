//! Cameras: from a point of the picture to a ray.

use std::cmp::Ordering;

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

/// How a camera sees a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Column and row of the pixel.
    pub pixel: [u32; 2],
    /// The ray on which the point lies.
    pub ray: Ray,
    /// How far along it.
    pub distance: f64,
    /// Pixels of the picture that a square metre at the point covers, across the ray.
    pub density: f64,
}

impl Camera {
    /// How it sees a point; `None` for a point beside the picture or behind the camera.
    pub fn sight(&self, point: DVec3) -> Option<Sight> {
        let local = self.frame.point_to_local(point);
        let depth = -local.z;
        let scale = match self.projection {
            Projection::Perspective => self.pixel_edge * depth,
            Projection::Orthographic => self.pixel_edge,
        };
        if depth.partial_cmp(&0.0) != Some(Ordering::Greater) {
            return None;
        }
        let place = DVec2::new(self.half_size.x + local.x / scale, self.half_size.y - local.y / scale);
        let end = self.half_size * 2.0;
        if !(place.cmpge(DVec2::ZERO).all() && place.cmplt(end).all()) {
            return None;
        }
        let ray = self.ray(place);
        let distance = (point - ray.origin).length();
        // A plane at the depth of the point, seen at an angle.
        let tilted = match self.projection {
            Projection::Perspective => distance / depth,
            Projection::Orthographic => 1.0,
        };
        let density = tilted / (scale * scale);
        Some(Sight { pixel: [place.x as u32, place.y as u32], ray, distance, density })
    }

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
    fn a_point_is_seen_on_the_ray_through_its_pixel_and_covers_its_share_of_the_picture() {
        let orthographic = CameraDescription::Orthographic {
            position: [0.3, 0.2, 5.0],
            look_at: [0.1, 0.0, 0.0],
            up: [0.0, 1.0, 0.0],
            height: 2.0,
        };
        for camera in [perspective(), Camera::new(&orthographic, FILM)] {
            for (place, distance) in [([3.2, 4.7], 2.0), ([39.9, 0.1], 0.5), ([20.0, 10.0], 7.0)] {
                let ray = camera.ray(DVec2::from(place));
                let seen = camera.sight(ray.at(distance)).unwrap();
                assert_eq!(seen.pixel, place.map(|coordinate| coordinate as u32));
                assert!((seen.distance - distance).abs() < 1e-9 && (seen.ray.origin - ray.origin).length() < 1e-9);
                assert!((seen.ray.direction - ray.direction).length() < 1e-9);
                // The area across the ray that a small square of the picture covers.
                let step = 1e-4;
                let edges = [DVec2::X, DVec2::Y].map(|axis| {
                    let beside = camera.ray(DVec2::from(place) + axis * step);
                    let along =
                        (ray.at(distance) - beside.origin).dot(ray.direction) / beside.direction.dot(ray.direction);
                    beside.at(along) - ray.at(distance)
                });
                let expected = step * step / edges[0].cross(edges[1]).length();
                assert!((seen.density / expected - 1.0).abs() < 1e-3, "{} {expected}", seen.density);
            }
            let middle = camera.ray(DVec2::new(20.0, 10.0));
            assert!(camera.sight(middle.at(-1.0)).is_none() && camera.sight(middle.origin).is_none());
            assert!(camera.sight(camera.ray(DVec2::new(40.5, 10.0)).at(3.0)).is_none());
        }
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
