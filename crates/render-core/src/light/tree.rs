//! A tree over the lights: it chooses one for a point of a surface, and finds those on a ray. It can be over other
//! things through which light comes, too.
//!
//! The probability of a light is the product of the choices on its way down (Conty Estevez and Kulla 2018; pbrt-v4,
//! section 12.6.3). Each choice is by a bound of what the lights below may bring: power, distance, and the cosines at
//! both ends.

use std::cmp::Ordering;

use glam::DVec3;

use super::cone::EmissionCone;
use super::{Light, LightBounds, Receiver};
use crate::geometry::Ray;

/// Buckets along an axis in which splits are sought.
const BUCKETS: usize = 12;

/// The largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// Relative error of a distance to the side of a box.
const ROUNDING: f64 = 1e-12;

/// Weight of the lengths of a box beside its area in the cost of a split.
const FLATNESS: f64 = 1e-3;

/// Least share of a child whose lights may bring anything: a bound may be far off, and no light may be left out.
const LEAST_SHARE: f64 = 1e-3;

/// Levels of a tree below which lights are halved.
const MOST_UNEVEN_LEVELS: u32 = 64;

/// No point is taken for nearer to a light than this, metres.
const NEAREST: f64 = 1e-6;

/// The lights in a part of the tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cluster {
    /// The smallest and the largest corner of a box around them.
    pub(crate) min: DVec3,
    pub(crate) max: DVec3,
    /// Power, W; of all things in a tree, up to a factor.
    pub(crate) power: f64,
    /// The directions in which light leaves.
    pub(crate) cone: EmissionCone,
    /// Of a ball around the middle of the box that holds all lights.
    pub(crate) radius: f64,
    /// Whether a ray can meet any of them.
    pub(crate) can_be_met: bool,
}

/// A light that a tree has chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Chosen {
    /// Its index in the scene.
    pub(crate) light: u32,
    /// The probability with which it is chosen.
    pub(crate) probability: f64,
    /// What is left of the random number: another one, of fewer digits.
    pub(crate) rest: f64,
}

/// A node; its first child follows it.
#[derive(Clone, Copy, Debug)]
struct Node {
    cluster: Cluster,
    /// The parent; the root's is itself.
    parent: u32,
    below: Below,
}

#[derive(Clone, Copy, Debug)]
enum Below {
    /// A light, by its index in the scene.
    Light(u32),
    /// The second of two children.
    Second(u32),
}

/// A tree over the lights that are somewhere.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightTree {
    nodes: Vec<Node>,
    /// The leaf of each light in the scene; `None` for those that are nowhere.
    leaves: Vec<Option<u32>>,
}

impl Cluster {
    fn of(light: &Light) -> Option<Self> {
        let [min, max] = light.bounding_box()?;
        let half_diagonal = 0.5 * (max - min).length();
        let radius = match light.bounds() {
            LightBounds::Ball { centre, radius } if centre == (min + max) * 0.5 => radius.min(half_diagonal),
            _ => half_diagonal,
        };
        let (power, cone) = (light.power(), light.emission_cone());
        // Rays meet surfaces of the scene without this tree.
        let can_be_met = !light.is_delta() && light.triangles().is_none();
        Some(Self { min, max, power, cone, radius, can_be_met })
    }

    fn union(self, other: Self) -> Self {
        let (min, max) = (self.min.min(other.min), self.max.max(other.max));
        Self {
            min,
            max,
            power: self.power + other.power,
            cone: self.cone.union(other.cone),
            radius: 0.5 * (max - min).length(),
            can_be_met: self.can_be_met || other.can_be_met,
        }
    }

