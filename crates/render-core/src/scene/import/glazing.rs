//! Window panes from the flat shapes and thin boxes that modellers put into windows.
//!
//! A mesh is cut into its connected pieces. Each piece becomes a pane, or the reason why it does not.

use std::collections::BTreeMap;

use clerestory_glazing::{area as polygon_area, convex_hull};
use glam::{DVec2, DVec3};

use crate::geometry::MOST_CORNERS;

/// Longest distance from a plane of what is flat, metres, and as a fraction of the size.
const FLATNESS: [f64; 2] = [1e-4, 1e-4];

/// The thickest box that is a pane, as a fraction of its shorter edge.
const THICKEST: f64 = 0.25;

/// Largest difference of the area from that of a rectangle, as a fraction.
const AREA_TOLERANCE: f64 = 5e-3;

/// Largest part of a box that a pane may lack: edges may be rounded.
const VOLUME_TOLERANCE: f64 = 0.03;

/// A rectangle or another flat shape that becomes a pane or a leaded window.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PaneFit {
    /// Its middle, between both faces.
    pub(crate) centre: DVec3,
    /// Unit vectors along width and height.
    pub(crate) axes: [DVec3; 2],
    /// Width and height, metres.
    pub(crate) size: [f64; 2],
    /// The corners of a shape that is no rectangle, from the middle along `axes`, counterclockwise, metres.
    pub(crate) outline: Option<Vec<DVec2>>,
    /// Distance between the faces of a body, metres; `None` for a flat shape.
    pub(crate) thickness: Option<f64>,
}

/// A connected piece of a mesh.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// The corners of its triangles.
    pub(crate) triangles: Vec<[DVec3; 3]>,
    /// The pane that it is, or why it is none.
    pub(crate) fit: Result<PaneFit, String>,
}

/// The pieces of a mesh, in the order of their first triangles.
pub(crate) fn pieces(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Piece> {
    let corners = |triangle: &[u32; 3]| triangle.map(|vertex| positions[vertex as usize]);
    let piece = |triangles: Vec<[u32; 3]>| {
        let triangles: Vec<[DVec3; 3]> = triangles.iter().map(corners).collect();
        Piece { fit: fit(&triangles), triangles }
    };
    connected(positions, triangles).into_iter().map(piece).collect()
}

/// The connected pieces of a mesh. Vertices in the same place are one.
fn connected(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Vec<[u32; 3]>> {
    let mut first_at: BTreeMap<[u64; 3], u32> = BTreeMap::new();
    let welded: Vec<u32> = (0..)
        .zip(positions)
        .map(|(index, position)| *first_at.entry(position.to_array().map(|x| (x + 0.0).to_bits())).or_insert(index))
        .collect();
    let mut parents: Vec<u32> = (0..positions.len() as u32).collect();
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| welded[vertex as usize]);
        let root = root_of(&mut parents, a);
        for other in [b, c] {
            let other = root_of(&mut parents, other);
            parents[other as usize] = root;
        }
    }
    let mut order = Vec::new();
    let mut pieces: BTreeMap<u32, Vec<[u32; 3]>> = BTreeMap::new();
    for triangle in triangles {
        let root = root_of(&mut parents, welded[triangle[0] as usize]);
        let piece = pieces.entry(root).or_default();
        if piece.is_empty() {
            order.push(root);
        }
        piece.push(*triangle);
    }
    order.iter().filter_map(|root| pieces.remove(root)).collect()
}

/// The vertex that stands for all that are connected with one.
fn root_of(parents: &mut [u32], mut vertex: u32) -> u32 {
    while parents[vertex as usize] != vertex {
        let above = parents[parents[vertex as usize] as usize];
        parents[vertex as usize] = above;
        vertex = above;
    }
    vertex
}

