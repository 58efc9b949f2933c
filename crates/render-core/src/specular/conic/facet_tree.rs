//! The hierarchy of triangles in which only boxes that may hold a path are opened. What its leaves hold is looked at
//! triangle by triangle (`facet_leaf`).
//!
//! A box bounds places M = c + d, and normals by a linear function of the place, n = m + J d + v, with small v. The
//! half vector at M is h = g + H d + r, with g that at the middle, H its derivative, and r of second order. At a path
//!
//! ```text
//! h x n  =  g x m  +  (H d) x m + g x (J d)  +  (H d) x (J d) + r x n + (g + H d) x v
//! ```
//!
//! vanishes in each component: those that say how far P, L and the normal are from one plane, and how far from Snell's
//! law, alike. The misfit is across n: two coordinates are enough. The first term is known, the next two are linear in
//! d, and the rest is small and bounded. It also vanishes along each direction in which the linear terms do not depend
//! on one coordinate of d. There the two coordinates across the normals distinguish waves that run askew to the axes.
//! So about as many boxes are opened as touch the places where the linear terms say that a path is, whatever their
//! size.

use std::ops::Range;

use arrayvec::ArrayVec;
use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3};
use smallvec::{SmallVec, smallvec};

use super::{
    ends::Ends,
    facet::Facet,
    facet_leaf::FacetLeaf,
    seen_ends::{ALL, ByLane, GRAIN, ROUNDING, SeenEnds, Vectors, in_order, missing, numbers, steepest_axis, vectors},
};
use crate::geometry::large_pages::LargePages;
use crate::math::simd::Instructions;
use crate::math::simd::singles::{SINGLES, Singles, Singles2, Singles3, prefetch};
use crate::specular::widest::{self, Computation};

/// Boxes in a node.
const WIDTH: usize = SINGLES;

/// Marks the number of a child that is a leaf.
const IS_LEAF: u32 = 1 << 31;

/// Nodes of a level that are looked at without allocating memory.
const USUAL: usize = 64;

