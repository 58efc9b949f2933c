//! What the tests of this module share: water, and ends of paths over it.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::{ends::Ends, facet::Facet, facet_tree::FacetTree};
use crate::{light::Source, specular::testing::between};
use clerestory_film::TrialStream;

/// Index of refraction of water.
pub(super) const WATER: f64 = 1.33;

/// Water two metres wide, in `cells` by `cells` squares of two triangles.
pub(super) fn water(cells: u32, amplitude: f64) -> Vec<Facet> {
    let waves = [(DVec2::new(2.0, 1.0), 0.3), (DVec2::new(-1.0, 3.0), 1.1), (DVec2::new(4.0, -2.0), 2.0)];
    let corner = |i: u32, j: u32| {
        let place = DVec2::new(f64::from(i), f64::from(j)) / f64::from(cells) * 2.0 - 1.0;
        let (mut height, mut slope) = (0.0, DVec2::ZERO);
        for (wave, phase) in waves {
            let angle = TAU * wave.dot(place) * 0.5 + phase;
            height += amplitude / wave.length() * libm::sin(angle);
            slope += wave * (0.5 * TAU * amplitude / wave.length() * libm::cos(angle));
        }
        (place.extend(height), DVec3::new(-slope.x, -slope.y, 1.0).normalize())
    };
    let mut facets = Vec::new();
    for j in 0..cells {
        for i in 0..cells {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            for [x, y, z] in [[a, b, c], [a, c, d]] {
                facets.push(Facet { corners: [x.0, y.0, z.0], normals: [x.1, y.1, z.1] });
            }
        }
    }
    facets
}

/// A ball around the origin, whose normals point everywhere: `cells` from pole to pole, twice as many around.
pub(super) fn ball(cells: u32, radius: f64) -> Vec<Facet> {
    let normal = |i: u32, j: u32| {
        let (sine, cosine) = libm::sincos(0.5 * TAU * f64::from(j) / f64::from(cells));
        let (sine_around, cosine_around) = libm::sincos(0.5 * TAU * f64::from(i) / f64::from(cells));
        DVec3::new(sine * cosine_around, sine * sine_around, cosine)
    };
    let mut facets = Vec::new();
    for j in 0..cells {
        for i in 0..2 * cells {
            let [a, b, c, d] = [normal(i, j), normal(i + 1, j), normal(i + 1, j + 1), normal(i, j + 1)];
            let of = |normals: [DVec3; 3]| Facet { corners: normals.map(|normal| normal * radius), normals };
            // At the poles, one of the two is nothing.
            facets.extend((j > 0).then(|| of([a, b, c])));
            facets.extend((j + 1 < cells).then(|| of([a, c, d])));
        }
    }
    facets
}

/// The ends of a path: refracted from either side to a point, or to a direction, or mirrored, in turn.
pub(super) fn problem(random: &mut TrialStream, case: u32) -> Ends {
    let mut side = |height: f64| {
        DVec3::new(between(random, -1.0, 1.0), between(random, -1.0, 1.0), height * between(random, 0.5, 2.0))
    };
    let (below, above) = (side(-1.0), side(1.5));
    let mirrored = side(1.2);
    match case % 4 {
        0 => Ends::refracted(below, Source::Point(above), WATER, false),
        1 => Ends::refracted(below, Source::Direction(above.normalize()), WATER, false),
        2 => Ends::refracted(above, Source::Point(below), WATER, true),
        _ => Ends::mirrored(mirrored, Source::Point(above)),
    }
}

/// Adds a place that is not among the known ones.
pub(super) fn distinct(places: &mut Vec<DVec3>, place: DVec3) {
    if places.iter().all(|known| (*known - place).length() > 1e-8) {
        places.push(place);
    }
}

/// Where all paths are, by the tree and the curves.
pub(super) fn found(facets: &[Facet], tree: &FacetTree, ends: &Ends) -> Vec<DVec3> {
    let mut places = Vec::new();
    tree.visit(ends, |triangle| {
        let facet = &facets[triangle as usize];
        facet.paths(ends).into_iter().for_each(|weights| distinct(&mut places, facet.place(weights)));
    });
    places
}
