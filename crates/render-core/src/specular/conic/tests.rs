//! Tests of the search over whole meshes: what the tree opens, and what is found there.

use glam::{DMat3, DVec2, DVec3};

use super::{
    ends::Ends,
    facet::Facet,
    facet_tree::FacetTree,
    focus::STRONG,
    testing::{WATER, ball, distinct, found, problem, water},
};
use crate::{
    bsdf::fresnel::{reflect, refract},
    light::Source,
    specular::testing::{between, random},
};

/// Newton's method from many places of each triangle.
fn sought_everywhere(facets: &[Facet], ends: &Ends) -> Vec<DVec3> {
    const SEEDS: u32 = 5;
    let mut places = Vec::new();
    for facet in facets {
        for i in 0..SEEDS {
            for j in 0..SEEDS - i {
                let seed = (DVec2::new(f64::from(i), f64::from(j)) + 0.3) / f64::from(SEEDS);
                if let Some(weights) = facet.polished(ends, seed) {
                    distinct(&mut places, facet.place(weights));
                }
            }
        }
    }
    places
}

#[test]
fn all_paths_over_water_are_found() {
    let mut paths = 0;
    for (cells, amplitude) in [(4, 0.05), (16, 0.05), (16, 0.15), (40, 0.1)] {
        let facets = water(cells, amplitude);
        let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
        let mut random = random(5);
        let (mut opened, mut several) = (0, 0);
        let problems = 200;
        for case in 0..problems {
            let ends = problem(&mut random, case);
            let ours = found(&facets, &tree, &ends);
            let theirs = sought_everywhere(&facets, &ends);
            tree.visit(&ends, |_| opened += 1);
            for place in &theirs {
                assert!(
                    ours.iter().any(|known| (*known - *place).length() < 1e-7),
                    "{cells} {case}: {place} of {theirs:?} is not in {ours:?}"
                );
            }
            paths += ours.len();
            several += usize::from(ours.len() > theirs.len());
        }
        println!(
            "{cells} {amplitude}: {opened} triangles opened for {problems} problems, {paths} paths, {several} \
             with more than seeds find"
        );
    }
    assert!(paths > 0);
}

#[test]
fn paths_are_found_however_the_surface_lies() {
    let askew = DVec3::new(1.0, 2.0, 3.0).normalize();
    let (first, second) = askew.any_orthonormal_pair();
    let turns = [
        DMat3::IDENTITY,
        DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X),
        DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y),
        DMat3::from_cols(first, second, askew),
    ];
    for (name, facets) in [("water", water(16, 0.15)), ("ball", ball(12, 0.4))] {
        for (number, turn) in turns.into_iter().enumerate() {
            let turned = |vectors: [DVec3; 3]| vectors.map(|vector| turn * vector);
            let facets: Vec<Facet> = facets
                .iter()
                .map(|facet| Facet { corners: turned(facet.corners), normals: turned(facet.normals) })
                .collect();
            let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
            let mut random = random(11);
            let (mut paths, mut opened) = (0, 0);
            for case in 0..200 {
                let ends = problem(&mut random, case);
                let ends = Ends { point: turn * ends.point, light: turn * ends.light, ..ends };
                let mut all = Vec::new();
                for facet in &facets {
                    facet.paths(&ends).into_iter().for_each(|path| distinct(&mut all, facet.place(path)));
                }
                let ours = found(&facets, &tree, &ends);
                assert!(
                    ours.len() == all.len()
                        && all.iter().all(|place| ours.iter().any(|known| (*known - *place).length() < 1e-7)),
                    "{name}, turn {number}, {case}: {ours:?} are not {all:?}"
                );
                paths += all.len();
                tree.visit(&ends, |_| opened += 1);
            }
            println!("{name}, turn {number}: {paths} paths, {opened} triangles opened");
            assert!(paths > 100 && opened < 20 * paths, "{name}, turn {number}: {paths} {opened}");
        }
    }
}

#[test]
fn every_processor_opens_the_same_triangles() {
    let facets = water(40, 0.1);
    let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
    let mut random = random(6);
    let mut opened = 0;
    for case in 0..300 {
        let ends = problem(&mut random, case);
        let (mut widest, mut plain) = (Vec::new(), Vec::new());
        let looks = tree.visit(&ends, |triangle| widest.push(triangle));
        let looks_plain = tree.visit_with(pulp::Scalar256b, &ends, None, |triangle, _| plain.push(triangle));
        assert_eq!(looks, looks_plain);
        assert_eq!(widest, plain);
        opened += plain.len();
    }
    assert!(opened > 100, "{opened}");
}