fn fit(triangles: &[[DVec3; 3]]) -> Result<PaneFit, String> {
    let crosses: Vec<DVec3> = triangles.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a)).collect();
    let area = 0.5 * crosses.iter().map(|cross| cross.length()).sum::<f64>();
    // The largest triangle lies in a face, and one of its edges along the border.
    let by_size = |a: &usize, b: &usize| crosses[*a].length_squared().total_cmp(&crosses[*b].length_squared());
    let largest = (0..crosses.len()).max_by(by_size).ok_or("it has no triangle")?;
    let normal = crosses[largest].try_normalize().ok_or("it has no area")?;
    let [a, b, c] = triangles[largest];
    let boxes = [b - a, c - b, a - c].into_iter().filter_map(|edge| {
        let along = edge.try_normalize()?;
        let axes = [along, normal.cross(along)];
        let [min, max] = bounds(triangles, axes, normal);
        Some((axes, (max.x - min.x) * (max.y - min.y)))
    });
    let (axes, rectangle) = boxes.min_by(|a, b| a.1.total_cmp(&b.1)).ok_or("it has no area")?;
    let axes = upright(axes);
    let [min, max] = bounds(triangles, axes, normal);
    let (extent, middle) = (max - min, 0.5 * (min + max));
    let size = [extent.x, extent.y];
    let centre = axes[0] * middle.x + axes[1] * middle.y + normal * middle.z;
    let [absolute, relative] = FLATNESS;
    let flat = absolute.min(relative * extent.x.max(extent.y));
    if extent.z <= flat {
        if (area / rectangle - 1.0).abs() <= AREA_TOLERANCE {
            return Ok(PaneFit { centre, axes, size, outline: None, thickness: None });
        }
        return outlined(triangles, axes, normal);
    }
    if extent.z > THICKEST * size[0].min(size[1]) {
        let DVec3 { x, y, z } = extent;
        return Err(format!("it is no thin box: {z:.3} m thick where it is {x:.3} m by {y:.3} m"));
    }
    let volume = triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|corner| corner - centre);
        a.dot(b.cross(c)) / 6.0
    });
    let filled = volume.sum::<f64>().abs() / (rectangle * extent.z);
    if (filled - 1.0).abs() <= VOLUME_TOLERANCE {
        return Ok(PaneFit { centre, axes, size, outline: None, thickness: Some(extent.z) });
    }
    // A sheet of another outline has it on both faces.
    let is_front = |corners: &&[DVec3; 3]| corners.iter().all(|corner| max.z - corner.dot(normal) <= flat);
    let front: Vec<[DVec3; 3]> = triangles.iter().filter(is_front).copied().collect();
    let face = 0.5 * front.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a).length()).sum::<f64>();
    let sheet = face / rectangle;
    if (filled / sheet - 1.0).abs() > VOLUME_TOLERANCE {
        return Err(format!("it is neither flat nor a closed box or sheet: it fills {:.0} % of one", 100.0 * filled));
    }
    let face = outlined(&front, axes, normal)?;
    Ok(PaneFit { centre: face.centre - normal * (0.5 * extent.z), thickness: Some(extent.z), ..face })
}

/// Directions in a plane are upright where they rise by at least this much over their length.
const LEAST_RISE: f64 = 1e-3;

/// The outline of a flat shape. It stands upright, or lies along the axes where it lies flat.
fn outlined(triangles: &[[DVec3; 3]], axes: [DVec3; 2], normal: DVec3) -> Result<PaneFit, String> {
    let up = DVec3::Z - normal * normal.z;
    let axes = if up.length() < LEAST_RISE { axes } else { [up.normalize().cross(normal), up.normalize()] };
    let [min, max] = bounds(triangles, axes, normal);
    let (extent, middle) = (max - min, 0.5 * (min + max));
    let [x, y] = axes;
    let centre = x * middle.x + y * middle.y + normal * middle.z;
    let local = |corner: DVec3| DVec2::new((corner - centre).dot(x), (corner - centre).dot(y));
    let flat: Vec<[DVec2; 3]> = triangles.iter().map(|triangle| triangle.map(local)).collect();
    let outline = border(&flat)?;
    Ok(PaneFit { centre, axes, size: [extent.x, extent.y], outline: Some(outline), thickness: None })
}

