//! Light from all directions.
//!
//! Mitsuba looks along +z at the middle of a picture, has +x left of it, and +y up. Its first row is the pole itself,
//! where ours is centred half a row below it. Between rows both are linear. So a picture of twice the rows and one more
//! is the same light: its odd rows are ours, and the others lie halfway between.

use clerestory_render_core::settings::Triple;
use clerestory_render_core::texture::RadiancePicture;
use glam::{DMat3, DMat4};

use super::element::{float, matrix, rgb};
use super::xml::Element;
use crate::error::ExportError;
use crate::texture::Pictures;

/// Pixels of the largest picture that is written once more with other rows.
const LARGEST: usize = 1 << 24;

/// The same radiance from all directions.
pub(super) fn constant(radiance: Triple) -> Element {
    Element::plugin("emitter", "constant").containing(rgb("radiance", radiance))
}

/// The file that Mitsuba reads for a picture of all directions, which is also in `file` as it is.
pub(super) fn file(
    file: &str,
    picture: Option<&RadiancePicture>,
    pictures: &mut Pictures,
    differ: &mut dyn FnMut(&'static str, &'static str),
) -> Result<String, ExportError> {
    match picture {
        Some(picture) if picture.texels().len() <= LARGEST => {
            let (size, texels) = with_poles(picture);
            pictures.colours(size, texels)
        }
        _ => {
            differ("`envmap`", "its rows are moved towards the poles, by half a row at most");
            Ok(file.to_owned())
        }
    }
}

/// A picture whose first and last rows are the poles.
fn with_poles(picture: &RadiancePicture) -> ([usize; 2], Vec<[f32; 3]>) {
    let [width, height] = picture.size();
    let rows = 2 * height + 1;
    let texel = |index: usize| {
        let (column, row) = (index % width, index / width);
        picture.between(column as f64 + 0.5, 0.5 * row as f64).to_array().map(|value| value as f32)
    };
    ([width, rows], (0..width * rows).map(texel).collect())
}

/// A picture of all directions: unit vectors towards its middle, what is left of that, and its top.
pub(super) fn environment(file: &str, scale: f64, [middle, left, up]: [Triple; 3]) -> Element {
    let axes = DMat3::from_cols(left.into(), up.into(), middle.into());
    Element::plugin("emitter", "envmap")
        .containing(Element::value("string", "filename", file))
        .containing(float("scale", scale))
        .containing(matrix(DMat4::from_mat3(axes)))
}
