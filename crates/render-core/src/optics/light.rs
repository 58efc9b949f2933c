//! Lights.

use std::f64::consts::PI;

use glam::DVec3;

use crate::geometry::Frame;
use crate::scene::description::LightDescription;

/// A light of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Its name in the scene file.
    pub name: String,
    /// What it is.
    pub kind: LightKind,
}

/// The kinds of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// A point of equal intensity in all directions.
    Point {
        /// Where it is, metres.
        position: DVec3,
        /// Radiant intensity, W/sr.
        intensity: DVec3,
    },
    /// A sphere of uniform radiance.
    Sphere {
        /// Its centre, metres.
        centre: DVec3,
        /// Its radius, metres.
        radius: f64,
        /// Emitted radiance, W/(m2 sr).
        radiance: DVec3,
    },
    /// A rectangle of uniform radiance that shines along its frame's z axis.
    Rectangle {
        /// Origin at the centre, x and y along the edges.
        frame: Frame,
        /// Half the extent along x and y, metres.
        half_size: [f64; 2],
        /// Emitted radiance, W/(m2 sr).
        radiance: DVec3,
    },
    /// A disk of uniform radiance that shines along its frame's z axis.
    Disk {
        /// Origin at the centre, z along the normal.
        frame: Frame,
        /// Its radius, metres.
        radius: f64,
        /// Emitted radiance, W/(m2 sr).
        radiance: DVec3,
    },
    /// A distant disc of uniform radiance.
    Sun {
        /// Unit vector from the scene towards its middle.
        direction: DVec3,
        /// Cosine of the angular radius.
        cos_radius: f64,
        /// Sine of the angular radius.
        sin_radius: f64,
        /// Emitted radiance, W/(m2 sr).
        radiance: DVec3,
    },
}

impl Light {
    /// The light of a valid description.
    pub fn new(description: &LightDescription) -> Self {
        let kind = match *description {
            LightDescription::Point { position, intensity, .. } => {
                LightKind::Point { position: DVec3::from(position), intensity: DVec3::from(intensity) }
            }
            LightDescription::Sphere { centre, radius, radiance, .. } => {
                LightKind::Sphere { centre: DVec3::from(centre), radius, radiance: DVec3::from(radiance) }
            }
            LightDescription::Rectangle { centre, edge_u, edge_v, radiance, .. } => {
                let (edge_u, edge_v) = (DVec3::from(edge_u), DVec3::from(edge_v));
                let normal = edge_u.cross(edge_v).normalize();
                let x = edge_u.normalize();
                LightKind::Rectangle {
                    // The second edge is perpendicular only as far as decimal numbers could say.
                    frame: Frame::new(DVec3::from(centre), x, normal.cross(x)),
                    half_size: [edge_u.length() / 2.0, edge_v.length() / 2.0],
                    radiance: DVec3::from(radiance),
                }
            }
            LightDescription::Disk { centre, normal, radius, radiance, .. } => LightKind::Disk {
                frame: Frame { origin: DVec3::from(centre), ..Frame::around(DVec3::from(normal).normalize()) },
                radius,
                radiance: DVec3::from(radiance),
            },
            LightDescription::Sun { direction, angular_radius, radiance, .. } => {
                let (sin_radius, cos_radius) = libm::sincos(angular_radius.to_radians());
                LightKind::Sun {
                    direction: DVec3::from(direction).normalize(),
                    cos_radius,
                    sin_radius,
                    radiance: DVec3::from(radiance),
                }
            }
        };
        Self { name: description.name().to_owned(), kind }
    }
}

/// Where a light is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Body {
    /// In a ball; a point has radius 0.
    Ball {
        /// Its centre, metres.
        centre: DVec3,
        /// Its radius, metres.
        radius: f64,
    },
    /// In a flat convex polygon with these corners, metres.
    Polygon(Vec<DVec3>),
}

/// Corners of the polygon that stands for a disk: it lies in it, and lacks 0.04 percent of its radius.
const DISK_CORNERS: u32 = 128;

