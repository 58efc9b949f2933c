//! Which panes light can come through at all: a tree over the panes of a scene that leaves out most of them at once.
//!
//! A pane bends light by a bounded angle. So light can come through a pane only if the directions from point to pane
//! and from pane to light are nearly the same. Let n be the index of a pane whose faces have slopes of at most s1 and
//! s2. Then the tangential part of a ray's direction changes by at most `D = sqrt(n^2 - 1) (s1 + s2)`. The part along
//! the normal follows. All angles are compared as chords between unit vectors, which add up like them or to less.
//!
//! Where a pane mirrors light, a normal of its face halves the angle between the directions to the point and to the
//! light. So their sum has a tangential part of at most the largest slope times its part along the pane's normal. Over
//! a ball around the pane the sum hardly varies.

use glam::{DVec2, DVec3};
use smallvec::{SmallVec, smallvec};

use crate::{
    geometry::{Face, Pane},
    light::{Light, LightBounds, Source},
};

/// Panes for which no memory is allocated.
const USUAL_PANES: usize = 8;

/// Numbers of panes.
pub(crate) type Panes = SmallVec<[u32; USUAL_PANES]>;

/// Normals whose chord is shorter are the same.
const SAME_NORMAL: f64 = 1e-9;

/// Room for rounding in a comparison of chords.
const SLACK: f64 = 1e-9;

/// Room for the inexactness of vertices at which light is mirrored, which are solved for, in a comparison of chords.
const MIRROR_SLACK: f64 = 1e-6;

/// A tree over the panes of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct PaneTree {
    /// Each node comes before its children.
    nodes: Vec<Node>,
}

#[derive(Clone, Debug)]
struct Node {
    /// A ball around all panes.
    centre: DVec3,
    radius: f64,
    /// The normal of all panes, when it is the same.
    normal: Option<DVec3>,
    /// Largest change of the tangential part of a direction.
    change: f64,
    /// Largest slope of a face.
    slope: f64,
    content: Content,
}

#[derive(Clone, Debug)]
enum Content {
    Pane(u32),
    Children([usize; 2]),
}

/// Where light comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LightRegion {
    /// Unit vectors within a chord of a direction.
    Cap { direction: DVec3, chord: f64 },
    /// Points in a ball.
    Ball { centre: DVec3, radius: f64 },
}

impl LightRegion {
    /// A light point or direction.
    pub(crate) fn of_source(source: Source) -> Self {
        match source {
            Source::Point(centre) => Self::Ball { centre, radius: 0.0 },
            Source::Direction(direction) => Self::Cap { direction, chord: 0.0 },
        }
    }

    /// A whole light.
    pub(crate) fn of_light(light: &Light) -> Self {
        match light.bounds() {
            LightBounds::Cap { direction, sin_radius } => Self::Cap { direction, chord: cap_chord(sin_radius) },
            LightBounds::Ball { centre, radius } => Self::Ball { centre, radius },
            LightBounds::Everywhere => Self::Cap { direction: DVec3::Z, chord: 2.0 },
        }
    }

    /// The direction towards it from the middle of a ball, and the longest chord between that and the direction from
    /// another point of the ball; `None` when they may meet.
    fn seen_from_ball(&self, middle: DVec3, ball_radius: f64) -> Option<(DVec3, f64)> {
        match *self {
            Self::Cap { direction, chord } => Some((direction, chord)),
            Self::Ball { centre, radius } => {
                let offset = centre - middle;
                let distance = offset.length();
                (distance > ball_radius + radius)
                    .then(|| (offset / distance, cap_chord((ball_radius + radius) / distance)))
            }
        }
    }
}

impl PaneTree {
    /// The tree over the panes.
    pub(crate) fn new(panes: &[Pane]) -> Self {
        let mut tree = Self::default();
        let mut leaves: Vec<Node> = (0u32..).zip(panes).map(|(index, pane)| Node::of_pane(index, pane)).collect();
        if !leaves.is_empty() {
            tree.add(&mut leaves);
        }
        tree
    }

