//! A glTF file as things of the scene.

use std::collections::BTreeSet;

use glam::{DAffine3, DVec3};
use serde_json::Value;

use super::description::{GlazeRule, ImportDescription, ImportFiles};
use super::gltf::{Camera, GltfFile, Light, LightKind, Projection};
use super::gltf_materials::{GltfMaterials, LUMENS_FOR_A_WATT, is_transparent};
use super::old_glass::profile;
use super::things::{Corners, Expansion, ImportedCamera, Thing, add};
use crate::light::{LightDescription, PointLight, SpotLight, SunLight};
use crate::scene::Assets;
use crate::scene::assets::{asset_bytes, beside};
use crate::scene::description::{CameraDescription, GltfSource, MeshSource};
use crate::settings::AssetProblem;

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
    let mut expansion = Expansion::default();
    let mut taken = BTreeSet::new();
    let mut materials = GltfMaterials::new(import, &file);
    let to_scene = import.to_scene();
    for node in file.nodes() {
        let world = to_scene * node.world;
        if let Some(index) = node.mesh
            && let Some(mesh) = file.meshes().nth(index)
        {
            let name = node.name.or(mesh.name).map_or_else(|| format!("mesh {index}"), str::to_owned);
            for (number, primitive) in
                mesh.primitives.iter().enumerate().filter(|(_, primitive)| primitive.triangles > 0)
            {
                let material = primitive.material.and_then(|index| file.materials().get(index));
                let others = [mesh.name, material.and_then(|material| material.name.as_deref())];
                let tags = [node.extras, mesh.extras].into_iter().chain(material.map(|material| &material.extras));
                let thing = Thing {
                    name: name.clone(),
                    others: others.into_iter().flatten().map(str::to_owned).collect(),
                    to_scene: world,
                    source: MeshSource::Gltf(GltfSource {
                        file: files.file.clone(),
                        files: Vec::new(),
                        mesh: index as u32,
                        primitive: number as u32,
                    }),
                    material: materials.name(primitive.material, &mut expansion),
                    is_transparent: material.is_some_and(is_transparent),
                    emission: material.and_then(|material| materials.emission(material)),
                    pane: tags.into_iter().find_map(pane_of),
                };
                let corners = || -> Result<Corners, AssetProblem> {
                    let decoded = file.decode(index, number)?;
                    Ok((decoded.positions, decoded.triangles))
                };
                add(import, &mut expansion, &mut taken, thing, corners)?;
            }
        }
        if let Some(camera) = node.camera.and_then(|index| file.cameras().get(index)) {
            let name = node.name.or(camera.name.as_deref()).unwrap_or("camera").to_owned();
            expansion.cameras.push(camera_at(camera, name, world, import.metres_per_unit));
        }
        if let Some(light) = node.light.and_then(|index| file.lights().get(index)).filter(|_| import.lights) {
            let name = import.name_of(node.name.or(light.name.as_deref()).unwrap_or("light"), &mut taken);
            expansion.lights.push(light_at(light, name, world));
        }
    }
    let notes = file.notes().iter().map(|note| format!("{}: {note}", files.file));
    expansion.notes.splice(0..0, notes);
    Ok(expansion)
}

/// What a program says of a thing that is a pane: `{"clerestory": {"kind": "pane", "thickness": 0.002, "profile":
/// "crown"}}`.
fn pane_of(extras: &Value) -> Option<GlazeRule> {
    let tag = extras.get("clerestory").filter(|tag| tag.get("kind").and_then(Value::as_str) == Some("pane"))?;
    let name = tag.get("profile").and_then(Value::as_str).unwrap_or("flat");
    let thickness =
        tag.get("thickness").and_then(Value::as_f64).filter(|thickness| *thickness > 0.0 && *thickness <= 1.0);
    let [front, back] = [1, 2].map(|seed| profile(name, seed).unwrap_or_default());
    Some(GlazeRule { thickness, front, back, ..GlazeRule::flat("*") })
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
