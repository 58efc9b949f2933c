//! The hierarchy of triangles in which only boxes that may hold a path are opened. What its leaves hold is looked at triangle by
//! triangle (`facet_leaf`).
//!
//! A box bounds places M = c + d, and normals by a linear function of the place, n = m + J d + v, with small v. The half
//! vector at M is h = g + H d + r, with g that at the middle, H its derivative, and r of second order. At a path
//!
//! ```text
//! h x n  =  g x m  +  (H d) x m + g x (J d)  +  (H d) x (J d) + r x n + (g + H d) x v
//! ```
//!
//! vanishes in each component: those that say how far P, L and the normal are from one plane, and how far from Snell's law,
//! alike. The first term is known, the next two are linear in d, and the rest is small and bounded. It vanishes as well along each
//! direction in which the linear terms do not depend on one coordinate of d: waves that run askew to the axes are told apart
//! there, by the two coordinates along which the mesh is longer. So about as many boxes are opened as touch the places where the linear terms say that a path is, whatever their size.

use std::ops::Range;

use glam::{DMat3, DVec3};
use smallvec::{SmallVec, smallvec};

use super::{
    ends::Ends,
    facet::Facet,
    facet_leaf::FacetLeaf,
    seen_ends::{ALL, ByLane, GRAIN, ROUNDING, SeenEnds, Vectors, missing, numbers, vectors},
};
use crate::lanes::{
    Instructions,
    singles::{SINGLES, Singles, Singles3, prefetch},
};
use crate::specular::widest::{self, Computation};

/// Boxes in a node.
const WIDTH: usize = SINGLES;

/// Marks the number of a child that is a leaf.
const IS_LEAF: u32 = 1 << 31;

/// Nodes of a level that are looked at without allocating memory.
const USUAL: usize = 64;

/// A node: the boxes of its children, in single precision relative to the middle of the mesh.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Node {
    /// Their middles c.
    centre: Vectors,
    /// Half of their edges.
    half: Vectors,
    /// The normals m there.
    normal: Vectors,
    /// How normals vary with places: the columns of J.
    turning: [Vectors; 3],
    /// Bounds of what remains of normals, |v|.
    remainder: ByLane,
    /// Bounds of how far places are from the middle, |d|.
    reach: ByLane,
    /// Bounds of how far normals are from m, |J d + v|.
    away: ByLane,
    /// Bounds of their length.
    longest: ByLane,
    /// Numbers of nodes, or of leaves with [`IS_LEAF`].
    children: [u32; WIDTH],
    /// The bits of boxes that do not exist.
    missing: u32,
}

/// What bounds the places and normals of some triangles.
#[derive(Clone, Copy, Debug)]
struct FacetBox {
    centre: DVec3,
    half: DVec3,
    normal: DVec3,
    turning: DMat3,
    remainder: f64,
}

/// The triangles of a mesh by place and normal.
#[derive(Clone, Debug)]
pub(crate) struct FacetTree {
    nodes: Vec<Node>,
    leaves: Vec<FacetLeaf>,
    /// Number of the root, as those of children.
    root: u32,
    /// The middle of the mesh.
    middle: DVec3,
    /// How far corners can be from there.
    radius: f64,
    /// The axis along which the mesh is shortest.
    short: usize,
}

impl FacetTree {
    /// The tree over triangles by their numbers; `None` when there are none.
    pub(crate) fn over(triangles: Range<u32>, facet: impl Fn(u32) -> Facet) -> Option<Self> {
        if triangles.is_empty() {
            return None;
        }
        let mut order: Vec<(u32, DVec3)> =
            triangles.map(|triangle| (triangle, facet(triangle).corners.iter().sum::<DVec3>() / 3.0)).collect();
        let [low, high] = bounds(&order);
        let middle = 0.5 * (low + high);
        let farthest = |&(triangle, _): &(u32, DVec3)| facet(triangle).corners.map(|corner| (corner - middle).length());
        let radius = order.iter().flat_map(farthest).fold(0.0, f64::max);
        let extent = high - low;
        let short = (0..3).fold(0, |short, axis| if extent[axis] < extent[short] { axis } else { short });
        let mut tree = Self { nodes: Vec::new(), leaves: Vec::new(), root: 0, middle, radius, short };
        tree.root = tree.build(&mut order, &facet, &mut Vec::new());
        Some(tree)
    }