/// The corners around flat triangles, counterclockwise.
fn border(triangles: &[[DVec2; 3]]) -> Result<Vec<DVec2>, String> {
    let area: f64 = triangles.iter().map(|triangle| polygon_area(triangle).abs()).sum();
    let is_all = |outline: &[DVec2]| (area / polygon_area(outline) - 1.0).abs() <= AREA_TOLERANCE;
    // Corners on the edges of other triangles do not matter where the shape is convex.
    let hull = convex_hull(&triangles.concat());
    if is_all(&hull) {
        return Ok(hull);
    }
    let loops = loops(triangles);
    match &loops[..] {
        [outline] if is_all(outline) => Ok(outline.clone()),
        [_] | [] => Err("it is flat, but its triangles overlap or leave gaps".to_owned()),
        several => Err(format!("it is flat, but has {} edges around it and in it", several.len())),
    }
}

/// The closed lines along those edges that two triangles do not share, counterclockwise around the shape.
fn loops(triangles: &[[DVec2; 3]]) -> Vec<Vec<DVec2>> {
    let key = |corner: DVec2| corner.to_array().map(|x| (x / WELD).round() as i64);
    let mut next: BTreeMap<[i64; 2], Vec<([i64; 2], DVec2)>> = BTreeMap::new();
    for triangle in triangles {
        let [a, b, c] = *triangle;
        let [a, b, c] = if polygon_area(triangle) < 0.0 { [a, c, b] } else { [a, b, c] };
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let (start, end) = (key(from), key(to));
            let back = next.get_mut(&end);
            let shared = back.and_then(|ends| Some((ends.iter().position(|(to, _)| *to == start)?, ends)));
            match shared {
                Some((place, ends)) => drop(ends.swap_remove(place)),
                None if start != end => next.entry(start).or_default().push((end, from)),
                None => {}
            }
        }
    }
    let mut loops = Vec::new();
    while let Some((first, _)) = next.first_key_value() {
        let (mut outline, mut at) = (Vec::new(), *first);
        while let Some(ends) = next.get_mut(&at) {
            let edge = ends.pop();
            if ends.is_empty() {
                next.remove(&at);
            }
            let Some((end, from)) = edge else { break };
            outline.push(from);
            at = end;
        }
        if !outline.is_empty() {
            loops.push(outline);
        }
    }
    loops
}

/// Corners this near to each other are one, metres.
const WELD: f64 = 1e-6;

/// The smallest and largest coordinates along two axes and a normal.
fn bounds(triangles: &[[DVec3; 3]], [x, y]: [DVec3; 2], normal: DVec3) -> [DVec3; 2] {
    let local = triangles.iter().flatten().map(|at| DVec3::new(at.dot(x), at.dot(y), at.dot(normal)));
    local.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[min, max], at| [min.min(at), max.max(at)])
}

/// The same axes, the second as upright as it can be, the first to its right for who looks against the normal.
fn upright([x, y]: [DVec3; 2]) -> [DVec3; 2] {
    let turns = [[x, y], [y, -x], [-x, -y], [-y, x]];
    let [first, others @ ..] = turns;
    others.into_iter().fold(first, |best, turn| if turn[1].z > best[1].z + 1e-9 { turn } else { best })
}

impl PaneFit {
    /// Its outline as that of one sheet of glass; empty for a rectangle.
    ///
    /// # Errors
    ///
    /// Why one sheet has no such outline.
    pub(crate) fn convex_outline(&self) -> Result<&[DVec2], String> {
        let Some(outline) = &self.outline else { return Ok(&[]) };
        let hull = polygon_area(&convex_hull(outline));
        let part = polygon_area(outline) / hull;
        if (part - 1.0).abs() > AREA_TOLERANCE {
            let part = 100.0 * part;
            return Err(format!(
                "it is flat, but its outline is not convex: it fills {part:.0} % of the convex hull. Lead it, with \
                 `diamonds` for instance"
            ));
        }
        if outline.len() > MOST_CORNERS {
            let corners = outline.len();
            return Err(format!(
                "its outline has {corners} corners, and panes have at most {MOST_CORNERS}. Lead it, with `diamonds` \
                 for instance"
            ));
        }
        Ok(outline)
    }