impl Light {
    /// Where it is; `None` for the sun, which is nowhere.
    pub(crate) fn body(&self) -> Option<Body> {
        let on = |frame: &Frame, x: f64, y: f64| frame.point_to_world(DVec3::new(x, y, 0.0));
        match &self.kind {
            LightKind::Point { position, .. } => Some(Body::Ball { centre: *position, radius: 0.0 }),
            LightKind::Sphere { centre, radius, .. } => Some(Body::Ball { centre: *centre, radius: *radius }),
            LightKind::Rectangle { frame, half_size: [x, y], .. } => {
                Some(Body::Polygon(vec![on(frame, -x, -y), on(frame, *x, -y), on(frame, *x, *y), on(frame, -x, *y)]))
            }
            LightKind::Disk { frame, radius, .. } => {
                let corner = |step: u32| {
                    let (sin, cos) = libm::sincos(2.0 * PI * f64::from(step) / f64::from(DISK_CORNERS));
                    on(frame, radius * cos, radius * sin)
                };
                Some(Body::Polygon((0..DISK_CORNERS).map(corner).collect()))
            }
            LightKind::Sun { .. } => None,
        }
    }

    /// The largest solid angle at which it may be seen from a box, up to 2 pi; `None` for a point light, which has none.
    pub(crate) fn largest_solid_angle(&self, [min, max]: [DVec3; 2]) -> Option<f64> {
        let whole = 2.0 * PI;
        let distance = |centre: DVec3| centre.distance(centre.clamp(min, max));
        // From no nearer than this, the area can be seen at no larger angle than if it were all there, seen head on.
        let of_area = |area: f64, nearest: f64| if nearest > 0.0 { area / (nearest * nearest) } else { whole };
        let solid_angle = match &self.kind {
            LightKind::Point { .. } => return None,
            LightKind::Sphere { centre, radius, .. } => {
                let sine = radius / distance(*centre);
                if sine < 1.0 { whole * (1.0 - (1.0 - sine * sine).sqrt()) } else { whole }
            }
            LightKind::Rectangle { frame, half_size: [x, y], .. } => {
                of_area(4.0 * x * y, distance(frame.origin) - (x * x + y * y).sqrt())
            }
            LightKind::Disk { frame, radius, .. } => of_area(PI * radius * radius, distance(frame.origin) - radius),
            LightKind::Sun { cos_radius, .. } => whole * (1.0 - cos_radius),
        };
        Some(solid_angle.min(whole))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_shines_along_its_edges_cross_product() {
        let light = Light::new(&LightDescription::Rectangle {
            name: "panel".to_owned(),
            centre: [1.0, 2.0, 3.0],
            edge_u: [0.0, 0.0, 4.0],
            edge_v: [2.0, 0.0, 0.0],
            radiance: [1.0; 3],
        });
        let LightKind::Rectangle { frame, half_size, .. } = light.kind else { panic!("{light:?} is no rectangle") };
        assert_eq!(frame.axes.z_axis, DVec3::Y);
        assert_eq!(frame.point_to_world(DVec3::new(half_size[0], half_size[1], 0.0)), DVec3::new(2.0, 2.0, 5.0));
    }

    #[test]
    fn a_disk_shines_along_its_normal() {
        let light = Light::new(&LightDescription::Disk {
            name: "aperture".to_owned(),
            centre: [1.0, 2.0, 3.0],
            normal: [0.0, -5.0, 0.0],
            radius: 0.5,
            radiance: [1.0; 3],
        });
        let LightKind::Disk { frame, radius, .. } = light.kind else { panic!("{light:?} is no disk") };
        assert_eq!((frame.origin, frame.axes.z_axis, radius), (DVec3::new(1.0, 2.0, 3.0), DVec3::NEG_Y, 0.5));
    }

    #[test]
    fn a_sun_keeps_its_angular_radius_and_points_at_it() {
        let light = Light::new(&LightDescription::Sun {
            name: "sun".to_owned(),
            direction: [0.0, 3.0, 4.0],
            angular_radius: 30.0,
            radiance: [1.0; 3],
        });
        let LightKind::Sun { direction, cos_radius, sin_radius, .. } = light.kind else {
            panic!("{light:?} is no sun")
        };
        assert!((direction - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-15);
        assert!((sin_radius - 0.5).abs() < 1e-15 && (cos_radius - 0.75f64.sqrt()).abs() < 1e-15);
    }
}
