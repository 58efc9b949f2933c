//! Which panes light can come through at all: a tree over the panes of a scene that leaves out most of them at once.
//!
//! A pane bends light by a bounded angle. Let g1 and g2 be the gradients of its faces. Let a and w be the directions of
//! a ray before and behind it, and a_t and w_t their parts along the pane. Then `w_t - a_t = k2 g2 - k1 g1`. The
//! strengths k depend on the index and on the angle of incidence alone. So the direction from the point to the pane,
//! bent like this, is nearly that from the pane to the light. Small panes bend all light nearly alike, so this leaves
//! few of them. All angles are compared as chords between unit vectors, which add up like them or to less.
//!
//! Where a pane mirrors light, a normal of its face halves the angle between the directions to the point and to the
//! light. So their sum has a tangential part of at most the largest slope times its part along the pane's normal. Over
//! a ball around the pane the sum hardly varies.
//!
//! Where a second pane stands close behind a pane, the direction between both takes the place of w. The second pane
//! bounds by how much it is off.
//!
//! Light never comes through a pane from the point's side of it, nor is it mirrored from the other side. That leaves
//! out whole walls at once.

use glam::{DVec2, DVec3};
use smallvec::{SmallVec, smallvec};

use super::looks::Looks;
use crate::geometry::{Face, Pane};
use crate::light::{Light, LightBounds, Source};
use crate::math::Interval;

/// Panes for which no memory is allocated.
const USUAL_PANES: usize = 8;

/// Numbers of panes.
pub(crate) type Panes = SmallVec<[u32; USUAL_PANES]>;

/// Panes whose normals differ by more than this along an axis are taken to stand in different walls.
const OTHER_WALL: f64 = 0.5;

/// Room for rounding in a comparison of chords.
const SLACK: f64 = 1e-9;

/// Room for the inexactness of vertices at which light is mirrored, which are solved for, in a comparison of chords.
const MIRROR_SLACK: f64 = 1e-6;

/// A normal that is off by a chord turns what is along the pane by as much, twice over, and by its square.
const TILTED: f64 = 3.0;

/// A tree over the panes of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct PaneTree {
    /// Each node comes before its children.
    nodes: Vec<Node>,
}

#[derive(Clone, Debug)]
struct Node {
    /// All panes.
    place: Ball,
    /// Their unit normals.
    normals: Ball,
    /// Where they are along the middle of these normals.
    heights: Interval,
    /// Gradients of the back face less those of the front face, in the world.
    bends: Ball,
    /// Largest slope of a face, and largest sum of those of both faces.
    slope: f64,
    slopes: f64,
    /// Smallest and largest index of refraction.
    index: [f64; 2],
    beyond: Beyond,
    content: Content,
}

/// What a second pane close behind a pane may do to light, at most.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Beyond {
    /// By how much the tangential part of a direction may change there.
    pub(crate) change: f64,
    /// By how much its normal is off that of the first pane, or of its other side, as a chord.
    pub(crate) tilt: f64,
    /// Its thickness, metres.
    pub(crate) thickness: f64,
    /// How far light may travel between both, metres.
    pub(crate) apart: f64,
}

impl Beyond {
    /// What either may do.
    pub(crate) fn or(&self, other: &Self) -> Self {
        Self {
            change: self.change.max(other.change),
            tilt: self.tilt.max(other.tilt),
            thickness: self.thickness.max(other.thickness),
            apart: self.apart.max(other.apart),
        }
    }

    /// By how much it moves light along the pane, at most: up to 71 degrees, three times its thickness.
    pub(crate) fn displacement(&self) -> f64 {
        3.0 * self.thickness
    }

    /// How far apart directions before and behind it may be, as a chord: at grazing angles, the part along the normal
    /// changes most.
    fn chord(&self) -> f64 {
        (self.change * self.change + 2.0 * self.change).sqrt()
    }

    /// How far apart the parts of these directions along the first pane may be.
    fn along(&self) -> f64 {
        self.change + TILTED * self.tilt * self.chord()
    }

