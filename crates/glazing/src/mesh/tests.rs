use std::collections::BTreeMap;

use crate::polygon;
use crate::{
    Arch, Bars, CameProfile, Cames, Ferramenta, Geometrical, Head, Lead, MeshPart, Opening, PlanMesh, StoneHole,
    Tracery, WindowDesign, WindowPlan,
};

/// Checks that every edge is there twice: once in each direction.
pub(crate) fn assert_closed(mesh: &PlanMesh) {
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

/// Checks that the faces of tracery are cut into triangles that do not overlap.
pub(crate) fn assert_stone_is_solid(plan: &WindowPlan) {
    let Some(frame) = &plan.stone else { return };
    let mesh = plan.meshes().into_iter().find(|mesh| mesh.part == MeshPart::Stone).unwrap();
    let half = 0.5 * frame.depth;
    let is_front = |triangle: &&[u32; 3]| triangle.iter().all(|&corner| mesh.positions[corner as usize][2] == half);
    let covered: f64 = (mesh.triangles.iter().filter(is_front))
        .map(|triangle| {
            let corners = triangle.map(|corner| {
                let [x, y, _] = mesh.positions[corner as usize];
                glam::DVec2::new(x, y)
            });
            let area = polygon::area(&corners);
            assert!(area > -1e-9, "a triangle is turned over: {area:e}");
            area.abs()
        })
        .sum();
    let holes: f64 = frame.holes.iter().map(|hole| polygon::area(&hole.face_outline)).sum();
    let expected = polygon::area(&frame.outline) - holes;
    assert!((covered / expected - 1.0).abs() < 1e-6, "{covered} of {expected}");
}

#[test]
fn stone_has_the_volume_of_its_section() {
    let plan = design().plan().unwrap();
    assert_stone_is_solid(&plan);
    let meshes = plan.meshes();
    let stone = meshes.iter().find(|mesh| mesh.part == MeshPart::Stone).unwrap();
    let frame = plan.stone.as_ref().unwrap();
    let area = |hole: fn(&StoneHole) -> &Vec<glam::DVec2>| {
        let holes: f64 = frame.holes.iter().map(|frame| polygon::area(hole(frame))).sum();
        polygon::area(&frame.outline) - holes
    };
    let [straight, face] = [area(|hole| &hole.outline), area(|hole| &hole.face_outline)];
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
