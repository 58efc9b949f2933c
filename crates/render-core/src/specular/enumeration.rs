//! All paths from a shading point to a source through a pane, with a test that there are no others.
//!
//! The window is halved again and again. A part is dropped where the bounds show that no light from it reaches the
//! source. If the derivative of the end point stays near one invertible matrix all over a part, it holds at most one
//! path. This is Krawczyk's test (1969; Neumaier 1990, "Interval Methods for Systems of Equations", section 5.1). One
//! traced path from its middle then bounds where that path can be, or shows that there is none. Newton's method finds
//! it. The remaining parts are on a fold of the caustic. Seeds in them find their paths, but nothing proves that these
//! are all.
//!
//! Small terms of the derivative are estimated and not bounded (`deflection`), so `complete` is all but a proof. Who
//! relies on it for an unbiased result has to look for further paths now and then.

use glam::DVec2;
use smallvec::{SmallVec, smallvec};

use super::{
    fermat::{Connection, Theta},
    newton::{Root, SearchRegion, solve_complete},
    widest::{self, Computation},
    window::Window,
};
use crate::math::Rect;
use crate::math::simd::{Instructions, LANES, LaneRects, Lanes, Mask};
use clerestory_film::counters::Counters;

/// The paths that were found.
#[derive(Clone, Debug)]
pub struct Enumeration {
    /// Distinct stationary paths.
    pub roots: SmallVec<[Root; USUAL_PATHS]>,
    /// Whether the bounds say that there is no other.
    pub complete: bool,
}

/// Parts that are looked at, at the most.
const MOST_PARTS: usize = 1000;

/// A part is not halved below this many cells of the finer face: what then is left lies on a fold, and more halving
/// would cost more than it finds.
const SMALLEST: f64 = 0.25;

/// A traced path ends with less than this error, in thicknesses of the pane: its second vertex is off by less than its
/// last step (`Connection::trace_four`).
const TRACE_ERROR: f64 = 1e-4;

/// Larger parts, in cells of the finer face, are halved without a traced path, and all but the whole window without a
/// look at the curvatures: over this many cells they hardly ever say anything.
const LARGE: f64 = 4.0;

/// What is left of a part is looked at again before it is halved if its area is less than this share of the part's.
const SMALLER: f64 = 0.5;

/// Room for the parts of most windows, without allocating memory.
const USUAL_PARTS: usize = 64;

/// Room for the paths of most windows.
const USUAL_PATHS: usize = 4;

/// What is sought, and the search for it in one window.
struct Search<'a, 'b> {
    window: &'b Window<'a>,
    connection: &'b Connection<'a>,
    region: &'b SearchRegion,
    counters: &'b mut Counters,
    /// Rounding and the error of a traced path.
    slack: f64,
    /// The edge of a cell of the finer face.
    cell: f64,
    /// Parts that have to be looked at.
    unseen: SmallVec<[Rect; USUAL_PARTS]>,
    found: Enumeration,
}

/// What is known of four parts after a look, and a traced path at those that are worth it.
struct Findings {
    /// What can matter of them, by the slopes there.
    parts: [Rect; LANES],
    /// Where they may hold paths; empty where they hold none.
    left: [Rect; LANES],
    /// Whether `left` is so much smaller that it is worth another look.
    again: [bool; LANES],
    /// Whether there is at most one path, which is sought from the seed.
    single: [bool; LANES],
    seeds: [Theta; LANES],
}

/// Finds all paths of a connection through a window.
pub fn enumerate<'a>(
    window: &Window<'a>,
    connection: &Connection<'a>,
    region: &SearchRegion,
    counters: &mut Counters,
) -> Enumeration {
    widest::run(Search::new(window, connection, region, counters))
}

impl Computation for Search<'_, '_> {
    type Output = Enumeration;

    #[inline(always)]
    fn run<S: Instructions>(mut self, simd: S) -> Enumeration {
        let mut looked_at = 0;
        loop {
            let mut parts = [Rect::new(DVec2::ZERO, DVec2::ZERO); LANES];
            let mut count = 0;
            while count < LANES
                && let Some(rect) = self.unseen.pop()
            {
                looked_at += 1;
                if looked_at > MOST_PARTS {
                    // What is left may still hold paths.
                    self.found.complete = false;
                    self.unseen.clear();
                    break;
                }
                if looked_at > 1 && (rect.max - rect.min).max_element() > LARGE * self.cell {
                    if let Some(part) = self.window.part(&rect) {
                        self.push_smaller(&rect, part.rect);
                    }
                    continue;
                }
                parts[count] = rect;
                count += 1;
            }
            if count == 0 {
                return self.found;
            }
            let findings = self.look(simd, &parts, count);
            for lane in 0..count {
                self.follow(&findings, lane);
            }
        }
    }
}

