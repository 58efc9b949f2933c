//! Cameras.

use std::f64::consts::PI;

use super::fault::{check_range, fault};
use super::schema::{self, Document};
use crate::settings::AssetProblem;

/// A camera at the origin of its node. It looks along -z, and y is up.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Camera {
    /// Its name, as written.
    pub(crate) name: Option<String>,
    /// How it projects.
    pub(crate) projection: Projection,
}

/// How a camera projects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Projection {
    /// Towards its place.
    Perspective {
        /// The angle between the upper and the lower edge of the image, radians.
        vertical_angle: f64,
        /// Width over height, if the file says so.
        aspect: Option<f64>,
    },
    /// Along its direction.
    Orthographic {
        /// Half of the width and half of the height that it sees, metres.
        half_extent: [f64; 2],
    },
}

/// Reads all cameras.
pub(super) fn read(document: &Document<'_>) -> Result<Vec<Camera>, AssetProblem> {
    let camera = |(index, camera)| read_camera(camera, &format!("cameras[{index}]"));
    document.cameras.iter().enumerate().map(camera).collect()
}

fn read_camera(camera: &schema::Camera, place: &str) -> Result<Camera, AssetProblem> {
    let positive = f64::MIN_POSITIVE..=f64::INFINITY;
    let projection = match (camera.kind.as_str(), &camera.perspective, &camera.orthographic) {
        ("perspective", Some(perspective), _) => {
            let place = format!("{place}.perspective");
            let angle = check_range(format_args!("{place}.yfov"), perspective.yfov, f64::MIN_POSITIVE..=PI)?;
            if let Some(aspect) = perspective.aspect_ratio {
                check_range(format_args!("{place}.aspectRatio"), aspect, positive)?;
            }
            Projection::Perspective { vertical_angle: angle, aspect: perspective.aspect_ratio }
        }
        ("orthographic", _, Some(orthographic)) => {
            let place = format!("{place}.orthographic");
            // Negative ones mirror the image; glTF allows them and advises against them.
            let extent =
                |name: &str, number: f64| check_range(format_args!("{place}.{name}"), number.abs(), positive.clone());
            let half_extent = [extent("xmag", orthographic.xmag)?, extent("ymag", orthographic.ymag)?];
            Projection::Orthographic { half_extent }
        }
        (kind @ ("perspective" | "orthographic"), ..) => {
            return Err(fault(place, format_args!("is {kind}, but has no member \"{kind}\"")));
        }
        (kind, ..) => {
            let message = format!("found \"{kind}\", must be \"perspective\" or \"orthographic\"");
            return Err(fault(format_args!("{place}.type"), message));
        }
    };
    Ok(Camera { name: camera.name.clone(), projection })
}
