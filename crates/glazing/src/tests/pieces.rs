//! What holds for the pieces of every window.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec2;

use super::designs::{all, arch, border, without_lead};
use crate::polygon::{self, area, bounds, contains, edges};
use crate::{
    Bars, Cames, Diamonds, Filling, GlassCycle, GlassPattern, Head, Lead, Piece, Rectangles, WindowDesign, WindowPlan,
    Zone,
};

fn planned(design: &WindowDesign) -> WindowPlan {
    design.plan().unwrap_or_else(|error| panic!("{error}: {design:?}"))
}

/// Whether a line along an edge of either piece separates them, up to a tolerance.
fn are_apart(first: &[DVec2], second: &[DVec2], tolerance: f64) -> bool {
    let separates = |of: &[DVec2], other: &[DVec2]| {
        edges(of).any(|[from, to]| {
            let direction = (to - from).normalize();
            other.iter().all(|&corner| direction.perp_dot(corner - from) <= tolerance)
        })
    };
    separates(first, second) || separates(second, first)
}

fn assert_disjoint(pieces: &[Piece], tolerance: f64) {
    let mut boxes: Vec<([DVec2; 2], &Piece)> = pieces.iter().map(|piece| (bounds(&piece.outline), piece)).collect();
    boxes.sort_by(|([first, _], _), ([second, _], _)| first.x.total_cmp(&second.x));
    for (index, ([low, high], first)) in boxes.iter().enumerate() {
        let reached = boxes[index + 1..].iter().take_while(|([other_low, _], _)| other_low.x < high.x);
        for ([other_low, other_high], second) in reached {
            if low.y < other_high.y && other_low.y < high.y {
                let is_apart = are_apart(&first.outline, &second.outline, tolerance);
                assert!(is_apart, "{} and {}", first.place, second.place);
            }
        }
    }
}

/// Checks what is promised of a plan's pieces.
pub(super) fn assert_sound(plan: &WindowPlan) {
    let mut places = BTreeSet::new();
    for piece in &plan.pieces {
        assert!((3..=64).contains(&piece.outline.len()), "{}", piece.place);
        assert!(polygon::is_convex(&piece.outline), "{}: {:?}", piece.place, piece.outline);
        assert!(area(&piece.outline) > 0.0);
        let shortest = edges(&piece.outline).map(|[from, to]| from.distance(to)).fold(f64::INFINITY, f64::min);
        assert!(shortest > if plan.lead.is_some() { 1e-5 } else { 1e-9 }, "{}: {shortest:e}", piece.place);
        assert!(places.insert(piece.place), "{} is there twice", piece.place);
        let light = &plan.lights[piece.place.light];
        for &corner in &piece.outline {
            let distance = polygon::distance_to_border(light, corner);
            assert!(contains(light, corner) || distance < 1e-3, "{}: {distance}", piece.place);
        }
        assert!(piece.thickness_factor > 0.0);
        assert!((0.0..1.0).contains(&piece.cut.u) && (0.0..1.0).contains(&piece.cut.v));
    }
    assert!(plan.pieces.is_sorted_by_key(|piece| piece.place));
    let tolerance = plan.lead.as_ref().map_or(1e-4, |lead| -0.9 * lead.heart_thickness);
    assert_disjoint(&plan.pieces, tolerance);
}

#[test]
fn pieces_are_convex_in_their_light_and_apart_and_reach_under_the_flanges() {
    for design in all() {
        let plan = planned(&design);
        assert_sound(&plan);
        assert_tight(&plan, 80);
    }
}

/// Checks that pieces without lead cover their light. Drawn lines that nearly meet are moved together, by up to 0.4 mm.
pub(super) fn assert_covers(plan: &WindowPlan, is_drawn: bool) {
    for (index, light) in plan.lights.iter().enumerate() {
        let pieces = plan.pieces.iter().filter(|piece| piece.place.light == index);
        let covered: f64 = pieces.map(|piece| area(&piece.outline)).sum();
        let missing = (covered / area(light) - 1.0).abs();
        assert!(missing < if is_drawn { 2e-3 } else { 1e-6 }, "{missing:e} of light {index}");
    }
}