impl<'a, 'b> Search<'a, 'b> {
    fn new(
        window: &'b Window<'a>,
        connection: &'b Connection<'a>,
        region: &'b SearchRegion,
        counters: &'b mut Counters,
    ) -> Self {
        let side = window.side();
        let cell = side.near_surface().cell_size().min(side.far_surface().cell_size()).min_element();
        Self {
            window,
            connection,
            region,
            counters,
            slack: TRACE_ERROR * side.pane.thickness,
            cell,
            unseen: smallvec![*window.rect()],
            found: Enumeration { roots: SmallVec::new(), complete: true },
        }
    }

    /// Looks at the first `count` of four parts, and traces a path from each middle.
    #[inline(always)]
    fn look<S: Instructions>(&mut self, simd: S, parts: &[Rect; LANES], count: usize) -> Findings {
        let (window, slack) = (self.window, self.slack);
        let deflection = window.deflection();
        let rects = LaneRects::new(simd, parts);
        let around = rects.grown(slack);
        let live = Mask::new(simd, [count > 0, count > 1, count > 2, count > 3]).and(deflection.meets_glass(around));
        if !live.any() {
            let none = live;
            return Findings::without_tracing(rects, none, none);
        }
        let shapes = deflection.shapes(around, live, self.counters);
        let (parts, reached) = window.shaped_parts(rects, &shapes);
        let live = live.and(reached);
        let again = parts.area().less_than(rects.area() * SMALLER);
        let traced_at = live.and_not(again);
        if !traced_at.any() {
            return Findings::without_tracing(parts, live, again);
        }
        let half_size = parts.half_size();
        let (mut stretch, regular) = deflection.stretch(&shapes);
        let injective = stretch.is_injective(half_size + DVec2::splat(slack));
        let large = Lanes::splat(simd, 0.5 * LARGE * self.cell).less_than(half_size.max_element());
        let traced_at = traced_at.and(regular).and(injective.or(large.not()));
        if !traced_at.any() {
            return Findings::without_tracing(parts, live, again);
        }
        let (traced, arrived) =
            self.connection.trace_four(&shapes[0].middle, &shapes[1].middle, traced_at, self.counters);
        let mut traced_at = traced_at.and(arrived);
        // The way from there to any place of the part has to lie where the derivative is bounded.
        let outside = traced_at.and_not(around.contains(traced.place));
        if outside.any() {
            let hull = LaneRects { min: around.min.min(traced.place), max: around.max.max(traced.place) };
            let [near, far] = deflection.shapes(hull, outside, self.counters);
            let (wider, regular) = deflection.stretch(&[near.everywhere(), far.everywhere()]);
            stretch = wider.where_or(outside, stretch);
            traced_at = traced_at.and_not(outside.and_not(regular));
        }
        let reaching = stretch.reaching(parts, traced.place, traced.miss, slack);
        let away = (reaching.min - traced.place).abs().max((reaching.max - traced.place).abs());
        let (predicted, off) = stretch.prediction(traced.place, traced.miss, away, slack);
        let possible = reaching.intersection(LaneRects { min: predicted - off, max: predicted + off });
        let left = possible.where_or(traced_at, parts);
        let single = traced_at.and(injective).and(parts.grown(slack).contains(predicted));
        Findings {
            parts: parts.to_array(),
            left: left.where_or_empty(live).to_array(),
            again: again.to_array(),
            single: single.to_array(),
            seeds: traced.moved(predicted),
        }
    }

