//! Tests of the shapes that the curve takes when it is not one arc through a triangle.

use glam::{DMat3, DVec2, DVec3};

use super::{
    certified::Problem,
    curve::{self, quadratic_form},
    ends::Ends,
    facet::Facet,
    facet_tree::FacetTree,
    neighbours::Neighbours,
    testing::{WATER, found, problem},
    walk::first_path,
};
use crate::light::Source;
use crate::math::bernstein::roots;
use crate::specular::testing::{between, pair, random};
use clerestory_film::TrialStream;

/// A triangle of some extent whose normals are tilted by up to `tilt`, as tangents.
pub(super) fn any_facet(random: &mut TrialStream, tilt: f64) -> Facet {
    let mut corner = |x: f64, y: f64| {
        DVec3::new(x + between(random, -0.3, 0.3), y + between(random, -0.3, 0.3), between(random, -0.1, 0.1))
    };
    let corners = [corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.0, 0.5)];
    let normals = [0, 1, 2].map(|_| ((pair(random) - 0.5) * (2.0 * tilt)).extend(1.0).normalize());
    Facet { corners, normals }
}

/// Whether the paths over a facet are those that are certain. False where none can be certain.
#[track_caller]
fn check(facet: &Facet, ends: &Ends) -> bool {
    let Some(certain) = Problem::new(facet, ends).paths() else { return false };
    let mut places: Vec<DVec2> = Vec::new();
    for weights in certain {
        if places.iter().all(|known| (*known - weights).abs().max_element() > 1e-8) {
            places.push(weights);
        }
    }
    let ours = facet.paths(ends);
    let known = |weights: &DVec2| places.iter().any(|other| (*other - *weights).abs().max_element() < 1e-6);
    assert!(
        ours.len() == places.len() && ours.iter().all(known),
        "{ours:?} are not {places:?} for {facet:?}, {ends:?}"
    );
    true
}

/// The matrix of the curve on a facet.
fn form_on(facet: &Facet, ends: &Ends) -> Option<DMat3> {
    let columns = |corners: &[DVec3; 3]| DMat3::from_cols(corners[0], corners[1], corners[2]);
    quadratic_form(&columns(&facet.corners), &columns(&facet.normals), ends)
}

/// How often the curve crosses each edge.
fn crossings(facet: &Facet, ends: &Ends) -> Option<[usize; 3]> {
    let met = curve::crossings(&form_on(facet, ends)?);
    Some([0, 1, 2].map(|edge: usize| met.iter().filter(|weights| weights[(edge + 2) % 3] == 0.0).count()))
}

/// Whether the arcs of the curve are all of it within the triangle, end where it crosses edges, and are on it. False
/// where there are none, since it is too close to a pair of lines.
#[track_caller]
fn check_arcs(form: &DMat3) -> bool {
    const PARTS: u32 = 200;
    let Some(arcs) = curve::arcs_within(form) else { return false };
    let polylines: Vec<Vec<DVec3>> = arcs
        .iter()
        .map(|arc| {
            let at = |part: u32| curve::value(arc, f64::from(part) / f64::from(PARTS));
            (0..=PARTS).map(at).map(|weights| weights / weights.element_sum()).collect()
        })
        .collect();
    let largest = form.to_cols_array().into_iter().fold(0.0, |largest: f64, entry| largest.max(entry.abs()));
    for weights in polylines.iter().flatten() {
        assert!(weights.min_element() > -1e-6, "{weights} on {form}");
        assert!(weights.dot(*form * *weights).abs() < 1e-6 * largest, "{weights} on {form}");
    }
    let met = curve::crossings(form);
    for crossing in &met {
        let near = |line: &Vec<DVec3>| [line[0], line[line.len() - 1]].iter().any(|end| end.distance(*crossing) < 1e-5);
        assert!(polylines.iter().any(near), "{crossing} on {form}: {arcs:?}");
    }
    // Where lines beside the first edge cross the curve.
    for part in 1..20 {
        let across = f64::from(part) / 20.0;
        let [from, to] = [DVec3::new(1.0 - across, 0.0, across), DVec3::new(0.0, 1.0 - across, across)];
        roots(&[from.dot(*form * from), from.dot(*form * to), to.dot(*form * to)], &mut |t| {
            let place = from.lerp(to, t);
            let to_segment = |pair: &[DVec3]| {
                let along = pair[1] - pair[0];
                let t = (place - pair[0]).dot(along) / along.length_squared().max(1e-300);
                pair[0].lerp(pair[1], t.clamp(0.0, 1.0)).distance(place)
            };
            let distance =
                polylines.iter().flat_map(|line| line.windows(2)).map(to_segment).fold(f64::INFINITY, f64::min);
            assert!(distance < 1e-2, "{place} is {distance} from the arcs on {form}: {arcs:?}");
        });
    }
    true
}