    /// Adds a tree over the leaves, and returns its root.
    fn add(&mut self, leaves: &mut [Node]) -> usize {
        let root = self.nodes.len();
        if let [leaf] = leaves {
            self.nodes.push(leaf.clone());
            return root;
        }
        let (min, max) = leaves.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), leaf| {
            (min.min(leaf.centre), max.max(leaf.centre))
        });
        let axis = (max - min).max_position();
        let middle = leaves.len() / 2;
        leaves.select_nth_unstable_by(middle, |a, b| a.centre[axis].total_cmp(&b.centre[axis]));
        let centre = (min + max) * 0.5;
        let radius = leaves.iter().map(|leaf| (leaf.centre - centre).length() + leaf.radius).fold(0.0, f64::max);
        let normal = leaves[0].normal.filter(|first| {
            leaves.iter().all(|leaf| leaf.normal.is_some_and(|normal| (normal - *first).length() < SAME_NORMAL))
        });
        let change = leaves.iter().map(|leaf| leaf.change).fold(0.0, f64::max);
        let slope = leaves.iter().map(|leaf| leaf.slope).fold(0.0, f64::max);
        self.nodes.push(Node { centre, radius, normal, change, slope, content: Content::Children([0; 2]) });
        let (first, second) = leaves.split_at_mut(middle);
        let children = [self.add(first), self.add(second)];
        self.nodes[root].content = Content::Children(children);
        root
    }

    /// The panes through which light of `region` may come to the shading point `from`, in ascending order.
    pub(crate) fn candidates(&self, from: DVec3, region: &LightRegion) -> Panes {
        self.panes_where(|node| node.may_show(from, region))
    }

    /// The panes whose outside may mirror light of `region` to the shading point `from`, in ascending order.
    pub(crate) fn mirrors(&self, from: DVec3, region: &LightRegion) -> Panes {
        self.panes_where(|node| node.may_mirror(from, region))
    }

    /// The panes of which something is true, in ascending order: what is not true of a node is true of no pane in it.
    fn panes_where(&self, may: impl Fn(&Node) -> bool) -> Panes {
        let mut found = Panes::new();
        let mut stack: SmallVec<[usize; 2 * USUAL_PANES]> = smallvec![0];
        while let Some(node) = stack.pop().and_then(|index| self.nodes.get(index)) {
            if !may(node) {
                continue;
            }
            match node.content {
                Content::Pane(index) => found.push(index),
                Content::Children(children) => stack.extend(children),
            }
        }
        found.sort_unstable();
        found
    }
}

impl Node {
    fn of_pane(index: u32, pane: &Pane) -> Self {
        let [low, high] = pane.local_bounds();
        let middle = (low + high) * 0.5;
        let across = |corner: &DVec2| (*corner - middle.truncate()).length_squared();
        let across = pane.outline.corners().iter().map(across).fold(0.0, f64::max);
        let slope = |face| {
            let [x, y] = pane.bounds(face).gradient.map(|slope| slope.magnitude());
            (x * x + y * y).sqrt()
        };
        let n = pane.index_of_refraction;
        let slopes = [slope(Face::Front), slope(Face::Back)];
        Self {
            centre: pane.frame.point_to_world(middle),
            radius: (across + (high.z - middle.z) * (high.z - middle.z)).sqrt(),
            normal: Some(pane.frame.vector_to_world(DVec3::Z)),
            change: (n * n - 1.0).max(0.0).sqrt() * (slopes[0] + slopes[1]),
            slope: slopes[0].max(slopes[1]),
            content: Content::Pane(index),
        }
    }

    fn may_show(&self, from: DVec3, region: &LightRegion) -> bool {
        let offset = self.centre - from;
        let distance = offset.length();
        if distance <= self.radius {
            return true;
        }
        let Some((onwards, spread)) = region.seen_from_ball(self.centre, self.radius) else { return true };
        let direction = offset / distance;
        let sine = self.radius / distance;
        (direction - onwards).length() <= cap_chord(sine) + self.deflection(direction, sine) + spread + SLACK
    }

    fn may_mirror(&self, from: DVec3, region: &LightRegion) -> bool {
        let offset = from - self.centre;
        let distance = offset.length();
        if distance <= self.radius {
            return true;
        }
        let Some(normal) = self.normal else { return true };
        let Some((onwards, spread)) = region.seen_from_ball(self.centre, self.radius) else { return true };
        let sum = offset / distance + onwards;
        let slack = cap_chord(self.radius / distance) + spread + MIRROR_SLACK;
        let along = sum.dot(normal);
        let across = (sum - normal * along).length();
        across - slack <= self.slope * (along.abs() + slack)
    }

    /// The longest chord between the directions of a ray before and behind one of the panes, when it meets it within a
    /// cap of the given sine around `direction`.
    fn deflection(&self, direction: DVec3, sine: f64) -> f64 {
        let change = self.change;
        let at_worst = (change * change + 2.0 * change).sqrt();
        let Some(normal) = self.normal else { return at_worst };
        let along = direction.dot(normal).abs();
        let across = (1.0 - along * along).max(0.0).sqrt();
        if along <= sine {
            return at_worst;
        }
        let tangential = across * (1.0 - sine * sine).sqrt() + along * sine + change;
        if tangential >= 1.0 {
            return at_worst;
        }
        let steepness = tangential / (1.0 - tangential * tangential).sqrt();
        (change * (1.0 + steepness * steepness).sqrt()).min(at_worst)
    }
}

/// The chord between the axis of a cap and its rim, from the sine of its angular radius; the diameter where there is no
/// such angle.
fn cap_chord(sine: f64) -> f64 {
    if sine < 1.0 { (2.0 - 2.0 * (1.0 - sine * sine).sqrt()).max(0.0).sqrt() } else { 2.0 }
}

#[cfg(test)]
mod tests {
    use glam::dvec2;

