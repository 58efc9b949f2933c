//! All paths over a facet by halving and interval arithmetic: slow, and certain. The search along curves is held to it.
//!
//! The facet is cut into boxes of weights. A box is dropped if bounds of the misfit exclude zero. If Krawczyk's
//! operator maps the box into itself, it holds one path (Neumaier 1990, "Interval Methods for Systems of Equations",
//! section 5.1). Neither the curves nor the derivatives of the renderer are used.

use std::ops::{Add, Mul, Sub};

use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;

use super::{
    curve::straight_through,
    ends::Ends,
    facet::Facet,
    facet_tree::FacetTree,
    neighbours::Neighbours,
    testing::{distinct, found, problem, water},
    walk::first_path,
};
use crate::specular::testing::random;

/// A closed interval. Ends are rounded outwards.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: f64,
    high: f64,
}

impl Bounds {
    fn point(value: f64) -> Self {
        Self { low: value, high: value }
    }

    /// Rounded outwards. What is not a number, as a difference of infinities, bounds nothing.
    fn outwards(low: f64, high: f64) -> Self {
        Self {
            low: if low.is_nan() { f64::NEG_INFINITY } else { low.next_down() },
            high: if high.is_nan() { f64::INFINITY } else { high.next_up() },
        }
    }

    fn holds_zero(self) -> bool {
        self.low <= 0.0 && self.high >= 0.0
    }

    fn middle(self) -> f64 {
        0.5 * (self.low + self.high)
    }

    /// One over the root.
    fn inverse_root(self) -> Self {
        if self.low > 0.0 {
            let [low, high] = [self.high, self.low].map(|value| 1.0 / value.sqrt());
            Self { low: low.next_down().next_down(), high: high.next_up().next_up() }
        } else {
            Self { low: 0.0, high: f64::INFINITY }
        }
    }
}

impl Add for Bounds {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::outwards(self.low + other.low, self.high + other.high)
    }
}

impl Sub for Bounds {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::outwards(self.low - other.high, self.high - other.low)
    }
}

impl Mul for Bounds {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let products = [self.low * other.low, self.low * other.high, self.high * other.low, self.high * other.high];
        if products.iter().any(|product| product.is_nan()) {
            return Self { low: f64::NEG_INFINITY, high: f64::INFINITY };
        }
        let [a, b, c, d] = products;
        Self::outwards(a.min(b).min(c.min(d)), a.max(b).max(c.max(d)))
    }
}

/// Bounds of a quantity and of its derivatives by both weights.
#[derive(Clone, Copy, Debug)]
struct Jet {
    value: Bounds,
    by: [Bounds; 2],
}

impl Jet {
    fn constant(value: f64) -> Self {
        Self { value: Bounds::point(value), by: [Bounds::point(0.0); 2] }
    }

    fn inverse_root(self) -> Self {
        let value = self.value.inverse_root();
        let slope = value * value * value * Bounds::point(-0.5);
        Self { value, by: self.by.map(|by| slope * by) }
    }
}

impl Add for Jet {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, by: [0, 1].map(|k| self.by[k] + other.by[k]) }
    }
}

impl Sub for Jet {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, by: [0, 1].map(|k| self.by[k] - other.by[k]) }
    }
}

impl Mul for Jet {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let scaled = |by: [Bounds; 2], factor: Bounds| Self { value: Bounds::point(0.0), by: by.map(|by| by * factor) };
        let by = (scaled(self.by, other.value).add(scaled(other.by, self.value))).by;
        Self { value: self.value * other.value, by }
    }
}

type Jets = [Jet; 3];

