//! The glazing of a light: pieces, cames and joints from the lead lines of its filling.

use std::collections::BTreeMap;

use glam::DVec2;

use crate::arrangement::Arrangement;
use crate::convex::{ConvexParts, CutTests};
use crate::error::GlazingError;
use crate::filling::{Cell, CellGlass, Filling, Layout, MAX_PIECES, Region};
use crate::glass::{GlassPattern, PatternPlace};
use crate::grid::VertexGrid;
use crate::lead::Cames;
use crate::outline::Outline;
use crate::plan::{Came, Piece, PiecePlace, SheetCut, SolderJoint, Zone};
use crate::polygon;
use crate::random::Random;

/// Most corners of a piece.
pub(crate) const MAX_CORNERS: usize = 64;

/// Pieces with a smaller area are dust, square metres.
const MIN_AREA: f64 = 1e-10;

/// Edges of glass under lead that are shorter than this are left out, metres.
const SHORT: f64 = 2e-5;

/// Cames end where they would turn by more than this; the cosine.
const SHARPEST_TURN: f64 = 0.6;

/// How often parts of the lead that touch no other are tied.
const MAX_TIES: usize = 8;

/// What the glazing of all lights of a window has in common.
pub(crate) struct Glazier<'a> {
    pub(crate) filling: &'a Filling,
    pub(crate) glass: &'a GlassPattern,
    pub(crate) cames: Option<&'a Cames>,
    pub(crate) tilt: f64,
    pub(crate) thickness_variation: f64,
    pub(crate) seed: u64,
    /// The upper left corner of the opening's bounding box.
    pub(crate) upper_left: DVec2,
}

/// A glazed light.
pub(crate) struct GlazedLight {
    pub(crate) pieces: Vec<Piece>,
    pub(crate) cames: Vec<Came>,
    pub(crate) joints: Vec<SolderJoint>,
}