    /// Hands the numbers of all triangles that may hold a path to `open`, and returns how many nodes and leaves it looked at.
    pub(super) fn visit(&self, ends: &Ends, mut open: impl FnMut(u32)) -> usize {
        widest::run(Visit { tree: self, ends, of_whole: None, open: |triangle, _| open(triangle) })
    }

    /// The same for one point of a `whole` light, `drawn`; what may hold a path to another of its points is opened where it may focus
    /// the light more than `strongly`.
    pub(super) fn visit_whole(&self, whole: &Ends, drawn: &Ends, strongly: f64, open: impl FnMut(u32, May)) -> usize {
        widest::run(Visit { tree: self, ends: whole, of_whole: Some((drawn, strongly)), open })
    }

    #[inline(always)]
    pub(super) fn visit_with<S: Instructions>(
        &self,
        simd: S,
        ends: &Ends,
        of_whole: Option<(&Ends, f64)>,
        open: impl FnMut(u32, May),
    ) -> usize {
        if ends.near == 0.0 {
            self.visit_nodes::<S, false>(simd, ends, of_whole, open)
        } else {
            self.visit_nodes::<S, true>(simd, ends, of_whole, open)
        }
    }

    #[inline(always)]
    fn visit_nodes<S: Instructions, const NEAR: bool>(
        &self,
        simd: S,
        ends: &Ends,
        of_whole: Option<(&Ends, f64)>,
        mut open: impl FnMut(u32, May),
    ) -> usize {
        let ends = SeenEnds::<S, NEAR>::new(simd, ends, self.middle, self.radius, self.short);
        let mut looks = 0;
        let (mut level, mut below): (SmallVec<[u32; USUAL]>, SmallVec<[u32; USUAL]>) = (smallvec![], smallvec![]);
        let (mut masks, mut leaves): (SmallVec<[u32; USUAL]>, SmallVec<[u32; USUAL]>) = (smallvec![], smallvec![]);
        if self.root & IS_LEAF == 0 {
            let root = &self.nodes[self.root as usize];
            if root.missing | root.hidden(simd, &ends) == ALL {
                return 1;
            }
            level.push(self.root)
        } else {
            leaves.push(self.root & !IS_LEAF)
        }
        while !level.is_empty() {
            looks += level.len();
            // All nodes of a level before any of the next: no look waits for another.
            masks.clear();
            for &number in &level {
                masks.push(self.nodes[number as usize].may_hold(simd, &ends));
            }
            for (&number, &mask) in level.iter().zip(&masks) {
                let mut may = mask;
                while may != 0 {
                    let child = self.nodes[number as usize].children[may.trailing_zeros() as usize];
                    may &= may - 1;
                    if child & IS_LEAF == 0 {
                        self.nodes[child as usize].prefetch();
                        below.push(child);
                    } else {
                        let leaf = child & !IS_LEAF;
                        self.leaves[leaf as usize].prefetch();
                        leaves.push(leaf);
                    }
                }
            }
            std::mem::swap(&mut level, &mut below);
            below.clear();
        }
        looks += leaves.len();
        masks.clear();
        if let Some((drawn, strongly)) = of_whole {
            let drawn = SeenEnds::<S, NEAR>::new(simd, drawn, self.middle, self.radius, self.short);
            for &number in &leaves {
                let leaf = &self.leaves[number as usize];
                let [holding, focusing] = leaf.may_hold_and_focus(simd, &ends, strongly);
                let holding_drawn = if holding == 0 { 0 } else { holding & leaf.may_hold(simd, &drawn) };
                masks.push(holding_drawn | focusing << WIDTH);
            }
        } else {
            for &number in &leaves {
                masks.push(self.leaves[number as usize].may_hold(simd, &ends));
            }
        }
        for (&number, &mask) in leaves.iter().zip(&masks) {
            let (holding, focusing) = (mask & ALL, mask >> WIDTH);
            let mut may = holding | focusing;
            while may != 0 {
                let lane = may.trailing_zeros();
                may &= may - 1;
                let is_in = |lanes: u32| lanes >> lane & 1 != 0;
                let triangle = self.leaves[number as usize].triangles[lane as usize];
                open(triangle, May { hold: is_in(holding), focus: is_in(focusing) });
            }
        }
        looks
    }