    /// Solves what is left of a part, or keeps it for another look.
    #[inline(always)]
    fn follow(&mut self, findings: &Findings, lane: usize) {
        let (part, left) = (&findings.parts[lane], findings.left[lane]);
        if left.is_empty() {
            return;
        }
        if findings.again[lane] {
            self.unseen.push(left);
            return;
        }
        if findings.single[lane]
            && let Some(root) = solve_complete(self.connection, findings.seeds[lane], self.region, self.counters)
        {
            let place = self.window.place_of(root.path.vertices[0]);
            // A stationary path may be a reflection, of which the bounds say nothing.
            let refracted = root.path.crosses(self.window.side().sign);
            self.add(root);
            if refracted && part.grown(self.slack).contains(place) {
                return;
            }
        }
        let size = left.max - left.min;
        if size.max_element() > SMALLEST * self.cell || left.area() < SMALLER * part.area() {
            self.push_smaller(part, left);
        } else {
            self.found.complete = false;
            self.solve_from(left.centre());
        }
    }

    /// Keeps what is left of a part for another look, or its halves.
    fn push_smaller(&mut self, part: &Rect, left: Rect) {
        if left.area() < SMALLER * part.area() {
            self.unseen.push(left);
        } else {
            self.unseen.extend(left.halves());
        }
    }

    fn solve_from(&mut self, place: DVec2) {
        let seed = self.connection.thin_seed(place, self.counters);
        let root = seed.and_then(|seed| solve_complete(self.connection, seed, self.region, self.counters));
        if let Some(root) = root {
            self.add(root);
        }
    }

    fn add(&mut self, root: Root) {
        if !self.found.roots.iter().any(|known| self.region.same(known, &root)) {
            self.found.roots.push(root);
        }
    }
}

