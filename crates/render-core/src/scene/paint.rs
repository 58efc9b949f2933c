//! Vitreous paint on panes: grisaille, trace lines and matt, as a thin layer that scatters what it lets through.
//!
//! A paint of ground glass and iron or copper oxide is fired onto a face of the glass. Here it is a mesh of the material
//! `diffuse_transmission` just before that face, of which the mask says how much is there. So every method sees through
//! it where there is none, and no pane has to know of it.
//!
//! The air between both is thinner than what can be seen. It keeps the pane's own reflections and leaves out those that
//! light makes between paint and glass, so fractions of the paint are those of painted glass over clear glass.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::description::{MeshDescription, MeshSource, PaneDescription};
use super::mesh::is_degenerate;
use crate::bsdf::{DiffuseTransmissionMaterial, MaterialDescription, MaterialSettings};
use crate::geometry::Face;
use crate::settings::check::check_above;
use crate::settings::{Check, JsonPath, Triple, is_default};
use crate::texture::{ColourDescription, TextureUse, ValueDescription};

/// Vitreous paint on a face of a pane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PaintDescription {
    /// Where it is: 1 for paint, 0 for clear glass, and a part of both in between.
    pub mask: ValueDescription,
    /// Fraction of light that the paint scatters back. Default: dark brown.
    #[serde(default = "reflectance", skip_serializing_if = "is_usual_reflectance")]
    pub reflectance: ColourDescription,
    /// Fraction of light that the paint scatters to the other side. Default: what a thick trace line lets through.
    #[serde(default = "transmittance", skip_serializing_if = "is_usual_transmittance")]
    pub transmittance: ColourDescription,
    /// The face on which it is. The inner face of a window's pieces is the back.
    #[serde(default, skip_serializing_if = "is_default")]
    pub face: PaintedFace,
    /// Distance of the paint from the highest point of the face, metres; more than 0, at most 0.01. On a measured face,
    /// from its mean plane.
    #[serde(default = "distance", skip_serializing_if = "is_usual_distance")]
    #[schemars(range(max = 0.01), extend("exclusiveMinimum" = 0))]
    pub distance: f64,
}

/// A face of a pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PaintedFace {
    /// The front, which is outside in a window.
    Front,
    /// The back, which is inside in a window.
    #[default]
    Back,
}

/// Measured values for fired paint are hardly published; these are estimates for a dense brown trace line.
fn reflectance() -> ColourDescription {
    ColourDescription::Colour([0.07, 0.055, 0.045])
}

fn is_usual_reflectance(colour: &ColourDescription) -> bool {
    *colour == reflectance()
}

fn transmittance() -> ColourDescription {
    ColourDescription::Colour([0.05, 0.035, 0.02])
}

fn is_usual_transmittance(colour: &ColourDescription) -> bool {
    *colour == transmittance()
}

fn distance() -> f64 {
    0.0003
}

fn is_usual_distance(metres: &f64) -> bool {
    *metres == distance()
}

/// Distance between two paints on one piece, metres.
const COAT: f64 = 0.0001;

impl PaintDescription {
    /// Dense brown trace lines, where a mask has them.
    pub fn of_mask(mask: ValueDescription) -> Self {
        Self {
            mask,
            reflectance: reflectance(),
            transmittance: transmittance(),
            face: PaintedFace::default(),
            distance: distance(),
        }
    }

    /// Checks it.
    pub(crate) fn check(&self, path: &JsonPath<'_>) -> Check {
        self.mask.check(0.0, 1.0, &path.member("mask"))?;
        DiffuseTransmissionMaterial { opacity: ValueDescription::number(1.0), ..self.material() }.check(path)?;
        check_above(self.distance, 0.0, 0.01, &path.member("distance"))
    }

    /// The pictures that it names, with their places below it.
    pub(crate) fn textures(&self) -> Vec<TextureUse<'_>> {
        let colours = [("reflectance", &self.reflectance), ("transmittance", &self.transmittance)];
        let colours = colours.into_iter().filter_map(|(member, colour)| colour.texture(member));
        self.mask.texture("mask").into_iter().chain(colours).collect()
    }

    fn material(&self) -> DiffuseTransmissionMaterial {
        DiffuseTransmissionMaterial {
            reflectance: self.reflectance.clone(),
            transmittance: self.transmittance.clone(),
            opacity: self.mask.clone(),
            opacity_threshold: None,
        }
    }
}

