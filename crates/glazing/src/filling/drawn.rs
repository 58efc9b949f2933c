//! Pieces along drawn outlines: figures, medallions, heraldry.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Cell, CellGlass, Filling, FillingShape, Layout, MAX_PIECES, Region};
use crate::drawing::{closed_path, millimetre};
use crate::error::{GlazingError, check, join};
use crate::glass::check_name;
use crate::outline::Outline;
use crate::plan::Zone;
use crate::polygon;

/// Pieces along drawn outlines. A piece hides what lies under it: earlier pieces, and the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Drawn {
    /// Size of a unit of the paths, metres; 0.000001 to 100. The default is for drawings in millimetres.
    #[serde(default = "millimetre")]
    #[schemars(range(min = 0.000_001, max = 100.0))]
    pub scale: f64,
    /// Position of the drawing's origin, metres to the right of and below the upper left corner of the opening's
    /// bounding box; -100 to 100.
    #[serde(default)]
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub offset: [f64; 2],
    /// The pieces, 1 to 5000. Those that stick out of a light are cut along its edge.
    #[schemars(length(min = 1, max = 5000))]
    pub pieces: Vec<DrawnPiece>,
    /// How the rest of the lights is divided.
    #[serde(default = "plain")]
    pub ground: Box<Filling>,
}

/// A drawn piece.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DrawnPiece {
    /// Its outline as an SVG path of one closed part, x to the right and y down.
    #[schemars(length(min = 1, max = 100_000))]
    pub path: String,
    /// The kind of glass.
    #[schemars(length(min = 1, max = 200))]
    pub glass: String,
}

fn plain() -> Box<Filling> {
    Box::new(Filling::Plain)
}

/// Most drawn pieces.
const MAX_DRAWN: usize = 5000;

/// Outlines that are drawn this near to each other are meant to be one line, metres.
const DRAWN: f64 = 0.0004;

/// Most comparisons of lines with corners of pieces that may hide them, some seconds.
const MAX_WORK: usize = 1 << 28;

/// The outline of a piece in window coordinates.
struct Shape {
    corners: Vec<DVec2>,
    bounds: [DVec2; 2],
}

impl Shape {
    fn contains(&self, point: DVec2) -> bool {
        let [low, high] = self.bounds;
        point.cmpge(low).all() && point.cmple(high).all() && polygon::contains(&self.corners, point)
    }

    /// Whether the bounding box of a segment meets that of the shape.
    fn is_near(&self, [from, to]: [DVec2; 2]) -> bool {
        let [low, high] = self.bounds;
        from.max(to).cmpge(low).all() && from.min(to).cmple(high).all()
    }
}

impl Drawn {
    /// The outlines of all pieces.
    fn shapes(&self, upper_left: DVec2, path: &str) -> Result<Vec<Shape>, GlazingError> {
        let shape = |(index, piece): (usize, &DrawnPiece)| {
            self.shape(piece, upper_left).map_err(|expected| {
                GlazingError::new(format!("{path}.pieces[{index}].path"), format!("\"{}\"", piece.path), expected)
            })
        };
        self.pieces.iter().enumerate().map(shape).collect()
    }

    /// The outline of a piece, counterclockwise, or what is expected of its path.
    fn shape(&self, piece: &DrawnPiece, upper_left: DVec2) -> Result<Shape, String> {
        let [right, down] = self.offset;
        let corners = closed_path(&piece.path, upper_left + DVec2::new(right, -down), self.scale)?;
        Ok(Shape { bounds: polygon::bounds(&corners), corners })
    }
}

/// The parts of lines that no shape hides; `None` where finding them takes more work than is left.
fn visible<'a>(
    segments: Vec<[DVec2; 2]>,
    shapes: impl IntoIterator<Item = &'a Shape>,
    work_left: &mut usize,
) -> Option<Vec<[DVec2; 2]>> {
    let mut left = segments;
    for shape in shapes {
        let near = left.iter().filter(|segment| shape.is_near(**segment)).count();
        *work_left = work_left.checked_sub(left.len() + near * shape.corners.len())?;
        if near > 0 {
            left = (left.into_iter())
                .flat_map(|segment| {
                    let [from, to] = segment;
                    if shape.is_near(segment) {
                        polygon::clip_segment_outside(&shape.corners, from, to)
                    } else {
                        vec![segment]
                    }
                })
                .collect();
        }
    }
    Some(left)
}

