//! Designs for tests.

use crate::{
    Arch, Border, Diamonds, Drawn, DrawnPiece, Drop, Filling, Foil, Geometrical, GlassPattern, Head, Intersecting,
    Lancet, Lead, Mullions, Ogee, Opening, Rectangles, Reticulated, Roundel, Roundels, Segmental, Tracery, Tudor,
    UniformGlass, WindowDesign,
};

pub(super) fn arch(width: f64, height: f64, head: Head) -> Opening {
    Opening::Arch(Arch { width, height, head })
}

pub(super) fn border(field: Filling) -> Filling {
    let glass = Some(GlassPattern::Uniform(UniformGlass { name: "ruby".to_owned() }));
    Filling::Border(Border { width: 0.05, length: None, glass, field: Box::new(field) })
}

pub(super) fn drawn(paths: &[&str], ground: Filling) -> Filling {
    let piece =
        |(index, path): (usize, &&str)| DrawnPiece { path: (*path).to_owned(), glass: format!("drawn {index}") };
    let pieces = paths.iter().enumerate().map(piece).collect();
    Filling::Drawn(Drawn { scale: 0.001, offset: [0.0; 2], pieces, ground: Box::new(ground) })
}

pub(super) fn fillings() -> Vec<Filling> {
    let disc = "M 350 400 A 150 150 0 1 1 350 700 A 150 150 0 1 1 350 400 Z";
    let star = "M 350 480 L 365 530 L 415 530 L 375 560 L 390 610 L 350 580 L 310 610 L 325 560 L 285 530 L 335 530 Z";
    vec![
        Filling::Plain,
        Filling::Diamonds(Diamonds::default()),
        Filling::Rectangles(Rectangles::default()),
        Filling::Rectangles(Rectangles { offset: 0.5, ..Rectangles::default() }),
        border(Filling::Diamonds(Diamonds::default())),
        border(border(Filling::Plain)),
        Filling::Roundels(Roundels::default()),
        drawn(&[disc, star], Filling::Plain),
        border(drawn(&[disc, star], Filling::Diamonds(Diamonds::default()))),
    ]
}

pub(super) fn heads() -> Vec<Head> {
    vec![
        Head::Rectangle,
        Head::Round,
        Head::Segmental(Segmental { rise: 0.1 }),
        Head::Lancet(Lancet { radius: 1.1 }),
        Head::Equilateral,
        Head::Drop(Drop { radius: 0.5 }),
        Head::Tudor(Tudor { rise: 0.25, haunch_radius: None, haunch_angle: 55.0 }),
        Head::Ogee(Ogee { rise: 0.6, radius: None, apex_angle: 40.0 }),
    ]
}

/// Moves drawn pieces down, out of the stone of tracery.
fn lower(filling: &mut Filling) {
    match filling {
        Filling::Drawn(drawn) => drawn.offset = [0.1, 1.2],
        Filling::Border(border) => lower(&mut border.field),
        _ => {}
    }
}

/// Every head with every filling, other openings, and every tracery.
pub(super) fn all() -> Vec<WindowDesign> {
    let mut designs = Vec::new();
    for mut filling in fillings() {
        for head in heads() {
            designs.push(WindowDesign { filling: filling.clone(), ..WindowDesign::new(arch(0.7, 1.5, head)) });
        }
        for opening in [
            Opening::Roundel(Roundel { diameter: 1.2 }),
            Opening::Foil(Foil { diameter: 1.3, lobes: 4 }),
            Opening::Foil(Foil { diameter: 1.3, lobes: 3 }),
        ] {
            designs.push(WindowDesign { filling: filling.clone(), ..WindowDesign::new(opening) });
        }
        lower(&mut filling);
        for (head, tracery) in [
            (Head::Equilateral, Tracery::Y),
            (Head::Equilateral, Tracery::Intersecting(Intersecting { lights: 3 })),
            (Head::Lancet(Lancet { radius: 1.9 }), Tracery::Geometrical(Geometrical { lobes: 4 })),
            (Head::Equilateral, Tracery::Reticulated(Reticulated::default())),
            (Head::Round, Tracery::Mullions(Mullions { lights: 3, head: None })),
            (Head::Rectangle, Tracery::Mullions(Mullions { lights: 2, head: Some(Head::Equilateral) })),
        ] {
            let opening = arch(1.8, 3.0, head);
            designs.push(WindowDesign { tracery, filling: filling.clone(), ..WindowDesign::new(opening) });
        }
    }
    designs
}

pub(super) fn without_lead(design: WindowDesign) -> WindowDesign {
    WindowDesign { lead: Lead::None, ..design }
}
