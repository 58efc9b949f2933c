use super::*;
use crate::opening::{Arch, Head, Lancet, Opening};

fn lights(head: Head, tracery: Tracery, bar: f64) -> Result<Vec<Outline>, GlazingError> {
    let form = Opening::Arch(Arch { width: 2.0, height: 5.0, head }).form("opening")?;
    tracery.lights(&form, bar, "tracery")
}

#[test]
fn lights_lie_in_the_opening_apart_from_each_other() {
    let bar = 0.12;
    for (head, tracery) in [
        (Head::Equilateral, Tracery::Y),
        (Head::Lancet(Lancet { radius: 2.5 }), Tracery::Intersecting(Intersecting { lights: 4 })),
        (Head::Equilateral, Tracery::Geometrical(Geometrical { lobes: 5 })),
        (Head::Equilateral, Tracery::Reticulated(Reticulated { lights: 3, rise: None })),
        (Head::Lancet(Lancet { radius: 2.5 }), Tracery::Reticulated(Reticulated { lights: 4, rise: Some(0.4) })),
        (Head::Round, Tracery::Mullions(Mullions { lights: 3, head: None })),
        (Head::Rectangle, Tracery::Mullions(Mullions { lights: 3, head: Some(Head::Equilateral) })),
    ] {
        let opening =
            Opening::Arch(Arch { width: 2.0, height: 5.0, head: head.clone() }).form("").unwrap().outline.polygon();
        let lights: Vec<_> = lights(head, tracery.clone(), bar).unwrap().iter().map(Outline::polygon).collect();
        for (index, light) in lights.iter().enumerate() {
            for &corner in light {
                assert!(polygon::contains(&opening, corner));
                let distance = polygon::distance_to_border(&opening, corner);
                assert!(distance > 0.5 * bar - 1e-3, "{tracery:?}: {distance}");
                for other in lights.iter().skip(index + 1) {
                    let distance = polygon::distance_to_border(other, corner);
                    assert!(distance > bar - 1e-3 && !polygon::contains(other, corner), "{tracery:?}: {distance}");
                }
            }
        }
    }
}

#[test]
fn intersecting_tracery_has_a_net_of_lights() {
    for number in 2..5 {
        let tracery = Tracery::Intersecting(Intersecting { lights: number });
        let count = lights(Head::Lancet(Lancet { radius: 2.5 }), tracery, 0.08).unwrap().len() as u32;
        assert_eq!(count, number + number * (number - 1) / 2);
    }
}

#[test]
fn tracery_that_does_not_fit_is_refused_at_its_member() {
    let path = |head, tracery, bar| lights(head, tracery, bar).unwrap_err().path;
    assert_eq!(path(Head::Round, Tracery::Y, 0.1), "tracery.y");
    assert_eq!(path(Head::Equilateral, Tracery::Y, 0.99), "stone.width");
    let mullions = |lights, head| Tracery::Mullions(Mullions { lights, head });
    assert_eq!(path(Head::Round, mullions(1, None), 0.1), "tracery.mullions.lights");
    assert_eq!(path(Head::Round, mullions(2, Some(Head::Round)), 0.1), "tracery.mullions.head");
}