    /// The middle of its front face, for glass of this thickness.
    pub(crate) fn front(&self, thickness: f64) -> DVec3 {
        let [x, y] = self.axes;
        self.centre - x.cross(y) * (0.5 * thickness)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Frame;

    fn panes(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Result<PaneFit, String>> {
        pieces(positions, triangles).into_iter().map(|piece| piece.fit).collect()
    }

    /// A rectangle in a frame of `x` and `y`, with a corner at `from`.
    fn rectangle(from: DVec3, x: DVec3, y: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        (vec![from, from + x, from + x + y, from + y], vec![[0, 1, 2], [0, 2, 3]])
    }

    fn solid(from: DVec3, edges: [DVec3; 3]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let corner = |index: usize| (0..3).filter(|axis| index >> axis & 1 == 1).map(|axis| edges[axis]).sum::<DVec3>();
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        ((0..8).map(|index| from + corner(index)).collect(), triangles)
    }

    #[test]
    fn a_flat_rectangle_becomes_a_pane_that_stands_upright() {
        let along = DVec3::new(0.6, 0.8, 0.0);
        let (positions, triangles) = rectangle(DVec3::new(1.0, 2.0, 3.0), along * 0.5, DVec3::Z * 2.0);
        let found = panes(&positions, &triangles);
        let Ok(pane) = &found[0] else { panic!("{found:?}") };
        assert!((pane.centre - (DVec3::new(1.0, 2.0, 4.0) + along * 0.25)).length() < 1e-12);
        assert!((pane.size[0] - 0.5).abs() < 1e-12 && (pane.size[1] - 2.0).abs() < 1e-12, "{pane:?}");
        assert!((pane.axes[1] - DVec3::Z).length() < 1e-12 && pane.thickness.is_none());
    }

    #[test]
    fn a_thin_box_becomes_a_pane_of_its_thickness_however_it_is_turned() {
        let frame = Frame::around(DVec3::new(0.3, -0.5, 0.8).normalize());
        let edges = [DVec3::X * 0.4, DVec3::Y * 0.003, DVec3::Z * 0.7].map(|edge| frame.vector_to_world(edge));
        let (positions, triangles) = solid(DVec3::new(5.0, 0.0, 1.0), edges);
        let found = panes(&positions, &triangles);
        let [Ok(pane)] = &found[..] else { panic!("{found:?}") };
        assert!((pane.thickness.unwrap() - 0.003).abs() < 1e-9);
        let mut size = pane.size;
        size.sort_by(f64::total_cmp);
        assert!((size[0] - 0.4).abs() < 1e-9 && (size[1] - 0.7).abs() < 1e-9, "{pane:?}");
        let front = pane.front(0.003);
        assert!((front - pane.centre).dot(pane.axes[0].cross(pane.axes[1])) < -0.0014);
    }

    #[test]
    fn each_piece_of_a_mesh_is_a_pane_of_its_own() {
        let (mut positions, mut triangles) = rectangle(DVec3::ZERO, DVec3::X, DVec3::Z);
        let (more, others) = rectangle(DVec3::X * 2.0, DVec3::X, DVec3::Z);
        triangles.extend(others.iter().map(|triangle| triangle.map(|vertex| vertex + positions.len() as u32)));
        positions.extend(more);
        assert_eq!(panes(&positions, &triangles).iter().filter(|pane| pane.is_ok()).count(), 2);
        // Corners that are stored for each triangle are in the same places.
        let apart: Vec<DVec3> = triangles.iter().flatten().map(|vertex| positions[*vertex as usize]).collect();
        let triangles: Vec<[u32; 3]> = (0..4).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
        assert_eq!(panes(&apart, &triangles).len(), 2);
    }

    #[test]
    fn what_is_no_pane_says_why() {
        let reason = |positions: &[DVec3], triangles: &[[u32; 3]]| {
            let pane = panes(positions, triangles)[0].clone();
            pane.and_then(|pane| pane.convex_outline().map(drop)).unwrap_err()
        };
        let (positions, _) = rectangle(DVec3::ZERO, DVec3::X, DVec3::Z);
        let arrow = [[0, 1, 2], [0, 2, 3]];
        let mut dented = positions.clone();
        dented[2] = dented[0] + 0.3 * (dented[2] - dented[0]);
        assert!(reason(&dented, &arrow).contains("not convex: it fills 60 %"), "{}", reason(&dented, &arrow));
        let (positions, triangles) = solid(DVec3::ZERO, [DVec3::X, DVec3::Y, DVec3::Z]);
        assert!(reason(&positions, &triangles).contains("no thin box"));
        let (positions, triangles) = solid(DVec3::ZERO, [DVec3::X, DVec3::Y * 0.01, DVec3::Z]);
        assert!(reason(&positions, &triangles[..8]).contains("closed box"));
        let bent = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 0.1, 1.0), DVec3::Z];
        assert!(reason(&bent, &[[0, 1, 2], [0, 2, 3]]).contains("neither flat"));
    }