    /// Where light comes from, as far as it is not turned: what it is moved, and what its way to the second pane comes
    /// to.
    fn widened(&self, region: &LightRegion) -> LightRegion {
        match *region {
            LightRegion::Cap { .. } => *region,
            LightRegion::Ball { centre, radius } => {
                let chord = self.chord();
                LightRegion::Ball { centre, radius: radius + 2.0 * self.displacement() + self.apart * chord * chord }
            }
        }
    }
}

/// A ball around points.
#[derive(Clone, Copy, Debug)]
struct Ball {
    centre: DVec3,
    radius: f64,
}

impl Ball {
    /// A ball around balls, about the middle of their centres.
    fn around(balls: impl Iterator<Item = Self> + Clone) -> Self {
        let (min, max) = balls.clone().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), ball| {
            (min.min(ball.centre), max.max(ball.centre))
        });
        let centre = (min + max) * 0.5;
        let radius = balls.map(|ball| (ball.centre - centre).length() + ball.radius).fold(0.0, f64::max);
        Self { centre, radius }
    }
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
    pub(crate) fn seen_from_ball(&self, middle: DVec3, ball_radius: f64) -> Option<(DVec3, f64)> {
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
        Self::over((0u32..).zip(panes).map(|(index, pane)| (index, pane, Beyond::default())))
    }

    /// A tree over some panes, by their numbers, and what is behind each.
    pub(crate) fn over<'a>(panes: impl Iterator<Item = (u32, &'a Pane, Beyond)>) -> Self {
        let mut tree = Self::default();
        let mut leaves: Vec<Node> = panes.map(|(index, pane, beyond)| Node::of_pane(index, pane, beyond)).collect();
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
        let middle = split(leaves);
        let largest = |part: fn(&Node) -> f64| leaves.iter().map(part).fold(f64::NEG_INFINITY, f64::max);
        let normals = Ball::around(leaves.iter().map(|leaf| leaf.normals));
        let heights = leaves.iter().map(|leaf| leaf.heights_along(normals.centre));
        self.nodes.push(Node {
            place: Ball::around(leaves.iter().map(|leaf| leaf.place)),
            normals,
            heights: heights.fold(Interval::EMPTY, |all, leaf| all.union(leaf)),
            bends: Ball::around(leaves.iter().map(|leaf| leaf.bends)),
            slope: largest(|leaf| leaf.slope),
            slopes: largest(|leaf| leaf.slopes),
            index: [-largest(|leaf| -leaf.index[0]), largest(|leaf| leaf.index[1])],
            beyond: leaves.iter().fold(Beyond::default(), |most, leaf| most.or(&leaf.beyond)),
            content: Content::Children([0; 2]),
        });
        let (first, second) = leaves.split_at_mut(middle);
        let children = [self.add(first), self.add(second)];
        self.nodes[root].content = Content::Children(children);
        root
    }

    /// The panes through which light of `region` may come to the shading point `from`, in ascending order.
    pub(crate) fn candidates(&self, from: DVec3, region: &LightRegion) -> Panes {
        self.panes_where(|node| node.may_show(from, region))
    }

    /// The panes whose outside may mirror light of `region`, on the point's side of them, to the shading point `from`,
    /// in ascending order.
    pub(crate) fn mirrors(&self, from: DVec3, region: &LightRegion) -> Panes {
        self.panes_where(|node| node.may_mirror(from, region))
    }

    /// The panes of which something is true, in ascending order: what is not true of a node is true of no pane in it.
    fn panes_where(&self, may: impl Fn(&Node) -> bool) -> Panes {
        let (mut found, mut visited) = (Panes::new(), 0);
        let mut stack: SmallVec<[usize; 2 * USUAL_PANES]> = smallvec![0];
        while let Some(node) = stack.pop().and_then(|index| self.nodes.get(index)) {
            visited += 1;
            if !may(node) {
                continue;
            }
            match node.content {
                Content::Pane(index) => found.push(index),
                Content::Children(children) => stack.extend(children),
            }
        }
        Looks::count(|looks| looks.nodes += visited);
        found.sort_unstable();
        found
    }
}

