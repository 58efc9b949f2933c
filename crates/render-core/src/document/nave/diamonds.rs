//! Leaded windows of diamonds in the openings.

use std::collections::BTreeMap;

use clerestory_glazing::{
    Arch, Diamonds, Filling, GlassPattern, Head, MixedGlass, Opening as WindowOpening, WeightedGlass, WindowDesign,
};

use super::stonework::{GLASS_DEPTH, OPENING, WINDOWS, window_centre};
use crate::scene::window::{GlassColour, GlassDescription, GlassSheet, WindowDescription};

/// The kinds of glass, by name, with how often they occur. Glaziers took what was at hand.
const GLASS: [(&str, GlassSheet, f64); 3] = [
    ("crown", GlassSheet::Crown, 3.0),
    ("cylinder", GlassSheet::Cylinder, 2.0),
    ("hammered", GlassSheet::Hammered, 0.5),
];

/// One window for each opening.
pub(super) fn windows() -> Vec<WindowDescription> {
    (0..WINDOWS).map(window).collect()
}

fn window(number: u32) -> WindowDescription {
    let (width, height) = (2.0 * OPENING.half_width, OPENING.head - OPENING.sill);
    let mut design = WindowDesign::new(WindowOpening::Arch(Arch { width, height, head: Head::Rectangle }));
    design.filling = Filling::Diamonds(Diamonds { width: 0.125, height: 0.17 });
    let kinds = GLASS.iter().map(|(name, _, weight)| WeightedGlass { name: (*name).to_owned(), weight: *weight });
    design.glass = GlassPattern::Mixed(MixedGlass { kinds: kinds.collect() });
    design.seed = u64::from(number);
    let kind = |(name, sheet, _): (&str, GlassSheet, f64)| {
        let colour = GlassColour::Named("greenish".to_owned());
        (name.to_owned(), GlassDescription { sheet, colour, ..GlassDescription::default() })
    };
    WindowDescription {
        name: format!("window {}", number + 1),
        sill: [-GLASS_DEPTH, window_centre(number), OPENING.sill],
        x_axis: [0.0, -1.0, 0.0],
        y_axis: [0.0, 0.0, 1.0],
        design,
        glass: BTreeMap::from(GLASS.map(kind)),
        paint: None,
        outer: None,
    }
}