    use super::*;
    use crate::{
        geometry::{
            Frame, Ray,
            testing::{Glass, rectangular},
        },
        specular::{
            side::{PaneSide, unit_normal},
            testing::{between, pair, random},
        },
    };
    use clerestory_film::counters::Counters;

    /// A wall of panes in one plane, and some that hang about.
    fn panes() -> Vec<Pane> {
        let mut random = random(23);
        let size = dvec2(0.3, 0.24);
        let pane = |frame: Frame, amplitude: f64| {
            let faces = [0.3, 1.9].map(|phase| Glass::Bumpy.face(size, amplitude, phase));
            rectangular(frame, size, 0.003, 1.5, DVec3::ZERO, faces)
        };
        let in_wall = |index: i32| {
            let centre = DVec3::new(f64::from(index % 8) * 0.32, f64::from(index / 8) * 0.26, 0.0);
            pane(Frame::new(centre, DVec3::X, DVec3::Y), 0.1e-3)
        };
        let mut panes: Vec<Pane> = (0..32).map(in_wall).collect();
        for _ in 0..16 {
            let z = (pair(&mut random) - 0.5).extend(between(&mut random, -0.5, 0.5)).normalize();
            let mut frame = Frame::around(z);
            frame.origin = pair(&mut random).extend(between(&mut random, 0.5, 2.0)) * 2.0;
            panes.push(pane(frame, 0.6e-3));
        }
        panes
    }

    #[test]
    fn no_pane_through_which_light_comes_is_left_out_and_most_others_are() {
        let panes = panes();
        let tree = PaneTree::new(&panes);
        let mut random = random(24);
        let (mut traced, mut kept) = (0, 0);
        for _ in 0..4000 {
            let index = (random.next_f64() * panes.len() as f64) as usize;
            let pane = &panes[index];
            let from = (pair(&mut random) * 3.0 - 0.5).extend(between(&mut random, -6.0, 6.0));
            let target = ((pair(&mut random) - 0.5) * pane.size()).extend(0.0);
            let origin = pane.frame.point_to_local(from);
            let Some(side) = PaneSide::facing(pane, origin) else { continue };
            let ray = Ray::new(origin, (target - origin).normalize());
            let Some(through) = side.transmit(&ray, &mut Counters::default()) else { continue };
            let direction = pane.frame.vector_to_world(through.direction);
            let exit = pane.frame.point_to_world(through.exit);
            traced += 1;
            for source in
                [Source::Direction(direction), Source::Point(exit + direction * between(&mut random, 0.1, 20.0))]
            {
                let candidates = tree.candidates(from, &LightRegion::of_source(source));
                assert!(candidates.contains(&(index as u32)), "pane {index} from {from} for {source:?}");
                assert!(candidates.is_sorted());
                kept += candidates.len();
            }
        }
        assert!(traced > 1000, "only {traced} rays came through");
        assert!(kept < 2 * traced * panes.len() / 2, "{kept} candidates for {traced} rays");
    }

    #[test]
    fn no_pane_that_mirrors_light_is_left_out_and_most_others_are() {
        let panes = panes();
        let tree = PaneTree::new(&panes);
        let mut random = random(25);
        let (mut mirrored, mut kept) = (0, 0);
        for _ in 0..4000 {
            let index = (random.next_f64() * panes.len() as f64) as usize;
            let pane = &panes[index];
            let from = (pair(&mut random) * 3.0 - 0.5).extend(between(&mut random, -6.0, 6.0));
            let origin = pane.frame.point_to_local(from);
            let Some(side) = PaneSide::facing(pane, origin) else { continue };
            let place = (pair(&mut random) - 0.5) * pane.size();
            let jet = side.near_surface().jet(place);
            let vertex = place.extend(side.near_base() + jet.height);
            let normal = unit_normal(jet.gradient);
            let towards = (vertex - origin).normalize();
            let direction = pane.frame.vector_to_world(towards - normal * (2.0 * towards.dot(normal)));
            let vertex = pane.frame.point_to_world(vertex);
            mirrored += 1;
            for source in
                [Source::Direction(direction), Source::Point(vertex + direction * between(&mut random, 0.1, 20.0))]
            {
                let mirrors = tree.mirrors(from, &LightRegion::of_source(source));
                assert!(mirrors.contains(&(index as u32)), "pane {index} from {from} for {source:?}");
                assert!(mirrors.is_sorted());
                kept += mirrors.len();
            }
        }
        assert!(mirrored > 3000, "only {mirrored} reflections");
        println!("{} of {} panes are kept", kept / (2 * mirrored), panes.len());
        assert!(kept < 2 * mirrored * panes.len() / 2, "{kept} candidates for {mirrored} reflections");
    }

    #[test]
    fn a_scene_without_panes_has_no_candidates() {
        let region = LightRegion::of_source(Source::Direction(DVec3::Z));
        assert!(PaneTree::new(&[]).candidates(DVec3::ZERO, &region).is_empty());
        assert!(PaneTree::new(&[]).mirrors(DVec3::ZERO, &region).is_empty());
    }
}