fn overlapping(path: String) -> GlazingError {
    let expected = format!("pieces that overlap less: a window has at most {MAX_PIECES} pieces");
    GlazingError::new(path, "a piece under many", expected)
}

impl FillingShape for Drawn {
    fn validate(&self, path: &str) -> Result<(), GlazingError> {
        check(path, "scale", self.scale, 1e-6..=100.0, "metres")?;
        for (index, offset) in self.offset.into_iter().enumerate() {
            check(path, &format!("offset[{index}]"), offset, -100.0..=100.0, "metres")?;
        }
        if !(1..=MAX_DRAWN).contains(&self.pieces.len()) {
            let found = format!("{} pieces", self.pieces.len());
            return Err(GlazingError::new(join(path, "pieces"), found, format!("1 to {MAX_DRAWN} pieces")));
        }
        for (index, piece) in self.pieces.iter().enumerate() {
            check_name(&format!("{path}.pieces[{index}].glass"), &piece.glass)?;
        }
        self.ground.validate(&join(path, "ground"))
    }

    fn check_fit(&self, lights: &[Outline], upper_left: DVec2, path: &str) -> Result<(), GlazingError> {
        let polygons: Vec<Vec<DVec2>> = lights.iter().map(Outline::polygon).collect();
        for (index, shape) in self.shapes(upper_left, path)?.iter().enumerate() {
            let meets = |light: &Vec<DVec2>| {
                light.first().is_some_and(|&corner| shape.contains(corner))
                    || polygon::edges(&shape.corners)
                        .any(|[from, to]| !polygon::clip_segment(light, from, to).is_empty())
            };
            if !polygons.iter().any(meets) {
                let [low, high] = shape.bounds;
                let found = format!("a piece from {low:.3} to {high:.3} metres of the window");
                let expected = "a piece that lies in a light at least in part";
                return Err(GlazingError::new(format!("{path}.pieces[{index}].path"), found, expected));
            }
        }
        self.ground.check_fit(lights, upper_left, &join(path, "ground"))
    }

    fn lay_out<'a>(&'a self, region: Region<'_>, path: &str) -> Result<Layout<'a>, GlazingError> {
        let shapes = self.shapes(region.upper_left, path)?;
        let mut lines = Vec::new();
        let mut work_left = MAX_WORK;
        for (index, shape) in shapes.iter().enumerate() {
            let hiding = shapes[index + 1..].iter().filter(|other| other.is_near(shape.bounds));
            let inside = polygon::edges(&shape.corners)
                .flat_map(|[from, to]| polygon::clip_segment(region.polygon, from, to))
                .collect();
            let visible = visible(inside, hiding, &mut work_left)
                .ok_or_else(|| overlapping(format!("{path}.pieces[{index}].path")))?;
            lines.extend(polygon::joined(visible));
        }
        if lines.len() > 4 * MAX_PIECES {
            let found = format!("{} pieces", self.pieces.len());
            return Err(GlazingError::new(
                join(path, "pieces"),
                found,
                format!("at most {MAX_PIECES} pieces of glass"),
            ));
        }
        let ground = self.ground.lay_out(region, &join(path, "ground"))?;
        for line in ground.lines {
            let segments = line.windows(2).map(|ends| [ends[0], ends[1]]).collect();
            let visible =
                visible(segments, &shapes, &mut work_left).ok_or_else(|| overlapping(join(path, "pieces")))?;
            lines.extend(polygon::joined(visible));
        }
        let locate = move |point: DVec2| {
            let Some(index) = shapes.iter().rposition(|shape| shape.contains(point)) else {
                return (ground.locate)(point);
            };
            let glass = self.pieces.get(index).map(|piece| CellGlass::Named(&piece.glass));
            Cell { zone: Zone::Figure, row: 0, column: index as i64, checker: index as i64, glass }
        };
        Ok(Layout { lines, locate: Box::new(locate), tolerance: DRAWN })
    }

    fn glass_names(&self) -> Vec<&str> {
        let drawn = self.pieces.iter().map(|piece| piece.glass.as_str());
        drawn.chain(self.ground.glass_names()).collect()
    }
}
