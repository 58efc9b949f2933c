//! What is certified, against paths that are sought in other ways.

use super::super::enumeration::{Enumeration, enumerate};
use super::super::fermat::Connection;
use super::super::newton::{SearchRegion, solve_complete};
use super::super::testing::{between, pair, pane, random};
use super::*;
use crate::geometry::testing::Glass;
use crate::geometry::{Pane, Ray};
use crate::light::Source;
use clerestory_film::TrialStream;

/// What came of many windows.
#[derive(Debug, Default)]
struct Tally {
    windows: u32,
    certified: u32,
    without_fold: u32,
    /// Points of certified lights that a path leads to.
    reached: u32,
}

/// A light, and the shading point from which it is looked at.
struct Look {
    origin: DVec3,
    bounds: SourceBounds,
}

impl Look {
    /// From near and far, straight and at grazing angles; through the middle of what is to be seen.
    fn new(pane: &Pane, case: u32, random: &mut TrialStream) -> Self {
        let sign = if case.is_multiple_of(2) { 1.0 } else { -1.0 };
        let distance = between(random, 0.05, 1.0).powi(2) * 6.0;
        let reach = if case % 8 < 2 { 12.0 } else { 1.5 };
        let origin = ((pair(random) - 0.5) * reach * distance).extend(-sign * (0.01 + distance));
        let through = (pair(random) - 0.5) * pane.size();
        let direction = (through.extend(0.0) - origin).normalize();
        let size = between(random, 0.0, 1.0).powi(4) * 0.1;
        let bounds = if case % 4 < 2 {
            SourceBounds::Cap { direction, sin_radius: size }
        } else {
            let far = between(random, 0.1, 2.0).powi(3);
            let centre = through.extend(0.0) + direction * (far + size / direction.z.abs());
            SourceBounds::Ball { centre, radius: size * far }
        };
        Self { origin, bounds }
    }

    /// A point of the light.
    fn point(&self, random: &mut TrialStream) -> Source {
        let off = DVec3::new(random.next_f64(), random.next_f64(), random.next_f64()) * 2.0 - 1.0;
        let off = off / off.length().max(1.0);
        match self.bounds {
            SourceBounds::Cap { direction, sin_radius } => {
                let across = off - direction * off.dot(direction);
                Source::Direction(
                    (direction * (1.0 - sin_radius * sin_radius).sqrt() + across * sin_radius).normalize(),
                )
            }
            SourceBounds::Ball { centre, radius } => Source::Point(centre + off * radius),
        }
    }
}

/// Looks through a pane many times, and for more paths than a certificate allows.
#[track_caller]
fn check(glass: Glass, amplitude: f64, cases: u32, seed: u32) -> Tally {
    let pane = &pane(glass, amplitude);
    let mut random = random(seed);
    let counters = &mut Counters::default();
    let mut tally = Tally::default();
    for case in 0..cases {
        let look = Look::new(pane, case, &mut random);
        let Some(side) = PaneSide::facing(pane, look.origin) else { continue };
        let Some(window) = Window::new(&side, look.origin, &look.bounds) else { continue };
        tally.windows += 1;
        let Some(certificate) = Certificate::new(&window, &look.bounds, MOST_LOOKS, counters) else { continue };
        let Certificate::OnePath(held) = certificate else {
            tally.without_fold += 1;
            check_determinants(&look, &window, &mut random);
            continue;
        };
        tally.certified += 1;
        for _ in 0..3 {
            let source = look.point(&mut random);
            let connection = Connection::new(&side, look.origin, source);
            let region = SearchRegion::around(&window.entry(), pane.thickness);
            let bounds = match source {
                Source::Point(centre) => SourceBounds::Ball { centre, radius: 0.0 },
                Source::Direction(direction) => SourceBounds::Cap { direction, sin_radius: 0.0 },
            };
            let own = Window::new(&side, look.origin, &bounds);
            let mut roots = own.map_or_else(Vec::new, |own| {
                let Enumeration { roots, .. } = enumerate(&own, &connection, &region, counters);
                roots.to_vec()
            });
            for _ in 0..2 {
                let place = window.rect().min + (window.rect().max - window.rect().min) * pair(&mut random);
                let seed = connection.thin_seed(place, counters);
                roots.extend(seed.and_then(|seed| solve_complete(&connection, seed, &region, counters)));
            }
            roots.retain(|root| root.path.crosses(side.sign) && held.contains(window.place_of(root.path.vertices[0])));
            tally.reached += u32::from(!roots.is_empty());
            let is_only = roots.iter().all(|root| region.same(root, &roots[0]));
            assert!(is_only, "case {case}: {:?}", roots.iter().map(|root| root.theta).collect::<Vec<_>>());
        }
    }
    println!("{tally:?}");
    tally
}

