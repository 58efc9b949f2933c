//! A glTF file as things of the scene.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use glam::{DAffine3, DVec3};
use serde_json::Value;

use super::description::{GlazeRule, ImportDescription, ImportFiles};
use super::gltf::{Camera, GltfFile, Light, LightKind, Projection};
use super::gltf_materials::{GltfMaterials, LUMENS_FOR_A_WATT, is_body, is_transparent};
use super::old_glass::{OLD_GLASS, hex_colour, profile};
use super::things::{Assembly, Corners, Expansion, ImportedCamera, Thing};
use crate::geometry::closed::is_closed;
use crate::light::{LightDescription, PointLight, SpotLight, SunLight};
use crate::scene::Assets;
use crate::scene::assets::{asset_bytes, beside};
use crate::scene::description::{CameraDescription, GltfSource, MeshSource};
use crate::settings::AssetProblem;
use crate::settings::check::Quoted;

/// Angular radius of the sun, degrees.
const SUN: f64 = 0.267;

/// The files that a glTF file refers to.
pub(super) fn files(files: &ImportFiles, assets: &Assets) -> Result<Vec<String>, AssetProblem> {
    let names = GltfFile::files(asset_bytes(assets, &files.file)?)?;
    Ok(names.iter().map(|name| files.beside(name)).collect())
}

pub(super) fn expand(import: &ImportDescription, assets: &Assets) -> Result<Expansion, AssetProblem> {
    let files = import.source.files();
    let file = GltfFile::open(asset_bytes(assets, &files.file)?, &|uri| beside(assets, &files.file, uri))?;
    let mut assembly = Assembly::new(import);
    let meshes: Vec<_> = file.meshes().collect();
    let mut closed: BTreeMap<(usize, usize), bool> = BTreeMap::new();
    let mut materials = GltfMaterials::new(import, &file);
    let to_scene = import.to_scene();
    for node in file.nodes() {
        let world = to_scene * node.world;
        if let Some(index) = node.mesh
            && let Some(mesh) = meshes.get(index)
        {
            let name = node.name.or(mesh.name).map_or_else(|| format!("mesh {index}"), str::to_owned);
            for (number, primitive) in
                mesh.primitives.iter().enumerate().filter(|(_, primitive)| primitive.triangles > 0)
            {
                let material = primitive.material.and_then(|index| file.materials().get(index));
                let extras = [node.extras, mesh.extras].into_iter().chain(material.map(|material| &material.extras));
                let corners = || -> Result<Corners, AssetProblem> {
                    let decoded = file.decode(index, number)?;
                    Ok((decoded.positions, decoded.triangles))
                };
                let is_closed = if material.is_some_and(is_body) {
                    let closed = closed.entry((index, number));
                    match closed {
                        Entry::Occupied(known) => *known.get(),
                        Entry::Vacant(unknown) => *unknown.insert(is_closed_mesh(&corners()?)),
                    }
                } else {
                    true
                };
                let pane = extras.clone().find_map(pane_of);
                if let Some((_, problems)) = &pane {
                    let notes = problems.iter().map(|problem| format!("{name}: {problem}"));
                    assembly.expansion.notes.extend(notes);
                }
                let thing = Thing {
                    name: name.clone(),
                    mesh: mesh.name.map(str::to_owned),
                    material_in_file: material.and_then(|material| material.name.clone()),
                    to_scene: world,
                    source: MeshSource::Gltf(GltfSource {
                        file: files.file.clone(),
                        files: Vec::new(),
                        mesh: index as u32,
                        primitive: number as u32,
                    }),
                    material: materials.name(primitive.material, is_closed, &mut assembly.expansion),
                    is_transparent: material.is_some_and(is_transparent),
                    emission: material.and_then(|material| materials.emission(material)),
                    pane: pane.map(|(rule, _)| rule),
                    tags: extras.flat_map(tags).collect(),
                };
                assembly.add(thing, corners)?;
            }
        }
        if let Some(camera) = node.camera.and_then(|index| file.cameras().get(index)) {
            let name = node.name.or(camera.name.as_deref()).unwrap_or("camera").to_owned();
            assembly.expansion.cameras.push(camera_at(camera, name, world, import.metres_per_unit));
        }
        if let Some(light) = node.light.and_then(|index| file.lights().get(index)).filter(|_| import.lights) {
            let name = assembly.name(node.name.or(light.name.as_deref()).unwrap_or("light"));
            assembly.expansion.lights.push(light_at(light, name, world));
        }
    }
    let notes = file.notes().iter().map(|note| format!("{}: {note}", files.file));
    assembly.expansion.notes.splice(0..0, notes);
    Ok(assembly.finish())
}