/// A node: the boxes of its children, in single precision relative to the middle of the mesh.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
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
    /// The axis whose coordinate comes last in all vectors.
    axis: u32,
    /// Nothing, to the end of the last cache line.
    rest: [u32; 6],
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
#[derive(Debug)]
pub(crate) struct FacetTree {
    nodes: LargePages<Node>,
    leaves: LargePages<FacetLeaf>,
    /// Number of the root, as those of children.
    root: u32,
    /// The middle of the mesh.
    middle: DVec3,
    /// How far corners can be from there.
    radius: f64,
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
        let Sizes { nodes, leaves } = Sizes::over(order.len());
        let (nodes, leaves) = (LargePages::zeroed(nodes), LargePages::zeroed(leaves));
        let mut tree = Self { nodes, leaves, root: 0, middle, radius };
        tree.root = tree.build(&mut order, &facet, &mut Vec::new(), &mut Sizes::default());
        Some(tree)
    }

    /// Hands the numbers of all triangles that may hold a path to `open`, and returns how many nodes and leaves it
    /// looked at.
    pub(super) fn visit(&self, ends: &Ends, mut open: impl FnMut(u32)) -> usize {
        widest::run(Visit { tree: self, ends, of_whole: None, open: |triangle, _| open(triangle) })
    }

    /// The same for one point of a `whole` light, `drawn`; what may hold a path to another of its points is opened
    /// where it may focus the light more than `strongly`.
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
        let (nodes, all_leaves) = (&self.nodes[..], &self.leaves[..]);
        let mut ends = SeenEnds::<S, NEAR>::new(simd, ends, self.middle, self.radius);
        let mut looks = 0;
        let (mut level, mut below): (SmallVec<[u32; USUAL]>, SmallVec<[u32; USUAL]>) = (smallvec![], smallvec![]);
        let (mut masks, mut leaves): (SmallVec<[u32; USUAL]>, SmallVec<[u32; USUAL]>) = (smallvec![], smallvec![]);
        if self.root & IS_LEAF == 0 {
            let root = &nodes[self.root as usize];
            let sides = root.sides(simd, &ends);
            if ends.has_side && root.missing | sides.wrong == ALL {
                return 1;
            }
            // What is right for the mesh is right for its parts.
            ends.has_side &= root.missing | sides.right != ALL;
            level.push(self.root)
        } else {
            leaves.push(self.root & !IS_LEAF)
        }
        while !level.is_empty() {
            looks += level.len();
            // All nodes of a level before any of the next: no look waits for another.
            masks.clear();
            for &number in &level {
                masks.push(nodes[number as usize].may_hold(simd, &ends));
            }
            for (&number, &mask) in level.iter().zip(&masks) {
                let mut may = mask;
                while may != 0 {
                    let child = nodes[number as usize].children[may.trailing_zeros() as usize];
                    may &= may - 1;
                    if child & IS_LEAF == 0 {
                        nodes[child as usize].prefetch();
                        below.push(child);
                    } else {
                        let leaf = child & !IS_LEAF;
                        all_leaves[leaf as usize].prefetch();
                        leaves.push(leaf);
                    }
                }
            }
            std::mem::swap(&mut level, &mut below);
            below.clear();
        }
        looks += leaves.len();
        let drawn = of_whole
            .map(|(drawn, strongly)| (SeenEnds::<S, NEAR>::new(simd, drawn, self.middle, self.radius), strongly));
        for &number in &leaves {
            let leaf = &all_leaves[number as usize];
            let [holding, focusing] = match &drawn {
                Some((drawn, strongly)) => leaf.may_hold_and_focus(simd, &ends, drawn, *strongly),
                None => [leaf.may_hold(simd, &ends), 0],
            };
            let mut may = holding | focusing;
            while may != 0 {
                let lane = may.trailing_zeros();
                may &= may - 1;
                let is_in = |lanes: u32| lanes >> lane & 1 != 0;
                open(leaf.triangles[lane as usize], May { hold: is_in(holding), focus: is_in(focusing) });
            }
        }
        looks
    }

    /// Makes the node or leaf over `order`, and all below it, behind those that are `made`, and appends the corners of
    /// its triangles to `corners`. Returns its number, as those of children.
    fn build(
        &mut self,
        order: &mut [(u32, DVec3)],
        facet: &impl Fn(u32) -> Facet,
        corners: &mut Vec<Corner>,
        made: &mut Sizes,
    ) -> u32 {
        if order.len() <= WIDTH {
            let facets: ArrayVec<(u32, Facet), WIDTH> =
                order.iter().map(|&(triangle, _)| (triangle, facet(triangle))).collect();
            let leaf = made.leaves;
            self.leaves[leaf] = FacetLeaf::over(&facets, self.middle);
            made.leaves += 1;
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
            return leaf as u32 | IS_LEAF;
        }
        let mut parts = ArrayVec::new();
        cut(order, children(order.len()), &mut parts);
        let mut children = [0; WIDTH];
        let mut boxes: ArrayVec<FacetBox, WIDTH> = ArrayVec::new();
        for (child, part) in children.iter_mut().zip(parts) {
            let first = corners.len();
            *child = self.build(part, facet, corners, made);
            boxes.push(FacetBox::around(&corners[first..], GRAIN * self.radius));
        }
        let node = made.nodes;
        self.nodes[node] = Node { children, ..Node::over(&boxes) };
        made.nodes += 1;
        node as u32
    }
}

/// How many nodes and leaves there are.
#[derive(Clone, Copy, Debug, Default)]
struct Sizes {
    nodes: usize,
    leaves: usize,
}

impl Sizes {
    /// The sizes of the tree over this number of triangles.
    fn over(triangles: usize) -> Self {
        if triangles <= WIDTH {
            return Self { nodes: 0, leaves: 1 };
        }
        let mut sizes = Self { nodes: 1, leaves: 0 };
        let mut parts: ArrayVec<usize, WIDTH> = ArrayVec::new();
        share(triangles, children(triangles), &mut parts);
        for part in parts {
            let Self { nodes, leaves } = Self::over(part);
            sizes = Self { nodes: sizes.nodes + nodes, leaves: sizes.leaves + leaves };
        }
        sizes
    }
}

