//! Outlines cut by a disc.

use glam::DVec2;

use crate::curve::Curve;
use crate::outline::{Corner, Outline, Side};

/// Parts of a side that are shorter than this part of it are none.
const SHORTEST: f64 = 1e-9;

/// A part of a side.
struct Part {
    side: Side,
    is_inside: bool,
}

/// The part of an outline within a disc; `None` where there is none, or more than one.
pub(crate) fn clipped(outline: &Outline, disc: Curve) -> Option<Outline> {
    let Curve::Circle { centre, radius, .. } = disc else { return None };
    let mut parts: Vec<Part> = Vec::new();
    for (index, &side) in outline.sides().iter().enumerate() {
        let places = crossings(outline, index, disc);
        let mut from = 0.0;
        for to in places.into_iter().chain([1.0]) {
            let middle = outline.point(index, 0.5 * (from + to));
            let corner = if to == 1.0 { side.corner } else { Corner::Convex };
            parts.push(Part { side: Side { corner, ..side }, is_inside: middle.distance(centre) < radius });
            from = to;
        }
    }
    let count = parts.len();
    let enters = |index: &usize| parts[*index].is_inside && !parts[(*index + count - 1) % count].is_inside;
    let entries: Vec<usize> = (0..count).filter(enters).collect();
    match entries[..] {
        [] if parts.iter().all(|part| part.is_inside) => Some(outline.clone()),
        [entry] => {
            parts.rotate_left(entry);
            let mut sides: Vec<Side> = parts.iter().take_while(|part| part.is_inside).map(|part| part.side).collect();
            // The disc goes on where the outline leaves it.
            sides.last_mut()?.corner = Corner::Convex;
            sides.push(Side::convex(disc));
            Outline::new(sides)
        }
        _ => None,
    }
}

/// Where a side crosses the edge of a disc, as parts of its length, in order.
fn crossings(outline: &Outline, index: usize, disc: Curve) -> Vec<f64> {
    let curve = outline.sides()[index].curve;
    let place = |point: DVec2| match curve {
        Curve::Line { .. } => {
            let along = outline.end(index) - outline.start(index);
            (point - outline.start(index)).dot(along) / along.length_squared()
        }
        Curve::Circle { .. } => curve.sweep(outline.start(index), point) / outline.sweep(index),
    };
    let mut places: Vec<f64> = (curve.intersections(disc).into_iter().flatten())
        .map(place)
        .filter(|place| (SHORTEST..1.0 - SHORTEST).contains(place))
        .collect();
    places.sort_unstable_by(f64::total_cmp);
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polygon;

    #[test]
    fn two_discs_share_a_lens() {
        let (first, second) = (DVec2::ZERO, DVec2::new(1.0, 0.0));
        let outline = Outline::disc(first, 1.0).unwrap();
        let lens = clipped(&outline, Curve::disc(second, 1.0)).unwrap();
        let expected = 2.0 * std::f64::consts::FRAC_PI_3 - 0.75_f64.sqrt();
        assert!((polygon::area(&lens.polygon()) - expected).abs() < 1e-3);
        assert_eq!(clipped(&outline, Curve::disc(second, 3.0)), Some(outline.clone()));
        assert_eq!(clipped(&outline, Curve::disc(second, -0.1)), None);
        assert_eq!(clipped(&outline, Curve::disc(DVec2::new(3.0, 0.0), 1.0)), None);
    }

    #[test]
    fn a_square_keeps_its_straight_sides() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(DVec2::from);
        let sides = polygon::edges(&corners).map(|[from, to]| Side::convex(Curve::line(from, to))).collect();
        let clipped = clipped(&Outline::new(sides).unwrap(), Curve::disc(DVec2::ZERO, 1.0)).unwrap();
        assert_eq!(clipped.sides().len(), 3);
        assert!((polygon::area(&clipped.polygon()) - 0.25 * std::f64::consts::PI).abs() < 1e-3);
    }
}
