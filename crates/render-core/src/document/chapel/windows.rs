//! The windows, whose walls are the east and the south wall of the chapel.

use std::collections::BTreeMap;

use clerestory_glazing::{
    Arch, Border, Diamonds, Filling, GlassCycle, GlassPattern, Head, MixedGlass, Opening, UniformGlass, Wall,
    WeightedGlass, WindowDesign,
};

use super::dimensions::{BAYS, GABLE, LENGTH, SPRINGING, WIDTH};
use crate::scene::window::{GlassColour, GlassDescription, GlassSheet, OuterGlazing, WindowDescription};

/// From the middle of the glass to the inner face of the wall, metres.
const INSIDE: f64 = 0.45;

pub(super) fn windows() -> Vec<WindowDescription> {
    let lancets = [("east north", 1.0, 2.9), ("east middle", 3.0, 3.6), ("east south", 5.0, 2.9)];
    let east = (0..).zip(lancets).map(|(seed, (name, x, height))| east(name, x, height, seed));
    east.chain((0..BAYS).map(south)).collect()
}

/// A lancet of stained glass in a third of the east wall.
fn east(name: &str, x: f64, height: f64, seed: u64) -> WindowDescription {
    const SILL: f64 = 1.7;
    let width = 0.8;
    let mut design = design(width, height, "lancet");
    let side = 0.5 * (WIDTH / 3.0 - width);
    design.wall = Some(wall([side, side], SILL, GABLE - SILL - height));
    let names = ["ruby", "silver_stain"].map(str::to_owned).to_vec();
    design.filling = Filling::Border(Border {
        width: 0.07,
        length: None,
        glass: Some(GlassPattern::Checker(GlassCycle { names })),
        field: Box::new(Filling::Diamonds(Diamonds { width: 0.13, height: 0.18 })),
    });
    let kinds = [("potash", 3.0), ("cobalt", 2.5), ("ruby", 1.2), ("green", 0.8), ("murrey", 0.6), ("amber", 0.4)];
    let kind = |(name, weight): (&str, f64)| WeightedGlass { name: name.to_owned(), weight };
    design.glass = GlassPattern::Mixed(MixedGlass { kinds: kinds.map(kind).to_vec() });
    design.seed = seed;
    WindowDescription {
        name: name.to_owned(),
        sill: [x, LENGTH + INSIDE, SILL],
        x_axis: [1.0, 0.0, 0.0],
        y_axis: [0.0, 0.0, 1.0],
        design,
        glass: BTreeMap::new(),
        paint: None,
        outer: None,
    }
}

/// Diamonds of crown glass behind a protective pane, in a bay of the south wall.
fn south(number: u32) -> WindowDescription {
    const SILL: f64 = 1.5;
    let (width, height) = (1.1, 2.3);
    let bay = LENGTH / f64::from(BAYS);
    let mut design = design(width, height, "equilateral");
    let side = 0.5 * (bay - width);
    design.wall = Some(wall([side, side], SILL, SPRINGING - SILL - height));
    design.glass = GlassPattern::Uniform(UniformGlass { name: "crown".to_owned() });
    design.seed = 10 + u64::from(number);
    let crown = GlassDescription {
        sheet: GlassSheet::Crown,
        colour: GlassColour::Named("greenish".to_owned()),
        ..GlassDescription::default()
    };
    WindowDescription {
        name: format!("south {}", number + 1),
        sill: [WIDTH + INSIDE, bay * (f64::from(number) + 0.5), SILL],
        x_axis: [0.0, -1.0, 0.0],
        y_axis: [0.0, 0.0, 1.0],
        design,
        glass: BTreeMap::from([("crown".to_owned(), crown)]),
        paint: None,
        outer: Some(OuterGlazing { distance: 0.08, glass: GlassDescription::float() }),
    }
}

fn design(width: f64, height: f64, head: &str) -> WindowDesign {
    let head = Head::usual(head, width).unwrap_or_default();
    WindowDesign::new(Opening::Arch(Arch { width, height, head }))
}

fn wall([left, right]: [f64; 2], below: f64, above: f64) -> Wall {
    Wall { left, right, below, above, inside: INSIDE, outside: 0.25, splay: 25.0, outer_splay: 15.0 }
}
