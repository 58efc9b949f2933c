//! A path among bodies that touch, overlap or hold each other: it knows all bodies around it.
//!
//! A boundary of a body is an interface between the medium of the place before it and that of the place behind it. If a
//! higher body is around both, or both media are equal, the path goes straight on.
//!
//! Where one body ends within `contact::RIM` of the place where the next one begins, a film of what is around both lies
//! between them. Between panes that lie on each other it is air. Light that is reflected within the film is summed. So
//! such a place is one vertex, wherever rounding puts the two faces.

use glam::DVec3;

use crate::bsdf::fresnel::{Refraction, refract};
use crate::bsdf::polarisation::{Fresnel, Mueller};
use crate::geometry::contact::{NOWHERE, join};
use crate::geometry::{Ray, SurfaceId};
use crate::scene::Scene;
use crate::scene::media::{Bodies, Medium};

/// Most boundaries that a path goes straight through; by rounding, there might be no end of them.
pub(super) const MOST_STRAIGHT: u32 = 10_000;

/// A film is looked for no further along a ray than `contact::RIM` over this.
pub(super) const LEAST_COSINE: f64 = 0.01;

/// The bodies around the camera, or those that may be around a ray of it.
#[derive(Debug)]
pub(super) enum Start {
    /// Around all rays, and what absorbs light there.
    Same(Around, DVec3),
    /// Different ones around each ray, of these.
    Of(Vec<u32>),
}

impl Start {
    pub(super) fn of(scene: &Scene) -> Self {
        let aperture = scene.camera().aperture();
        let bounds = aperture.iter().fold(NOWHERE, |bounds, corner| join(bounds, [*corner, *corner]));
        let near = scene.bodies_near(&bounds);
        if near.is_empty() || aperture.len() == 1 {
            let (around, absorbs) = Around::at(scene, bounds[0], &near);
            return Self::Same(around, absorbs);
        }
        Self::Of(near)
    }

    /// The bodies around the start of a ray, and what absorbs light there.
    pub(super) fn around(&self, scene: &Scene, ray: &Ray) -> (Around, DVec3) {
        match self {
            Self::Same(around, absorbs) => (around.clone(), *absorbs),
            Self::Of(near) => Around::at(scene, ray.origin, near),
        }
    }
}

/// The bodies around a ray, and what it has left.
#[derive(Clone, Debug, Default)]
pub(super) struct Around {
    /// Meshes are among them only if they are immersed.
    pub(super) bodies: Bodies,
    /// The face behind the film that the ray leaves.
    pub(super) second: Option<SurfaceId>,
    /// The pane that it has left by the edge.
    pub(super) left: Option<u32>,
    /// Boundaries that it has gone straight through.
    pub(super) passed: u32,
}

impl Around {
    fn at(scene: &Scene, point: DVec3, near: &[u32]) -> (Self, DVec3) {
        let all = scene.bodies_around(point, near);
        let absorbs = scene.media().medium(&all).absorption;
        // A path finds its way through a mesh that stands apart by its surface alone.
        let is_tracked = |body: &&u32| scene.media().mesh_of(**body).is_none() || scene.media().is_immersed(**body);
        let tracked = all.numbers().iter().filter(is_tracked);
        let bodies = tracked.fold(Bodies::default(), |bodies, body| bodies.with(*body));
        (Self { bodies, ..Self::default() }, absorbs)
    }

    /// Whether no body that meets others is around the ray.
    pub(super) fn is_air(&self) -> bool {
        self.bodies.is_empty()
    }

    pub(super) fn bodies(&self) -> &Bodies {
        &self.bodies
    }

    /// A new vertex: the ray starts on that alone.
    pub(super) fn leave_surface(&mut self) {
        (self.second, self.left) = (None, None);
    }
}

/// A boundary of a body on the way of a path.
pub(super) enum Meeting {
    /// Nothing that concerns media.
    Plain,
    /// A path goes straight on to these bodies.
    Straight(Bodies),
    /// The edge of a pane.
    Black,
    /// The face of a pane, or two faces with a film between them.
    Face(Interface),
    /// A mesh.
    Surface(Interface),
}

/// A boundary between two media.
pub(super) struct Interface {
    pub(super) media: [Medium; 2],
    /// The bodies on both sides.
    pub(super) before: Bodies,
    pub(super) behind: Bodies,
    pub(super) film: Option<Film>,
}

/// A film between two faces.
pub(super) struct Film {
    pub(super) medium: Medium,
    /// The other face.
    pub(super) second: SurfaceId,
}

impl Interface {
    /// The index of refraction on the inside of the body over that on its outside.
    pub(super) fn ratio(&self) -> f64 {
        let [before, behind] = self.media.map(|medium| medium.index_of_refraction);
        if self.behind.numbers().len() > self.before.numbers().len() { behind / before } else { before / behind }
    }

    pub(super) fn behind(&self) -> Medium {
        self.media[1]
    }

    pub(super) fn bodies_behind(&self) -> &Bodies {
        &self.behind
    }

    pub(super) fn into_behind(self) -> Around {
        Around { bodies: self.behind, ..Around::default() }
    }

    /// What it does to light: the direction behind it with what is transmitted, and what is reflected.
    pub(super) fn scattering(&self, direction: DVec3, normal: DVec3) -> (Option<(DVec3, Mueller)>, Mueller) {
        let [before, behind] = self.media.map(|medium| medium.index_of_refraction);
        let total = (None, Fresnel::TOTAL.reflection());
        let Some(Film { medium, .. }) = &self.film else {
            let Some(Refraction { direction, fresnel }) = refract(direction, normal, before, behind) else {
                return total;
            };
            return (Some((direction, fresnel.transmission())), fresnel.reflection());
        };
        let within = medium.index_of_refraction;
        let Some(first) = refract(direction, normal, before, within) else { return total };
        let Some(second) = refract(first.direction, normal, within, behind) else { return total };
        let [through, back] = first.fresnel.film(&second.fresnel);
        (Some((second.direction, through)), back)
    }
}
