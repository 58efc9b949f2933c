//! What the building and its windows share.

/// Inside of the chapel, metres: x from the north wall to the south, y from the west wall to the east.
pub(super) const WIDTH: f64 = 6.0;
pub(super) const LENGTH: f64 = 10.0;

/// The height at which the vault begins, and that of the gables, metres.
pub(super) const SPRINGING: f64 = 4.2;
pub(super) const GABLE: f64 = 8.4;

/// Bays between transverse ribs. Each has a window to the south.
pub(super) const BAYS: u32 = 3;
