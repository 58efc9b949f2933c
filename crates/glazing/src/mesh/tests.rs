use std::collections::BTreeMap;

use crate::{
    Arch, Bars, CameProfile, Cames, Ferramenta, Geometrical, Head, Lead, MeshPart, Opening, PlanMesh, Tracery,
    WindowDesign,
};

/// Twice each: once in each direction.
fn assert_closed(mesh: &PlanMesh) {
    let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for [a, b, c] in &mesh.triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *edges.entry([*from.min(to), *from.max(to)]).or_default() += if from < to { 1 } else { -1 };
            *edges.entry([*from.max(to), *from.min(to)]).or_default() += 1;
        }
    }
    for ([from, to], count) in edges {
        assert_eq!(count, if from < to { 0 } else { 2 }, "{:?}: {from} {to}", mesh.part);
    }
}

fn volume(mesh: &PlanMesh) -> f64 {
    let corner = |index: u32| glam::DVec3::from(mesh.positions[index as usize]);
    mesh.triangles.iter().map(|[a, b, c]| corner(*a).dot(corner(*b).cross(corner(*c))) / 6.0).sum()
}

fn design() -> WindowDesign {
    WindowDesign {
        tracery: Tracery::Geometrical(Geometrical::default()),
        ..WindowDesign::new(Opening::Arch(Arch { width: 1.6, height: 3.2, head: Head::Equilateral }))
    }
}

#[test]
fn meshes_are_closed_and_point_outwards() {
    for (profile, bars) in
        [(CameProfile::Flat, Bars::default()), (CameProfile::Round, Bars::Ferramenta(Ferramenta::default()))]
    {
        let lead = Lead::Cames(Cames { profile, ..Cames::default() });
        let meshes = WindowDesign { lead, bars, ..design() }.plan().unwrap().meshes();
        let parts: Vec<MeshPart> = meshes.iter().map(|mesh| mesh.part).collect();
        assert_eq!(parts, [MeshPart::Lead, MeshPart::Solder, MeshPart::Iron, MeshPart::Stone]);
        for mesh in &meshes {
            assert_closed(mesh);
            assert!(volume(mesh) > 0.0, "{:?}", mesh.part);
        }
    }
}

#[test]
fn stone_has_the_volume_of_its_section() {
    let plan = design().plan().unwrap();
    let meshes = plan.meshes();
    let stone = meshes.iter().find(|mesh| mesh.part == MeshPart::Stone).unwrap();
    let frame = plan.stone.as_ref().unwrap();
    let area = |corners: &[glam::DVec2]| crate::polygon::area(corners);
    let [straight, face]: [f64; 2] = [
        area(&frame.outline) - frame.holes.iter().map(|hole| area(&hole.outline)).sum::<f64>(),
        area(&frame.outline) - frame.holes.iter().map(|hole| area(&hole.face_outline)).sum::<f64>(),
    ];
    assert!(face < straight);
    // A chamfer is about a prismatoid between both sections.
    let expected = straight * (frame.depth - 2.0 * frame.chamfer_depth) + (straight + face) * frame.chamfer_depth;
    assert!((volume(stone) / expected - 1.0).abs() < 1e-3);
}

#[test]
fn a_window_without_lead_and_bars_has_no_meshes() {
    let design = WindowDesign {
        lead: Lead::None,
        bars: Bars::None,
        ..WindowDesign::new(Opening::Arch(Arch { width: 0.5, height: 1.0, head: Head::Round }))
    };
    assert!(design.plan().unwrap().meshes().is_empty());
}