    /// Appends the node or leaf over `order`, and all below it, and to `corners` those of its triangles. Returns its number, as those of
    /// children.
    fn build(&mut self, order: &mut [(u32, DVec3)], facet: &impl Fn(u32) -> Facet, corners: &mut Vec<Corner>) -> u32 {
        if order.len() <= WIDTH {
            let facets: Vec<(u32, Facet)> = order.iter().map(|&(triangle, _)| (triangle, facet(triangle))).collect();
            self.leaves.push(FacetLeaf::over(&facets, self.middle));
            let first = corners.len();
            for (_, Facet { corners: places, normals }) in &facets {
                for (place, normal) in places.iter().zip(normals) {
                    let corner = Corner { place: *place - self.middle, normal: *normal };
                    // Triangles of a leaf share about half of them.
                    if !corners[first..].contains(&corner) {
                        corners.push(corner);
                    }
                }
            }
            return (self.leaves.len() - 1) as u32 | IS_LEAF;
        }
        // As few children as can hold the triangles at this height: all nodes are about full.
        let mut most_in_child = WIDTH;
        while most_in_child * WIDTH < order.len() {
            most_in_child *= WIDTH;
        }
        let mut parts = Vec::with_capacity(WIDTH);
        let count = order.len().div_ceil(most_in_child);
        cut(order, count, &mut parts);
        let mut children = [0; WIDTH];
        let mut boxes = Vec::with_capacity(WIDTH);
        for (child, part) in children.iter_mut().zip(parts) {
            let first = corners.len();
            *child = self.build(part, facet, corners);
            boxes.push(FacetBox::around(&corners[first..], GRAIN * self.radius));
        }
        self.nodes.push(Node { children, ..Node::over(&boxes) });
        (self.nodes.len() - 1) as u32
    }
}

/// A corner of a triangle relative to the middle of the mesh, with its normal.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Corner {
    place: DVec3,
    normal: DVec3,
}

/// What a triangle may do.
#[derive(Clone, Copy, Debug)]
pub(super) struct May {
    /// It may hold a path.
    pub(super) hold: bool,
    /// It may focus a whole light.
    pub(super) focus: bool,
}

/// The visit of a tree.
struct Visit<'a, F> {
    tree: &'a FacetTree,
    ends: &'a Ends,
    of_whole: Option<(&'a Ends, f64)>,
    open: F,
}

impl<F: FnMut(u32, May)> Computation for Visit<'_, F> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Instructions>(self, simd: S) -> usize {
        self.tree.visit_with(simd, self.ends, self.of_whole, self.open)
    }
}

/// Cuts some triangles into `count` parts of about equal numbers, each time along the longest extent.
fn cut<'a>(order: &'a mut [(u32, DVec3)], count: usize, parts: &mut Vec<&'a mut [(u32, DVec3)]>) {
    if count <= 1 {
        parts.push(order);
        return;
    }
    let [low, high] = bounds(order);
    let extent = high - low;
    let axis = (0..3).fold(0, |longest, axis| if extent[axis] > extent[longest] { axis } else { longest });
    let first = order.len() * (count / 2) / count;
    order.select_nth_unstable_by(first, |a, b| a.1[axis].total_cmp(&b.1[axis]).then(a.0.cmp(&b.0)));
    let (low, high) = order.split_at_mut(first);
    cut(low, count / 2, parts);
    cut(high, count - count / 2, parts);
}