impl Glazier<'_> {
    /// Glazes a light.
    pub(crate) fn glaze(
        &self,
        light: usize,
        outline: &Outline,
        tests: &mut CutTests,
    ) -> Result<GlazedLight, GlazingError> {
        let edge = outline.polygon();
        let region = Region { outline, polygon: &edge, upper_left: self.upper_left };
        let Layout { lines, locate, tolerance } = self.filling.lay_out(region, "filling")?;
        let border = edge.iter().chain(edge.first()).copied().collect();
        let mut lines: Vec<Vec<DVec2>> = [border].into_iter().chain(lines).collect();
        let mut arrangement = Arrangement::new(&lines, tolerance).ok_or_else(crowded)?;
        for _ in 0..MAX_TIES {
            let ties = arrangement.ties();
            if ties.is_empty() {
                break;
            }
            lines.extend(ties);
            arrangement = Arrangement::new(&lines, tolerance).ok_or_else(crowded)?;
        }
        let hidden = self.cames.map_or(0.0, Cames::hidden);
        let mut lead = LeadLines::new(self.cames);
        lead.add_edges(&arrangement);
        let mut cut_pieces = Vec::new();
        for face in &arrangement.faces {
            let corners = arrangement.corners(face);
            let middle = polygon::inner_point(&corners);
            let cell = locate(middle);
            let parts = ConvexParts::new(&corners, hidden, MAX_CORNERS, tests).ok_or_else(|| uncut(middle))?;
            for cut in parts.cuts {
                lead.add_cut(cut);
            }
            for part in parts.parts {
                let glass = self.glass_edge(&part);
                if polygon::area(&glass) < MIN_AREA {
                    continue;
                }
                if !polygon::is_convex(&glass) {
                    return Err(uncut(middle));
                }
                cut_pieces.push((cell, glass));
            }
        }
        let (cames, joints) = lead.finish();
        Ok(GlazedLight { pieces: self.pieces(light, cut_pieces), cames, joints })
    }

    /// The edge of the glass in a cell; empty where the flanges cover the whole cell.
    fn glass_edge(&self, cell: &[DVec2]) -> Vec<DVec2> {
        let Some(cames) = self.cames else { return cell.to_vec() };
        if polygon::inset_convex(cell, 0.5 * cames.flange_width.min(cames.border_width)).is_empty() {
            return Vec::new();
        }
        // The flanges hide what this takes, and short edges go.
        polygon::cleaned(&polygon::inset_convex(cell, 0.5 * cames.heart_thickness), SHORT)
    }

    /// The pieces of a light, ordered by their places.
    fn pieces(&self, light: usize, cut_pieces: Vec<(Cell<'_>, Vec<DVec2>)>) -> Vec<Piece> {
        let mut first: BTreeMap<Zone, [i64; 2]> = BTreeMap::new();
        for (Cell { zone, row, column, .. }, _) in &cut_pieces {
            let [least_row, least_column] = first.entry(*zone).or_insert([*row, *column]);
            (*least_row, *least_column) = ((*least_row).min(*row), (*least_column).min(*column));
        }
        let mut parts = BTreeMap::new();
        let mut pieces = Vec::with_capacity(cut_pieces.len());
        for (cell, outline) in cut_pieces {
            let Cell { zone, row, column, .. } = cell;
            let part = parts.entry((zone, row, column)).or_insert(0);
            let [row, column] = first.get(&zone).map_or([0; 2], |first| {
                [row - first[0], column - first[1]].map(|number| u32::try_from(number).unwrap_or(u32::MAX))
            });
            pieces.push(self.piece(outline, PiecePlace { light, zone, row, column, part: *part }, &cell));
            *part += 1;
        }
        pieces.sort_unstable_by_key(|piece| piece.place);
        pieces
    }

    /// A piece with its random numbers.
    fn piece(&self, outline: Vec<DVec2>, place: PiecePlace, cell: &Cell<'_>) -> Piece {
        let PiecePlace { light, zone, part, .. } = place;
        let key = [light as u64, zone as u64, cell.row as u64, cell.column as u64, part as u64];
        // Pieces keep their other numbers when the pattern of glass changes.
        let mut random = Random::new(self.seed, &key);
        let tilt = [0.0; 2].map(|_: f64| self.tilt * random.normal());
        let thickness_factor = 1.0 + self.thickness_variation * random.normal();
        let cut = SheetCut { u: random.unit(), v: random.unit(), rotation: std::f64::consts::TAU * random.unit() };
        let at = PatternPlace { light: light as i64, row: cell.row, checker: cell.checker };
        let pick = |pattern: &GlassPattern, random: &mut Random| pattern.pick(at, random).to_owned();
        let glass = match cell.glass {
            None => pick(self.glass, &mut random),
            Some(CellGlass::Pattern(pattern)) => pick(pattern, &mut random),
            Some(CellGlass::Named(name)) => name.to_owned(),
        };
        Piece { outline, place, glass, tilt, thickness_factor, cut }
    }
}

/// A piece that cannot be cut into convex ones.
fn uncut(at: DVec2) -> GlazingError {
    let found = format!("a piece around {at:.3} metres that touches itself or is too intricate");
    GlazingError::new("filling", found, "pieces that lead lines can cut into convex ones")
}

fn crowded() -> GlazingError {
    let expected = format!("fewer: a window has at most {MAX_PIECES} pieces");
    GlazingError::new("filling", "lines that cross each other millions of times", expected)
}

/// Collects the cames and joints of a light.
struct LeadLines<'a> {
    settings: Option<&'a Cames>,
    cames: Vec<Came>,
    joints: VertexGrid,
    is_border: Vec<bool>,
}

/// Joints nearer to each other than this are one, metres.
const JOINT_DISTANCE: f64 = 0.002;

/// Radius of the solder on a joint, as a part of the width of a flange.
const SOLDER: f64 = 0.7;

impl<'a> LeadLines<'a> {
    fn new(settings: Option<&'a Cames>) -> Self {
        Self { settings, cames: Vec::new(), joints: VertexGrid::new(JOINT_DISTANCE), is_border: Vec::new() }
    }

    fn add_joint(&mut self, at: DVec2, is_border: bool) {
        let joint = self.joints.insert(at);
        self.is_border.resize(self.is_border.len().max(joint + 1), false);
        self.is_border[joint] |= is_border;
    }