fn dot(a: &Jets, b: &Jets) -> Jet {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn constants(vector: DVec3) -> Jets {
    vector.to_array().map(Jet::constant)
}

/// A box of weights.
#[derive(Clone, Copy, Debug)]
struct Part {
    low: DVec2,
    high: DVec2,
}

impl Part {
    fn point(at: DVec2) -> Self {
        Self { low: at, high: at }
    }

    fn middle(&self) -> DVec2 {
        0.5 * (self.low + self.high)
    }

    fn size(&self) -> DVec2 {
        self.high - self.low
    }

    fn halves(&self) -> [Self; 2] {
        let axis = if self.size().x >= self.size().y { 0 } else { 1 };
        let (mut first, mut second) = (*self, *self);
        first.high[axis] = self.middle()[axis];
        second.low[axis] = self.middle()[axis];
        [first, second]
    }
}

/// Paths so far outside a facet belong to it as well: they are on its edge.
const ON_EDGE: f64 = 1e-9;

/// Boxes smaller than this lie on a double root, of which nothing can be certain.
const SMALLEST: f64 = 1e-10;

/// A facet, the ends of a path over it, and two directions across its normal.
pub(super) struct Problem<'a> {
    facet: &'a Facet,
    ends: &'a Ends,
    across: [DVec3; 2],
}

impl<'a> Problem<'a> {
    pub(super) fn new(facet: &'a Facet, ends: &'a Ends) -> Self {
        let normal = facet.normals.iter().sum::<DVec3>().normalize();
        assert!(facet.normals.iter().all(|corner| corner.dot(normal) > 0.0), "a gentle facet");
        let (u, v) = normal.any_orthonormal_pair();
        Self { facet, ends, across: [u, v] }
    }

    /// Two components of `h x n`. The third is zero where they are, since n is never across the mean normal.
    fn misfit(&self, part: &Part) -> [Jet; 2] {
        let weights = [0, 1].map(|axis| Jet {
            value: Bounds { low: part.low[axis], high: part.high[axis] },
            by: [0, 1].map(|k| Bounds::point(if k == axis { 1.0 } else { 0.0 })),
        });
        let blend = |[a, b, c]: [DVec3; 3]| -> Jets {
            std::array::from_fn(|k| {
                Jet::constant(a[k]) + Jet::constant(b[k] - a[k]) * weights[0] + Jet::constant(c[k] - a[k]) * weights[1]
            })
        };
        let place = blend(self.facet.corners);
        let normal = blend(self.facet.normals);
        let unit = |offset: Jets| {
            let inverse = dot(&offset, &offset).inverse_root();
            offset.map(|component| component * inverse)
        };
        let ends = self.ends;
        let to_point: Jets = std::array::from_fn(|k| Jet::constant(ends.point[k]) - place[k]);
        let to_light: Jets =
            std::array::from_fn(|k| Jet::constant(ends.light[k]) - Jet::constant(ends.near) * place[k]);
        let [from_point, from_light] = ends.indices.map(Jet::constant);
        let (to_point, to_light) = (unit(to_point), unit(to_light));
        let half: Jets = std::array::from_fn(|k| from_point * to_point[k] + from_light * to_light[k]);
        let cross = [(1, 2), (2, 0), (0, 1)].map(|(a, b)| half[a] * normal[b] - half[b] * normal[a]);
        self.across.map(|axis| dot(&constants(axis), &cross))
    }

