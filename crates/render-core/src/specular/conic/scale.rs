//! Paths over millions of triangles, far from the origin, under far lights and close to the surface. The tree finds the
//! same ones as a test of all triangles one by one.

use glam::DVec3;
use rayon::prelude::*;

use super::{
    certified::all_paths,
    ends::Ends,
    facet::Facet,
    facet_tree::FacetTree,
    testing::{WATER, distinct, found, problem, water},
};
use crate::{
    light::Source,
    specular::testing::{between, pair, random},
};
use clerestory_film::TrialStream;

/// The paths of each triangle by itself.
fn of_all(facets: &[Facet], ends: &Ends) -> Vec<DVec3> {
    let by_facet =
        |facet: &Facet| facet.paths(ends).into_iter().map(|weights| facet.place(weights)).collect::<Vec<_>>();
    let mut places = Vec::new();
    for place in facets.par_iter().flat_map_iter(by_facet).collect::<Vec<_>>() {
        distinct(&mut places, place);
    }
    places
}

#[track_caller]
fn assert_same(ours: &[DVec3], theirs: &[DVec3], tolerance: f64, ends: &Ends) {
    let near = |place: &DVec3| theirs.iter().any(|other| (*other - *place).length() < tolerance);
    assert!(ours.len() == theirs.len() && ours.iter().all(near), "{ours:?} are not {theirs:?} for {ends:?}");
}

fn tree_over(facets: &[Facet]) -> FacetTree {
    FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap()
}

#[test]
fn paths_over_many_triangles_are_those_of_each_triangle_and_certain() {
    check_paths_over_water(200, 12);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn paths_over_two_million_triangles_are_those_of_each_triangle_and_certain() {
    check_paths_over_water(1000, 36);
}

/// Checks the paths over water of `cells` cells along each edge, two triangles each.
fn check_paths_over_water(cells: u32, cases: u32) {
    let facets = water(cells, 0.1);
    let tree = tree_over(&facets);
    let mut random = random(41);
    let (mut paths, mut opened) = (0, 0);
    for case in 0..cases {
        let ends = problem(&mut random, case);
        let ours = found(&facets, &tree, &ends);
        assert_same(&ours, &of_all(&facets, &ends), 1e-7, &ends);
        tree.visit(&ends, |_| opened += 1);
        paths += ours.len();
        if case < 4 {
            assert_same(&ours, &all_paths(&facets, &ends).unwrap(), 1e-7, &ends);
        }
    }
    println!("{paths} paths, {opened} triangles opened");
    assert!(paths > cases as usize && opened < 2 * paths, "{paths} {opened}");
}

/// Ends of paths over water around `middle`, by the number of the case: as usual, with a light as far as a star or a
/// lamp at the horizon, and with the shading point a hair below the surface.
fn extreme(random: &mut TrialStream, facets: &[Facet], middle: DVec3, case: u32) -> Ends {
    let mut place =
        |extent: f64, height: f64| middle + (pair(random) * 2.0 - 1.0).extend(height) * DVec3::new(extent, extent, 1.0);
    let (below, above) = (place(1.0, -1.0), place(1.0, 1.5));
    let far = (above - below).normalize();
    match case % 5 {
        0 => Ends::refracted(below, Source::Point(above), WATER, false),
        1 => Ends::refracted(below, Source::Point(below + far * 1e7), WATER, false),
        2 => Ends::refracted(below, Source::Point(middle + DVec3::new(1e4, 2e3, 30.0)), WATER, false),
        3 => {
            let depth = libm::exp10(between(random, -4.0, -2.0));
            let facet = &facets[(random.next_f64() * facets.len() as f64) as usize];
            let over = facet.place(0.2 + 0.3 * pair(random));
            Ends::refracted(over - DVec3::Z * depth, Source::Point(above), WATER, false)
        }
        _ => Ends::mirrored(above, Source::Direction(DVec3::new(far.x, far.y, far.z.abs()).normalize())),
    }
}

#[test]
fn paths_are_found_far_from_the_origin_under_far_lights_and_close_to_the_surface() {
    for (cells, amplitude) in [(16, 0.15), (100, 0.1)] {
        let mut at_the_origin = Vec::new();
        for (offset, tolerance) in [(DVec3::ZERO, 1e-7), (DVec3::new(1e4, -2e4, 3e3), 1e-6)] {
            let moved = |facet: Facet| Facet { corners: facet.corners.map(|corner| corner + offset), ..facet };
            let facets: Vec<Facet> = water(cells, amplitude).into_iter().map(moved).collect();
            let tree = tree_over(&facets);
            let mut random = random(42);
            let mut by_kind = [0; 5];
            for case in 0..500 {
                let ends = extreme(&mut random, &facets, offset, case);
                let ours = found(&facets, &tree, &ends);
                assert_same(&ours, &of_all(&facets, &ends), tolerance, &ends);
                by_kind[case as usize % 5] += ours.len();
                let back: Vec<DVec3> = ours.into_iter().map(|place| place - offset).collect();
                if offset == DVec3::ZERO {
                    if cells == 16 {
                        assert_same(&back, &all_paths(&facets, &ends).unwrap(), 1e-7, &ends);
                    }
                    at_the_origin.push(back);
                } else {
                    assert_same(&back, &at_the_origin[case as usize], tolerance, &ends);
                }
            }
            println!("{cells} {offset}: {by_kind:?}");
            assert!(by_kind.iter().all(|&paths| paths >= 100), "{by_kind:?}");
        }
    }
}

#[test]
fn a_shading_point_on_the_surface_but_for_rounding_has_each_path_once_and_no_others() {
    let facets = water(16, 0.15);
    let tree = tree_over(&facets);
    let mut random = random(43);
    let mut paths = 0;
    for case in 0..2000 {
        let facet = &facets[(random.next_f64() * facets.len() as f64) as usize];
        let over = facet.place(0.2 + 0.3 * pair(&mut random));
        let depth = libm::exp10(between(&mut random, -10.0, -5.0));
        let light = (pair(&mut random) * 2.0 - 1.0).extend(1.5);
        let source = if case % 2 == 0 { Source::Point(light) } else { Source::Direction(light.normalize()) };
        let ends = Ends::refracted(over - DVec3::Z * depth, source, WATER, false);
        let ours = found(&facets, &tree, &ends);
        let close: Vec<&DVec3> = ours.iter().filter(|place| place.distance(ends.point) < 10.0 * depth).collect();
        for place in &close {
            // What is accepted misses the light by less than what rounding makes of so short a segment.
            let normal = facet.area().normalize();
            assert!((**place - ends.point).dot(normal) > 0.0, "{place} is not above {ends:?}");
        }
        assert!(close.len() <= 1, "{close:?} for {ends:?}");
        paths += close.len();
    }
    println!("{paths} paths close to the shading point");
    assert!(paths > 1000, "{paths}");
}
