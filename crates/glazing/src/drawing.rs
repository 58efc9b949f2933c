//! Closed outlines from SVG paths.

use glam::DVec2;
use kurbo::{BezPath, PathEl, Point};

use crate::grid::crossing;
use crate::polygon;

/// The unit of drawings whose scale is not said, metres.
pub(crate) fn millimetre() -> f64 {
    0.001
}

/// Longest path, bytes.
const MAX_PATH: usize = 100_000;

/// Most corners of a drawn outline.
const MAX_CORNERS: usize = 2048;

/// Largest distance of a curve from its chords, metres.
const FLATNESS: f64 = 0.0003;

/// Smallest area of an outline, square metres.
const MIN_AREA: f64 = 1e-6;

/// The corners of a path of one closed part, counterclockwise, metres: x to the right and y upwards. The path has units
/// of `scale` metres, its y axis points down, and its origin lies at `origin`.
///
/// # Errors
///
/// What is expected of the path.
pub(crate) fn closed_path(text: &str, origin: DVec2, scale: f64) -> Result<Vec<DVec2>, String> {
    if text.len() > MAX_PATH {
        return Err(format!("at most {MAX_PATH} bytes long"));
    }
    let path = BezPath::from_svg(text).map_err(|error| format!("an SVG path: {error}"))?;
    let place = |point: Point| origin + scale * DVec2::new(point.x, -point.y);
    let mut corners: Vec<DVec2> = Vec::new();
    for (index, element) in path.elements().iter().enumerate() {
        let from = corners.last().copied();
        match (*element, from) {
            (PathEl::MoveTo(to), _) if index == 0 => corners.push(place(to)),
            (PathEl::LineTo(to), _) => corners.push(place(to)),
            (PathEl::QuadTo(control, to), Some(from)) => {
                let (control, to) = (place(control), place(to));
                let cubic = [from, from.lerp(control, 2.0 / 3.0), to.lerp(control, 2.0 / 3.0), to];
                flatten(cubic, &mut corners)?;
            }
            (PathEl::CurveTo(first, second, to), Some(from)) => {
                flatten([from, place(first), place(second), place(to)], &mut corners)?;
            }
            (PathEl::ClosePath, _) => {}
            _ => return Err("one closed part, without holes".to_owned()),
        }
        if corners.len() > MAX_CORNERS {
            return Err(format!("simple enough for {MAX_CORNERS} corners"));
        }
    }
    let is_near = |corner: &DVec2| corner.is_finite() && corner.abs().max_element() < 1000.0;
    if !corners.iter().all(is_near) {
        return Err("within 1000 metres".to_owned());
    }
    corners.dedup_by(|next, corner| next.distance(*corner) < 1e-9);
    if polygon::area(&corners) < 0.0 {
        corners.reverse();
    }
    let corners = polygon::cleaned(&corners, 1e-9);
    if let Some(at) = crossing(&corners) {
        let on_paper = [at.x - origin.x, origin.y - at.y].map(|way| way / scale);
        return Err(format!("an outline that does not cross itself: it does near {on_paper:.3?}"));
    }
    let area = polygon::area(&corners);
    if area < MIN_AREA {
        return Err(format!("an outline around at least {MIN_AREA} square metres, not {area:.3e}"));
    }
    Ok(corners)
}

/// Adds the points of a cubic curve after its first, at equal distances of the parameter: as many as Wang's formula
/// asks for. They are the same in both directions.
fn flatten([a, b, c, d]: [DVec2; 4], corners: &mut Vec<DVec2>) -> Result<(), String> {
    let bend = (a - 2.0 * b + c).length().max((b - 2.0 * c + d).length());
    let wanted = (0.75 * bend / FLATNESS).sqrt().ceil().max(1.0);
    if wanted.is_nan() || wanted > MAX_CORNERS as f64 {
        return Err(format!("simple enough for {MAX_CORNERS} corners"));
    }
    for step in 1..=wanted as u32 {
        let t = f64::from(step) / wanted;
        let s = 1.0 - t;
        corners.push(s * s * s * a + 3.0 * s * s * t * b + 3.0 * s * t * t * c + t * t * t * d);
    }
    Ok(())
}