    /// Cames along the edges of an arrangement. Edges of a line that follow each other are one came, up to a sharp
    /// turn.
    fn add_edges(&mut self, arrangement: &Arrangement) {
        if self.settings.is_none() {
            return;
        }
        let mut uses: Vec<(u32, usize)> = vec![(0, usize::MAX); arrangement.vertices.len()];
        let mut is_joint = vec![false; arrangement.vertices.len()];
        for edge in &arrangement.edges {
            for end in edge.ends {
                let (count, line) = &mut uses[end];
                is_joint[end] |= *count >= 2 || *count == 1 && *line != edge.line;
                *count += 1;
                *line = edge.line;
            }
        }
        let at = |vertex: usize| arrangement.vertices[vertex];
        for run in arrangement.edges.chunk_by(|edge, next| edge.line == next.line && edge.ends[1] == next.ends[0]) {
            let is_border = run[0].line == 0;
            let mut vertices: Vec<usize> = run[..1].iter().map(|edge| edge.ends[0]).collect();
            vertices.extend(run.iter().map(|edge| edge.ends[1]));
            let is_loop = vertices.len() > 3 && vertices.first() == vertices.last();
            let turns = |before: usize, vertex: usize, after: usize| {
                let [arriving, leaving] = [at(vertex) - at(before), at(after) - at(vertex)];
                arriving.normalize_or_zero().dot(leaving.normalize_or_zero()) < SHARPEST_TURN
            };
            if is_loop {
                // The loop starts at a sharp turn, if it has one.
                vertices.pop();
                let count = vertices.len();
                let sharp = (0..count).find(|&index| {
                    turns(vertices[(index + count - 1) % count], vertices[index], vertices[(index + 1) % count])
                });
                let Some(sharp) = sharp else {
                    self.add_came(vertices.iter().map(|&vertex| at(vertex)).collect(), true, is_border);
                    continue;
                };
                vertices.rotate_left(sharp);
                vertices.push(vertices[0]);
            }
            let mut start = 0;
            for index in 1..vertices.len() {
                let is_end = index + 1 == vertices.len();
                if is_end || turns(vertices[index - 1], vertices[index], vertices[index + 1]) {
                    let path = vertices[start..=index].iter().map(|&vertex| at(vertex)).collect();
                    self.add_came(path, false, is_border);
                    is_joint[vertices[start]] = true;
                    is_joint[vertices[index]] = true;
                    start = index;
                }
            }
        }
        for (vertex, _) in is_joint.iter().enumerate().filter(|(_, is_joint)| **is_joint) {
            self.add_joint(at(vertex), false);
        }
        for edge in arrangement.edges.iter().filter(|edge| edge.line == 0) {
            for end in edge.ends.into_iter().filter(|&end| is_joint[end]) {
                self.add_joint(at(end), true);
            }
        }
    }

    /// A came that cuts a hollow piece.
    fn add_cut(&mut self, ends: [DVec2; 2]) {
        if self.settings.is_some() {
            ends.into_iter().for_each(|end| self.add_joint(end, false));
            self.add_came(ends.to_vec(), false, false);
        }
    }

    fn add_came(&mut self, mut path: Vec<DVec2>, is_closed: bool, is_border: bool) {
        let Some(settings) = self.settings else { return };
        if is_closed {
            path = polygon::cleaned(&path, STRAIGHT);
        } else {
            path = without_straight_corners(&path);
        }
        let flange_width = if is_border { settings.border_width } else { settings.flange_width };
        self.cames.push(Came { path, is_closed, flange_width, is_border });
    }

    fn finish(self) -> (Vec<Came>, Vec<SolderJoint>) {
        let Some(settings) = self.settings.filter(|settings| settings.solder) else {
            return (self.cames, Vec::new());
        };
        let joint = |(at, is_border): (DVec2, bool)| {
            let width = if is_border { settings.border_width } else { settings.flange_width };
            SolderJoint { at, radius: SOLDER * width }
        };
        let joints = self.joints.into_points().into_iter().zip(self.is_border).map(joint).collect();
        (self.cames, joints)
    }
}

/// A corner of a came that deviates this little from its neighbours is left out, metres.
const STRAIGHT: f64 = 5e-5;

/// A polyline without corners that lie on the line of their neighbours.
fn without_straight_corners(path: &[DVec2]) -> Vec<DVec2> {
    let mut kept: Vec<DVec2> = Vec::new();
    for (index, &point) in path.iter().enumerate() {
        let is_straight = match (kept.last(), path.get(index + 1)) {
            (Some(&before), Some(&after)) => polygon::nearest(before, after, point).distance(point) <= STRAIGHT,
            _ => false,
        };
        if !is_straight {
            kept.push(point);
        }
    }
    kept
}
