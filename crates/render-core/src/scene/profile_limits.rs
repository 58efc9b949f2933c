//! What the settings of profiles may be, for faces of panes and of sheets.

use super::description::{ProfileDescription, SheetDescription};
use super::profile;
use crate::settings::check::{Number, check_asset_name, check_pair, check_range};
use crate::settings::limits::{MAX_COORDINATE, PANE_EDGES};
use crate::settings::{Check, JsonPath, SceneError};

/// Checks the size of a sheet and its reliefs.
pub(super) fn check_sheet(sheet: &SheetDescription, path: &JsonPath<'_>) -> Check {
    let [least, most] = PANE_EDGES;
    check_range(sheet.width, least, most, &path.member("width"))?;
    check_range(sheet.height, least, most, &path.member("height"))?;
    let size = SizedFace { width: sheet.width, height: sheet.height, relief: 1.0 };
    check_profile(&sheet.front, &size, &path.member("front"))?;
    check_profile(&sheet.back, &size, &path.member("back"))
}

/// What a profile has to fit: the size of its face, and the largest amplitude, metres.
pub(super) struct SizedFace {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) relief: f64,
}

/// Checks the settings of a profile.
pub(super) fn check_profile(description: &ProfileDescription, face: &SizedFace, path: &JsonPath<'_>) -> Check {
    let path = path.member(description.name());
    let check_amplitude = |amplitude: f64| check_range(amplitude, -face.relief, face.relief, &path.member("amplitude"));
    match description {
        ProfileDescription::Flat => Ok(()),
        ProfileDescription::Crown { centre, wavelength, amplitude, .. } => {
            check_pair(*centre, -MAX_COORDINATE, MAX_COORDINATE, &path.member("centre"))?;
            check_amplitude(*amplitude)?;
            check_wavelength(*wavelength, description, face, &path.member("wavelength"))
        }
        ProfileDescription::Cylinder { axis, wavelength, amplitude, .. } => {
            check_range(*axis, -360.0, 360.0, &path.member("axis"))?;
            check_amplitude(*amplitude)?;
            check_wavelength(*wavelength, description, face, &path.member("wavelength"))
        }
        ProfileDescription::Bump { centre, radius, rotation, amplitude } => {
            check_pair(*centre, -MAX_COORDINATE, MAX_COORDINATE, &path.member("centre"))?;
            let radius_path = path.member("radius");
            for (index, component) in radius.iter().enumerate() {
                check_wavelength(*component, description, face, &radius_path.element(index))?;
            }
            check_range(*rotation, -360.0, 360.0, &path.member("rotation"))?;
            check_amplitude(*amplitude)
        }
        ProfileDescription::Hammered { wavelength, amplitude, .. } => {
            check_amplitude(*amplitude)?;
            check_wavelength(*wavelength, description, face, &path.member("wavelength"))
        }
        ProfileDescription::HeightMap { file, scale, offset } => {
            check_asset_name(file, &path.member("file"))?;
            check_range(*scale, -1e6, 1e6, &path.member("scale"))?;
            check_range(*offset, -1.0, 1.0, &path.member("offset"))
        }
    }
}

impl ProfileDescription {
    /// What it is, as written in the scene file.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Flat => "flat",
            Self::Crown { .. } => "crown",
            Self::Cylinder { .. } => "cylinder",
            Self::Bump { .. } => "bump",
            Self::Hammered { .. } => "hammered",
            Self::HeightMap { .. } => "height_map",
        }
    }
}

/// A length that the coefficients of a profile must resolve.
fn check_wavelength(wavelength: f64, description: &ProfileDescription, face: &SizedFace, path: &JsonPath<'_>) -> Check {
    let edge = face.width.max(face.height);
    let shortest = profile::shortest_wavelength(description, edge);
    if !wavelength.is_finite() || wavelength < shortest || wavelength > MAX_COORDINATE {
        let expected = format!(
            "{shortest:.3e} to {MAX_COORDINATE}: {} coefficients across the {edge} m of this face resolve no less",
            profile::MAX_COEFFICIENTS_PER_AXIS
        );
        return Err(SceneError::value(path, Number(wavelength), expected));
    }
    Ok(())
}
