//! Things of a file of another program, before and after the rules of an import.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DAffine3, DMat3, DVec3};

use super::description::{GlazeRule, ImportDescription, UpAxis};
use super::glazing::{PaneFit, Piece, pieces};
use crate::bsdf::MaterialDescription;
use crate::geometry::rotation::rotation;
use crate::light::{LightDescription, MeshLight};
use crate::scene::description::{CameraDescription, MeshDescription, MeshSource, PaneDescription, ProfileDescription};
use crate::scene::profile::shortest_wavelength;
use crate::settings::AssetProblem;
use crate::settings::Triple;
use crate::settings::limits::MAX_NAME_BYTES;
use crate::settings::pattern::matches;
use crate::texture::TextureDescription;

/// What a file adds to a scene.
#[derive(Clone, Debug, Default)]
pub struct Expansion {
    /// Materials by their names.
    pub materials: BTreeMap<String, MaterialDescription>,
    /// Meshes, in the order of the file.
    pub meshes: Vec<MeshDescription>,
    /// Panes, where rules make some.
    pub panes: Vec<PaneDescription>,
    /// Lights, if they shine.
    pub lights: Vec<LightDescription>,
    /// Cameras, which a scene takes by hand.
    pub cameras: Vec<ImportedCamera>,
    /// What is in the file and not in the scene, or differs, one sentence each.
    pub notes: Vec<String>,
    /// Names that a rule makes panes of and that are none, with the reason.
    pub unglazed: Vec<(String, String)>,
    /// Names of windows without a rule, by what they are called or made of, with the number of panes that they could
    /// become.
    pub glazable: Vec<(String, usize)>,
}

impl Expansion {
    /// What is in the file and not in the scene, or differs, and what a rule would make a pane of and is none: one
    /// sentence each.
    pub fn remarks(&self) -> impl Iterator<Item = String> {
        let unglazed = self.unglazed.iter().map(|(name, reason)| format!("{name} is no pane: {reason}"));
        self.notes.iter().cloned().chain(unglazed)
    }
}

/// A camera of a file.
#[derive(Clone, Debug)]
pub struct ImportedCamera {
    /// Its name.
    pub name: String,
    /// The camera.
    pub camera: CameraDescription,
    /// Width over height, if the file says.
    pub aspect: Option<f64>,
}

/// A mesh of a file, before rules.
pub(super) struct Thing {
    /// What it is called: the node, else the mesh.
    pub(super) name: String,
    /// Other names: of the mesh, of the material in the file.
    pub(super) others: Vec<String>,
    /// From the coordinates of the file to those of the scene.
    pub(super) to_scene: DAffine3,
    pub(super) source: MeshSource,
    /// Name of its material among [`Expansion::materials`].
    pub(super) material: String,
    /// Whether its material lets light through.
    pub(super) is_transparent: bool,
    /// The light of its material, if it emits any.
    pub(super) emission: Option<Emission>,
    /// What the program that wrote the file says of glazing, if anything.
    pub(super) pane: Option<GlazeRule>,
}

/// Light that a material emits.
#[derive(Clone, Debug)]
pub(super) struct Emission {
    /// W/(m2 sr).
    pub(super) radiance: Triple,
    /// By what radiance is multiplied.
    pub(super) texture: Option<TextureDescription>,
}

/// The corners of a thing: positions in the file, and triangles.
pub(super) type Corners = (Vec<DVec3>, Vec<[u32; 3]>);

/// Words in names that are worth glazing, in lower case.
const WINDOWS: [&str; 9] = ["window", "glass", "pane", "glaz", "fenster", "glas", "vitrail", "fenetre", "vetr"];

/// Whether a name is that of a window.
pub(super) fn is_called_window(name: &str) -> bool {
    let name = name.to_lowercase();
    WINDOWS.iter().any(|word| name.contains(word))
}

