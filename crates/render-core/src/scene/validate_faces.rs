//! Specular meshes that touch others face to face. Examples are a block of glass exactly on a floor, two that share a
//! face, and a mirror in the plane of its wall. Between two faces in one place there is nothing that says which a ray
//! meets first.

use glam::DVec3;

use super::MeshSurface;
use super::validate_places::{Metres, further};
use crate::geometry::coincidence::{Faces, area_normal};
use crate::geometry::contact::{NOWHERE, Shape, join, overlap};
use crate::settings::Check;
use crate::settings::JsonPath;
use crate::settings::SceneError;
use crate::settings::check::Quoted;

/// In meshes of more triangles, such as water, faces are compared with those of other meshes alone.
const MOST_OWN_TRIANGLES: u32 = 1 << 18;

/// Boxes that are compared to find out which faces are, a second's work: faces beyond that are all compared.
const MOST_BOX_TESTS: u64 = 1 << 29;

/// Checks that no face of a dielectric lies in one place with another face, and no mirror in the surface of another
/// mesh.
pub(super) fn check_faces(corners: impl Fn(u32) -> [DVec3; 3], meshes: &[MeshSurface]) -> Check {
    let triangles = candidates(&corners, meshes);
    let mesh_of = |triangle: u32| meshes.partition_point(|mesh| mesh.triangle_range().end <= triangle);
    let is_specular = |triangle: u32| meshes[mesh_of(triangle)].is_specular();
    let conflict = |a: u32, b: u32| {
        let (first, second) = (mesh_of(a), mesh_of(b));
        let face_alike = || area_normal(corners(a)).dot(area_normal(corners(b))) > 0.0;
        meshes[first].is_dielectric() || meshes[second].is_dielectric() || (first != second && face_alike())
    };
    let faces = Faces { triangles: &triangles, corners: &corners };
    let Some((pair, at)) = faces.coincidence(is_specular, conflict) else { return Ok(()) };
    let [first, second] = pair.map(|triangle| (mesh_of(triangle), triangle));
    let rank = |mesh: usize| (meshes[mesh].is_dielectric(), meshes[mesh].is_specular(), mesh);
    let ((subject, triangle), (other, _)) =
        if rank(first.0) > rank(second.0) { (first, second) } else { (second, first) };
    let root = JsonPath::Root;
    let path = root.member("meshes");
    let path = path.element(subject);
    let (path, name) = (path.member("source"), Quoted(meshes[subject].name()));
    if subject == other {
        let found = format!("mesh {name}, of which two faces lie in one place at {}", Metres(at));
        let expected = "one face, or none between parts of the same glass: light through both would be wrong";
        return Err(SceneError::value(&path, found, expected));
    }
    let found = format!(
        "mesh {name} face to face with mesh {} (meshes[{other}]) at {}",
        Quoted(meshes[other].name()),
        Metres(at)
    );
    let outwards = area_normal(corners(triangle)).normalize_or_zero();
    // A body moves away from what it touches, a mirror in front of it.
    let way = if meshes[subject].is_dielectric() { -outwards } else { outwards };
    let expected = format!("apart from it, such as {} (light that meets both would be wrong)", further(1.0, way));
    Err(SceneError::value(&path, found, expected))
}

/// The triangles of specular meshes that may lie where others do, and those others. Where that takes too long to find
/// out, some more.
fn candidates(corners: &impl Fn(u32) -> [DVec3; 3], meshes: &[MeshSurface]) -> Vec<u32> {
    if !meshes.iter().any(MeshSurface::is_specular) {
        return Vec::new();
    }
    let around = |triangle: u32| Shape::Polygon(&corners(triangle)).bounds();
    let bounds = meshes.iter().map(|mesh| mesh.triangle_range().map(around).fold(NOWHERE, join)).collect();
    let mut near = Near { meshes, bounds, tests: MOST_BOX_TESTS };
    let mut faces = Vec::new();
    let mut others = NOWHERE;
    for (index, mesh) in meshes.iter().enumerate().filter(|(_, mesh)| !mesh.is_specular()) {
        let boxes = near.specular_meshes(index);
        let whole = boxes.iter().copied().fold(NOWHERE, join);
        for triangle in mesh.triangle_range() {
            let bounds = around(triangle);
            if overlap(&bounds, &whole) && near.meets(&boxes, &bounds) {
                others = join(others, bounds);
                faces.push(triangle);
            }
        }
    }
    for (index, mesh) in meshes.iter().enumerate().filter(|(_, mesh)| mesh.is_specular()) {
        if mesh.is_dielectric() && mesh.triangles() <= MOST_OWN_TRIANGLES {
            faces.extend(mesh.triangle_range());
            continue;
        }
        let boxes = near.specular_meshes(index);
        let whole = boxes.iter().copied().fold(NOWHERE, join);
        faces.extend(mesh.triangle_range().filter(|triangle| {
            let bounds = around(*triangle);
            overlap(&bounds, &others) || overlap(&bounds, &whole) && near.meets(&boxes, &bounds)
        }));
    }
    faces
}