/// Checks facets on which the curve crosses the edges as wanted, until `facets` of them had a path.
#[track_caller]
fn check_where(wanted: impl Fn([usize; 3]) -> bool, facets: usize) {
    let mut random = random(21);
    let (mut checked, mut followed, mut with_paths) = (0, 0, 0);
    for case in 0..2_000_000 {
        let facet = any_facet(&mut random, 0.8);
        let ends = problem(&mut random, case);
        if crossings(&facet, &ends).is_some_and(&wanted) && check(&facet, &ends) {
            followed += usize::from(check_arcs(&form_on(&facet, &ends).unwrap()));
            checked += 1;
            with_paths += usize::from(!facet.paths(&ends).is_empty());
            if with_paths == facets {
                println!("{checked} facets, {followed} followed, {with_paths} with paths, of {case}");
                assert!(followed * 100 >= checked * 98, "{followed} of {checked}");
                return;
            }
        }
    }
    panic!("only {with_paths} of {checked} facets have paths");
}

#[test]
fn paths_on_an_ellipse_within_the_triangle_are_found() {
    check_where(|counts| counts == [0; 3], 40);
}

#[test]
fn paths_are_found_on_an_ellipse_of_which_an_edge_cuts_off_however_little() {
    let mut random = random(27);
    let (mut ellipses, mut paths, mut cut_off) = (0, 0, 0);
    for case in 0..200_000 {
        let facet = any_facet(&mut random, 0.8);
        let ends = problem(&mut random, case);
        if crossings(&facet, &ends) != Some([0; 3]) || facet.paths(&ends).is_empty() {
            continue;
        }
        let Some(arcs) = form_on(&facet, &ends).and_then(|form| curve::arcs_within(&form)) else { continue };
        let weights = |arc: &curve::Arc, part: u32| curve::value(arc, f64::from(part) / 1e4);
        let first_weights =
            arcs.iter().flat_map(|arc| (0..=10_000).map(move |part| weights(arc, part))).map(|w| w.x / w.element_sum());
        let least = first_weights.fold(f64::INFINITY, f64::min);
        ellipses += 1;
        // What is left of the triangle, whose new edge is that much beyond the ellipse's outermost place, or before it.
        for beyond in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 0.0, -1e-9, -1e-6] {
            let edge = least + beyond;
            let corners = [DVec2::ZERO, DVec2::new(1.0 - edge, 0.0), DVec2::new(0.0, 1.0 - edge)];
            let part = Facet {
                corners: corners.map(|corner| facet.place(corner)),
                normals: corners.map(|corner| facet.normal(corner)),
            };
            let counts = crossings(&part, &ends);
            if check(&part, &ends) {
                paths += part.paths(&ends).len();
                cut_off += usize::from(counts.is_some_and(|counts| counts != [0; 3]));
            }
        }
    }
    println!("{ellipses} ellipses, {paths} paths, {cut_off} cut off");
    assert!(ellipses > 100 && paths > 1000 && cut_off > 500, "{ellipses} {paths} {cut_off}");
}

#[test]
fn paths_are_found_where_the_curve_crosses_the_edges_four_times_and_more() {
    check_where(|counts| counts.iter().sum::<usize>() >= 4, 200);
}

#[test]
fn paths_are_found_where_the_curve_crosses_one_edge_twice_and_no_other() {
    check_where(
        |mut counts| {
            counts.sort_unstable();
            counts == [0, 0, 2]
        },
        100,
    );
}

