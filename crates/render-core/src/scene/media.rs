//! Media: which body a place of the scene belongs to, where bodies touch, overlap or hold each other.
//!
//! Bodies are ranked (Schmidt and Budge 2002, "Simple Nested Dielectrics in Ray Traced Images"). A place belongs to the
//! highest body around it; around no body, there is air. The rank is the priority in the file, then the smaller box,
//! then the later in the file. So it is a total order, and light sees the same media both ways.
//!
//! A body is *immersed* if it meets another body, or if a light stands in a pane. Specular methods know air on the
//! outside of a body alone. They leave immersed bodies to the path tracer.

use std::sync::OnceLock;

use arrayvec::ArrayVec;
use glam::DVec3;

use super::MeshSurface;
use super::contacts::{Contacts, Finder, lit_panes};
use super::parts::SceneParts;
use crate::bsdf::Interior;
use crate::geometry::closed::is_solid;
use crate::geometry::{Accelerator, Pane};
use crate::light::Light;
use crate::settings::SceneError;

/// Most bodies around one place; more are air.
const MOST_BODIES: usize = 16;

/// What fills a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Index of refraction.
    pub index_of_refraction: f64,
    /// Absorption, per metre.
    pub absorption: DVec3,
}

impl Medium {
    /// What is around no body.
    pub const AIR: Self = Self { index_of_refraction: 1.0, absorption: DVec3::ZERO };
}

/// The bodies around a place, by their numbers: panes first, then meshes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bodies(ArrayVec<u32, MOST_BODIES>);

impl Bodies {
    /// Whether there is air.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Their numbers. Those of panes are the numbers of the panes.
    pub fn numbers(&self) -> &[u32] {
        &self.0
    }

    /// Whether the place is in a body.
    pub fn contains(&self, body: u32) -> bool {
        self.0.contains(&body)
    }

    /// The same place with a body around it.
    #[must_use]
    pub fn with(&self, body: u32) -> Self {
        let mut bodies = self.clone();
        if !bodies.contains(body) {
            // A body too many is air.
            _ = bodies.0.try_push(body);
        }
        bodies
    }

    /// The same place without a body around it.
    #[must_use]
    pub fn without(&self, body: u32) -> Self {
        let mut bodies = self.clone();
        bodies.0.retain(|known| *known != body);
        bodies
    }
}

/// The bodies of a scene.
#[derive(Debug)]
pub struct Media {
    panes: u32,
    /// For each body, what fills it and its rank; `None` for meshes that bound nothing.
    bodies: Vec<Option<(Medium, u32)>>,
    /// Whether each mesh has an inside, found when it is asked for first.
    pub(super) solid: Vec<OnceLock<bool>>,
    contacts: Contacts,
    /// For each body, those that it meets; empty where no bodies meet.
    neighbours: Vec<Vec<u32>>,
    /// For each body, whether it is immersed; empty where none is.
    pub(super) immersed: Vec<bool>,
}

impl Media {
    /// The media of a scene.
    ///
    /// # Errors
    ///
    /// A mesh without an inside in the glass of a pane.
    pub(super) fn new(
        parts: SceneParts<'_>,
        accelerator: &Accelerator,
        meshes: &[MeshSurface],
        mesh_bounds: &[[DVec3; 2]],
        lights: &[Light],
        is_light: &dyn Fn(u32) -> bool,
    ) -> Result<Self, SceneError> {
        let panes = accelerator.panes();
        let solid: Vec<OnceLock<bool>> = meshes.iter().map(|_| OnceLock::new()).collect();
        let is_body = |mesh: u32| is_body(&solid, accelerator, meshes, mesh);
        let contacts = Finder::new(accelerator, meshes, mesh_bounds, is_light, &is_body).find()?;
        let mut media = Self {
            panes: panes.len() as u32,
            bodies: ranked(parts, panes, meshes, mesh_bounds),
            neighbours: neighbours(panes.len() + meshes.len(), &contacts),
            immersed: Vec::new(),
            contacts,
            solid,
        };
        media.set_lights(panes, lights);
        Ok(media)
    }

    /// Under other lights.
    pub(super) fn set_lights(&mut self, panes: &[Pane], lights: &[Light]) {
        let mut immersed = vec![false; self.bodies.len()];
        let met = self.contacts.pairs.iter().flatten().chain(&self.contacts.shone_into).copied();
        for body in met.chain(lit_panes(panes, lights)) {
            immersed[body as usize] = true;
        }
        self.immersed = if immersed.contains(&true) { immersed } else { Vec::new() };
    }