impl ImportDescription {
    /// From the coordinates of the file to those of the scene.
    pub(super) fn to_scene(&self) -> DAffine3 {
        let upright = match self.up {
            UpAxis::Z => DMat3::IDENTITY,
            UpAxis::Y => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        };
        let linear = rotation(self.rotate) * upright * self.metres_per_unit;
        DAffine3 { matrix3: linear, translation: DVec3::from(self.translate) }
    }

    /// The name of a thing of the file in the scene.
    pub(super) fn name_of(&self, name: &str, taken: &mut BTreeSet<String>) -> String {
        let plain: String = name.chars().filter(|character| !character.is_control()).collect();
        let mut long = format!("{}/{}", self.name, if plain.is_empty() { "unnamed" } else { &plain });
        // Room for a number.
        long.truncate(long.floor_char_boundary(MAX_NAME_BYTES - 12));
        let mut unique = long.clone();
        let mut number = 1;
        while !taken.insert(unique.clone()) {
            number += 1;
            unique = format!("{long} {number}");
        }
        unique
    }
}

/// Three rows of a placement.
pub(super) fn rows(affine: DAffine3) -> [[f64; 4]; 3] {
    let [x, y, z] = [affine.matrix3.x_axis, affine.matrix3.y_axis, affine.matrix3.z_axis];
    [0, 1, 2].map(|row| [x[row], y[row], z[row], affine.translation[row]])
}

impl Thing {
    /// Whether a pattern fits one of its names.
    fn fits(&self, pattern: &str) -> bool {
        matches(pattern, &self.name) || self.others.iter().any(|other| matches(pattern, other))
    }

    /// Whether it is called or looks like a window.
    fn is_window(&self) -> bool {
        self.is_transparent || self.others.iter().chain([&self.name]).any(|name| is_called_window(name))
    }

    /// Its pieces, in the coordinates of the scene.
    fn pieces(&self, (positions, triangles): Corners) -> Vec<Piece> {
        let placed: Vec<DVec3> = positions.iter().map(|at| self.to_scene.transform_point3(*at)).collect();
        pieces(&placed, &triangles)
    }

    /// Adds it as a mesh of the scene. It shines if its material does and no material of the scene takes its place.
    fn add_mesh(self, import: &ImportDescription, name: String, expansion: &mut Expansion) {
        let rule = import.materials.iter().find(|rule| self.fits(&rule.pattern));
        if rule.is_none()
            && import.lights
            && let Some(Emission { radiance, texture }) = self.emission
        {
            let (texture, mesh) = (texture.map(Box::new), name.clone());
            expansion.lights.push(LightDescription::Mesh(MeshLight { name: name.clone(), mesh, radiance, texture }));
        }
        expansion.meshes.push(MeshDescription {
            name,
            material: rule.map_or(self.material, |rule| rule.material.clone()),
            source: self.source,
            matrix: Some(rows(self.to_scene)),
            scale: 1.0,
            rotate: [0.0; 3],
            translate: [0.0; 3],
        });
    }
}

/// Adds a thing to the scene: as a mesh, or as panes where a rule says so. What a rule fits and what is no pane stays a
/// mesh.
pub(super) fn add(
    import: &ImportDescription,
    expansion: &mut Expansion,
    taken: &mut BTreeSet<String>,
    thing: Thing,
    corners: impl FnOnce() -> Result<Corners, AssetProblem>,
) -> Result<(), AssetProblem> {
    let rule = import.glaze.iter().find(|rule| thing.fits(&rule.pattern)).or(thing.pane.as_ref()).cloned();
    let Some(rule) = rule else {
        if thing.is_window() {
            let count = thing.pieces(corners()?).iter().filter(|piece| piece.fit.is_ok()).count();
            if count > 0 {
                expansion.glazable.push((thing.name.clone(), count));
            }
        }
        let name = import.name_of(&thing.name, taken);
        thing.add_mesh(import, name, expansion);
        return Ok(());
    };
    if thing.emission.is_some() && import.lights {
        expansion.notes.push(format!("{}: glass emits no light, though its material does", thing.name));
    }
    let (mut rest, before) = (Vec::new(), expansion.panes.len());
    for piece in thing.pieces(corners()?) {
        let pane = piece.fit.as_ref().map_err(String::clone).and_then(|fit| {
            let pane = rule.pane(String::new(), fit, expansion.panes.len() as u64);
            check_resolved(&pane).map(|()| pane)
        });
        match pane {
            Ok(pane) => {
                let name = import.name_of(&thing.name, taken);
                expansion.panes.push(PaneDescription { name, ..pane });
            }
            Err(reason) => {
                expansion.unglazed.push((thing.name.clone(), reason));
                rest.push(piece);
            }
        }
    }
    if expansion.panes.len() == before {
        // Such as the textured frame of a window, which is called like one.
        let name = import.name_of(&thing.name, taken);
        thing.add_mesh(import, name, expansion);
    } else if !rest.is_empty() {
        let name = import.name_of(&thing.name, taken);
        let source = inline(&rest);
        let to_scene = DAffine3::IDENTITY;
        // These have no texture coordinates.
        let emission = thing.emission.filter(|emission| emission.texture.is_none());
        Thing { source, to_scene, emission, ..thing }.add_mesh(import, name, expansion);
    }
    Ok(())
}