/// Paint that is laid on pieces of glass: one mesh with its material.
#[derive(Clone, Debug)]
pub(super) struct PaintLayer {
    paint: PaintDescription,
    coats_below: u32,
    positions: Vec<Triple>,
    triangles: Vec<[u32; 3]>,
    texture_coordinates: Vec<[f64; 2]>,
}

impl PaintLayer {
    /// A layer with so many others between it and the glass.
    pub(super) fn new(paint: &PaintDescription, coats_below: u32) -> Self {
        Self {
            paint: paint.clone(),
            coats_below,
            positions: Vec::new(),
            triangles: Vec::new(),
            texture_coordinates: Vec::new(),
        }
    }

    /// Paints a pane, whose faces reach this far out of their planes, metres. `coordinates` of the mask belong to the
    /// places of the pane.
    pub(super) fn add(
        &mut self,
        pane: &PaneDescription,
        reach: impl Fn(Face) -> f64,
        coordinates: impl Fn(DVec2) -> DVec2,
    ) {
        let distance = self.paint.distance + COAT * f64::from(self.coats_below);
        let height = match self.paint.face {
            PaintedFace::Front => -reach(Face::Front) - distance,
            PaintedFace::Back => pane.thickness + reach(Face::Back) + distance,
        };
        let frame = pane.hanging();
        let corners: Vec<(DVec3, DVec2)> =
            pane.corners().into_iter().map(|at| (frame.point_to_world(at.extend(height)), coordinates(at))).collect();
        let first = self.positions.len() as u32;
        let fan = (1..corners.len().saturating_sub(1)).map(|corner| [0, corner, corner + 1]);
        let there = fan.filter(|triangle| !is_degenerate(triangle.map(|corner| corners[corner].0)));
        self.triangles.extend(there.map(|triangle| triangle.map(|corner| first + corner as u32)));
        self.positions.extend(corners.iter().map(|(at, _)| at.to_array()));
        self.texture_coordinates.extend(corners.iter().map(|(_, coordinates)| coordinates.to_array()));
    }

    /// Its mesh and its material, both of this name; `None` where nothing has been painted.
    pub(super) fn finish(self, name: &str) -> Option<(MeshDescription, MaterialDescription)> {
        if self.triangles.is_empty() {
            return None;
        }
        let material = MaterialDescription::DiffuseTransmission(self.paint.material());
        let mesh = MeshDescription {
            name: name.to_owned(),
            material: name.to_owned(),
            source: MeshSource::Inline {
                positions: self.positions,
                triangles: self.triangles,
                texture_coordinates: self.texture_coordinates,
                normals: Vec::new(),
            },
            matrix: None,
            scale: 1.0,
            rotate: [0.0; 3],
            translate: [0.0; 3],
        };
        Some((mesh, material))
    }
}

/// Takes the paint off panes that have some of their own, and gives it as meshes with their materials. The mask is
/// mapped over the pane's rectangle.
pub(crate) fn take_paint(
    panes: &mut [PaneDescription],
    sheets: &BTreeMap<String, super::description::SheetDescription>,
) -> Vec<(MeshDescription, MaterialDescription)> {
    let take = |pane: &mut PaneDescription| {
        let paint = pane.paint.take()?;
        let mut layer = PaintLayer::new(&paint, 0);
        let sheet = pane.sheet.as_ref().and_then(|cut| sheets.get(&cut.name));
        let [front, back] = sheet.map_or([&pane.front, &pane.back], |sheet| [&sheet.front, &sheet.back]);
        let reach = |face| if face == Face::Front { front.reach() } else { back.reach() };
        let size = DVec2::new(pane.width, pane.height);
        layer.add(pane, reach, |at| at / size + 0.5);
        layer.finish(&format!("{} paint", pane.name))
    };
    panes.iter_mut().filter_map(take).collect()
}