#[test]
fn without_lead_pieces_cover_their_light() {
    for design in all() {
        let is_drawn = design.glass_names().iter().any(|name| name.starts_with("drawn"));
        let plan = planned(&without_lead(design));
        assert_sound(&plan);
        assert_covers(&plan, is_drawn);
    }
}

/// A convex polygon whose edges are moved outwards.
fn outset(corners: &[DVec2], distance: f64) -> Vec<DVec2> {
    let moved: Vec<[DVec2; 2]> = edges(corners)
        .map(|[from, to]| {
            let direction = (to - from).normalize();
            [from - direction.perp() * distance, direction]
        })
        .collect();
    (0..moved.len())
        .map(|index| {
            let [[a, along], [b, other]] = [moved[index], moved[(index + 1) % moved.len()]];
            a + along * ((b - a).perp_dot(other) / along.perp_dot(other))
        })
        .collect()
}

#[test]
fn pieces_and_the_strips_under_the_lead_fill_the_light() {
    for filling in [
        Filling::Diamonds(Diamonds::default()),
        Filling::Rectangles(Rectangles { offset: 0.5, ..Rectangles::default() }),
        border(Filling::Diamonds(Diamonds::default())),
    ] {
        let design = WindowDesign { filling, ..WindowDesign::new(arch(0.7, 1.5, Head::Rectangle)) };
        let plan = planned(&design);
        let half_heart = 0.5 * Cames::default().heart_thickness;
        let cells: f64 = plan.pieces.iter().map(|piece| area(&outset(&piece.outline, half_heart))).sum();
        assert!((cells / (0.7 * 1.5) - 1.0).abs() < 1e-4, "{cells}");
        let glass: f64 = plan.pieces.iter().map(|piece| area(&piece.outline)).sum();
        assert!(glass < 0.99 * cells);
    }
}

/// Checks that light has no way past the glass: every point of a light lies on glass or under a flange.
pub(super) fn assert_tight(plan: &WindowPlan, points: u32) {
    let cames: Vec<([DVec2; 2], f64)> = (plan.cames.iter())
        .flat_map(|came| {
            let closing = came.is_closed.then(|| [came.path[came.path.len() - 1], came.path[0]]);
            let segments = came.path.windows(2).map(|ends| [ends[0], ends[1]]).chain(closing);
            segments.map(|ends| (ends, 0.5 * came.flange_width + 2e-4)).collect::<Vec<_>>()
        })
        .collect();
    let is_covered = |point: DVec2| {
        cames.iter().any(|&([from, to], width)| polygon::nearest(from, to, point).distance(point) <= width)
    };
    for (index, light) in plan.lights.iter().enumerate() {
        let pieces: Vec<&Piece> = plan.pieces.iter().filter(|piece| piece.place.light == index).collect();
        let [low, high] = bounds(light);
        for step in 0..points {
            // A rank-1 lattice of points.
            let part =
                DVec2::new(f64::from(step) / f64::from(points), (f64::from(step) * 0.618_033_988_749_895).fract());
            let point = low + (high - low) * part;
            if contains(light, point) && !pieces.iter().any(|piece| contains(&piece.outline, point)) {
                assert!(is_covered(point), "light shines past the glass at {point}");
            }
        }
    }
}

#[test]
fn neighbours_without_lead_share_their_edges_to_the_bit() {
    let design = WindowDesign {
        filling: Filling::Diamonds(Diamonds::default()),
        ..WindowDesign::new(arch(0.7, 1.6, Head::Equilateral))
    };
    let plan = planned(&without_lead(design));
    let bits = |corner: DVec2| corner.to_array().map(f64::to_bits);
    let mut open = BTreeMap::new();
    for [from, to] in plan.pieces.iter().flat_map(|piece| edges(&piece.outline).collect::<Vec<_>>()) {
        if open.remove(&[bits(to), bits(from)]).is_none() {
            open.insert([bits(from), bits(to)], [from, to]);
        }
    }
    for [from, to] in open.into_values() {
        let distance = polygon::distance_to_border(&plan.lights[0], 0.5 * (from + to));
        assert!(distance < 1e-6, "no neighbour at {from} to {to}: {distance}");
    }
}