/// Finds the specular meshes near something.
struct Near<'a> {
    meshes: &'a [MeshSurface],
    /// Boxes around all meshes.
    bounds: Vec<[DVec3; 2]>,
    /// Boxes that may still be compared.
    tests: u64,
}

impl Near<'_> {
    /// The boxes around the other specular meshes that overlap that around a mesh.
    fn specular_meshes(&mut self, index: usize) -> Vec<[DVec3; 2]> {
        let Some(left) = self.tests.checked_sub(self.meshes.len() as u64) else {
            return vec![[DVec3::NEG_INFINITY, DVec3::INFINITY]];
        };
        self.tests = left;
        let others = self.meshes.iter().zip(&self.bounds).enumerate();
        let near = others.filter(|(other, (mesh, bounds))| {
            *other != index && mesh.is_specular() && overlap(&self.bounds[index], bounds)
        });
        near.map(|(_, (_, bounds))| *bounds).collect()
    }

    /// Whether a box overlaps one of some, as far as there is time to find out.
    fn meets(&mut self, boxes: &[[DVec3; 2]], bounds: &[DVec3; 2]) -> bool {
        let Some(left) = self.tests.checked_sub(boxes.len() as u64) else { return true };
        self.tests = left;
        boxes.iter().any(|other| overlap(bounds, other))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::slice::from_ref;

    use serde_json::{Value, json};

    use super::*;
    use crate::document::malformed_scenes::valid_scene;
    use crate::document::{SceneBundle, SceneDescription};

    /// Corners, and triangles of them.
    type Triangles = (Vec<[f64; 3]>, Vec<[u32; 3]>);

    /// A box, from outside counterclockwise.
    fn block(min: [f64; 3], max: [f64; 3]) -> Triangles {
        let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { max[axis] } else { min[axis] });
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        ((0..8).map(corner).collect(), sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect())
    }

    fn mesh(name: &str, material: &str, parts: &[Triangles]) -> Value {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (corners, sides) in parts {
            let first = positions.len() as u32;
            positions.extend_from_slice(corners);
            triangles.extend(sides.iter().map(|side| side.map(|corner| first + corner)));
        }
        let inline = json!({"positions": positions, "triangles": triangles});
        json!({"name": name, "material": material, "source": {"inline": inline}})
    }

    fn build(meshes: &[Value]) -> Result<(), SceneError> {
        let mut scene = valid_scene();
        scene["panes"] = json!([]);
        scene["meshes"] = json!(meshes);
        scene["materials"] = json!({
            "stone": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}},
            "glass": {"dielectric": {}},
            "mirror": {"mirror": {}}
        });
        let description = SceneDescription::parse(scene.to_string().as_bytes())?;
        SceneBundle::from_parts(description, BTreeMap::new())?.build_scene().map(drop)
    }

    #[track_caller]
    fn check_refused(path: &str, fragments: &[&str], meshes: &[Value]) {
        let error = build(meshes).expect_err("faces lie in one place");
        assert_eq!(error.path(), path, "{error}");
        for fragment in fragments {
            assert!(error.to_string().contains(fragment), "no {fragment:?} in: {error}");
        }
    }

    fn floor() -> Value {
        mesh("floor", "stone", &[block([-1.0, -1.0, -0.5], [1.0, 1.0, 0.0])])
    }

    #[test]
    fn glass_that_stands_exactly_on_something_is_refused_with_the_place_and_a_way_out() {
        let on = |z: f64| mesh("cube", "glass", &[block([0.1, 0.1, z], [0.3, 0.3, z + 0.2])]);
        let words = ["mesh \"cube\" face to face with mesh \"floor\" (meshes[0]) at [0.", ", 0]"];
        check_refused("meshes[1].source", &words, &[floor(), on(0.0)]);
        let words = ["mesh \"floor\" (meshes[1])", "0.000001 m further along [0, 0, 1]"];
        check_refused("meshes[0].source", &words, &[on(0.0), floor()]);
        for z in [1e-6, 1e-9, -0.01] {
            build(&[floor(), on(z)]).unwrap_or_else(|error| panic!("{z}: {error}"));
        }
    }

    #[test]
    fn two_blocks_of_glass_that_share_a_face_are_refused_in_two_meshes_and_in_one() {
        let [left, right] = [-0.2, 0.0].map(|x| block([x, -0.1, 0.1], [x + 0.2, 0.1, 0.3]));
        let apart = block([1e-6, -0.1, 0.1], [0.2, 0.1, 0.3]);
        let pair = [mesh("left", "glass", from_ref(&left)), mesh("right", "glass", from_ref(&right))];
        check_refused("meshes[1].source", &["\"right\" face to face with mesh \"left\"", "along [1, 0, 0]"], &pair);
        check_refused(
            "meshes[0].source",
            &["two faces lie in one place at [0, "],
            &[mesh("both", "glass", &[left.clone(), right])],
        );
        build(&[mesh("both", "glass", &[left.clone(), apart])]).unwrap();
        // Side by side in one plane, as slabs in a floor.
        let slab = mesh("slab", "stone", &[block([0.000_001, -0.1, 0.1], [0.2, 0.1, 0.3])]);
        build(&[mesh("left", "glass", &[left]), slab]).unwrap();
    }

    #[test]
    fn only_faces_near_other_specular_meshes_are_compared_and_all_when_there_is_no_time_to_find_out() {
        let cube = |x: f64| block([x, 0.1, 0.1], [x + 0.2, 0.3, 0.3]);
        let mut scene = valid_scene();
        scene["panes"] = json!([]);
        scene["materials"] = json!({
            "stone": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}},
            "glass": {"dielectric": {}},
            "mirror": {"mirror": {}}
        });
        // Stone and a mirror, each with one part that reaches into the cube of glass and one far away.
        scene["meshes"] = json!([
            mesh("stone", "stone", &[cube(0.05), cube(5.0)]),
            mesh("glass", "glass", &[cube(0.1)]),
            mesh("mirror", "mirror", &[cube(0.15), cube(-7.0)]),
            mesh("far", "mirror", &[cube(9.0)]),
        ]);
        for (index, mesh) in scene["meshes"].as_array_mut().unwrap().iter_mut().enumerate() {
            mesh["translate"] = json!([0, 0.01 * index as f64, 0.01 * index as f64]);
        }
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        let scene = SceneBundle::from_parts(description, BTreeMap::new()).unwrap().build_scene().unwrap();
        let corners = |triangle: u32| *scene.accelerator().corners(triangle);
        let found = candidates(&corners, scene.meshes());
        let around = |triangle: u32| Shape::Polygon(&corners(triangle)).bounds();
        let whole = |mesh: &MeshSurface| mesh.triangle_range().map(around).fold(NOWHERE, join);
        let is_near = |triangle: &u32| {
            let mesh = scene.mesh_of(*triangle);
            let others = scene.meshes().iter().enumerate().filter(|(other, _)| *other != mesh as usize);
            others.filter(|(_, mesh)| mesh.is_specular()).any(|(_, mesh)| overlap(&around(*triangle), &whole(mesh)))
        };
        let expected: Vec<u32> = (0..72).filter(|triangle| (24..36).contains(triangle) || is_near(triangle)).collect();
        assert_eq!(found, expected);
        assert!(expected.len() > 20 && !expected.iter().any(|k| (12..24).contains(k) || *k >= 48), "{expected:?}");
        let bounds = vec![NOWHERE; 4];
        let mut near = Near { meshes: scene.meshes(), bounds, tests: 3 };
        let everywhere = near.specular_meshes(0);
        assert!(near.meets(&everywhere, &[DVec3::ZERO, DVec3::ONE]));
    }

    #[test]
    fn a_mirror_in_the_plane_of_its_wall_is_refused_and_one_with_its_back_to_it_is_not() {
        let sheet = |z: f64| {
            let corners = vec![[-0.2, -0.2, z], [0.2, -0.2, z], [0.2, 0.2, z], [-0.2, 0.2, z]];
            mesh("glass of Venice", "mirror", &[(corners, vec![[0, 1, 2], [0, 2, 3]])])
        };
        check_refused("meshes[1].source", &["mesh \"floor\" (meshes[0])", "along [0, 0, 1]"], &[floor(), sheet(0.0)]);
        build(&[floor(), sheet(0.000_001)]).unwrap();
        build(&[floor(), mesh("block", "mirror", &[block([0.0, 0.0, 0.0], [0.1, 0.1, 0.1])])]).unwrap();
    }
}
