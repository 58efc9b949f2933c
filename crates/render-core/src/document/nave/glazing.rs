//! The panes: crown, cylinder-blown and hammered glass and bullions, mixed over the windows.
//!
//! Under the sun, a caustic 11 m behind a pane is blurred by 11 cm. So only longer waves are visible, with focal
//! lengths of about that distance. The other faces have shorter waves: they are blurred away, but every method has to
//! find its way through them. Slopes are 1e-3 to 6e-3, those of old glass.

use super::leading::GAP;
use super::stonework::{GLASS_DEPTH, OPENING, WINDOWS, window_centre};
use crate::document::triangles::rounded;
use crate::geometry::FaceCrossing;
use crate::scene::description::{LayersDescription, PaneDescription, ProfileDescription};
use crate::settings::Triple;

/// How a pane was made.
#[derive(Clone, Copy)]
enum Glass {
    Crown,
    Cylinder,
    Bullion,
    Hammered,
}

/// One of each in each row of four.
const MIX: [Glass; 4] = [Glass::Crown, Glass::Cylinder, Glass::Bullion, Glass::Hammered];

/// The panes of all windows, of which each is cut into `cuts` rows and columns.
pub(super) fn panes(cuts: u32) -> Vec<PaneDescription> {
    let mut panes = Vec::new();
    for window in 0..WINDOWS {
        for row in 0..cuts {
            for column in 0..cuts {
                // Neighbours differ, and every window that has four panes has one of each.
                let kind = MIX[((window + column + 2 * row + row / 2) % 4) as usize];
                panes.push(pane(kind, cuts, [window, row, column], panes.len() as u64 + 1));
            }
        }
    }
    panes
}

/// One pane: its window, its row from below and its column along the nave, counted from 0.
fn pane(glass: Glass, cuts: u32, [window, row, column]: [u32; 3], seed: u64) -> PaneDescription {
    let pitch = [2.0 * OPENING.half_width, OPENING.head - OPENING.sill].map(|extent| extent / f64::from(cuts));
    let middle = |index: u32, pitch: f64| (f64::from(index) + 0.5) * pitch;
    let (thickness, absorption) = glass.body();
    let [front, back] = glass.faces(seed);
    PaneDescription {
        name: format!("window {} row {} column {}", window + 1, row + 1, column + 1),
        centre: [
            0.5 * thickness - GLASS_DEPTH,
            window_centre(window) - OPENING.half_width + middle(column, pitch[0]),
            OPENING.sill + middle(row, pitch[1]),
        ]
        .map(rounded),
        // z points out of the building, so that the front is the inner face.
        x_axis: [0.0, -1.0, 0.0],
        y_axis: [0.0, 0.0, 1.0],
        width: rounded(pitch[0] - GAP),
        height: rounded(pitch[1] - GAP),
        outline: Vec::new(),
        sheet: None,
        thickness,
        index_of_refraction: 1.52,
        absorption,
        layers: LayersDescription::default(),
        paint: None,
        front,
        back,
        crossing: FaceCrossing::default(),
        priority: 0,
    }
}

impl Glass {
    /// Thickness, metres, and absorption, per metre.
    fn body(self) -> (f64, Triple) {
        match self {
            Self::Crown => (0.0018, [3.0, 1.5, 2.4]),
            Self::Cylinder => (0.002, [4.0, 2.0, 6.0]),
            Self::Bullion => (0.003, [40.0, 8.0, 30.0]),
            Self::Hammered => (0.0025, [6.0, 30.0, 120.0]),
        }
    }

    /// The profiles of the front and the back face.
    fn faces(self, seed: u64) -> [ProfileDescription; 2] {
        let crown = |centre, wavelength, amplitude| ProfileDescription::Crown { centre, wavelength, amplitude, seed };
        let cylinder = |axis, wavelength, amplitude| ProfileDescription::Cylinder { axis, wavelength, amplitude, seed };
        match self {
            Self::Crown => [crown([0.2, -0.35], 0.18, 1.6e-4), crown([0.2, -0.35], 0.06, 1.5e-5)],
            Self::Cylinder => [cylinder(84.0, 0.2, 2e-4), cylinder(87.0, 0.07, 1.5e-5)],
            Self::Bullion => [
                ProfileDescription::Bump {
                    centre: [0.005, -0.01],
                    radius: [0.05, 0.045],
                    rotation: 0.0,
                    amplitude: -4.5e-4,
                },
                crown([0.005, -0.01], 0.15, 8e-5),
            ],
            Self::Hammered => {
                [ProfileDescription::Hammered { wavelength: 0.16, amplitude: 8e-5, seed }, ProfileDescription::Flat]
            }
        }
    }
}