/// Sorts leaves into two parts, and returns the number of those in the first: panes of different walls, or else of
/// different places.
fn split(leaves: &mut [Node]) -> usize {
    let extent = |part: fn(&Node) -> DVec3| {
        let (min, max) = leaves
            .iter()
            .map(part)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), place| (min.min(place), max.max(place)));
        let axis = (max - min).max_position();
        (axis, min[axis], max[axis])
    };
    let (axis, min, max) = extent(|leaf| leaf.normals.centre);
    if max - min > OTHER_WALL {
        let between = 0.5 * (min + max);
        leaves.sort_unstable_by(|a, b| a.normals.centre[axis].total_cmp(&b.normals.centre[axis]));
        return leaves.partition_point(|leaf| leaf.normals.centre[axis] < between);
    }
    let (axis, ..) = extent(|leaf| leaf.place.centre);
    let middle = leaves.len() / 2;
    leaves.select_nth_unstable_by(middle, |a, b| a.place.centre[axis].total_cmp(&b.place.centre[axis]));
    middle
}

impl Node {
    fn of_pane(index: u32, pane: &Pane, beyond: Beyond) -> Self {
        let [low, high] = pane.local_bounds();
        let middle = (low + high) * 0.5;
        let across = |corner: &DVec2| (*corner - middle.truncate()).length_squared();
        let across = pane.outline.corners().iter().map(across).fold(0.0, f64::max);
        let gradients = [Face::Front, Face::Back].map(|face| pane.bounds(face).gradient);
        let slopes = gradients.map(|gradient| DVec2::from(gradient.map(|part| part.magnitude())).length());
        let middle_of = |bounds: &[Interval; 2]| DVec2::from(bounds.map(|part| 0.5 * (part.min + part.max)));
        let reach_of = |bounds: &[Interval; 2]| DVec2::from(bounds.map(|part| 0.5 * (part.max - part.min)));
        let [front, back] = &gradients;
        let bend = (middle_of(back) - middle_of(front)).extend(0.0);
        let height = high.z - middle.z;
        let (centre, normal) = (pane.frame.point_to_world(middle), pane.frame.vector_to_world(DVec3::Z));
        let along = centre.dot(normal);
        Self {
            place: Ball { centre, radius: (across + height * height).sqrt() },
            normals: Ball { centre: normal, radius: 0.0 },
            heights: Interval::new(along - height, along + height),
            bends: Ball {
                centre: pane.frame.vector_to_world(bend),
                radius: (reach_of(front) + reach_of(back)).length(),
            },
            slope: slopes[0].max(slopes[1]),
            slopes: slopes[0] + slopes[1],
            index: [pane.index_of_refraction; 2],
            beyond,
            content: Content::Pane(index),
        }
    }

    /// Where a leaf is along a direction near its normal.
    fn heights_along(&self, normal: DVec3) -> Interval {
        let (middle, reach) = (self.place.centre.dot(normal), 0.5 * (self.heights.max - self.heights.min));
        Interval::new(middle - reach, middle + reach)
    }

    /// The side of all panes on which a ball is: the sign of their normals; 0 where that is not sure.
    fn side_of(&self, ball: Ball) -> f64 {
        let Ball { centre: normal, radius: tilted } = self.normals;
        let height = ball.centre.dot(normal);
        let unsure = ball.radius
            + tilted * (ball.centre.distance(self.place.centre) + self.place.radius)
            + SLACK * self.heights.magnitude().max(height.abs());
        if height - unsure > self.heights.max {
            1.0
        } else if height + unsure < self.heights.min {
            -1.0
        } else {
            0.0
        }
    }

    /// The side of all panes on which a light is, in the same way.
    fn side_of_light(&self, region: &LightRegion) -> f64 {
        match *region {
            LightRegion::Ball { centre, radius } => self.side_of(Ball { centre, radius }),
            LightRegion::Cap { direction, chord } => {
                let Ball { centre: normal, radius: tilted } = self.normals;
                let cosine = direction.dot(normal);
                if cosine.abs() > chord + tilted + SLACK { cosine.signum() } else { 0.0 }
            }
        }
    }

