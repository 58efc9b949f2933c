//! Random designs: a plan is sound, or an error says what is wrong.

use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};

use super::pieces::{assert_covers, assert_sound, assert_tight};
use crate::mesh::tests::{assert_closed, assert_stone_is_solid};
use crate::{
    Arch, Border, Cames, Diamonds, Drawn, DrawnPiece, Drop, Filling, Foil, Geometrical, Head, Intersecting, Lancet,
    Lead, Mullions, Ogee, Opening, Rectangles, Reticulated, Roundel, Roundels, Segmental, StoneSection, Tracery, Tudor,
    WindowDesign,
};

/// A head for an opening 1 m wide.
fn head() -> impl Strategy<Value = Head> {
    let tudor = |(rise, haunch_angle)| Head::Tudor(Tudor { rise, haunch_radius: None, haunch_angle });
    let ogee = |(rise, apex_angle)| Head::Ogee(Ogee { rise, radius: None, apex_angle });
    prop_oneof![
        Just(Head::Rectangle),
        Just(Head::Round),
        Just(Head::Equilateral),
        (0.01..0.49).prop_map(|rise| Head::Segmental(Segmental { rise })),
        (1.0..5.0).prop_map(|radius| Head::Lancet(Lancet { radius })),
        (0.51..1.0).prop_map(|radius| Head::Drop(Drop { radius })),
        (0.3..0.6, 40.0..70.0).prop_map(tudor),
        (0.6..1.2, 20.0..60.0).prop_map(ogee),
    ]
}

/// A head of a width.
fn widened(head: Head, width: f64) -> Head {
    match head {
        Head::Segmental(head) => Head::Segmental(Segmental { rise: head.rise * width }),
        Head::Lancet(head) => Head::Lancet(Lancet { radius: head.radius * width }),
        Head::Drop(head) => Head::Drop(Drop { radius: head.radius * width }),
        Head::Tudor(head) => Head::Tudor(Tudor { rise: head.rise * width, ..head }),
        Head::Ogee(head) => Head::Ogee(Ogee { rise: head.rise * width, ..head }),
        other => other,
    }
}

fn arch(width: f64, jambs: f64, head: Head) -> Opening {
    let head = widened(head, width);
    let rise = head.form(width, "").map_or(width, |form| form.rise);
    Opening::Arch(Arch { width, height: rise + jambs, head })
}

/// An opening, with tracery that it can have.
fn opening() -> impl Strategy<Value = (Opening, Tracery)> {
    let pointed = prop_oneof![
        Just(Head::Equilateral),
        (1.0..3.0).prop_map(|radius| Head::Lancet(Lancet { radius })),
        (0.51..1.0).prop_map(|radius| Head::Drop(Drop { radius })),
    ];
    let net = prop_oneof![
        Just(Tracery::Y),
        (2..5_u32).prop_map(|lights| Tracery::Intersecting(Intersecting { lights })),
        (3..7_u32).prop_map(|lobes| Tracery::Geometrical(Geometrical { lobes })),
        (2..5_u32).prop_map(|lights| Tracery::Reticulated(Reticulated { lights, rise: None })),
    ];
    let mullions = prop_oneof![
        2 => Just(Tracery::None),
        1 => (2..5_u32).prop_map(|lights| Tracery::Mullions(Mullions { lights, head: None })),
    ];
    prop_oneof![
        3 => (0.3..2.0, 0.0..2.0, head(), mullions)
            .prop_map(|(width, jambs, head, tracery)| (arch(width, jambs, head), tracery)),
        2 => (0.8..2.5, 0.1..2.0, pointed, net)
            .prop_map(|(width, jambs, head, tracery)| (arch(width, jambs, head), tracery)),
        1 => (0.2..2.0).prop_map(|diameter| (Opening::Roundel(Roundel { diameter }), Tracery::None)),
        1 => (0.3..2.0, 3..9_u32)
            .prop_map(|(diameter, lobes)| (Opening::Foil(Foil { diameter, lobes }), Tracery::None)),
    ]
}