impl Findings {
    /// Of the `live` ones of four parts at which no traced path was worth its while.
    #[inline(always)]
    fn without_tracing<S: Instructions>(parts: LaneRects<S>, live: Mask<S>, again: Mask<S>) -> Self {
        Self {
            parts: parts.to_array(),
            left: parts.where_or_empty(live).to_array(),
            again: again.to_array(),
            single: [false; LANES],
            seeds: [[DVec2::ZERO; 2]; LANES],
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{
        geometry::testing::Glass,
        light::Source,
        specular::{
            newton::{Complete, Published, Solve, solve_published},
            side::PaneSide,
            testing::{between, pair, pane, random},
            window::SourceBounds,
        },
    };

    /// Counts of a comparison with random seeds.
    #[derive(Debug, Default)]
    struct Tally {
        problems: u32,
        proven: u32,
        roots: usize,
        missed: u32,
    }

    /// Enumerates the paths of random connections, and looks for others from random seeds.
    #[track_caller]
    fn check(glass: Glass, amplitude: f64, problems: u32) -> Tally {
        let pane = pane(glass, amplitude);
        let mut random = random(3);
        let counters = &mut Counters::default();
        let mut tally = Tally::default();
        for case in 0..problems {
            let sign = if case % 2 == 0 { 1.0 } else { -1.0 };
            let distance = between(&mut random, 0.2, 2.0);
            let origin = ((pair(&mut random) - 0.5) * distance).extend(-sign * distance);
            let through = (pair(&mut random) - 0.5) * pane.size();
            let direction = (through.extend(0.0) - origin).normalize();
            let bent = DVec3::new(random.next_f64(), random.next_f64(), random.next_f64()) - 0.5;
            let (source, bounds) = if case % 4 < 2 {
                let direction = (direction + bent * 0.02).normalize();
                (Source::Direction(direction), SourceBounds::Cap { direction, sin_radius: 0.0 })
            } else {
                let centre = through.extend(0.0) + (direction + bent * 0.02) * between(&mut random, 0.3, 5.0);
                (Source::Point(centre), SourceBounds::Ball { centre, radius: 0.0 })
            };
            let Some(side) = PaneSide::facing(&pane, origin) else { continue };
            let Some(window) = Window::new(&side, origin, &bounds) else { continue };
            let connection = Connection::new(&side, origin, source);
            let region = SearchRegion::around(&window.entry(), pane.thickness);
            let Enumeration { roots, complete } = enumerate(&window, &connection, &region, counters);
            tally.problems += 1;
            tally.proven += u32::from(complete);
            tally.roots += roots.len();
            for _ in 0..60 {
                let place = window.rect().min + (window.rect().max - window.rect().min) * pair(&mut random);
                let seed = connection.thin_seed(place, counters);
                let Some(root) = seed.and_then(|seed| solve_complete(&connection, seed, &region, counters)) else {
                    continue;
                };
                // The window holds the paths through the outline; the search from a seed may leave it.
                let held = window.rect().contains(window.place_of(root.path.vertices[0]))
                    && root.theta.iter().all(|vertex| pane.outline.contains(*vertex));
                if held && !roots.iter().any(|known| region.same(known, &root)) {
                    assert!(!complete, "case {case}: a path at {:?} beside {} others", root.theta, roots.len());
                    tally.missed += 1;
                    break;
                }
            }
        }
        println!("{glass:?} {amplitude}: {tally:?}");
        assert!(tally.problems * 2 > problems, "{tally:?}");
        tally
    }

    #[test]
    fn most_connections_through_gentle_glass_are_proven_complete() {
        let tally = check(Glass::Crown, 0.03e-3, 400);
        assert!(tally.proven * 100 > tally.problems * 99, "{tally:?}");
        // Bumps of the size of a cell: the bounds have to get better within a cell.
        let tally = check(Glass::Bumpy, 0.02e-3, 400);
        assert!(tally.proven * 100 > tally.problems * 90 && tally.missed == 0, "{tally:?}");
    }

    #[test]
    fn what_is_proven_complete_through_rough_glass_is_complete() {
        for tally in
            [check(Glass::Crown, 0.3e-3, 200), check(Glass::Bumpy, 0.2e-3, 100), check(Glass::Steep, 0.05e-3, 100)]
        {
            assert!(tally.roots > tally.problems as usize, "{tally:?}");
        }
    }

    /// The bits of a root.
    fn bits(root: &Root) -> Vec<u64> {
        let [near, far] = root.path.vertices;
        let numbers =
            root.theta.iter().flat_map(|vertex| vertex.to_array()).chain(near.to_array()).chain(far.to_array());
        numbers.chain([root.determinant]).map(f64::to_bits).collect()
    }

    #[test]
    fn every_processor_computes_the_same_bits() {
        for glass in Glass::ALL {
            let pane = pane(glass, 0.1e-3);
            let mut random = random(8);
            let counters = &mut Counters::default();
            let mut found = 0;
            for case in 0..100 {
                let origin = ((pair(&mut random) - 0.5) * 0.6).extend(-0.9);
                let centre = ((pair(&mut random) - 0.5) * 0.6).extend(1.5);
                let side = PaneSide::facing(&pane, origin).unwrap();
                let direction = (centre - origin).normalize();
                let (source, bounds) = if case % 2 == 0 {
                    (Source::Point(centre), SourceBounds::Ball { centre, radius: 0.0 })
                } else {
                    (Source::Direction(direction), SourceBounds::Cap { direction, sin_radius: 0.0 })
                };
                let connection = Connection::new(&side, origin, source);
                let region = SearchRegion::around(pane.outline.bounds(), pane.thickness);
                let seed = [0, 1].map(|_| (pair(&mut random) - 0.5) * pane.size());
                let [mut widest, mut plain] = [Counters::default(); 2];
                let solved = [
                    (
                        solve_complete(&connection, seed, &region, &mut widest),
                        Complete(Solve { connection: &connection, seed, region: &region, counters: &mut plain })
                            .run(pulp::Scalar256b),
                    ),
                    (
                        solve_published(&connection, seed, &region, &mut widest),
                        Published(Solve { connection: &connection, seed, region: &region, counters: &mut plain })
                            .run(pulp::Scalar256b),
                    ),
                ];
                for (widest, plain) in &solved {
                    assert_eq!(widest.as_ref().map(bits), plain.as_ref().map(bits));
                }
                assert_eq!(widest, plain);
                let Some(window) = Window::new(&side, origin, &bounds) else { continue };
                let widest = enumerate(&window, &connection, &region, counters);
                let problem = Search::new(&window, &connection, &region, counters);
                let plain = problem.run(pulp::Scalar256b);
                assert_eq!(widest.complete, plain.complete);
                assert!(widest.roots.iter().map(bits).eq(plain.roots.iter().map(bits)));
                found += plain.roots.len();
            }
            assert!(found > 10, "{glass:?}: {found} paths");
        }
    }

    #[test]
    fn a_flat_pane_has_exactly_one_path() {
        let tally = check(Glass::Flat, 0.0, 200);
        assert_eq!((tally.proven, tally.roots), (tally.problems, tally.problems as usize));
    }
}
