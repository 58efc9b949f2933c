//! The bodies at a place of a scene, and which of them meet others.

use glam::DVec3;

use super::Scene;
use super::media::{Bodies, is_body};
use crate::geometry::SurfaceId;
use crate::geometry::contact::overlap;

impl Scene {
    /// Whether a surface bounds an immersed body.
    pub fn is_immersed(&self, surface: SurfaceId) -> bool {
        let media = self.media();
        media.has_immersed()
            && match surface {
                SurfaceId::Pane { index, .. } => media.is_immersed(index),
                SurfaceId::Triangle(triangle) => media.is_immersed_mesh(self.mesh_of(triangle)),
                SurfaceId::Nothing => false,
            }
    }

    /// The bodies whose boxes reach into a box, given by two corners.
    pub fn bodies_near(&self, bounds: &[DVec3; 2]) -> Vec<u32> {
        let panes = (0u32..).zip(self.panes()).filter(|(_, pane)| overlap(bounds, &pane.world_bounds()));
        let is_near = |mesh: &u32| {
            self.meshes()[*mesh as usize].interior().is_some() && overlap(bounds, &self.mesh_bounds(*mesh))
        };
        let is_body = |mesh: &u32| is_body(&self.media().solid, self.accelerator(), self.meshes(), *mesh);
        let meshes = (0..self.meshes().len() as u32).filter(is_near).filter(is_body);
        let meshes = meshes.map(|mesh| self.media().body_of_mesh(mesh));
        panes.map(|(index, _)| index).chain(meshes).collect()
    }

    /// Whether the box around a body reaches within a distance of a point.
    pub fn is_body_near(&self, body: u32, point: DVec3, distance: f64) -> bool {
        let bounds = match self.media().mesh_of(body) {
            None => self.panes()[body as usize].world_bounds(),
            Some(mesh) => self.mesh_bounds(mesh),
        };
        overlap(&bounds, &[point - distance, point + distance])
    }

    /// Which of some bodies are around a point.
    pub fn bodies_around(&self, point: DVec3, of: &[u32]) -> Bodies {
        let is_around = |body: &&u32| match self.media().mesh_of(**body) {
            None => self.panes()[**body as usize].holds(point),
            Some(mesh) => {
                let triangles = self.meshes()[mesh as usize].triangle_range();
                overlap(&[point, point], &self.mesh_bounds(mesh)) && self.accelerator().winding(point, &triangles) > 0
            }
        };
        of.iter().filter(is_around).fold(Bodies::default(), |bodies, body| bodies.with(*body))
    }

    /// In words, the bodies that meet others; `None` where there are none.
    pub fn immersed_names(&self, most: usize) -> Option<String> {
        let immersed = (0u32..).zip(&self.media().immersed).filter(|(_, immersed)| **immersed);
        let names: Vec<String> = immersed
            .map(|(body, _)| match self.media().mesh_of(body) {
                Some(mesh) => format!("\"{}\"", self.meshes()[mesh as usize].name()),
                None => format!("\"{}\"", self.panes()[body as usize].name),
            })
            .collect();
        match names.len() {
            0 => None,
            count if count <= most => Some(names.join(", ")),
            count => Some(format!("{} and {} more", names[..most].join(", "), count - most)),
        }
    }
}