    /// Whether any body is immersed.
    pub fn has_immersed(&self) -> bool {
        !self.immersed.is_empty()
    }

    /// Whether a body meets another one, or is a pane with a light in it.
    pub fn is_immersed(&self, body: u32) -> bool {
        self.has_immersed() && self.immersed[body as usize]
    }

    /// [`Self::is_immersed`] of a mesh.
    pub fn is_immersed_mesh(&self, mesh: u32) -> bool {
        self.is_immersed(self.body_of_mesh(mesh))
    }

    /// The number of the body that a mesh bounds.
    pub fn body_of_mesh(&self, mesh: u32) -> u32 {
        self.panes + mesh
    }

    /// The mesh that bounds a body; `None` for a pane.
    pub fn mesh_of(&self, body: u32) -> Option<u32> {
        body.checked_sub(self.panes)
    }

    /// The bodies that a body meets.
    pub fn neighbours(&self, body: u32) -> &[u32] {
        self.neighbours.get(body as usize).map_or(&[], Vec::as_slice)
    }

    /// The highest of the bodies around a place.
    pub fn highest(&self, bodies: &Bodies) -> Option<u32> {
        let rank = |body: &u32| self.bodies[*body as usize].map(|(_, rank)| rank);
        bodies.numbers().iter().copied().max_by_key(rank)
    }

    /// What fills a place.
    pub fn medium(&self, bodies: &Bodies) -> Medium {
        let highest = self.highest(bodies).and_then(|body| self.bodies[body as usize]);
        highest.map_or(Medium::AIR, |(medium, _)| medium)
    }
}

pub(super) fn is_body(solid: &[OnceLock<bool>], accelerator: &Accelerator, meshes: &[MeshSurface], mesh: u32) -> bool {
    let surface = &meshes[mesh as usize];
    let look = || is_solid(surface.triangle_range().map(|triangle| *accelerator.corners(triangle)));
    surface.interior().is_some() && *solid[mesh as usize].get_or_init(look)
}

fn neighbours(bodies: usize, contacts: &Contacts) -> Vec<Vec<u32>> {
    if contacts.pairs.is_empty() {
        return Vec::new();
    }
    let mut neighbours = vec![Vec::new(); bodies];
    for [first, second] in &contacts.pairs {
        neighbours[*first as usize].push(*second);
        neighbours[*second as usize].push(*first);
    }
    neighbours
}

/// The media of all bodies, with their ranks: the highest has the largest.
fn ranked(
    parts: SceneParts<'_>,
    panes: &[Pane],
    meshes: &[MeshSurface],
    mesh_bounds: &[[DVec3; 2]],
) -> Vec<Option<(Medium, u32)>> {
    let of_pane = |(pane, description): (&Pane, &super::description::PaneDescription)| {
        let [low, high] = pane.local_bounds();
        let (index_of_refraction, absorption) = (pane.index_of_refraction, pane.absorption);
        (
            Some(Interior { index_of_refraction, absorption, priority: description.priority }),
            (high - low).element_product(),
        )
    };
    let of_mesh =
        |(mesh, [low, high]): (&MeshSurface, &[DVec3; 2])| (mesh.interior(), (*high - *low).element_product());
    // In a scene file, the last body is the last pane.
    let panes_then_meshes: Vec<(Option<Interior>, f64)> =
        panes.iter().zip(parts.panes).map(of_pane).chain(meshes.iter().zip(mesh_bounds).map(of_mesh)).collect();
    let is_pane = |body: usize| body < panes.len();
    let mut order: Vec<usize> = (0..panes_then_meshes.len()).collect();
    order.sort_by(|a, b| {
        let priority = |body: usize| panes_then_meshes[body].0.map(|interior| interior.priority);
        let volume = |body: usize| panes_then_meshes[body].1;
        priority(*a)
            .cmp(&priority(*b))
            .then(volume(*b).total_cmp(&volume(*a)))
            .then((is_pane(*a), a).cmp(&(is_pane(*b), b)))
    });
    let mut bodies = vec![None; order.len()];
    for (rank, body) in (0u32..).zip(order) {
        bodies[body] = panes_then_meshes[body]
            .0
            .map(|Interior { index_of_refraction, absorption, .. }| (Medium { index_of_refraction, absorption }, rank));
    }
    bodies
}