#[test]
fn a_whole_light_opens_what_each_of_its_points_does() {
    let facets = water(16, 0.15);
    let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
    let mut random = random(8);
    let (mut all, mut may_hold, mut with_paths, mut may_focus, mut focus) = (0, 0, 0, 0, 0);
    for case in 0..300 {
        let ends = problem(&mut random, case);
        let mut aside = || {
            DVec3::new(
                between(&mut random, -1.0, 1.0),
                between(&mut random, -1.0, 1.0),
                between(&mut random, -1.0, 1.0),
            )
        };
        let (towards, part) = (aside().normalize(), aside().x.abs());
        // A lamp of up to 0.4 m, within a metre or so, or the sun with a radius of 60 degrees.
        let (whole, light) = if ends.near > 0.0 {
            (ends.spread(0.4), ends.light + towards * (0.4 * part))
        } else {
            let across = ends.light.cross(towards).normalize();
            let angle = part * std::f64::consts::FRAC_PI_3;
            let turned = ends.light * libm::cos(angle) + across * libm::sin(angle);
            (ends.spread(2.0 * libm::sin(std::f64::consts::FRAC_PI_6)), turned)
        };
        let drawn = Ends { light, ..ends };
        let (mut opened, mut holding, mut focusing) = (Vec::new(), Vec::new(), Vec::new());
        tree.visit(&whole, |triangle| opened.push(triangle));
        tree.visit_whole(&whole, &drawn, STRONG, |triangle, may| {
            assert!(may.hold || may.focus);
            holding.extend(may.hold.then_some(triangle));
            focusing.extend(may.focus.then_some(triangle));
        });
        for (triangle, facet) in (0u32..).zip(&facets) {
            if !facet.paths(&drawn).is_empty() {
                with_paths += 1;
                assert!(opened.contains(&triangle) && holding.contains(&triangle), "{case}: {triangle}");
            }
        }
        for triangle in &opened {
            if facets[*triangle as usize].focus(&whole) > STRONG {
                focus += 1;
                assert!(focusing.contains(triangle), "{case}: {triangle}");
            }
        }
        all += opened.len();
        may_hold += holding.len();
        may_focus += focusing.len();
    }
    println!(
        "{all} triangles for whole lights, {may_hold} for points, {with_paths} with paths; {may_focus} may focus, \
         {focus} do"
    );
    assert!(2 * may_hold < all && with_paths > 300);
    assert!(may_focus < 2 * focus && focus > 300);
}

#[test]
fn finer_meshes_of_the_same_water_cost_hardly_more() {
    let problems = 500;
    let mut costs = Vec::new();
    for cells in [22, 71, 224] {
        let facets = water(cells, 0.05);
        let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
        let mut random = random(5);
        let (mut looks, mut opened, mut paths) = (0, 0, 0);
        for _ in 0..problems {
            let below = DVec3::new(between(&mut random, -0.8, 0.8), between(&mut random, -0.8, 0.8), -1.0);
            let ends = Ends::refracted(below, Source::Point(DVec3::new(1.0, -0.8, 12.0)), WATER, false);
            looks += tree.visit(&ends, |triangle| {
                opened += 1;
                paths += facets[triangle as usize].paths(&ends).len();
            });
        }
        println!("{} triangles: {looks} nodes, {opened} triangles, {paths} paths", facets.len());
        assert!(paths >= problems && opened < 4 * paths);
        costs.push(looks);
    }
    assert!(costs[2] * 2 < costs[0] * 3, "{costs:?}");
}

#[test]
fn paths_through_corners_and_edges_of_waves_are_found() {
    let facets = water(12, 0.05);
    let tree = FacetTree::over(0..facets.len() as u32, |k| facets[k as usize]).unwrap();
    let mut random = random(6);
    for case in 0..1000 {
        let facet = facets[case * 7919 % facets.len()];
        // Even cases through a corner, odd ones through an edge.
        let along = if case % 2 == 0 { 0.0 } else { between(&mut random, 0.1, 0.9) };
        let at = if case % 3 == 0 { DVec2::new(1.0 - along, along) } else { DVec2::new(along, 0.0) };
        let (place, normal) = (facet.place(at), facet.normal(at).normalize());
        let point = place + DVec3::new(between(&mut random, -0.5, 0.5), between(&mut random, -0.5, 0.5), -1.0);
        let direction = (place - point).normalize();
        let Some(refraction) = refract(direction, normal, WATER, 1.0) else { continue };
        let light = place + refraction.direction * between(&mut random, 0.5, 3.0);
        let below = place + reflect(direction, normal) * between(&mut random, 0.5, 3.0);
        for ends in [
            Ends::refracted(point, Source::Point(light), WATER, false),
            Ends::refracted(light, Source::Point(point), WATER, true),
            Ends::mirrored(point, Source::Point(below)),
        ] {
            let places = found(&facets, &tree, &ends);
            assert!(places.iter().any(|known| (*known - place).length() < 1e-8), "{case}: {place} in {places:?}");
        }
    }
}

#[test]
fn paths_on_edges_and_corners_are_found() {
    // Flat, with corners at thirds: light straight above an edge, a corner, and along an edge or a diagonal.
    let third = 1.0 / 3.0;
    let flat = water(3, 0.0);
    let tree = FacetTree::over(0..flat.len() as u32, |k| flat[k as usize]).unwrap();
    for [px, py, lx, ly] in [
        [0.5, -0.4, 0.2, 0.1],
        [third, 0.1, third, 0.1],
        [third, third, third, third],
        [third, -0.2, third, 0.3],
        [-0.2, -0.2, 0.1, 0.1],
        [third, -0.9, third, 0.9],
        [0.0, third, 0.7, third],
    ] {
        let (point, light) = (DVec3::new(px, py, -1.0), DVec3::new(lx, ly, 0.8));
        let mirrored = Ends::mirrored(point, Source::Point(light - DVec3::Z * 1.6));
        for ends in [Ends::refracted(point, Source::Point(light), WATER, false), mirrored] {
            assert_eq!(found(&flat, &tree, &ends).len(), 1, "{point} {light}");
        }
    }
}
