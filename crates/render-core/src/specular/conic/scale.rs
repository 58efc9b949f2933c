//! Paths over millions of triangles, and far from the origin, the light or the surface: by the tree they are those of all triangles one
//! by one.

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
    film::TrialStream,
    optics::Source,
    specular::testing::{between, pair, random},
};

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
fn paths_over_two_million_triangles_are_those_of_each_triangle_and_certain() {
    let facets = water(1000, 0.1);
    assert_eq!(facets.len(), 2_000_000);
    let tree = tree_over(&facets);
    let mut random = random(41);
    let (mut paths, mut opened) = (0, 0);
    for case in 0..36 {
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
    assert!(paths > 36 && opened < 100 * paths, "{paths} {opened}");
}

/// Ends of paths over water around `middle`, by the number of the case: as usual, with a light as far as a star or a lamp at the
/// horizon, and with the shading point a hair below the surface.
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
            let depth = 10f64.powf(between(random, -4.0, -2.0));
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
        let mut at_the_origin = None;
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
            }
            println!("{cells} {offset}: {by_kind:?}");
            assert!(by_kind.iter().all(|&paths| paths >= 100), "{by_kind:?}");
            assert_eq!(*at_the_origin.get_or_insert(by_kind), by_kind);
        }
    }
}
