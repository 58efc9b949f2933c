//! Whether a surface of triangles is closed: whether it has an inside.

use glam::DVec3;

use crate::math::hash::mix;

/// Whether each edge belongs to an even number of triangles, as on a surface without a border. Corners are the same
/// when their coordinates are.
///
/// Each edge gets a random 64-bit number; a surface is closed when all of them cancel. A surface with a border is taken
/// for a closed one with probability 2^-64.
pub(crate) fn is_closed(triangles: impl Iterator<Item = [DVec3; 3]>) -> bool {
    let numbers = triangles.map(|corners| {
        let [a, b, c] = corners.map(number_of_corner);
        edge(a, b) ^ edge(b, c) ^ edge(c, a)
    });
    numbers.fold(0, |sum, triangle| sum ^ triangle) == 0
}

/// Whether a surface bounds a body: it is closed, and its triangles face outwards on both sides of each edge. As
/// [`is_closed`], it is wrong with probability 2^-64.
pub(crate) fn is_solid(triangles: impl Iterator<Item = [DVec3; 3]>) -> bool {
    let (mut open, mut volume, mut apex) = (0_u64, 0.0, None);
    for [a, b, c] in triangles {
        let [from, to, last] = [a, b, c].map(number_of_corner);
        for (from, to) in [(from, to), (to, last), (last, from)] {
            let number = edge(from, to);
            open = if from < to { open.wrapping_add(number) } else { open.wrapping_sub(number) };
        }
        let apex = *apex.get_or_insert(a);
        volume += (a - apex).dot((b - apex).cross(c - apex));
    }
    open == 0 && volume > 0.0
}

/// Of more triangles than this, it is not known whether a surface is convex: each is compared with all others.
const MOST_COMPARED: usize = 4096;

/// Whether a closed surface is known to be convex: all of it is on one side of the plane of each triangle, up to
/// rounding. So no ray that has left the body within meets it again.
pub(crate) fn is_convex(triangles: &[[DVec3; 3]]) -> bool {
    let (low, high) = triangles
        .as_flattened()
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), corner| (low.min(*corner), high.max(*corner)));
    // Corners that a file has in single precision are off their plane by about a tenth of it.
    let slack = 1e-6 * (high - low).length();
    triangles.len() <= MOST_COMPARED
        && triangles.iter().all(|[a, b, c]| {
            let normal = (*b - *a).cross(*c - *a).normalize_or_zero();
            let heights = triangles.as_flattened().iter().map(|corner| (*corner - *a).dot(normal));
            let (mut above, mut below) = (false, false);
            for height in heights {
                above |= height > slack;
                below |= height < -slack;
                if above && below {
                    return false;
                }
            }
            true
        })
}

/// The same for both directions.
fn edge(from: u64, to: u64) -> u64 {
    mix(from.min(to).wrapping_add(mix(from.max(to))))
}

fn number_of_corner(corner: DVec3) -> u64 {
    // Zero has two signs.
    corner.to_array().into_iter().fold(0, |state, coordinate| mix(state ^ (coordinate + 0.0).to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box around the origin, with corners of its own for each triangle.
    fn block() -> Vec<[DVec3; 3]> {
        let corner = |bits: [i32; 3]| DVec3::from(bits.map(|bit| if bit == 0 { -0.5 } else { 0.5 }));
        let sides = (0..3).flat_map(|axis| [0, 1].map(|side| (axis, side)));
        let quads = sides.map(|(axis, side)| {
            [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
                let mut bits = [0; 3];
                (bits[axis], bits[(axis + 1) % 3], bits[(axis + 2) % 3]) = (side, u, v);
                corner(bits)
            })
        });
        quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
    }

    #[test]
    fn a_box_is_closed_and_one_without_a_triangle_is_not() {
        let block = block();
        assert!(is_closed(block.iter().copied()));
        for missing in 0..block.len() {
            let rest = block.iter().enumerate().filter(|(index, _)| *index != missing);
            assert!(!is_closed(rest.map(|(_, triangle)| *triangle)), "{missing}");
        }
    }

    #[test]
    fn a_box_is_solid_unless_it_is_open_inside_out_or_twisted() {
        let block = block();
        let outwards = |[a, b, c]: &[DVec3; 3]| (*b - *a).cross(*c - *a).dot(*a + *b + *c) > 0.0;
        let turned = |[a, b, c]: [DVec3; 3]| [a, c, b];
        let solid: Vec<_> =
            block.iter().map(|triangle| if outwards(triangle) { *triangle } else { turned(*triangle) }).collect();
        assert!(is_solid(solid.iter().copied()));
        assert!(!is_solid(solid[1..].iter().copied()));
        assert!(!is_solid(solid.iter().copied().map(turned)));
        let twisted = solid.iter().enumerate().map(|(index, triangle)| match index {
            3 => turned(*triangle),
            _ => *triangle,
        });
        assert!(!is_solid(twisted));
    }

    #[test]
    fn a_box_is_convex_and_two_or_one_with_a_dent_are_not() {
        let block = block();
        assert!(is_convex(&block));
        let moved = |by: DVec3| block.iter().map(move |triangle| triangle.map(|corner| corner + by));
        let two: Vec<_> = moved(DVec3::ZERO).chain(moved(3.0 * DVec3::X)).collect();
        assert!(!is_convex(&two));
        let dent = |corner: DVec3| if corner == DVec3::splat(0.5) { DVec3::splat(0.1) } else { corner };
        let dented: Vec<_> = block.iter().map(|triangle| triangle.map(dent)).collect();
        assert!(is_closed(dented.iter().copied()) && !is_convex(&dented));
        let single = |triangle: &[DVec3; 3]| triangle.map(|corner| (corner * 0.123).as_vec3().as_dvec3());
        assert!(is_convex(&block.iter().map(single).collect::<Vec<_>>()));
    }

    #[test]
    fn winding_and_the_sign_of_zero_do_not_matter() {
        let shifted = block().into_iter().map(|triangle| triangle.map(|corner| corner + 0.5));
        let odd = shifted.enumerate().map(|(index, [a, b, c])| if index % 2 == 0 { [a, c, b] } else { [a, b, c] });
        let signed =
            odd.map(|triangle| triangle.map(|corner| DVec3::select(corner.cmpeq(DVec3::ZERO), -corner, corner)));
        assert!(is_closed(signed));
    }
}