    /// A body between an outline at y = 0 and the same at y = `depth`. Its faces are fans around the first corner.
    fn extruded(outline: &[[f64; 2]], depth: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let count = outline.len() as u32;
        let at = |y: f64| outline.iter().map(move |[x, z]| DVec3::new(*x, y, *z));
        let front = (1..count - 1).map(|corner| [0, corner, corner + 1]);
        let back = (1..count - 1).map(|corner| [count, count + corner + 1, count + corner]);
        let sides = (0..count).flat_map(|corner| {
            let next = (corner + 1) % count;
            [[corner, count + corner, next], [next, count + corner, count + next]]
        });
        (at(0.0).chain(at(depth)).collect(), front.chain(back).chain(sides).collect())
    }

    #[test]
    fn a_sheet_of_any_outline_becomes_a_pane_of_its_thickness() {
        let lancet = [[-0.3, 0.0], [0.3, 0.0], [0.3, 0.6], [0.0, 1.0], [-0.3, 0.6]];
        let (positions, triangles) = extruded(&lancet, 0.004);
        let found = panes(&positions, &triangles);
        let [Ok(pane)] = &found[..] else { panic!("{found:?}") };
        assert!((pane.thickness.unwrap() - 0.004).abs() < 1e-9);
        assert!((pane.centre - DVec3::new(0.0, 0.002, 0.5)).length() < 1e-9, "{pane:?}");
        let outline = pane.convex_outline().unwrap();
        assert_eq!(outline.len(), 5);
        assert!((polygon_area(outline) - 0.48).abs() < 1e-9);

        let open = &triangles[..8];
        assert!(panes(&positions, open)[0].clone().unwrap_err().contains("closed box or sheet"));
    }

    #[test]
    fn the_outline_of_what_is_not_convex_goes_around_it() {
        let arrow = [[0.0, 0.0], [1.0, 0.0], [0.3, 0.3], [0.0, 1.0]];
        for depth in [0.0, 0.01] {
            let turned = [arrow[2], arrow[3], arrow[0], arrow[1]];
            let (positions, triangles) = extruded(&turned, depth);
            let faces = if depth == 0.0 { 2 } else { triangles.len() };
            let found = panes(&positions, &triangles[..faces]);
            let [Ok(pane)] = &found[..] else { panic!("{found:?}") };
            let outline = pane.outline.as_ref().unwrap();
            assert_eq!(outline.len(), 4, "{outline:?}");
            assert!((polygon_area(outline) - 0.3).abs() < 1e-9, "{outline:?}");
        }
    }

    #[test]
    fn a_shape_with_a_hole_is_refused() {
        let square = |half: f64| [[-half, -half], [half, -half], [half, half], [-half, half]];
        let corners = square(1.0).into_iter().chain(square(0.4));
        let positions: Vec<DVec3> = corners.map(|[x, z]| DVec3::new(x, 0.0, z)).collect();
        let ring = |index: u32| {
            let next = (index + 1) % 4;
            [[index, next, 4 + index], [next, 4 + next, 4 + index]]
        };
        let triangles: Vec<[u32; 3]> = (0..4).flat_map(ring).collect();
        let reason = panes(&positions, &triangles)[0].clone().unwrap_err();
        assert!(reason.contains("2 edges around it and in it"), "{reason}");
    }
}
