//! How a light is divided into pieces. One file for each kind; `registry` lists them.

mod border;
mod diamonds;
mod drawn;
mod plain;
mod rectangles;
mod registry;
mod roundels;

use glam::DVec2;

pub use self::border::Border;
pub use self::diamonds::Diamonds;
pub use self::drawn::{Drawn, DrawnPiece};
pub use self::rectangles::Rectangles;
pub use self::registry::Filling;
pub use self::roundels::Roundels;
use crate::error::{GlazingError, join};
use crate::glass::GlassPattern;
use crate::outline::Outline;
use crate::plan::Zone;

/// Most pieces of a window.
pub(crate) const MAX_PIECES: usize = 100_000;

/// Smallest quarries, borders and discs, metres.
pub(crate) const MIN_SIZE: f64 = 0.01;

/// What is to be divided.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Region<'a> {
    /// The edge of the light, or of the field in it.
    pub(crate) outline: &'a Outline,
    /// Its corners.
    pub(crate) polygon: &'a [DVec2],
    /// The upper left corner of the opening's bounding box.
    pub(crate) upper_left: DVec2,
}

/// Lead lines, and what lies between them.
pub(crate) struct Layout<'a> {
    /// The lines, inside of the region.
    pub(crate) lines: Vec<Vec<DVec2>>,
    /// The cell of the filling that a point lies in.
    pub(crate) locate: Box<dyn Fn(DVec2) -> Cell<'a> + 'a>,
    /// Ends of lines this near to each other or to a line are meant to meet, metres.
    pub(crate) tolerance: f64,
}

/// Lines meet within this distance where a filling computes them, metres.
pub(crate) const COMPUTED: f64 = 1e-6;

/// A cell of a filling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell<'a> {
    pub(crate) zone: Zone,
    pub(crate) row: i64,
    pub(crate) column: i64,
    /// Differs by one between neighbours where the filling allows it.
    pub(crate) checker: i64,
    /// Glass other than the window's.
    pub(crate) glass: Option<CellGlass<'a>>,
}

/// Glass of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum CellGlass<'a> {
    Pattern(&'a GlassPattern),
    Named(&'a str),
}

/// What every kind of filling does.
pub(crate) trait FillingShape {
    /// Checks the settings.
    fn validate(&self, path: &str) -> Result<(), GlazingError>;

    /// The lead lines in a region.
    fn lay_out<'a>(&'a self, region: Region<'_>, path: &str) -> Result<Layout<'a>, GlazingError>;

    /// Checks the settings against all lights of a window.
    fn check_fit(&self, _lights: &[Outline], _upper_left: DVec2, _path: &str) -> Result<(), GlazingError> {
        Ok(())
    }

    /// Kinds of glass that the filling names.
    fn glass_names(&self) -> Vec<&str> {
        Vec::new()
    }
}

/// The parts of straight lines inside of a polygon.
pub(crate) fn clipped(polygon: &[DVec2], lines: impl IntoIterator<Item = [DVec2; 2]>) -> Vec<Vec<DVec2>> {
    let clip = |[from, to]: [DVec2; 2]| crate::polygon::clip_segment(polygon, from, to);
    lines.into_iter().flat_map(clip).map(Vec::from).collect()
}

/// Refuses more pieces than a window may have.
pub(crate) fn check_pieces(path: &str, member: &str, value: f64, area: f64, cell: f64) -> Result<(), GlazingError> {
    let count = area / cell;
    if count <= MAX_PIECES as f64 {
        return Ok(());
    }
    let expected = format!("large enough: {count:.0} pieces would be needed, and a window has at most {MAX_PIECES}");
    Err(GlazingError::new(join(path, member), value, expected))
}