/// The fewest children that can hold these triangles at their height: all nodes are about full.
fn children(triangles: usize) -> usize {
    let mut most_in_child = WIDTH;
    while most_in_child * WIDTH < triangles {
        most_in_child *= WIDTH;
    }
    triangles.div_ceil(most_in_child)
}

/// Number of triangles in the first half of the parts.
fn first_half(triangles: usize, parts: usize) -> usize {
    triangles * (parts / 2) / parts
}

/// Number of triangles in each of `count` parts.
fn share(triangles: usize, count: usize, parts: &mut ArrayVec<usize, WIDTH>) {
    if count <= 1 {
        parts.push(triangles);
        return;
    }
    let first = first_half(triangles, count);
    share(first, count / 2, parts);
    share(triangles - first, count - count / 2, parts);
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
fn cut<'a>(order: &'a mut [(u32, DVec3)], count: usize, parts: &mut ArrayVec<&'a mut [(u32, DVec3)], WIDTH>) {
    if count <= 1 {
        parts.push(order);
        return;
    }
    let [low, high] = bounds(order);
    let extent = high - low;
    let axis = (0..3).fold(0, |longest, axis| if extent[axis] > extent[longest] { axis } else { longest });
    let first = first_half(order.len(), count);
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
        let axis = steepest_axis(boxes.iter().map(|bounds| bounds.normal));
        let by_box = |vector: fn(&FacetBox) -> DVec3| vectors(boxes, |bounds| in_order(vector(bounds), axis));
        let turning = |column: usize| vectors(boxes, |bounds| in_order(bounds.turning.col(column), axis));
        Self {
            centre: by_box(|bounds| bounds.centre),
            half: by_box(|bounds| bounds.half),
            normal: by_box(|bounds| bounds.normal),
            turning: [(axis + 1) % 3, (axis + 2) % 3, axis].map(turning),
            remainder: numbers(boxes, |bounds| bounds.remainder),
            reach: numbers(boxes, |bounds| bounds.half.length()),
            away: numbers(boxes, FacetBox::away),
            longest: numbers(boxes, |bounds| bounds.normal.length() + bounds.away()),
            children: [0; WIDTH],
            missing: missing(boxes),
            axis: axis as u32,
            rest: [0; 6],
        }
    }

    /// Tells the processor that it will be looked at soon.
    #[inline(always)]
    fn prefetch(&self) {
        // Two arrays share a cache line.
        let Self { centre, half, normal, turning: [x, y, z], remainder, away, .. } = self;
        for numbers in [&centre[0], &centre[2], &half[1], &normal[0], &normal[2], &x[1], &y[0], &y[2], &z[1]] {
            prefetch(numbers);
        }
        prefetch(remainder);
        prefetch(away);
        prefetch(&self.children);
    }

    /// Which boxes may hold a path, as the bits of a number.
    #[inline(always)]
    fn may_hold<S: Instructions, const NEAR: bool>(&self, simd: S, ends: &SeenEnds<S, NEAR>) -> u32 {
        let (centre, normal) = (Singles3::new(simd, &self.centre), Singles3::new(simd, &self.normal));
        let (edges, reach) = (Singles3::new(simd, &self.half), Singles::new(simd, &self.reach));
        let [to_point, to_light] = ends.offsets(centre, self.axis);
        let near_end = ends.seen_point(to_point, closest(simd, to_point, edges, reach), reach);
        let (mut half, mut fastest, mut bent) = (near_end.half, near_end.speed, near_end.bent);
        let far_end =
            if NEAR { Some(ends.seen_light(to_light, closest(simd, to_light, edges, reach), reach)) } else { None };
        if let Some(far_end) = &far_end {
            (half, fastest, bent) = (half + far_end.half, fastest + far_end.speed, bent + far_end.bent);
        } else {
            (half, bent) = (half + to_light, bent + ends.bent_at_infinity());
        }
        let defect = half.cross_xy(normal);
        // How the defect changes as the place moves along each axis: the half vector turns, and the normal does.
        let x = half.cross_xy(Singles3::new(simd, &self.turning[0]));
        let y = half.cross_xy(Singles3::new(simd, &self.turning[1]));
        let z = half.cross_xy(Singles3::new(simd, &self.turning[2]));
        let slowest = Singles::splat(simd, 0.0) - fastest;
        let mut by = [
            Singles2 { x: x.x, y: normal.z.times_plus(fastest, x.y) },
            Singles2 { x: normal.z.times_plus(slowest, y.x), y: y.y },
            Singles2 { x: normal.y.times_plus(fastest, z.x), y: normal.x.times_plus(slowest, z.y) },
        ];
        by = near_end.lengthened(by, normal);
        if let Some(far_end) = &far_end {
            by = far_end.lengthened(by, normal);
        }
        let [by_x, by_y, by_z] = by;
        let size = half.length();
        let rounding = Singles::splat(simd, ROUNDING);
        let loose = size.times_plus(rounding, bent + rounding);
        let swung = fastest * reach * Singles::new(simd, &self.away);
        let rest = loose
            .times_plus(Singles::new(simd, &self.longest), size.times_plus(Singles::new(simd, &self.remainder), swung));
        let mut exceeds = self.missing
            | most([by_x.x, by_y.x, by_z.x], edges, rest).less_than(defect.x.abs())
            | most([by_x.y, by_y.y, by_z.y], edges, rest).less_than(defect.y.abs());
        // The same in both directions in which the place does not matter along one of the first two axes.
        let both = by_x.determinant(by_y).abs();
        let by_z = by_z * edges.z;
        exceeds |= exceeds_beside(by_x, both * edges.y, by_z, rest, defect)
            | exceeds_beside(by_y, both * edges.x, by_z, rest, defect);
        if ends.has_side {
            exceeds |= self.sides(simd, ends).wrong;
        }
        !exceeds & ALL
    }

    /// On which sides of the surface the ends are.
    #[inline(always)]
    fn sides<S: Instructions, const NEAR: bool>(&self, simd: S, ends: &SeenEnds<S, NEAR>) -> Sides {
        let (centre, normal) = (Singles3::new(simd, &self.centre), Singles3::new(simd, &self.normal));
        let (edges, reach) = (Singles3::new(simd, &self.half), Singles::new(simd, &self.reach));
        let (away, longest) = (Singles::new(simd, &self.away), Singles::new(simd, &self.longest));
        let zero = Singles::splat(simd, 0.0);
        let [to_point, to_light] = ends.offsets(centre, self.axis);
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
        Sides {
            wrong: (point_height + point_slack).less_than(zero) | light_slack.less_than(light_height),
            right: point_slack.less_than(point_height) & (light_height + light_slack).less_than(zero),
        }
    }
}