#[test]
fn the_path_over_a_flat_triangle_is_found() {
    let mut random = random(22);
    let mut found = 0;
    for case in 0..2000 {
        let normal = ((pair(&mut random) - 0.5) * 0.4).extend(1.0).normalize();
        let facet = Facet { normals: [normal; 3], ..any_facet(&mut random, 0.0) };
        let ends = problem(&mut random, case);
        assert!(check(&facet, &ends));
        found += facet.paths(&ends).len();
    }
    assert!(found > 300, "{found}");
}

#[test]
fn the_path_that_is_straight_is_found_wherever_the_normal_is_along_it() {
    let mut random = random(23);
    for case in 0..2000 {
        let bent = case % 2 == 0;
        let facet = any_facet(&mut random, 0.3);
        let facet = if bent { facet } else { Facet { normals: [DVec3::Z; 3], ..facet } };
        // The curve crosses itself there, or everything on the triangle is coplanar.
        let at = DVec2::new(0.2, 0.3) + pair(&mut random) * 0.2;
        let (place, normal) = (facet.place(at), facet.normal(at).normalize());
        let (below, above) = (place - normal * between(&mut random, 0.5, 2.0), place + normal);
        for ends in [
            Ends::refracted(below, Source::Point(above), WATER, false),
            Ends::refracted(above, Source::Direction(-normal), WATER, true),
            Ends::mirrored(above, Source::Point(place + normal * 3.0)),
        ] {
            let near = |weights: &DVec2| (*weights - at).abs().max_element() < 1e-7;
            assert!(facet.paths(&ends).iter().any(near), "{case}: {facet:?} {ends:?}");
            check(&facet, &ends);
        }
    }
}

#[test]
fn a_curve_that_total_reflection_interrupts_is_followed_on_both_sides() {
    let mut random = random(24);
    let (mut interrupted, mut found) = (0, 0);
    for _ in 0..4000 {
        let facet = any_facet(&mut random, 0.6);
        // From under water at grazing angles.
        let point = DVec3::new(between(&mut random, 1.0, 1.6), between(&mut random, -0.5, 0.5), -1.0);
        let light = DVec3::new(between(&mut random, -3.0, 0.0), between(&mut random, -1.0, 1.0), 0.7);
        let ends = Ends::refracted(point, Source::Point(light), WATER, false);
        let reflects = |weights: DVec2| {
            let direction = (facet.place(weights) - point).normalize();
            crate::bsdf::fresnel::refract(direction, facet.normal(weights).normalize(), WATER, 1.0).is_none()
        };
        let corners = [DVec2::ZERO, DVec2::X, DVec2::Y].map(reflects);
        if corners.contains(&true) && corners.contains(&false) {
            interrupted += 1;
            assert!(check(&facet, &ends));
            found += facet.paths(&ends).len();
        }
    }
    assert!(interrupted > 500 && found > 50, "{interrupted} {found}");
}