    fn centre(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// The cost of a part of a split, with the longest edge of the whole, and that over the edge along the axis.
    fn cost(&self, longest: f64, elongation: f64) -> f64 {
        let [x, y, z] = (self.max - self.min).to_array();
        // Lights on a line span no area; their lengths count then.
        let area = x * y + y * z + z * x + FLATNESS * longest * (x + y + z);
        self.power * self.cone.measure() * elongation * area
    }

    /// A bound of what its lights may bring to a point, up to a factor.
    fn importance(&self, receiver: &Receiver) -> f64 {
        let offset = self.centre() - receiver.position;
        let distance_squared = offset.length_squared();
        let spread = self.power / distance_squared.max(self.radius * self.radius).max(NEAREST * NEAREST);
        let Some(towards) = offset.try_normalize() else { return spread };
        let Some(arriving) = receiver.side.cosine(towards) else { return spread };
        let sine_squared = self.radius * self.radius / distance_squared;
        let cos_region = if sine_squared < 1.0 { (1.0 - sine_squared).sqrt() } else { -1.0 };
        let leaving = self.cone.largest_cosine(-self.cone.axis.dot(towards), cos_region);
        spread * leaving * largest_cosine(arriving, cos_region)
    }

    /// Whether a ray meets its box before `end`.
    fn is_met(&self, ray: &Ray, inverse: DVec3, end: f64) -> bool {
        let (first, second) = ((self.min - ray.origin) * inverse, (self.max - ray.origin) * inverse);
        let (near, far) = (first.min(second), first.max(second));
        let (enters, leaves) = (near.max_element().max(0.0), far.min_element().min(end));
        // What cannot be told, since the ray runs in a side of the box, is told by the light itself; so is a light that
        // is thinner than the rounding of its box.
        enters.partial_cmp(&(leaves * (1.0 + ROUNDING) + f64::MIN_POSITIVE)) != Some(Ordering::Greater)
            || [enters, leaves].iter().any(|distance| distance.is_nan())
    }
}

impl LightTree {
    /// The tree over lights.
    pub(super) fn new(lights: &[Light]) -> Self {
        Self::over(lights.iter().map(Cluster::of))
    }

    /// The tree over things, by their numbers.
    pub(crate) fn over(things: impl ExactSizeIterator<Item = Option<Cluster>>) -> Self {
        let count = things.len();
        let mut leaves: Vec<(u32, Cluster)> =
            (0u32..).zip(things).filter_map(|(index, thing)| Some((index, thing?))).collect();
        let nodes = Vec::with_capacity((2 * leaves.len()).saturating_sub(1));
        let mut tree = Self { nodes, leaves: vec![None; count] };
        if !leaves.is_empty() {
            tree.add(&mut leaves, 0, 0);
        }
        tree
    }