/// A drawn piece around a centre, with straight or curved edges between corners at different distances from it.
fn drawn_piece() -> impl Strategy<Value = DrawnPiece> {
    let radii = prop::collection::vec(20.0..200.0, 3..9);
    (50.0..500.0, 50.0..900.0, radii, any::<bool>()).prop_map(|(x, y, radii, is_curved)| {
        let count = radii.len() as f64;
        let at = |part: f64, radius: f64| {
            let (sine, cosine) = libm::sincos(std::f64::consts::TAU * part / count);
            format!("{:.3} {:.3}", x + radius * cosine, y + radius * sine)
        };
        let mut path = String::new();
        for (index, &radius) in radii.iter().enumerate() {
            path += &match (index, is_curved) {
                (0, _) => format!("M {}", at(0.0, radius)),
                (_, false) => format!(" L {}", at(index as f64, radius)),
                (_, true) => format!(" Q {} {}", at(index as f64 - 0.5, radius), at(index as f64, radius)),
            };
        }
        DrawnPiece { path: path + " Z", glass: "drawn".to_owned() }
    })
}

fn filling() -> impl Strategy<Value = Filling> {
    let size = || 0.04..0.4;
    let leaf = prop_oneof![
        Just(Filling::Plain),
        (size(), size()).prop_map(|(width, height)| Filling::Diamonds(Diamonds { width, height })),
        (size(), size(), 0.0..1.0).prop_map(|(width, height, offset)| Filling::Rectangles(Rectangles {
            width,
            height,
            offset
        })),
        (size(), 0.005..0.05).prop_map(|(diameter, gap)| Filling::Roundels(Roundels { diameter, gap, between: None })),
    ];
    let drawn = (prop::collection::vec(drawn_piece(), 1..5), leaf.clone()).prop_map(|(pieces, ground)| {
        Filling::Drawn(Drawn { scale: 0.001, offset: [0.0; 2], pieces, ground: ground.into() })
    });
    let leaf = prop_oneof![4 => leaf, 1 => drawn];
    leaf.prop_recursive(2, 3, 1, |field| {
        (0.02..0.1, field).prop_map(|(width, field)| {
            Filling::Border(Border { width, length: None, glass: None, field: field.into() })
        })
    })
}

fn lead() -> impl Strategy<Value = Lead> {
    prop_oneof![
        1 => Just(Lead::None),
        3 => (0.004..0.02, 0.0005..0.002).prop_map(|(flange_width, heart_thickness)| {
            Lead::Cames(Cames { flange_width, heart_thickness, ..Cames::default() })
        }),
    ]
}

proptest! {
    #![proptest_config(Config {
        cases: 48,
        rng_seed: RngSeed::Fixed(0x6c65_6164),
        failure_persistence: None,
        ..Config::default()
    })]

    #[test]
    fn plans_are_sound(
        ((opening, tracery), filling, lead) in (opening(), filling(), lead()),
        (width, seed) in (0.04..0.15, any::<u64>()),
    ) {
        let stone = StoneSection { width, chamfer: 0.2 * width, ..StoneSection::default() };
        let design = WindowDesign { tracery, filling, lead, stone, seed, ..WindowDesign::new(opening) };
        match design.plan() {
            Ok(plan) => {
                assert_sound(&plan);
                if plan.lead.is_none() {
                    assert_covers(&plan, design.glass_names().contains(&"drawn"));
                } else {
                    assert_tight(&plan, 60);
                }
                plan.meshes().iter().for_each(assert_closed);
                assert_stone_is_solid(&plan);
            }
            Err(error) => {
                // Values out of range are refused at their member, and no piece is too intricate.
                prop_assert!(error.path != "filling", "{error}");
            }
        }
    }
}