/// Most values of a thing that patterns are matched with, and the longest of them, bytes.
const MOST_TAGS: usize = 32;
const LONGEST_TAG: usize = 200;

/// What a modeller has written on a thing, as `key:value`.
fn tags(extras: &Value) -> Vec<String> {
    let tag = |(key, value): (&String, &Value)| match value {
        Value::String(text) => Some(format!("{key}:{text}")),
        Value::Bool(_) | Value::Number(_) => Some(format!("{key}:{value}")),
        _ => None,
    };
    let tags = extras.as_object().into_iter().flatten().filter_map(tag);
    tags.filter(|tag| tag.len() <= LONGEST_TAG).take(MOST_TAGS).collect()
}

/// Whether a mesh has no border.
fn is_closed_mesh((positions, triangles): &Corners) -> bool {
    let corner = |vertex: u32| positions.get(vertex as usize).copied().unwrap_or(DVec3::NAN);
    is_closed(triangles.iter().map(|triangle| triangle.map(corner)))
}

/// What a program says of a thing that is a pane: `{"clerestory": {"kind": "pane", "thickness": 0.002, "profile":
/// "crown", "colour": "#d8e8d0"}}`; and what of it makes no sense.
fn pane_of(extras: &Value) -> Option<(GlazeRule, Vec<String>)> {
    let tag = extras.get("clerestory").filter(|tag| tag.get("kind").and_then(Value::as_str) == Some("pane"))?;
    let mut problems = Vec::new();
    let mut rule = GlazeRule::flat("*");
    let mut problem = |member: &str, value: &Value, expected: &str| {
        problems.push(format!("its {member} of glass is {}: expected {expected}", Quoted(&value.to_string())));
    };
    if let Some(value) = tag.get("profile") {
        let profiles = |name: &str| Some([profile(name, 1)?, profile(name, 2)?]);
        match value.as_str().and_then(|name| profiles(&name.to_lowercase())) {
            Some([front, back]) => (rule.front, rule.back) = (front, back),
            None => problem("profile", value, &format!("one of {}, it is flat", OLD_GLASS.join(", "))),
        }
    }
    if let Some(value) = tag.get("thickness") {
        rule.thickness = value.as_f64().filter(|thickness| *thickness > 0.0 && *thickness <= 1.0);
        if rule.thickness.is_none() {
            problem("thickness", value, "metres, more than 0 and at most 1");
        }
    }
    if let Some(value) = tag.get("colour") {
        match value.as_str().and_then(hex_colour) {
            Some(colour) => rule = rule.coloured(colour),
            None => problem("colour", value, "a colour such as #d8e8d0"),
        }
    }
    Some((rule, problems))
}

fn camera_at(camera: &Camera, name: String, world: DAffine3, metres_per_unit: f64) -> ImportedCamera {
    let position = world.translation;
    let direction = |local: DVec3| world.transform_vector3(local).normalize_or(local);
    let view = [position, position + direction(DVec3::NEG_Z), direction(DVec3::Y)].map(|vector| vector.to_array());
    let [position, look_at, up] = view;
    let (camera, aspect) = match camera.projection {
        Projection::Perspective { vertical_angle, aspect } => {
            let vertical_field_of_view = vertical_angle.to_degrees().min(179.0);
            (CameraDescription::Perspective { position, look_at, up, vertical_field_of_view }, aspect)
        }
        Projection::Orthographic { half_extent: [width, height] } => {
            let camera =
                CameraDescription::Orthographic { position, look_at, up, height: 2.0 * height * metres_per_unit };
            (camera, Some(width / height))
        }
    };
    ImportedCamera { name, camera, aspect }
}

/// A light of the file. Its photometric units become radiometric ones.
fn light_at(light: &Light, name: String, world: DAffine3) -> LightDescription {
    let position = world.translation.to_array();
    let along = world.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
    let watts = light.colour.map(|channel| channel * light.intensity / LUMENS_FOR_A_WATT);
    match light.kind {
        LightKind::Point => LightDescription::Point(PointLight { name, position, intensity: watts }),
        LightKind::Spot { inner_angle, outer_angle } => LightDescription::Spot(SpotLight {
            name,
            position,
            direction: along.to_array(),
            intensity: watts,
            inner_angle: inner_angle.to_degrees().min(outer_angle.to_degrees()),
            outer_angle: outer_angle.to_degrees().clamp(1e-3, 90.0),
        }),
        LightKind::Directional => {
            let sine = libm::sin(SUN.to_radians());
            let radiance = watts.map(|irradiance| irradiance / (std::f64::consts::PI * sine * sine));
            let direction = (-along).to_array();
            LightDescription::Sun(SunLight { name, direction, angular_radius: SUN, radiance })
        }
    }
}
