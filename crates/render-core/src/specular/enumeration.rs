//! All paths from a shading point to a source through a pane, with a test that there are no others.
//!
//! The window is halved again and again. A part is dropped where the bounds show that no light from it reaches the source.
//! Where the derivative of the landing stays near one invertible matrix all over the part, it holds at most one path
//! (Krawczyk 1969; Neumaier, "Interval Methods for Systems of Equations", 1990, section 5.1): one shot from its middle
//! then bounds where that path can be, or shows that there is none, and Newton's method finds it. What is left in the end
//! are parts on a fold of the caustic; seeds in them find their paths, but nothing says that these are all.
//!
//! Small terms of the derivative are estimated and not bounded (`landing`), so `complete` is all but a proof. Who relies on
//! it for an unbiased result has to look for further paths now and then.

use glam::DVec2;

use super::{
    fermat::Connection,
    newton::{Root, SearchRegion, solve_complete},
    widest::{self, Computation},
    window::Window,
};
use crate::{
    counters::Counters,
    geometry::{Rect, ShapeBounds},
};

/// The paths that were found.
#[derive(Clone, Debug)]
pub struct Enumeration {
    /// Distinct stationary paths.
    pub roots: Vec<Root>,
    /// Whether the bounds say that there is no other.
    pub complete: bool,
}

/// Parts that are looked at, at the most.
const MOST_PARTS: usize = 1000;

/// A part is not halved below this many cells of the finer face: what then is left lies on a fold, and more halving would
/// cost more than it finds.
const SMALLEST: f64 = 0.25;

/// A shot lands with less than this error, in thicknesses of the pane: its second vertex is off by less than its last
/// step (`fermat::Connection::shoot`).
const SHOT_ERROR: f64 = 1e-4;

/// Larger parts, in cells of the finer face, are halved without a shot, and all but the whole window without a look at the
/// curvatures: over so many cells they hardly ever say anything.
const LARGE: f64 = 4.0;

/// What is left of a part is looked at again before it is halved if its area is less than this share of the part's.
const SMALLER: f64 = 0.5;

/// Room for the parts of most windows.
const USUAL_PARTS: usize = 64;

/// A part and the shapes of the faces there.
struct Seen {
    rect: Rect,
    /// What can matter of the rectangle, by the slopes there.
    part: Rect,
    shapes: [ShapeBounds; 2],
}

/// What is known of a part after one shot.
enum Finding {
    /// It holds no path, or just the one that is now known.
    Settled,
    /// It may hold others, and only in this rectangle.
    Open(Rect),
}

/// The search in one window.
struct Search<'a, 'b> {
    window: &'b Window<'a>,
    connection: &'b Connection<'a>,
    region: &'b SearchRegion,
    /// Rounding and the error of a shot.
    slack: f64,
    large: f64,
    roots: Vec<Root>,
}

/// What is sought.
struct Problem<'a, 'b> {
    window: &'b Window<'a>,
    connection: &'b Connection<'a>,
    region: &'b SearchRegion,
    counters: &'b mut Counters,
}

impl Computation for Problem<'_, '_> {
    type Output = Enumeration;

    #[inline(always)]
    fn run(self) -> Enumeration {
        all_paths(self.window, self.connection, self.region, self.counters)
    }
}

/// Finds all paths of a connection through a window.
pub fn enumerate<'a>(
    window: &Window<'a>,
    connection: &Connection<'a>,
    region: &SearchRegion,
    counters: &mut Counters,
) -> Enumeration {
    widest::run(Problem { window, connection, region, counters })
}

#[inline(always)]
fn all_paths<'a>(
    window: &Window<'a>,
    connection: &Connection<'a>,
    region: &SearchRegion,
    counters: &mut Counters,
) -> Enumeration {
    let side = window.side();
    let slack = SHOT_ERROR * side.pane.thickness;
    let cell = side.near_surface().cell_size().min(side.far_surface().cell_size()).min_element();
    let mut search = Search { window, connection, region, slack, large: LARGE * cell, roots: Vec::new() };
    let mut complete = true;
    let mut unseen = Vec::with_capacity(USUAL_PARTS);
    let mut seen = Vec::with_capacity(USUAL_PARTS);
    unseen.push(*window.rect());
    let mut looked_at = 0;
    loop {
        // One part after the other without a shot in between: each look waits for little but itself, and none for another.
        while let Some(rect) = unseen.pop() {
            looked_at += 1;
            if looked_at > MOST_PARTS {
                // What has been seen may still hold paths.
                complete = false;
                unseen.clear();
                break;
            }
            if looked_at > 1 && (rect.max - rect.min).max_element() > search.large {
                if let Some(part) = window.part(&rect) {
                    push_smaller(&mut unseen, &rect, part.rect);
                }
                continue;
            }
            let around = rect.grown(slack);
            if !window.landing().meets_glass(&around) {
                continue;
            }
            let shapes = window.landing().shapes(&around, counters);
            let Some(part) = window.shaped_part(&rect, &shapes) else { continue };
            if part.area() < SMALLER * rect.area() {
                unseen.push(part);
            } else {
                seen.push(Seen { rect, part, shapes });
            }
        }
        let Some(Seen { rect, part, shapes }) = seen.pop() else { break };
        let Finding::Open(rect) = search.shoot(&rect, &part, &shapes, counters) else { continue };
        let size = rect.max - rect.min;
        if size.max_element() > SMALLEST * cell || rect.area() < SMALLER * part.area() {
            push_smaller(&mut unseen, &part, rect);
        } else {
            complete = false;
            search.solve_from(rect.centre(), counters);
        }
    }
    Enumeration { roots: search.roots, complete }
}

