//! The coverage rule `K(path)`: which paths a specular method owns.
//!
//! Consider a path from a vertex O that is not specular to a light. Its chain is the specular vertices between the two.
//! The method that answers for the chain owns the path. Every method says itself which chains it owns
//! ([`super::SpecularMethod::owns`]), as a function of O, the chain and the point of the light alone. The path tracer
//! leaves out the light of exactly these paths, whatever it was that sampled them, and keeps all others.
//! Light subpaths share what is left to chance (`integrator/light_subpaths`). They also share the paths of a method
//! that knows the density with which it finds them ([`super::SpecularMethod::density`]).
//!
//! `cone` and `fnee` own the chains through one pane ([`through_one_pane`]). These are exactly two transmissions, in
//! through the face that looks at O and out through the other, where
//!
//! - O does not lie between the highest and the lowest point of a face or its plane ([`PaneSide::facing`]);
//! - no segment runs along the pane (cosine at least [`GRAZING_COSINE`]).
//!
//! No method owns a path over an immersed body ([`crate::scene::media`]).

use glam::DVec3;

use super::SpecularEvent;
use super::side::{GRAZING_COSINE, PaneSide};
use crate::scene::ShadingPoint;
use crate::{
    geometry::{Face, SurfaceId},
    light::Source,
    scene::Scene,
};

/// A specular vertex that the path tracer has met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// What happened there.
    pub event: SpecularEvent,
    /// The surface: a face of a pane, or a triangle.
    pub surface: SurfaceId,
    /// Where, metres.
    pub position: DVec3,
    /// Unit direction in which the path came, away from the shading point.
    pub direction: DVec3,
}

/// A path from a shading point over specular vertices to a light, as the path tracer has found it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularPath<'a> {
    /// Index of the light in the scene.
    pub light: u32,
    /// Where on the light it comes from.
    pub source: Source,
    /// The triangle of the scene on which that is, where the light is made of such.
    pub triangle: Option<u32>,
    /// Unit direction towards the light behind the last vertex.
    pub last_direction: DVec3,
    /// The specular vertices, from the shading point on; at least one.
    pub links: &'a [Link],
}

/// The pane through which a path goes, when that is all that it meets, and steeply enough.
pub fn through_one_pane(scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>) -> Option<u32> {
    let [entry, exit] = path.links else { return None };
    let (SurfaceId::Pane { index, face: near }, SurfaceId::Pane { index: left, face: far }) =
        (entry.surface, exit.surface)
    else {
        return None;
    };
    let transmitted = [entry, exit].iter().all(|link| link.event == SpecularEvent::Transmission);
    if index != left || !transmitted || scene.media().is_immersed(index) {
        return None;
    }
    let pane = &scene.panes()[index as usize];
    let side = PaneSide::facing(pane, pane.frame.point_to_local(point.position))?;
    let directions =
        [entry.direction, exit.direction, path.last_direction].map(|world| pane.frame.vector_to_local(world));
    (near == side.near && far == side.far && steep(&side, directions)).then_some(index)
}

/// Whether a path goes to the light by way of one reflection at the face of a pane that looks at the point.
pub(super) fn off_one_pane(scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>) -> bool {
    match path.links {
        [Link { event: SpecularEvent::Reflection, surface: SurfaceId::Pane { index, face }, .. }] => {
            let frame = &scene.panes()[*index as usize].frame;
            let side = PaneSide::facing(&scene.panes()[*index as usize], frame.point_to_local(point.position));
            !scene.media().is_immersed(*index)
                && side.is_some_and(|side| side.near == *face && side.is_lit_from_here(path.source.in_frame(frame)))
        }
        _ => false,
    }
}

/// Whether the segments `directions` (towards the light, in the pane's frame) are steep enough to be owned.
pub fn steep(side: &PaneSide<'_>, directions: [DVec3; 3]) -> bool {
    directions.into_iter().all(|direction| direction.z * side.sign >= GRAZING_COSINE)
}

/// Whether a point sees this face of a pane as the near one.
pub(super) fn is_near(scene: &Scene, point: &ShadingPoint, pane: u32, face: Face) -> bool {
    let pane = &scene.panes()[pane as usize];
    PaneSide::facing(pane, pane.frame.point_to_local(point.position)).is_some_and(|side| side.near == face)
}