/// On which sides of eight boxes' surfaces both ends are, as the bits of numbers.
struct Sides {
    /// Those where they are nowhere on the right ones.
    wrong: u32,
    /// Those where they are on the right ones everywhere.
    right: u32,
}

/// One over how near places in boxes can be to the end at an offset from their middles, by the balls around them and
/// along the axis of their normals.
#[inline(always)]
fn closest<S: Instructions>(simd: S, offset: Singles3<S>, edges: Singles3<S>, reach: Singles<S>) -> Singles<S> {
    let (ball, height) = (offset.length() - reach, offset.z.abs() - edges.z);
    let nearest = height + (ball - height).positive_part();
    Singles::splat(simd, 1.0).over(nearest.positive_part())
}

/// The most that a coordinate of the defect changes by within boxes: by the place along each axis, and by what is not
/// linear.
#[inline(always)]
fn most<S: Instructions>([x, y, z]: [Singles<S>; 3], edges: Singles3<S>, rest: Singles<S>) -> Singles<S> {
    x.abs().times_plus(edges.x, y.abs().times_plus(edges.y, z.abs().times_plus(edges.z, rest)))
}

/// Whether the defect across a vector is more than two coordinates of the place, and what is not linear, can make up
/// for.
#[inline(always)]
fn exceeds_beside<S: Instructions>(
    along: Singles2<S>,
    first: Singles<S>,
    second: Singles2<S>,
    rest: Singles<S>,
    defect: Singles2<S>,
) -> u32 {
    let most = along.length().times_plus(rest, first + along.determinant(second).abs());
    most.less_than(along.determinant(defect).abs())
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