impl FacetBox {
    /// The box around some corners, whose places may be off by `grain`.
    fn around(corners: &[Corner], grain: f64) -> Self {
        let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let grown = |[low, high]: [DVec3; 2], point: DVec3| [low.min(point), high.max(point)];
        let [low, high] = corners.iter().fold(nothing, |bounds, corner| grown(bounds, corner.place));
        let (centre, half) = (0.5 * (low + high), 0.5 * (high - low) + grain);
        let count = corners.len() as f64;
        let mean = |pick: fn(&Corner) -> DVec3| corners.iter().map(pick).sum::<DVec3>() / count;
        let (mean_place, mean_normal) = (mean(|corner| corner.place), mean(|corner| corner.normal));
        // Least squares; the little that is added keeps flat meshes from a singular matrix.
        let (mut products, mut squares) = (DMat3::ZERO, DMat3::ZERO);
        for corner in corners {
            let (place, normal) = (corner.place - mean_place, corner.normal - mean_normal);
            products += outer(normal, place);
            squares += outer(place, place);
        }
        let trace = squares.x_axis.x + squares.y_axis.y + squares.z_axis.z;
        let turning = products * (squares + DMat3::from_diagonal(DVec3::splat(REGULARISATION * trace))).inverse();
        let turning = if turning.is_finite() { turning } else { DMat3::ZERO };
        let remains = |corner: &Corner| corner.normal - turning * (corner.place - centre);
        let [low, high] = corners.iter().fold(nothing, |bounds, corner| grown(bounds, remains(corner)));
        Self { centre, half, normal: 0.5 * (low + high), turning, remainder: 0.5 * (high - low).length() }
    }
}

impl FacetBox {
    /// A bound of how far normals are from that in the middle.
    fn away(&self) -> f64 {
        let by_place = [0, 1, 2].map(|axis| self.turning.col(axis).abs() * self.half[axis]);
        by_place.iter().sum::<DVec3>().length() + self.remainder
    }
}

impl Node {
    /// A node over children that are yet to be numbered.
    fn over(boxes: &[FacetBox]) -> Self {
        Self {
            centre: vectors(boxes, |bounds| bounds.centre),
            half: vectors(boxes, |bounds| bounds.half),
            normal: vectors(boxes, |bounds| bounds.normal),
            turning: [0, 1, 2].map(|axis| vectors(boxes, |bounds| bounds.turning.col(axis))),
            remainder: numbers(boxes, |bounds| bounds.remainder),
            reach: numbers(boxes, |bounds| bounds.half.length()),
            away: numbers(boxes, FacetBox::away),
            longest: numbers(boxes, |bounds| bounds.normal.length() + bounds.away()),
            children: [0; WIDTH],
            missing: missing(boxes),
        }
    }

    /// Tells the processor that it will be looked at soon.
    #[inline(always)]
    fn prefetch(&self) {
        let Self { centre, half, normal, turning, remainder, reach, away, longest, children, missing: _ } = self;
        [centre, half, normal].into_iter().chain(turning).flatten().for_each(prefetch);
        [remainder, reach, away, longest].into_iter().for_each(prefetch);
        prefetch(children);
    }

