//! Paint on panes as a thin layer that scatters what it lets through.
//!
//! It is a mesh of the material `diffuse_transmission` just before the painted face, of which the mask says how much is
//! there. So every method sees through it where there is none, and no pane has to know of it.
//!
//! The air between both is too thin to be seen. The pane keeps its own reflections. Light that goes back and forth
//! between paint and glass does so over air.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::description::{MeshDescription, MeshSource, PaneDescription, SheetDescription};
use super::mesh::is_degenerate;
use super::paint::{PaintDescription, PaintedFace};
use crate::bsdf::MaterialDescription;
use crate::geometry::Face;
use crate::settings::Triple;

/// Distance between two paints on one piece, metres.
const COAT: f64 = 0.0001;

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
    sheets: &BTreeMap<String, SheetDescription>,
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