    fn may_show(&self, from: DVec3, region: &LightRegion) -> bool {
        if self.side_of(Ball { centre: from, radius: 0.0 }) * self.side_of_light(region) > 0.0 {
            return false;
        }
        let Ball { centre, radius } = self.place;
        let offset = centre - from;
        let distance = offset.length();
        if distance <= radius {
            return true;
        }
        let region = self.beyond.widened(region);
        let Some((onwards, spread)) = region.seen_from_ball(centre, radius) else { return true };
        let direction = offset / distance;
        let ends = cap_chord(radius / distance) + spread + SLACK;
        let slack = ends + self.beyond.chord();
        let Ball { centre: normal, radius: tilted } = self.normals;
        let change = onwards - direction;
        let length = change.length();
        // Cosines in air at both faces, of any ray to any of the panes.
        let cosine = direction.dot(normal).abs();
        let unsure = length + slack + tilted + self.slope;
        let [least, most] = [(cosine + unsure).min(1.0), (cosine - unsure).max(0.0)];
        let strongest = strength(self.index[1], most);
        let weakest = strength(self.index[0], least) / (1.0 + self.slope * self.slope).sqrt();
        let (mean, off) = (0.5 * (strongest + weakest), 0.5 * (strongest - weakest));
        let along = change - normal * change.dot(normal);
        let reach = ends
            + self.beyond.along()
            + mean * self.bends.radius
            + off * self.slopes
            + TILTED * tilted * (length + slack);
        (along - self.bends.centre * mean).length() <= reach
    }

    fn may_mirror(&self, from: DVec3, region: &LightRegion) -> bool {
        if self.side_of(Ball { centre: from, radius: 0.0 }) * self.side_of_light(region) < 0.0 {
            return false;
        }
        let Ball { centre, radius } = self.place;
        let offset = from - centre;
        let distance = offset.length();
        if distance <= radius {
            return true;
        }
        let Some((onwards, spread)) = region.seen_from_ball(centre, radius) else { return true };
        let Ball { centre: normal, radius: tilted } = self.normals;
        let sum = offset / distance + onwards;
        let slack = cap_chord(radius / distance) + spread + MIRROR_SLACK + TILTED * tilted * sum.length();
        let along = sum.dot(normal);
        let across = (sum - normal * along).length();
        across - slack <= self.slope * (along.abs() + slack)
    }
}

/// By how much a gradient counts, for the cosine in air: `sqrt(n^2 - 1 + c^2) - c`, which falls with the cosine.
fn strength(index: f64, cosine: f64) -> f64 {
    (index * index - 1.0 + cosine * cosine).max(0.0).sqrt() - cosine
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
    fn no_pane_is_left_out_behind_which_a_second_one_bends_light() {
        let panes = panes();
        let beyond = Beyond { change: 0.004, tilt: 0.02, thickness: 0.004, apart: 0.1 };
        let tree = PaneTree::over((0u32..).zip(&panes).map(|(index, pane)| (index, pane, beyond)));
        let mut random = random(26);
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
            let before = pane.frame.vector_to_world(through.direction);
            // The second pane is tilted, moves light along itself, and turns it as far as it may.
            let tilt = (pair(&mut random) - 0.5).normalize() * (0.99 * beyond.tilt);
            let normal = pane.frame.vector_to_world(tilt.extend(1.0)).normalize();
            let axis = normal.any_orthonormal_vector();
            let turn = axis.lerp(normal.cross(axis), random.next_f64()).normalize() * beyond.change;
            let along = before - normal * before.dot(normal) + turn;
            let Some(up) = Some(1.0 - along.length_squared()).filter(|up| *up > 0.01) else { continue };
            let behind = along + normal * (up.sqrt() * before.dot(normal).signum());
            let met = pane.frame.point_to_world(through.exit) + before * (beyond.apart * random.next_f64());
            let exit = met + axis * beyond.thickness;
            traced += 1;
            for source in [Source::Direction(behind), Source::Point(exit + behind * between(&mut random, 0.5, 20.0))] {
                let candidates = tree.candidates(from, &LightRegion::of_source(source));
                assert!(candidates.contains(&(index as u32)), "pane {index} from {from} for {source:?}");
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
            let onwards = towards - normal * (2.0 * towards.dot(normal));
            if onwards.z * side.sign > -0.01 {
                // Steep relief mirrors it into the pane.
                continue;
            }
            let direction = pane.frame.vector_to_world(onwards);
            let vertex = pane.frame.point_to_world(vertex);
            mirrored += 1;
            for source in
                [Source::Direction(direction), Source::Point(vertex + direction * between(&mut random, 0.3, 20.0))]
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