#[test]
fn the_same_seed_gives_the_same_plan_and_another_seed_other_numbers() {
    let design = |seed| WindowDesign { seed, ..WindowDesign::new(arch(0.7, 1.6, Head::Equilateral)) };
    assert_eq!(planned(&design(1)), planned(&design(1)));
    let (first, second) = (planned(&design(1)), planned(&design(2)));
    assert_ne!(first.pieces[0].tilt, second.pieces[0].tilt);
    assert_eq!(first.cames, second.cames);
    let largest = first.pieces.iter().flat_map(|piece| piece.tilt).fold(0.0, |most: f64, tilt| most.max(tilt.abs()));
    assert!(largest > 0.3 && largest <= 0.9, "{largest}");
}

#[test]
fn a_checker_differs_between_neighbours() {
    let names = vec!["red".to_owned(), "blue".to_owned()];
    for filling in [Filling::Diamonds(Diamonds::default()), Filling::Rectangles(Rectangles::default())] {
        let design = WindowDesign {
            filling,
            glass: GlassPattern::Checker(GlassCycle { names: names.clone() }),
            ..WindowDesign::new(arch(0.7, 1.6, Head::Rectangle))
        };
        let plan = planned(&without_lead(design));
        let mut by_edge: BTreeMap<_, &str> = BTreeMap::new();
        let bits = |corner: DVec2| corner.to_array().map(f64::to_bits);
        for piece in &plan.pieces {
            for [from, to] in edges(&piece.outline) {
                let edge = [bits(from).min(bits(to)), bits(from).max(bits(to))];
                if let Some(other) = by_edge.insert(edge, &piece.glass) {
                    assert_ne!(other, piece.glass);
                }
            }
        }
    }
}

#[test]
fn a_border_has_its_own_glass() {
    let filling = border(Filling::Diamonds(Diamonds::default()));
    let plan = planned(&WindowDesign { filling, ..WindowDesign::new(arch(0.7, 1.6, Head::Round)) });
    for piece in &plan.pieces {
        let distance = piece.outline.iter().map(|&corner| polygon::distance_to_border(&plan.lights[0], corner));
        let is_border = distance.fold(f64::INFINITY, f64::min) < 0.04;
        assert_eq!(piece.place.zone == Zone::Border, is_border);
        assert_eq!(piece.glass, if is_border { "ruby" } else { "clear" });
    }
}

#[test]
fn cames_have_joints_at_their_ends() {
    for design in all().into_iter().step_by(7) {
        let plan = planned(&design);
        for came in plan.cames.iter().filter(|came| !came.is_closed) {
            for end in [came.path[0], came.path[came.path.len() - 1]] {
                let nearest = plan.joints.iter().map(|joint| joint.at.distance(end)).fold(f64::INFINITY, f64::min);
                assert!(nearest < 0.003, "{end}: {nearest}");
            }
        }
    }
}

#[test]
fn many_quarries_are_planned() {
    let filling = Filling::Diamonds(Diamonds { width: 0.03, height: 0.04 });
    let lead = Lead::Cames(Cames { flange_width: 0.004, border_width: 0.006, ..Cames::default() });
    let design =
        WindowDesign { filling, lead, bars: Bars::None, ..WindowDesign::new(arch(2.0, 6.0, Head::Equilateral)) };
    let plan = planned(&design);
    assert!((15_000..21_000).contains(&plan.pieces.len()), "{}", plan.pieces.len());
    assert!(plan.meshes().iter().map(|mesh| mesh.triangles.len()).sum::<usize>() > 0);
}
