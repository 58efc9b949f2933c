//! One piece.

use glam::DVec2;

use super::{COMPUTED, Cell, FillingShape, Layout, Region};
use crate::error::GlazingError;
use crate::plan::Zone;

/// One piece.
pub(super) struct Plain;

impl FillingShape for Plain {
    fn validate(&self, _: &str) -> Result<(), GlazingError> {
        Ok(())
    }

    fn lay_out<'a>(&'a self, _: Region<'_>, _: &str) -> Result<Layout<'a>, GlazingError> {
        let cell = Cell { zone: Zone::Field, row: 0, column: 0, checker: 0, glass: None };
        Ok(Layout { lines: Vec::new(), locate: Box::new(move |_: DVec2| cell), tolerance: COMPUTED })
    }
}