    /// The weights of all paths, one by one certain; `None` when some box is too close to a double root.
    pub(super) fn paths(&self) -> Option<Vec<DVec2>> {
        let mut paths = Vec::new();
        let mut open = vec![Part { low: DVec2::splat(-ON_EDGE), high: DVec2::splat(1.0 + ON_EDGE) }];
        while let Some(part) = open.pop() {
            if part.low.element_sum() > 1.0 + ON_EDGE {
                continue;
            }
            if part.size().max_element() < SMALLEST {
                return None;
            }
            // A path on the border of a box is within the grown box of either side.
            let grown = Part { low: part.low - 0.1 * part.size(), high: part.high + 0.1 * part.size() };
            let there = self.misfit(&grown);
            if there.iter().any(|component| !component.value.holds_zero()) {
                continue;
            }
            let middle = grown.middle();
            let here = self.misfit(&Part::point(middle));
            let away =
                [0, 1].map(|axis| Bounds::outwards(grown.low[axis] - middle[axis], grown.high[axis] - middle[axis]));
            let excluded = here
                .iter()
                .zip(&there)
                .any(|(here, there)| !(here.value + there.by[0] * away[0] + there.by[1] * away[1]).holds_zero());
            if excluded {
                continue;
            }
            let slope = DMat2::from_cols_array_2d(&[0, 1].map(|k| [0, 1].map(|row: usize| there[row].by[k].middle())));
            let inverse = slope.inverse();
            let krawczyk: Option<[Bounds; 2]> = inverse.is_finite().then(|| {
                std::array::from_fn(|row| {
                    let entry = |k: usize| Bounds::point(inverse.col(k)[row]);
                    let mut image = Bounds::point(middle[row]) - entry(0) * here[0].value - entry(1) * here[1].value;
                    for (k, away) in away.into_iter().enumerate() {
                        let identity = Bounds::point(if k == row { 1.0 } else { 0.0 });
                        let left = identity - entry(0) * there[0].by[k] - entry(1) * there[1].by[k];
                        image = image + left * away;
                    }
                    image
                })
            });
            let Some(image) = krawczyk else {
                open.extend(part.halves());
                continue;
            };
            let low = DVec2::new(image[0].low, image[1].low);
            let high = DVec2::new(image[0].high, image[1].high);
            if low.cmpgt(grown.low).all() && high.cmplt(grown.high).all() {
                paths.extend(self.refined(0.5 * (low + high)));
                continue;
            }
            let left = Part { low: low.max(part.low), high: high.min(part.high) };
            if left.size().min_element() < 0.0 {
                continue;
            }
            if left.size().element_product() < 0.5 * part.size().element_product() {
                open.push(left);
            } else {
                open.extend(part.halves());
            }
        }
        Some(paths)
    }

    /// The path that is certain to be around a place, if it is on the facet and has its ends on the right sides.
    fn refined(&self, start: DVec2) -> Option<DVec2> {
        let mut weights = start;
        for _ in 0..20 {
            let here = self.misfit(&Part::point(weights));
            let slope = DMat2::from_cols_array_2d(&[0, 1].map(|k| [0, 1].map(|row: usize| here[row].by[k].middle())));
            weights -= slope.inverse() * DVec2::new(here[0].value.middle(), here[1].value.middle());
        }
        let (place, normal) = (self.facet.place(weights), self.facet.normal(weights));
        let ends = self.ends;
        let within = weights.min_element() >= -ON_EDGE && weights.element_sum() <= 1.0 + ON_EDGE;
        let sides = ends.take_sides(normal.dot(ends.point - place), normal.dot(ends.offset_to_light(place)));
        (within && sides).then_some(weights)
    }
}

/// All paths over a mesh; `None` where not all can be certain.
pub(super) fn all_paths(facets: &[Facet], ends: &Ends) -> Option<Vec<DVec3>> {
    let mut places = Vec::new();
    for facet in facets {
        for weights in Problem::new(facet, ends).paths()? {
            distinct(&mut places, facet.place(weights));
        }
    }
    Some(places)
}

/// What the published walk finds: at most one path. `None` where it cannot start, since the line to the light passes
/// beside.
fn published(facets: &[Facet], neighbours: &Neighbours, ends: &Ends) -> Option<Option<DVec3>> {
    let start = (0u32..).zip(facets).find_map(|(k, facet)| Some((k, straight_through(facet, ends)?)))?;
    let found = first_path(start, |k| facets[k as usize], neighbours, ends);
    Some(found.map(|(triangle, weights)| facets[triangle as usize].place(weights)))
}

/// Counts over many problems.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    problems: usize,
    uncertain: usize,
    paths: usize,
    /// Those of problems from which the published walk can start.
    walked: usize,
    missed_by_walk: usize,
    /// Problems without a mirror, for which it is meant.
    refracted: usize,
    /// Those of them from which it cannot start.
    unstarted: usize,
    /// Their paths.
    beyond_its_start: usize,
}

impl Tally {
    /// The part of the paths that the published walk misses where it can start, and of all that are refracted.
    fn missed(&self) -> [f64; 2] {
        let all_missed = self.missed_by_walk + self.beyond_its_start;
        let part = |missed: usize, paths: usize| missed as f64 / paths as f64;
        [part(self.missed_by_walk, self.walked), part(all_missed, self.walked + self.beyond_its_start)]
    }
}

