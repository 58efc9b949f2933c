//! The panes of a scene: profiles computed or decoded, and hung in their place.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::assets::{Assets, asset_bytes};
use super::description::{PaneDescription, ProfileDescription};
use super::profile::procedural_coefficients;
use crate::geometry::{Face, Frame, HeightField, Pane};
use crate::settings::{AssetProblem, SceneError};
use crate::texture::height_map::{CoefficientGrid, HeightMap};

/// Height maps by the names of their files.
type HeightMaps<'a> = BTreeMap<&'a str, HeightMap>;

/// Builds all panes, in the order of the scene file.
pub(super) fn build_panes(panes: &[PaneDescription], assets: &Assets) -> Result<Vec<Pane>, SceneError> {
    let height_maps = decode_height_maps(panes, assets)?;
    // Collected before the first error is looked for, so that it is the same one on every machine.
    let built: Vec<Result<Pane, SceneError>> =
        panes.par_iter().enumerate().map(|(index, pane)| build_pane(index, pane, &height_maps)).collect();
    built.into_iter().collect()
}

pub(super) fn faces(pane: &PaneDescription) -> [(Face, &ProfileDescription, DVec2); 2] {
    let size = DVec2::new(pane.width, pane.height);
    [(Face::Front, &pane.front, size), (Face::Back, &pane.back, size)]
}

/// Decodes all height maps, each file once.
fn decode_height_maps<'a>(panes: &'a [PaneDescription], assets: &Assets) -> Result<HeightMaps<'a>, SceneError> {
    let mut height_maps = BTreeMap::new();
    for (index, pane) in panes.iter().enumerate() {
        for (face, profile, _) in faces(pane) {
            let ProfileDescription::HeightMap { file, .. } = profile else { continue };
            if !height_maps.contains_key(file.as_str()) {
                let map = asset_bytes(assets, file)
                    .and_then(HeightMap::decode)
                    .map_err(|problem| height_map_error(index, face, file, problem))?;
                height_maps.insert(file.as_str(), map);
            }
        }
    }
    Ok(height_maps)
}

fn build_pane(index: usize, description: &PaneDescription, height_maps: &HeightMaps<'_>) -> Result<Pane, SceneError> {
    let x = DVec3::from(description.x_axis).normalize();
    let z = x.cross(DVec3::from(description.y_axis).normalize()).normalize();
    let [front, back] =
        faces(description).map(|(face, profile, size)| height_field(index, face, profile, size, height_maps));
    let pane = Pane::new(
        description.name.clone(),
        Frame::new(DVec3::from(description.centre), x, z.cross(x)),
        DVec2::new(description.width, description.height),
        description.thickness,
        description.index_of_refraction,
        DVec3::from(description.absorption),
        front?,
        back?,
    )
    .map_err(|error| SceneError::Structure { path: format!("panes[{index}].thickness"), message: error.to_string() })?;
    Ok(Pane { crossing: description.crossing, ..pane })
}

fn height_field(
    index: usize,
    face: Face,
    profile: &ProfileDescription,
    size: DVec2,
    height_maps: &HeightMaps<'_>,
) -> Result<HeightField, SceneError> {
    let grid = match profile {
        ProfileDescription::HeightMap { file, scale, offset } => {
            let map = height_maps.get(file.as_str()).expect("every height map is decoded");
            Some(map.coefficients(*scale, *offset).map_err(|problem| height_map_error(index, face, file, problem))?)
        }
        procedural => procedural_coefficients(procedural, face, size),
    };
    let field = match grid {
        Some(CoefficientGrid { columns, rows, coefficients }) => HeightField::new(coefficients, columns, rows, size),
        None => HeightField::flat(size),
    };
    field.map_err(|error| SceneError::Structure { path: face_path(index, face), message: error.to_string() })
}

fn height_map_error(index: usize, face: Face, file: &str, problem: AssetProblem) -> SceneError {
    SceneError::Asset { path: face_path(index, face) + ".height_map.file", name: file.to_owned(), problem }
}

pub(super) fn face_path(index: usize, face: Face) -> String {
    match face {
        Face::Front => format!("panes[{index}].front"),
        Face::Back => format!("panes[{index}].back"),
    }
}