/// Pieces as triangles in the scene.
fn inline(pieces: &[Piece]) -> MeshSource {
    let corners = pieces.iter().flat_map(|piece| piece.triangles.iter().flatten());
    let positions: Vec<[f64; 3]> = corners.map(|corner| corner.to_array()).collect();
    let triangles = (0..positions.len() as u32 / 3).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]);
    MeshSource::Inline {
        triangles: triangles.collect(),
        // A material may have a texture, of which what is beside a pane has one texel.
        texture_coordinates: vec![[0.0; 2]; positions.len()],
        positions,
        normals: Vec::new(),
    }
}

/// Thickness of glass that is modelled as a flat rectangle, metres, where a rule has none.
pub const FLAT_THICKNESS: f64 = 0.002;

impl GlazeRule {
    /// The pane in a rectangle; `number` makes its relief another than that of others.
    fn pane(&self, name: String, fit: &PaneFit, number: u64) -> PaneDescription {
        let thickness = self.thickness.or(fit.thickness).unwrap_or(FLAT_THICKNESS);
        let [width, height] = fit.size.map(|edge| edge - 2.0 * self.inset);
        let [x_axis, y_axis] = fit.axes.map(|axis| axis.to_array());
        PaneDescription {
            name,
            centre: fit.front(thickness).to_array(),
            x_axis,
            y_axis,
            width,
            height,
            thickness,
            index_of_refraction: self.index_of_refraction,
            absorption: self.absorption,
            front: with_seed(&self.front, 2 * number),
            back: with_seed(&self.back, 2 * number + 1),
            crossing: crate::geometry::FaceCrossing::default(),
        }
    }
}

/// Refuses a pane that is too large for its relief.
fn check_resolved(pane: &PaneDescription) -> Result<(), String> {
    let edge = pane.width.max(pane.height);
    for profile in [&pane.front, &pane.back] {
        let (ProfileDescription::Crown { wavelength, .. }
        | ProfileDescription::Cylinder { wavelength, .. }
        | ProfileDescription::Hammered { wavelength, .. }) = profile
        else {
            continue;
        };
        let shortest = shortest_wavelength(profile, edge);
        if *wavelength < shortest {
            let (kind, longest) = (profile.name(), edge * wavelength / shortest);
            return Err(format!(
                "it measures {edge:.2} m, and panes of {kind} glass with waves of {wavelength} m at most {longest:.2} \
                 m: divide it into lights, or glaze it flat"
            ));
        }
    }
    Ok(())
}

/// The same profile with another seed, where it has one.
fn with_seed(profile: &ProfileDescription, more: u64) -> ProfileDescription {
    let mut profile = profile.clone();
    if let ProfileDescription::Crown { seed, .. }
    | ProfileDescription::Cylinder { seed, .. }
    | ProfileDescription::Hammered { seed, .. } = &mut profile
    {
        *seed = seed.wrapping_add(more);
    }
    profile
}