/// Where no point of a light is on a fold, paths to its points that are found from anywhere in the window have factors
/// that do not differ without bounds: they have the same sign of the determinant all over a path that moves.
fn check_determinants(look: &Look, window: &Window<'_>, random: &mut TrialStream) {
    let counters = &mut Counters::default();
    let side = window.side();
    let source = look.point(random);
    let connection = Connection::new(side, look.origin, source);
    let region = SearchRegion::around(&window.entry(), side.pane.thickness);
    let place = window.rect().min + (window.rect().max - window.rect().min) * pair(random);
    let seed = connection.thin_seed(place, counters);
    let Some(root) = seed.and_then(|seed| solve_complete(&connection, seed, &region, counters)) else { return };
    let at = window.place_of(root.path.vertices[0]);
    if !root.path.crosses(side.sign) || !window.rect().contains(at) {
        return;
    }
    // The same path, followed across the light.
    for _ in 0..4 {
        let other = Connection::new(side, look.origin, look.point(random));
        let mut theta = root.theta;
        let mut sign = root.determinant.signum();
        for step in 1..=8 {
            let (Source::Point(from) | Source::Direction(from)) = source;
            let (Source::Point(to) | Source::Direction(to)) = other.source;
            let between = from.lerp(to, f64::from(step) / 8.0);
            let between = match source {
                Source::Point(_) => Source::Point(between),
                Source::Direction(_) => Source::Direction(between.normalize()),
            };
            let connection = Connection::new(side, look.origin, between);
            let Some(next) = solve_complete(&connection, theta, &region, counters) else { break };
            let place = window.place_of(next.path.vertices[0]);
            let jumped = (next.theta[0] - theta[0]).length() > 0.2 * (window.rect().max - window.rect().min).length();
            if jumped || !window.rect().contains(place) {
                break;
            }
            assert_eq!(next.determinant.signum(), sign, "a fold within a light that was certified to be without");
            (theta, sign) = (next.theta, next.determinant.signum());
        }
    }
}

#[test]
fn a_certified_light_is_seen_once_at_the_most() {
    let gentle = check(Glass::Crown, 0.03e-3, 2000, 1);
    assert!(gentle.certified * 3 > gentle.windows && gentle.reached > 500, "{gentle:?}");
    let bumpy = check(Glass::Bumpy, 0.01e-3, 2000, 2);
    assert!(bumpy.certified > 50, "{bumpy:?}");
    // Much of it shows lights more than once.
    let rough = check(Glass::Crown, 0.3e-3, 2000, 3);
    assert!(rough.certified < rough.windows, "{rough:?}");
    check(Glass::Steep, 0.05e-3, 1000, 4);
    let flat = check(Glass::Flat, 0.0, 500, 5);
    assert!(flat.certified * 3 > flat.windows * 2, "{flat:?}");
}

#[test]
#[ignore = "a million lights, in minutes"]
fn no_certificate_of_a_million_is_wrong() {
    let mut certified = 0;
    for (number, glass) in [Glass::Crown, Glass::Bumpy, Glass::Steep].into_iter().cycle().take(60).enumerate() {
        let amplitude = [0.005e-3, 0.02e-3, 0.08e-3, 0.3e-3][number % 4];
        certified += check(glass, amplitude, 20_000, 100 + number as u32).certified;
    }
    assert!(certified > 100_000, "{certified}");
}

/// The derivative is that of rays that are traced through the pane, and in its bounds.
#[test]
fn the_derivative_of_traced_rays_is_within_its_bounds() {
    for glass in [Glass::Crown, Glass::Bumpy, Glass::Steep] {
        let pane = pane(glass, 0.05e-3);
        let mut random = random(7);
        let counters = &mut Counters::default();
        let (mut checked, mut narrow) = (0, 0);
        for case in 0..400 {
            let look = Look::new(&pane, case, &mut random);
            let Some(side) = PaneSide::facing(&pane, look.origin) else { continue };
            let at = (pair(&mut random) - 0.5) * pane.size() * 0.9;
            let half = between(&mut random, 1e-5, 2e-3);
            let region = Rect::new(at - half, at + half);
            let (origin, source) = (look.origin, &look.bounds);
            let chain = Chain { side: &side, origin, source, region, counters };
            let Some(derivative) = widest::run(chain) else { continue };
            let end = |place: DVec2, counters: &mut Counters| {
                let towards = place.extend(side.near_base()) - look.origin;
                let through = side.transmit(&Ray::new(look.origin, towards.normalize()), counters)?;
                let tangent = through.direction.truncate() / (through.direction.z * side.sign);
                Some(match look.bounds {
                    SourceBounds::Cap { .. } => tangent,
                    SourceBounds::Ball { centre, .. } => {
                        through.exit.truncate() + tangent * ((centre.z - through.exit.z) * side.sign)
                    }
                })
            };
            let place = region.min + (region.max - region.min) * pair(&mut random);
            let step = 1e-6;
            for (column, axis) in [DVec2::X, DVec2::Y].into_iter().enumerate() {
                let ends = [-step, step].map(|step| end(place + axis * step, counters));
                let [Some(before), Some(after)] = ends else { continue };
                let slope = (after - before) / (2.0 * step);
                for row in 0..2 {
                    let bounds = derivative[row][column];
                    let slack = 1e-4 * (1.0 + bounds.magnitude());
                    let inside = bounds.min - slack <= slope[row] && slope[row] <= bounds.max + slack;
                    assert!(inside, "case {case}, {row} {column}: {} not in {bounds:?}", slope[row]);
                    checked += 1;
                    narrow += u32::from(bounds.max - bounds.min < 0.2 * (1.0 + bounds.magnitude()));
                }
            }
        }
        assert!(checked > 400 && narrow > checked / 12, "{checked} {narrow}");
    }
}
