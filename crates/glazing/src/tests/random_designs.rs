//! Random designs: a plan is sound, or an error says what is wrong.

use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};

use super::pieces::assert_sound;
use crate::{
    Arch, Border, Cames, Diamonds, Drop, Filling, Foil, Geometrical, Head, Intersecting, Lancet, Lead, Mullions, Ogee,
    Opening, Rectangles, Roundel, Roundels, Segmental, StoneSection, Tracery, Tudor, WindowDesign,
};

fn head() -> impl Strategy<Value = Head> {
    let haunch_angle = 20.0..80.0;
    prop_oneof![
        Just(Head::Rectangle),
        Just(Head::Round),
        Just(Head::Equilateral),
        (0.0..0.6).prop_map(|rise| Head::Segmental(Segmental { rise })),
        (0.3..3.0).prop_map(|radius| Head::Lancet(Lancet { radius })),
        (0.3..2.0).prop_map(|radius| Head::Drop(Drop { radius })),
        (0.1..1.0, haunch_angle).prop_map(|(rise, haunch_angle)| Head::Tudor(Tudor {
            rise,
            haunch_radius: None,
            haunch_angle
        })),
        (0.2..1.5, 10.0..90.0).prop_map(|(rise, apex_angle)| Head::Ogee(Ogee { rise, radius: None, apex_angle })),
    ]
}

fn opening() -> impl Strategy<Value = Opening> {
    prop_oneof![
        4 => (0.2..2.0, 0.3..3.0, head()).prop_map(|(width, height, head)| Opening::Arch(Arch { width, height, head })),
        1 => (0.2..2.0).prop_map(|diameter| Opening::Roundel(Roundel { diameter })),
        1 => (0.2..2.0, 3..9_u32).prop_map(|(diameter, lobes)| Opening::Foil(Foil { diameter, lobes })),
    ]
}

fn tracery() -> impl Strategy<Value = Tracery> {
    prop_oneof![
        3 => Just(Tracery::None),
        1 => Just(Tracery::Y),
        1 => (2..5_u32).prop_map(|lights| Tracery::Intersecting(Intersecting { lights })),
        1 => (3..7_u32).prop_map(|lobes| Tracery::Geometrical(Geometrical { lobes })),
        1 => (2..5_u32).prop_map(|lights| Tracery::Mullions(Mullions { lights, head: None })),
    ]
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
        cases: 96,
        rng_seed: RngSeed::Fixed(0x6c65_6164),
        failure_persistence: None,
        ..Config::default()
    })]

    #[test]
    fn plans_are_sound(
        (opening, tracery, filling) in (opening(), tracery(), filling()),
        (lead, width, seed) in (lead(), 0.04..0.2, any::<u64>()),
    ) {
        let stone = StoneSection { width, chamfer: 0.2 * width, ..StoneSection::default() };
        let design = WindowDesign { tracery, filling, lead, stone, seed, ..WindowDesign::new(opening) };
        match design.plan() {
            Ok(plan) => {
                assert_sound(&plan);
                plan.meshes();
            }
            Err(error) => {
                // Values out of range are refused at their member, and no piece is too intricate.
                prop_assert!(error.path != "filling", "{error}");
            }
        }
    }
}