#[test]
fn paths_are_found_where_the_curve_crosses_itself() {
    let mut random = random(25);
    let (mut crossed, mut followed, mut paths) = (0, 0, 0);
    for case in 0..200_000 {
        let ends = problem(&mut random, case);
        let (from, to) = (any_facet(&mut random, 0.8), any_facet(&mut random, 0.8));
        let facet = |part: f64| Facet {
            corners: from.corners,
            normals: [0, 1, 2].map(|k| from.normals[k].lerp(to.normals[k], part).normalize()),
        };
        // Between two facets whose curves are of two kinds there is one whose curve is a pair of lines.
        let determinant = |part: f64| form_on(&facet(part), &ends).map_or(0.0, |form| form.determinant());
        let (mut low, mut high) = (0.0, 1.0);
        if determinant(low) * determinant(high) >= 0.0 {
            continue;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if determinant(middle) * determinant(0.0) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let facet = facet(low);
        let Some(form) = form_on(&facet, &ends) else { continue };
        let node = form.x_axis.cross(form.y_axis);
        let node = node / node.element_sum();
        // Lines that cross, rather than a single place.
        let lines = form.x_axis.x * form.y_axis.y < form.x_axis.y * form.x_axis.y;
        let place = facet.place(DVec2::new(node.y, node.z));
        let beside_the_straight_line =
            (place - ends.point).normalize().cross(ends.across().normalize()).length() > 1e-3;
        if node.min_element() > 0.05 && lines && beside_the_straight_line && check(&facet, &ends) {
            assert!((form * node).abs().max_element() < 1e-9 * form.x_axis.length(), "{form} {node}");
            followed += usize::from(check_arcs(&form));
            crossed += 1;
            paths += facet.paths(&ends).len();
        }
    }
    println!("{crossed} crossed, {followed} followed, {paths} paths");
    assert!(crossed > 500 && paths > 100 && followed * 100 >= crossed * 95, "{crossed} {followed} {paths}");
}

#[test]
fn both_lines_of_a_pair_are_followed_where_they_go_through_corners() {
    // Each of the form `x l + y m + z n = 0`; a line through a corner has a zero there.
    let lines = [
        [DVec3::new(1.0, 0.0, -1.0), DVec3::new(1.0, -3.0, 1.0)],
        [DVec3::new(1.0, 0.0, -1.0), DVec3::new(0.0, 1.0, -2.0)],
        [DVec3::new(1.0, -1.0, 0.0), DVec3::new(0.0, 1.0, -1.0)],
        [DVec3::new(2.0, -1.0, 0.0), DVec3::new(-1.0, 0.5, 0.5)],
        [DVec3::new(1.0, 1.0, -1.0), DVec3::new(1.0, -1.0, 0.0)],
    ];
    for [l, m] in lines {
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        let form = (outer(l, m) + outer(m, l)) * 0.5;
        assert!(check_arcs(&form) && check_arcs(&(form * -3e-4)), "{form}");
    }
}

/// Squares of two triangles each with waves along one of their diagonals, that which is no edge, so that straight
/// curves along it go through a corner of every triangle.
fn waves_along_diagonals(cells: u32) -> Vec<Facet> {
    let corner = |i: u32, j: u32| {
        let place = (DVec2::new(f64::from(i), f64::from(j)) / f64::from(cells)) * 2.0 - 1.0;
        let angle = 4.0 * (place.x - place.y);
        let (height, slope) = (0.02 * libm::sin(angle), 0.08 * libm::cos(angle));
        (place.extend(height), DVec3::new(-slope, slope, 1.0).normalize())
    };
    let mut facets = Vec::new();
    for (i, j) in (0..cells).flat_map(|j| (0..cells).map(move |i| (i, j))) {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        for [x, y, z] in [[a, b, c], [a, c, d]] {
            facets.push(Facet { corners: [x.0, y.0, z.0], normals: [x.1, y.1, z.1] });
        }
    }
    facets
}

#[test]
fn the_walk_goes_on_behind_corners() {
    let facets = waves_along_diagonals(32);
    let triangles = 0..facets.len() as u32;
    let neighbours = Neighbours::of(triangles.clone(), |k| facets[k as usize]);
    let tree = FacetTree::over(triangles, |k| facets[k as usize]).unwrap();
    let mut random = random(26);
    let mut walks = 0;
    for _ in 0..300 {
        let mut on_diagonal = |height: f64| {
            let along = between(&mut random, -0.7, 0.7);
            DVec3::new(along, -along, height)
        };
        let (point, light) = (on_diagonal(-1.0), on_diagonal(1.5));
        let ends = Ends::refracted(point, Source::Point(light), WATER, false);
        let [certain] = found(&facets, &tree, &ends)[..] else { continue };
        let start = (0u32..).zip(&facets).find_map(|(k, facet)| Some((k, curve::straight_through(facet, &ends)?)));
        let path = first_path(start.unwrap(), |k| facets[k as usize], &neighbours, &ends);
        let (triangle, weights) = path.unwrap_or_else(|| panic!("no path for {ends:?}"));
        assert!((facets[triangle as usize].place(weights) - certain).length() < 1e-7, "{ends:?}");
        walks += 1;
    }
    assert!(walks > 200, "{walks}");
}
