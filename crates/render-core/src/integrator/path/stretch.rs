//! The stretch of a path since its last vertex that scatters light into a solid angle: what may own its light.

use arrayvec::ArrayVec;

use crate::geometry::MOST_PASSED;
use crate::light::Receiver;
use crate::scene::ShadingPoint;
use crate::scene::visibility::Walls;
use crate::specular::Link;
use crate::specular::scope::MOST_SPECULAR_VERTICES;

/// The stretch of a path since its last diffuse vertex.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    /// The diffuse vertex; `None` before the first.
    pub(super) from: Option<Origin>,
    /// The walls that it has gone straight through since then, before any other specular vertex.
    pub(super) walls: Walls,
    /// How far it is to the last of them, metres.
    pub(super) length: f64,
    /// The specular vertices since then, but for those walls.
    pub(super) links: ArrayVec<Link, MOST_SPECULAR_VERTICES>,
    /// Whether no method owns it: of more specular vertices than any looks for, or over one that none searches.
    pub(super) is_left_to_chance: bool,
    /// Whether next event estimation finds none of it: it goes straight through what stops a shadow ray.
    pub(super) is_unseen: bool,
    /// Whether one of its specular vertices is of glass or water.
    pub(super) is_over_glass: bool,
    /// The probability of what happened at its specular vertices; 0 where light subpaths do not go its way, which are
    /// panes alone.
    pub(super) choices: f64,
}

impl Stretch {
    pub(super) fn new(from: Option<Origin>) -> Self {
        Self {
            from,
            walls: Walls::new(),
            length: 0.0,
            links: ArrayVec::new(),
            is_left_to_chance: false,
            is_unseen: false,
            is_over_glass: false,
            choices: 1.0,
        }
    }

    pub(super) fn push(&mut self, link: Link) {
        let does_not_fit = !self.walls.is_empty() || self.links.try_push(link).is_err();
        if does_not_fit {
            self.is_left_to_chance = true;
            self.choices = 0.0;
        }
    }

    /// Whether light that it meets is caustic: it has come over glass or water to a surface that scatters it.
    pub(super) fn is_caustic(&self) -> bool {
        self.from.is_some() && self.is_over_glass
    }

    /// Whether light subpaths may go its way.
    pub(super) fn is_open(&self) -> bool {
        self.choices > 0.0 && !self.is_unseen
    }

    /// Whether nothing is on it.
    pub(super) fn is_straight(&self) -> bool {
        self.is_open() && self.links.is_empty()
    }

    /// Goes straight through a wall, `distance` behind the last vertex. No method searches it.
    pub(super) fn pass(&mut self, triangle: u32, wall: Link, distance: f64) {
        self.choices = 0.0;
        if self.links.is_empty() && self.walls.len() < MOST_PASSED {
            self.walls.push(triangle);
            self.length += distance;
        } else {
            self.push(wall);
            self.is_left_to_chance = true;
        }
    }
}

/// The diffuse vertex at which a stretch begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Origin {
    pub(super) point: ShadingPoint,
    /// How it has asked for light.
    pub(super) receiver: Receiver,
    /// The BSDF's density per solid angle with which the stretch's first direction was drawn.
    pub(super) pdf: f64,
    /// Whether light from specular surfaces is gathered on both of its sides.
    pub(super) gathers_behind: bool,
    /// The cosine of that direction.
    pub(super) cosine: f64,
    /// What light subpaths find of the path up to there.
    pub(super) by_light: f64,
}
