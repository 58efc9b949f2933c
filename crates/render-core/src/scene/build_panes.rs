//! The panes of a scene: profiles computed or decoded, cut, and hung in their place.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::assets::{Assets, asset_bytes};
use super::build_step::BuildStep;
use super::description::{PaneDescription, ProfileDescription};
use super::parts::SceneParts;
use super::profile::procedural_coefficients;
use super::sheet::{face_name, profile_uses};
use crate::geometry::{Face, HeightField, Pane, PaneError, PaneParts};
use crate::settings::{AssetProblem, JsonPath, SceneError};
use crate::texture::height_map::{CoefficientGrid, HeightMap};

/// Panes that are built before the next is told of: enough to keep all cores busy, and still some steps a second.
const PANES_OF_A_STEP: usize = 1024;

/// Height maps by the names of their files.
type HeightMaps<'a> = BTreeMap<&'a str, HeightMap>;

/// The two faces of each sheet, by its name.
type Sheets<'a> = BTreeMap<&'a str, [Arc<HeightField>; 2]>;

/// Builds all panes, in the order of the scene file, and tells how many are built.
pub(super) fn build_panes(
    parts: SceneParts<'_>,
    assets: &Assets,
    begin: &mut dyn FnMut(BuildStep<'_>),
) -> Result<Vec<Pane>, SceneError> {
    let count = parts.panes.len();
    begin(BuildStep::Panes { done: 0, count });
    let height_maps = decode_height_maps(parts, assets)?;
    let sheets = build_sheets(parts, &height_maps)?;
    let mut panes = Vec::with_capacity(count);
    for part in parts.panes.chunks(PANES_OF_A_STEP) {
        let first = panes.len();
        if first > 0 {
            begin(BuildStep::Panes { done: first, count });
        }
        // Collected before the first error is looked for, so that it is the same one on every machine.
        let built: Vec<Result<Pane, SceneError>> = (part.par_iter().enumerate())
            .map(|(index, pane)| build_pane(first + index, pane, &sheets, &height_maps))
            .collect();
        for pane in built {
            panes.push(pane?);
        }
    }
    Ok(panes)
}

/// Decodes all height maps, each file once.
fn decode_height_maps<'a>(parts: SceneParts<'a>, assets: &Assets) -> Result<HeightMaps<'a>, SceneError> {
    let mut height_maps = BTreeMap::new();
    for (place, profile, _) in profile_uses(&parts) {
        let ProfileDescription::HeightMap { file, .. } = profile else { continue };
        if !height_maps.contains_key(file.as_str()) {
            let map = asset_bytes(assets, file)
                .and_then(HeightMap::decode)
                .map_err(|problem| height_map_error(&place, file, problem))?;
            height_maps.insert(file.as_str(), map);
        }
    }
    Ok(height_maps)
}

fn build_sheets<'a>(parts: SceneParts<'a>, height_maps: &HeightMaps<'_>) -> Result<Sheets<'a>, SceneError> {
    let built: Vec<Result<_, SceneError>> = (parts.sheets.par_iter())
        .map(|(name, sheet)| {
            let root = JsonPath::Root;
            let sheets = root.member("sheets");
            let place = sheets.member(name).to_string();
            let [front, back] = sheet.faces().map(|(face, profile)| {
                let place = format!("{place}.{}", face_name(face));
                height_field(&place, face, profile, sheet.size(), height_maps)
            });
            Ok((name.as_str(), [Arc::new(front?), Arc::new(back?)]))
        })
        .collect();
    built.into_iter().collect()
}

fn build_pane(
    index: usize,
    description: &PaneDescription,
    sheets: &Sheets<'_>,
    height_maps: &HeightMaps<'_>,
) -> Result<Pane, SceneError> {
    let of_sheet = description.sheet.as_ref().and_then(|cut| sheets.get(cut.name.as_str()).cloned());
    let faces = match of_sheet {
        Some(faces) => faces,
        None => {
            let size = DVec2::new(description.width, description.height);
            let [front, back] = [(Face::Front, &description.front), (Face::Back, &description.back)]
                .map(|(face, profile)| height_field(&face_path(index, face), face, profile, size, height_maps));
            [Arc::new(front?), Arc::new(back?)]
        }
    };
    let fault = |member: &str, message: String| {
        Err(SceneError::Structure { path: format!("panes[{index}].{member}"), message })
    };
    let Some((outline, frame)) = description.placed() else {
        return fault("outline", "the outline is not convex once it is turned on its sheet".to_owned());
    };
    let parts = PaneParts {
        name: description.name.clone(),
        frame,
        outline,
        thickness: description.thickness,
        index_of_refraction: description.index_of_refraction,
        absorption: DVec3::from(description.absorption),
        layers: [description.layers.front, description.layers.back].map(DVec3::from),
        faces,
    };
    match Pane::new(parts) {
        Ok(mut pane) => {
            pane.crossing = description.crossing;
            Ok(pane)
        }
        Err(error @ PaneError::BeyondFace { .. }) => fault("sheet", error.to_string()),
        Err(error) => fault("thickness", error.to_string()),
    }
}

fn height_field(
    place: &str,
    face: Face,
    profile: &ProfileDescription,
    size: DVec2,
    height_maps: &HeightMaps<'_>,
) -> Result<HeightField, SceneError> {
    let grid = match profile {
        ProfileDescription::HeightMap { file, scale, offset } => {
            let map = height_maps.get(file.as_str()).expect("every height map is decoded");
            Some(map.coefficients(*scale, *offset).map_err(|problem| height_map_error(place, file, problem))?)
        }
        procedural => procedural_coefficients(procedural, face, size),
    };
    let field = match grid {
        Some(CoefficientGrid { columns, rows, coefficients }) => HeightField::new(coefficients, columns, rows, size),
        None => HeightField::flat(size),
    };
    field.map_err(|error| SceneError::Structure { path: place.to_owned(), message: error.to_string() })
}

fn height_map_error(place: &str, file: &str, problem: AssetProblem) -> SceneError {
    SceneError::Asset { path: format!("{place}.height_map.file"), name: file.to_owned(), problem }
}

fn face_path(index: usize, face: Face) -> String {
    format!("panes[{index}].{}", face_name(face))
}