    /// Which boxes may hold a path, as the bits of a number.
    #[inline(always)]
    fn may_hold<S: Instructions, const NEAR: bool>(&self, simd: S, ends: &SeenEnds<S, NEAR>) -> u32 {
        let (centre, normal) = (Singles3::new(simd, &self.centre), Singles3::new(simd, &self.normal));
        let (edges, reach) = (Singles3::new(simd, &self.half), Singles::new(simd, &self.reach));
        let [to_point, to_light] = ends.offsets(centre);
        let near_end = ends.seen_point(to_point, closest(simd, to_point, edges), reach);
        let (mut half, mut fastest, mut bent) = (near_end.half, near_end.speed, near_end.bent);
        let far_end = if NEAR { Some(ends.seen_light(to_light, closest(simd, to_light, edges), reach)) } else { None };
        if let Some(far_end) = &far_end {
            (half, fastest, bent) = (half + far_end.half, fastest + far_end.speed, bent + far_end.bent);
        } else {
            (half, bent) = (half + to_light, bent + ends.bent_at_infinity());
        }
        let defect = half.cross(normal);
        // How the defect changes as the place moves along each axis: the half vector turns, and the normal does.
        let turned = normal * fastest;
        let x = half.cross(Singles3::new(simd, &self.turning[0]));
        let y = half.cross(Singles3::new(simd, &self.turning[1]));
        let z = half.cross(Singles3::new(simd, &self.turning[2]));
        let mut by = [
            Singles3 { x: x.x, y: x.y + turned.z, z: x.z - turned.y },
            Singles3 { x: y.x - turned.z, y: y.y, z: y.z + turned.x },
            Singles3 { x: z.x + turned.y, y: z.y - turned.x, z: z.z },
        ];
        by = near_end.lengthened(by, normal);
        if let Some(far_end) = &far_end {
            by = far_end.lengthened(by, normal);
        }
        let [by_x, by_y, by_z] = by;
        let by_place = by_x.abs().times_plus(edges.x, by_y.abs().times_plus(edges.y, by_z.abs() * edges.z));
        let size = half.length();
        let rounding = Singles::splat(simd, ROUNDING);
        let loose = size.times_plus(rounding, bent + rounding);
        let swung = fastest * reach * Singles::new(simd, &self.away);
        let rest = loose
            .times_plus(Singles::new(simd, &self.longest), size.times_plus(Singles::new(simd, &self.remainder), swung));
        let mut exceeds = self.missing
            | (by_place.x + rest).less_than(defect.x.abs())
            | (by_place.y + rest).less_than(defect.y.abs())
            | (by_place.z + rest).less_than(defect.z.abs());
        // The same in directions in which the place does not matter along one axis.
        let (x, y, z) = (by_x * edges.x, by_y * edges.y, by_z * edges.z);
        if ends.short != 0 {
            exceeds |= exceeds_beside(normal.cross(by_x), y, z, rest, defect);
        }
        if ends.short != 1 {
            exceeds |= exceeds_beside(normal.cross(by_y), z, x, rest, defect);
        }
        if ends.short != 2 {
            exceeds |= exceeds_beside(normal.cross(by_z), x, y, rest, defect);
        }
        !(exceeds | self.hidden(simd, ends)) & ALL
    }

    /// In which boxes the ends are nowhere on the right sides of the surface.
    #[inline(always)]
    fn hidden<S: Instructions, const NEAR: bool>(&self, simd: S, ends: &SeenEnds<S, NEAR>) -> u32 {
        if !ends.has_side {
            return 0;
        }
        let (centre, normal) = (Singles3::new(simd, &self.centre), Singles3::new(simd, &self.normal));
        let (edges, reach) = (Singles3::new(simd, &self.half), Singles::new(simd, &self.reach));
        let (away, longest) = (Singles::new(simd, &self.away), Singles::new(simd, &self.longest));
        let zero = Singles::splat(simd, 0.0);
        let [to_point, to_light] = ends.offsets(centre);
        let slack = normal.abs().dot(edges);
        let loose = longest.times_plus(Singles::splat(simd, ROUNDING), away);
        let point_slack = slack + ends.grains[0] * longest + loose * (to_point.length() + reach);
        let point_height = normal.dot(to_point) * ends.side;
        let light_height = normal.dot(to_light) * ends.side;
        let light_slack = if NEAR {
            slack + ends.grains[1] * longest + loose * (to_light.length() + reach)
        } else {
            // Of a vector as long as the index is large.
            (loose + ends.grains[1] * longest) * ends.indices[1]
        };
        (point_height + point_slack).less_than(zero) | light_slack.less_than(light_height)
    }
}

/// One over how near places in boxes can be to the end at an offset from their middles.
#[inline(always)]
fn closest<S: Instructions>(simd: S, offset: Singles3<S>, edges: Singles3<S>) -> Singles<S> {
    let outside = offset.abs() - edges;
    Singles::splat(simd, 2.0).over((outside + outside.abs()).length())
}

/// Whether the defect along a direction is more than two coordinates of the place, and what is not linear, can make up for.
#[inline(always)]
fn exceeds_beside<S: Instructions>(
    along: Singles3<S>,
    first: Singles3<S>,
    second: Singles3<S>,
    rest: Singles<S>,
    defect: Singles3<S>,
) -> u32 {
    let most = along.length().times_plus(rest, along.dot(first).abs() + along.dot(second).abs());
    most.less_than(along.dot(defect).abs())
}

/// What keeps the least squares of flat meshes from a singular matrix, relative.
const REGULARISATION: f64 = 1e-9;

/// The box around middles of triangles.
fn bounds(order: &[(u32, DVec3)]) -> [DVec3; 2] {
    order
        .iter()
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], (_, middle)| [low.min(*middle), high.max(*middle)])
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}