    /// What all things are together.
    pub(super) fn root(&self) -> Option<&Cluster> {
        self.nodes.first().map(|node| &node.cluster)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Adds a tree over some lights at a level, and answers its root.
    fn add(&mut self, lights: &mut [(u32, Cluster)], parent: u32, level: u32) -> u32 {
        let root = self.nodes.len() as u32;
        let cluster = lights.iter().map(|(_, cluster)| *cluster).reduce(Cluster::union);
        let cluster = cluster.expect("no tree is over no light");
        if let [(light, _)] = lights {
            self.nodes.push(Node { cluster, parent, below: Below::Light(*light) });
            self.leaves[*light as usize] = Some(root);
            return root;
        }
        // Halves end where the cost would part one light from all others again and again.
        let middle = if level < MOST_UNEVEN_LEVELS { split(lights, &cluster) } else { lights.len() / 2 };
        self.nodes.push(Node { cluster, parent, below: Below::Second(0) });
        let (first, second) = lights.split_at_mut(middle);
        self.add(first, root, level + 1);
        let second = self.add(second, root, level + 1);
        self.nodes[root as usize].below = Below::Second(second);
        root
    }

    /// The shares of the children of a node; `None` where no light below can bring anything.
    fn shares(&self, node: u32, second: u32, receiver: &Receiver) -> Option<[f64; 2]> {
        let [a, b] = [node + 1, second].map(|child| self.nodes[child as usize].cluster.importance(receiver));
        let sum = a + b;
        if sum <= 0.0 {
            return None;
        }
        if a == 0.0 || b == 0.0 {
            return Some([a / sum, b / sum]);
        }
        let first = (a / sum).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
        Some([first, 1.0 - first])
    }

    /// Chooses a light by a random number; `None` where no light can bring anything.
    pub(crate) fn choose(&self, receiver: &Receiver, mut random: f64) -> Option<Chosen> {
        let (mut node, mut probability) = (0, 1.0);
        loop {
            match self.nodes.get(node as usize)?.below {
                Below::Light(light) => return Some(Chosen { light, probability, rest: random }),
                Below::Second(second) => {
                    let [first, other] = self.shares(node, second, receiver)?;
                    if random < first {
                        random = (random / first).min(BELOW_ONE);
                        (node, probability) = (node + 1, probability * first);
                    } else {
                        random = ((random - first) / other).clamp(0.0, BELOW_ONE);
                        (node, probability) = (second, probability * other);
                    }
                }
            }
        }
    }

    /// The probability with which [`Self::choose`] chooses a light; zero for those that are nowhere.
    pub(crate) fn probability(&self, light: u32, receiver: &Receiver) -> f64 {
        let Some(mut node) = self.leaves[light as usize] else { return 0.0 };
        let mut probability = 1.0;
        while node != 0 {
            let parent = self.nodes[node as usize].parent;
            let Below::Second(second) = self.nodes[parent as usize].below else { return 0.0 };
            let Some([first, other]) = self.shares(parent, second, receiver) else { return 0.0 };
            probability *= if node == second { other } else { first };
            node = parent;
        }
        probability
    }

    /// Visits the lights whose boxes a ray meets before `end`, in no particular order, until one says that it is
    /// enough.
    pub(crate) fn on_ray(&self, ray: &Ray, end: f64, visit: &mut dyn FnMut(u32) -> bool) -> bool {
        let inverse = ray.direction.recip();
        let mut open = smallvec::SmallVec::<[u32; 64]>::new();
        open.extend((!self.nodes.is_empty()).then_some(0));
        while let Some(node) = open.pop() {
            let Node { cluster, below, .. } = &self.nodes[node as usize];
            if !cluster.can_be_met || !cluster.is_met(ray, inverse, end) {
                continue;
            }
            match *below {
                Below::Light(light) => {
                    if visit(light) {
                        return true;
                    }
                }
                Below::Second(second) => open.extend([second, node + 1]),
            }
        }
        false
    }
}

/// Upper bound of the cosine at which light arrives from a region that is seen under `cos_region`, whose middle is seen
/// at `cosine`.
fn largest_cosine(cosine: f64, cos_region: f64) -> f64 {
    if cosine >= cos_region {
        return 1.0;
    }
    let sine = |cosine: f64| (1.0 - cosine * cosine).max(0.0).sqrt();
    (cosine * cos_region + sine(cosine) * sine(cos_region)).max(0.0)
}

/// Sorts lights into two parts of the least cost, and answers where the second begins.
#[inline(never)]
fn split(lights: &mut [(u32, Cluster)], whole: &Cluster) -> usize {
    let extent = whole.max - whole.min;
    let longest = extent.max_element();
    let mut best: Option<(f64, usize, usize)> = None;
    let [low, high] = lights.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], (_, cluster)| {
        [low.min(cluster.centre()), high.max(cluster.centre())]
    });
    let bucket = |cluster: &Cluster, axis: usize| {
        let place = (cluster.centre()[axis] - low[axis]) / (high[axis] - low[axis]);
        ((place * BUCKETS as f64) as usize).min(BUCKETS - 1)
    };
    for axis in (0..3).filter(|axis| high[*axis] > low[*axis]) {
        let mut buckets = [None::<Cluster>; BUCKETS];
        for (_, cluster) in lights.iter() {
            let place = &mut buckets[bucket(cluster, axis)];
            *place = Some(place.map_or(*cluster, |before| before.union(*cluster)));
        }
        let elongation = longest / extent[axis];
        let joined = |part: Option<Cluster>, other: Option<Cluster>| match (part, other) {
            (Some(part), Some(other)) => Some(part.union(other)),
            (part, other) => part.or(other),
        };
        // What begins at each bucket, and what ends before it.
        let mut behind = buckets;
        for place in (0..BUCKETS - 1).rev() {
            behind[place] = joined(buckets[place], behind[place + 1]);
        }
        let mut before = None;
        for end in 1..BUCKETS {
            before = joined(before, buckets[end - 1]);
            let (Some(first), Some(second)) = (before, behind[end]) else { continue };
            let cost = first.cost(longest, elongation) + second.cost(longest, elongation);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, end));
            }
        }
    }
    let Some((_, axis, end)) = best else { return lights.len() / 2 };
    // Stable, so that equal lights stay in the order of the scene.
    lights.sort_by_key(|(_, cluster)| bucket(cluster, axis) >= end);
    lights.partition_point(|(_, cluster)| bucket(cluster, axis) < end)
}
