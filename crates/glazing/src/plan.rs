//! The plan of a window: what the caller makes panes and meshes of.
//!
//! Coordinates are metres: x to the right and y upwards, seen from inside of the building, and z from the glass towards
//! whoever looks. The origin is the middle of the sill, in the middle of the glass.

use std::fmt;

use glam::DVec2;

use crate::bars::Bar;
use crate::lead::Cames;
use crate::stone::StoneFrame;
use crate::wall::PlannedWall;

/// The plan of a window.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowPlan {
    /// The edge of the opening, counterclockwise.
    pub outline: Vec<DVec2>,
    /// The lights, counterclockwise: what the tracery leaves of the opening.
    pub lights: Vec<Vec<DVec2>>,
    /// The tracery, if there is any.
    pub stone: Option<StoneFrame>,
    /// The wall, if there is to be one.
    pub wall: Option<PlannedWall>,
    /// The pieces of glass, ordered by their places.
    pub pieces: Vec<Piece>,
    /// The cames.
    pub cames: Vec<Came>,
    /// Sections of the cames; `None` where pieces touch without lead.
    pub lead: Option<Cames>,
    /// Where cames are soldered together.
    pub joints: Vec<SolderJoint>,
    /// Iron bars on the inside of the glass.
    pub bars: Vec<Bar>,
}

/// A piece of glass.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// The edge of the glass, metres: convex and counterclockwise, with 3 to 64 corners. It lies under the flanges of
    /// the cames; without lead, neighbours share their edges.
    pub outline: Vec<DVec2>,
    /// Where the piece is. No two pieces share a place.
    pub place: PiecePlace,
    /// The kind of glass.
    pub glass: String,
    /// Rotation about the x axis and the y axis through the middle of the piece, degrees.
    pub tilt: [f64; 2],
    /// By which the thickness of the sheet is multiplied.
    pub thickness_factor: f64,
    /// Where in its sheet the piece is cut.
    pub cut: SheetCut,
}

/// Where in a sheet of glass a piece is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetCut {
    /// Position across the sheet, 0 to less than 1.
    pub u: f64,
    /// Position along the sheet, 0 to less than 1.
    pub v: f64,
    /// Rotation of the piece against the sheet, radians, 0 to less than 2 pi.
    pub rotation: f64,
}

/// The place of a piece in its window. Displayed, it is a name: `light 2 row 3 column 4`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PiecePlace {
    /// Number of the light, from 0.
    pub light: usize,
    /// Part of the filling.
    pub zone: Zone,
    /// Row of the light's zone, from 0 upwards.
    pub row: u32,
    /// Column of the light's zone, from 0; to the right, along a border, or in the order of drawn pieces.
    pub column: u32,
    /// Number among the pieces into which the outline of the light or lead lines cut one piece of the filling, from 0.
    pub part: usize,
}

/// A part of a filling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Zone {
    /// The border of a light.
    Border,
    /// Quarries, courses or a single piece.
    Field,
    /// Discs.
    Roundel,
    /// Glass between discs.
    Between,
    /// Drawn pieces.
    Figure,
}

impl Zone {
    /// The word for it in the name of a piece.
    pub fn name(self) -> &'static str {
        match self {
            Self::Border => "border",
            Self::Field => "field",
            Self::Roundel => "roundel",
            Self::Between => "between",
            Self::Figure => "figure",
        }
    }
}

impl fmt::Display for PiecePlace {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { light, zone, row, column, part } = self;
        write!(formatter, "light {} {} row {} column {}", light + 1, zone.name(), row + 1, column + 1)?;
        if *part > 0 { write!(formatter, " part {}", part + 1) } else { Ok(()) }
    }
}

/// A came.
#[derive(Clone, Debug, PartialEq)]
pub struct Came {
    /// The middle of the heart, metres. A closed came ends where it starts, and has that corner once.
    pub path: Vec<DVec2>,
    /// Whether the last corner is joined to the first.
    pub is_closed: bool,
    /// Width of its flanges, metres.
    pub flange_width: f64,
    /// Whether it runs along the edge of a light.
    pub is_border: bool,
}

/// Solder where cames meet, on both sides of the glass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolderJoint {
    /// The middle, metres.
    pub at: DVec2,
    /// Radius, metres.
    pub radius: f64,
}
