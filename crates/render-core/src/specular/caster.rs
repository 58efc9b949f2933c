//! Casters: the panes and the specular meshes of a scene, as the first thing that a chain of specular vertices meets.

use glam::DVec3;

use super::side::PaneSide;
use super::{Link, coverage};
use crate::scene::ShadingPoint;
use crate::{
    geometry::{Face, Hit, PaneBoundary, Ray, Surface, SurfaceId},
    scene::Scene,
};
use clerestory_film::TrialStream;
use clerestory_film::counters::Counters;

/// A specular thing, by its index in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Caster {
    /// A pane.
    Pane(u32),
    /// A specular mesh.
    Mesh(u32),
}

/// A caster, as seen from a shading point.
#[derive(Clone, Copy, Debug)]
pub(super) enum SeenCaster {
    /// The face of a pane that looks at the point.
    Face { pane: u32, face: Face },
    /// A mesh.
    Mesh(u32),
}

/// All casters of a scene: panes first, then meshes. Immersed bodies are none.
pub(super) fn casters(scene: &Scene) -> impl Iterator<Item = Caster> {
    let panes = (0u32..).zip(scene.panes()).map(|(index, _)| Caster::Pane(index));
    let meshes = (0u32..).zip(scene.meshes()).filter(|(_, mesh)| mesh.is_specular());
    let all = panes.chain(meshes.map(|(index, _)| Caster::Mesh(index)));
    all.filter(|caster| !caster.is_immersed(scene))
}

impl Caster {
    /// Whether it meets another body, so that no method searches it.
    pub(super) fn is_immersed(self, scene: &Scene) -> bool {
        match self {
            Self::Pane(pane) => scene.media().is_immersed(pane),
            Self::Mesh(mesh) => scene.media().is_immersed_mesh(mesh),
        }
    }

    /// The caster on which a chain begins.
    pub(super) fn of(scene: &Scene, first: &Link) -> Option<Self> {
        match first.surface {
            SurfaceId::Pane { index, .. } => Some(Self::Pane(index)),
            SurfaceId::Triangle(triangle) => Some(Self::Mesh(scene.mesh_of(triangle))),
            SurfaceId::Nothing => None,
        }
    }

    /// The caster to which a surface belongs.
    pub(super) fn of_surface(scene: &Scene, surface: &Surface) -> Option<Self> {
        match surface {
            Surface::Pane { index, .. } => Some(Self::Pane(*index)),
            Surface::Triangle { index, .. } => {
                let mesh = scene.mesh_of(*index);
                scene.meshes()[mesh as usize].is_specular().then_some(Self::Mesh(mesh))
            }
        }
    }

    /// The caster from a shading point; `None` where no chain that begins on it is owned.
    pub(super) fn seen_from(self, scene: &Scene, point: &ShadingPoint) -> Option<SeenCaster> {
        match self {
            Self::Pane(pane) => {
                let geometry = &scene.panes()[pane as usize];
                let origin = geometry.frame.point_to_local(point.position);
                let side = PaneSide::facing(geometry, origin)?;
                let above = side.rises_above(origin, geometry.frame.vector_to_local(point.normal));
                above.then_some(SeenCaster::Face { pane, face: side.near })
            }
            Self::Mesh(mesh) => {
                let [low, high] = scene.mesh_bounds(mesh);
                let highest = DVec3::select(point.normal.cmpgt(DVec3::ZERO), high, low);
                ((highest - point.position).dot(point.normal) > 0.0).then_some(SeenCaster::Mesh(mesh))
            }
        }
    }

    /// Whether a chain that begins with `first` is one that begins on the caster as seen from the point.
    pub(super) fn owns(self, scene: &Scene, point: &ShadingPoint, first: &Link) -> bool {
        match first.surface {
            SurfaceId::Pane { index, face } => {
                Self::Pane(index) == self && coverage::is_near(scene, point, index, face)
            }
            SurfaceId::Triangle(triangle) => Self::Mesh(scene.mesh_of(triangle)) == self,
            SurfaceId::Nothing => false,
        }
    }
}

impl SeenCaster {
    /// A point on it, uniform over its area (over the plane of a pane).
    pub(super) fn sample(&self, scene: &Scene, random: &mut TrialStream, counters: &mut Counters) -> Option<DVec3> {
        match *self {
            Self::Face { pane, face } => {
                let pane = &scene.panes()[pane as usize];
                let place = pane.outline.sample(glam::DVec2::new(random.next_f64(), random.next_f64()));
                counters.height_evaluations += 1;
                let height = pane.base_height(face) + pane.surface(face).height(place);
                Some(pane.frame.point_to_world(place.extend(height)))
            }
            Self::Mesh(mesh) => {
                let random = [random.next_f64(), random.next_f64(), random.next_f64()];
                scene.sample_mesh(mesh, random)
            }
        }
    }

    /// The nearest point at which a chain can go through a pane, to one of its near face's plane that is beside it or
    /// so near to its border that what enters there leaves by the edge; `None` where there is no other.
    pub(super) fn brought_within(&self, scene: &Scene, target: DVec3) -> Option<DVec3> {
        let Self::Face { pane, .. } = *self else { return None };
        let pane = &scene.panes()[pane as usize];
        let local = pane.frame.point_to_local(target);
        let within = pane.outline.nearest(local.truncate(), pane.thickness);
        (within != local.truncate()).then(|| pane.frame.point_to_world(within.extend(local.z)))
    }

    /// What a ray from the shading point meets first, if that belongs to it.
    pub(super) fn first_hit(
        &self,
        scene: &Scene,
        ray: &Ray,
        ray_origin: SurfaceId,
        counters: &mut Counters,
    ) -> Option<Hit> {
        let accelerator = scene.accelerator().solid();
        let holds = |surface: &Surface| match (self, surface) {
            (Self::Face { face, .. }, Surface::Pane { hit, .. }) => hit.boundary == PaneBoundary::Face(*face),
            (Self::Mesh(mesh), Surface::Triangle { index, .. }) => scene.mesh_of(*index) == *mesh,
            _ => false,
        };
        let hit = match *self {
            Self::Face { pane, .. } => accelerator.closest_hit_on_pane(pane, ray, f64::INFINITY, ray_origin, counters),
            Self::Mesh(_) => accelerator.closest_hit(ray, f64::INFINITY, ray_origin, counters),
        };
        hit.filter(|hit| holds(&hit.surface))
    }
}
