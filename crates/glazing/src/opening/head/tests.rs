use glam::DVec2;

use super::*;
use crate::opening::{Arch, Opening};

fn heads() -> Vec<Head> {
    vec![
        Head::Rectangle,
        Head::Round,
        Head::Segmental(Segmental { rise: 0.2 }),
        Head::Lancet(Lancet { radius: 1.8 }),
        Head::Equilateral,
        Head::Drop(Drop { radius: 0.7 }),
        Head::Tudor(Tudor { rise: 0.4, haunch_radius: None, haunch_angle: 55.0 }),
        Head::Ogee(Ogee { rise: 1.0, radius: None, apex_angle: 40.0 }),
    ]
}

fn outline(head: Head) -> crate::outline::Outline {
    Opening::Arch(Arch { width: 1.0, height: 2.5, head }).form("opening").unwrap().outline
}

#[test]
fn the_highest_point_is_at_the_height_of_the_opening() {
    for head in heads() {
        let name = head.name();
        let outline = outline(head);
        let highest = outline.polygon().iter().map(|corner| corner.y).fold(0.0, f64::max);
        assert!((highest - 2.5).abs() < 2e-4, "{name}: {highest}");
    }
}

#[test]
fn apexes_are_as_high_as_the_formulas_say() {
    let rise = |head: Head| head.form(1.0, "").unwrap().rise;
    assert_eq!(rise(Head::Round), 0.5);
    assert!((rise(Head::Equilateral) - 0.75_f64.sqrt()).abs() < 1e-12);
    assert!((rise(Head::Lancet(Lancet { radius: 1.8 })) - (1.8_f64 - 0.25).sqrt()).abs() < 1e-12);
    assert!((rise(Head::Drop(Drop { radius: 0.7 })) - (0.7_f64 - 0.25).sqrt()).abs() < 1e-12);
}

#[test]
fn outlines_have_corners_at_sill_and_apex_only() {
    for head in heads() {
        let name = head.name();
        let outline = outline(head);
        let is_pointed = !["rectangle", "round", "segmental"].contains(&name);
        let count = outline.sides().len();
        for (index, side) in outline.sides().iter().enumerate() {
            let end = outline.end(index);
            let next = outline.sides()[(index + 1) % count].curve;
            let turn = side.curve.tangent(end).perp_dot(next.tangent(end));
            let is_apex = is_pointed && end.x.abs() < 1e-9;
            let is_sharp = end.y == 0.0 || is_apex || !is_pointed && name != "round";
            assert_eq!(turn > 1e-9, is_sharp, "{name}, side {index}: {turn}");
        }
    }
}

#[test]
fn outlines_are_mirror_images_of_themselves() {
    for head in heads() {
        let corners = outline(head).polygon();
        for corner in &corners {
            let image = DVec2::new(-corner.x, corner.y);
            assert!(corners.iter().any(|other| other.distance(image) < 1e-9));
        }
    }
}

#[test]
fn parallel_outlines_keep_their_distance() {
    for head in heads() {
        let name = head.name();
        let outline = outline(head);
        let inset = outline.inset(0.05).unwrap_or_else(|| panic!("{name}"));
        for corner in inset.polygon() {
            let distance = crate::polygon::distance_to_border(&outline.polygon(), corner);
            assert!((distance - 0.05).abs() < 1e-3, "{name}: {distance}");
        }
        assert_eq!(outline.inset(0.6), None, "{name}");
    }
}

#[test]
fn impossible_heads_are_refused_at_their_member() {
    let refused = |head: Head, path: &str| {
        let error = head.form(1.0, "head").unwrap_err();
        assert_eq!(error.path, path, "{error}");
    };
    refused(Head::Segmental(Segmental { rise: 0.5 }), "head.segmental.rise");
    refused(Head::Lancet(Lancet { radius: 0.9 }), "head.lancet.radius");
    refused(Head::Drop(Drop { radius: f64::NAN }), "head.drop.radius");
    let tudor = |haunch_radius, haunch_angle| Head::Tudor(Tudor { rise: 0.4, haunch_radius, haunch_angle });
    refused(tudor(Some(0.39), 55.0), "head.tudor.haunch_radius");
    refused(tudor(None, 10.0), "head.tudor.haunch_angle");
    refused(tudor(Some(0.38), 55.0), "head.tudor.haunch_angle");
    refused(Head::Ogee(Ogee { rise: 0.3, radius: None, apex_angle: 40.0 }), "head.ogee.rise");
    refused(Head::Ogee(Ogee { rise: 1.9, radius: Some(0.5), apex_angle: 80.0 }), "head.ogee.apex_angle");
}