impl Add for Tally {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            problems: self.problems + other.problems,
            uncertain: self.uncertain + other.uncertain,
            paths: self.paths + other.paths,
            walked: self.walked + other.walked,
            missed_by_walk: self.missed_by_walk + other.missed_by_walk,
            refracted: self.refracted + other.refracted,
            unstarted: self.unstarted + other.unstarted,
            beyond_its_start: self.beyond_its_start + other.beyond_its_start,
        }
    }
}

/// Requires of random problems over water that the paths that are found are those that are certain, and that the
/// published walk finds some of them.
#[track_caller]
fn compare(cells: u32, amplitude: f64, problems: u32) -> Tally {
    let facets = water(cells, amplitude);
    let range = 0..facets.len() as u32;
    let tree = FacetTree::over(range.clone(), |k| facets[k as usize]).unwrap();
    let neighbours = Neighbours::of(range, |k| facets[k as usize]);
    let mut random = random(77);
    let ends: Vec<Ends> = (0..problems).map(|case| problem(&mut random, case)).collect();
    let one = |ends: &Ends| {
        let Some(certain) = all_paths(&facets, ends) else {
            return Tally { problems: 1, uncertain: 1, ..Tally::default() };
        };
        let ours = found(&facets, &tree, ends);
        let near = |place: &DVec3, places: &[DVec3]| places.iter().any(|other| (*other - *place).length() < 1e-7);
        assert!(
            ours.len() == certain.len() && ours.iter().all(|place| near(place, &certain)),
            "{cells} {amplitude}: {ours:?} are not {certain:?} for {ends:?}"
        );
        let all = Tally { problems: 1, paths: certain.len(), ..Tally::default() };
        if ends.is_mirrored() {
            return all;
        }
        let Some(path) = published(&facets, &neighbours, ends) else {
            return Tally { refracted: 1, unstarted: 1, beyond_its_start: certain.len(), ..all };
        };
        assert!(path.is_none_or(|path| near(&path, &certain)), "{path:?} is no path for {ends:?}");
        let missed_by_walk = certain.len() - usize::from(path.is_some());
        Tally { refracted: 1, walked: certain.len(), missed_by_walk, ..all }
    };
    let tally = ends.par_iter().map(one).reduce(Tally::default, Tally::add);
    let [missed, missed_of_all] = tally.missed().map(|part| 100.0 * part);
    println!(
        "{} triangles, waves of {amplitude}: {tally:?}: the published walk misses {missed:.1} percent where it can \
         start, which is not so in {} of {} problems, and {missed_of_all:.1} percent of all",
        facets.len(),
        tally.unstarted,
        tally.refracted
    );
    assert!(tally.uncertain == 0 && tally.paths > tally.problems, "{tally:?}");
    tally
}

#[test]
fn the_paths_over_water_are_those_that_are_certain_and_no_others() {
    check_water([500, 500, 500]);
}

#[test]
#[ignore = "takes half a minute; `tests/run long` has it"]
fn the_paths_over_more_water_are_those_that_are_certain_and_no_others() {
    check_water([3334, 3333, 3333]);
}

/// Compares these numbers of problems over coarse, gentle and rough water.
fn check_water(problems: [u32; 3]) {
    let mut all = Tally::default();
    for ((cells, amplitude), problems) in [(6, 0.1), (12, 0.05), (16, 0.15)].into_iter().zip(problems) {
        let tally = compare(cells, amplitude, problems);
        let [missed, missed_of_all] = tally.missed();
        assert!((1e-3..0.5).contains(&missed) && missed < missed_of_all, "{tally:?}");
        all = all + tally;
    }
    println!("{all:?}: the published walk misses {:.1} percent of all", 100.0 * all.missed()[1]);
    assert_eq!(all.problems, problems.iter().sum::<u32>() as usize);
}

/// Most of these triangles are so small that they hold one path at the most, which no triangle of the coarser water is;
/// the tree has five levels.
#[test]
fn the_paths_over_fine_water_are_those_that_are_certain_and_no_others() {
    let tally = compare(100, 0.05, 25) + compare(100, 0.1, 25);
    assert_eq!(tally.problems, 50);
}