/// Keeps what is left of a part for another look, or its halves.
fn push_smaller(stack: &mut Vec<Rect>, part: &Rect, left: Rect) {
    if left.area() < SMALLER * part.area() {
        stack.push(left);
    } else {
        stack.extend(left.halves());
    }
}

impl Search<'_, '_> {
    /// Shoots from the middle of a rectangle around which the faces have the given shapes. `part` is what matters of it.
    #[inline(always)]
    fn shoot(&mut self, rect: &Rect, part: &Rect, shapes: &[ShapeBounds; 2], counters: &mut Counters) -> Finding {
        let landing = self.window.landing();
        let half_size = 0.5 * (part.max - part.min);
        let Some(stretch) = landing.stretch(shapes) else { return Finding::Open(*part) };
        let injective = stretch.is_injective(half_size + self.slack);
        if !injective && half_size.max_element() > 0.5 * self.large {
            return Finding::Open(*part);
        }
        let Some(shot) = self.connection.shoot(&shapes[0].middle, &shapes[1].middle, counters) else {
            return Finding::Open(*part);
        };
        // The way from there to any place of the part has to lie where the derivative is bounded.
        let known = rect.grown(self.slack);
        let stretch = if known.contains(shot.place) {
            Some(stretch)
        } else {
            let hull = Rect::new(known.min.min(shot.place), known.max.max(shot.place));
            landing.stretch(&landing.shapes(&hull, counters).map(ShapeBounds::everywhere))
        };
        let Some(stretch) = stretch else { return Finding::Open(*part) };
        let around = part.grown(self.slack);
        let part = &stretch.reaching(part, shot.place, shot.miss, self.slack);
        if part.is_empty() {
            return Finding::Settled;
        }
        let away = (part.min - shot.place).abs().max((part.max - shot.place).abs());
        let predicted = shot.place + stretch.inverse * shot.miss;
        let reach = stretch.error_of_prediction(away, self.slack);
        let possible = Rect::new(predicted - reach, predicted + reach).intersection(part);
        if possible.is_empty() {
            return Finding::Settled;
        }
        if !injective {
            return Finding::Open(possible);
        }
        if around.contains(predicted)
            && let Some(root) = solve_complete(self.connection, shot.theta, self.region, counters)
        {
            let place = self.window.place_of(root.path.vertices[0]);
            // A stationary path may be a reflection, of which the bounds say nothing.
            let refracted = root.path.crosses(self.window.side().sign);
            self.add(root);
            if refracted && around.contains(place) {
                return Finding::Settled;
            }
        }
        Finding::Open(possible)
    }

    fn solve_from(&mut self, place: DVec2, counters: &mut Counters) {
        let seed = self.connection.thin_seed(place, counters);
        let root = seed.and_then(|seed| solve_complete(self.connection, seed, self.region, counters));
        if let Some(root) = root {
            self.add(root);
        }
    }

    fn add(&mut self, root: Root) {
        if !self.roots.iter().any(|known| self.region.same(known, &root)) {
            self.roots.push(root);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{
        geometry::testing::Glass,
        optics::Source,
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
            let through = (pair(&mut random) - 0.5) * pane.size;
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
                    && root.theta.iter().all(|vertex| pane.outline().contains(*vertex));
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
            for _ in 0..100 {
                let origin = ((pair(&mut random) - 0.5) * 0.6).extend(-0.9);
                let centre = ((pair(&mut random) - 0.5) * 0.6).extend(1.5);
                let side = PaneSide::facing(&pane, origin).unwrap();
                let connection = Connection::new(&side, origin, Source::Point(centre));
                let region = SearchRegion::around(&pane.outline(), pane.thickness);
                let seed = [0, 1].map(|_| (pair(&mut random) - 0.5) * pane.size);
                let [mut widest, mut plain] = [Counters::default(); 2];
                let solved = [
                    (
                        solve_complete(&connection, seed, &region, &mut widest),
                        Complete(Solve { connection: &connection, seed, region: &region, counters: &mut plain }).run(),
                    ),
                    (
                        solve_published(&connection, seed, &region, &mut widest),
                        Published(Solve { connection: &connection, seed, region: &region, counters: &mut plain }).run(),
                    ),
                ];
                for (widest, plain) in &solved {
                    assert_eq!(widest.as_ref().map(bits), plain.as_ref().map(bits));
                }
                assert_eq!(widest, plain);
                let Some(window) = Window::new(&side, origin, &SourceBounds::Ball { centre, radius: 0.0 }) else {
                    continue;
                };
                let widest = enumerate(&window, &connection, &region, counters);
                let problem = Problem { window: &window, connection: &connection, region: &region, counters };
                let plain = problem.run();
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
