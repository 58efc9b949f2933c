//! A pane as a specular mesh: both faces as triangles with interpolated normals.

use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::geometry::{Face, Pane};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::Asset;
use glam::{DVec2, DVec3};
use serde_json::json;

/// The scene with its one pane as a mesh of `cells` by `cells` squares of two triangles on each face.
///
/// # Panics
///
/// When the scene cannot be built that way.
pub fn as_mesh(original: &PreparedScene, cells: u32) -> PreparedScene {
    let pane = &original.scene().panes()[0];
    let mut description = serde_json::to_value(original.description()).expect("a description is JSON");
    description["panes"] = json!([]);
    description["materials"]["glass"] = json!({"dielectric": {"index_of_refraction": pane.index_of_refraction}});
    let mesh = json!({"name": "pane", "material": "glass", "source": {"ply": {"file": "pane.ply"}}});
    description["meshes"].as_array_mut().expect("a scene has meshes").push(mesh);
    let description = SceneDescription::parse(description.to_string().as_bytes()).expect("a valid scene");
    let assets = [("pane.ply".to_owned(), Asset::new(tessellated(pane, cells)))];
    let bundle = SceneBundle::from_parts(description, assets.into()).expect("no assets are missing");
    PreparedScene::build(&bundle).expect("a scene that can be built")
}

/// A PLY file of a pane as a mesh of both faces with the normals of their height fields.
fn tessellated(pane: &Pane, cells: u32) -> Vec<u8> {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for face in [Face::Front, Face::Back] {
        let first = (vertices.len() / 48) as u32;
        let sign = if face == Face::Back { 1.0 } else { -1.0 };
        for row in 0..=cells {
            for column in 0..=cells {
                let place = (DVec2::new(f64::from(column), f64::from(row)) / f64::from(cells) - 0.5) * pane.size();
                let jet = pane.surface(face).jet(place);
                let local = place.extend(pane.base_height(face) + jet.height);
                let normal = DVec3::new(-jet.gradient.x, -jet.gradient.y, 1.0) * sign;
                for vector in [pane.frame.point_to_world(local), pane.frame.vector_to_world(normal)] {
                    vertices.extend(vector.to_array().into_iter().flat_map(f64::to_le_bytes));
                }
            }
        }
        let vertex = |row: u32, column: u32| first + row * (cells + 1) + column;
        for row in 0..cells {
            for column in 0..cells {
                let [a, b] = [vertex(row, column), vertex(row, column + 1)];
                let [c, d] = [vertex(row + 1, column + 1), vertex(row + 1, column)];
                let pair = if face == Face::Back { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] };
                for triangle in pair {
                    triangles.push(3u8);
                    triangles.extend(triangle.into_iter().flat_map(u32::to_le_bytes));
                }
            }
        }
    }
    let properties: String = ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property double {name}\n")).concat();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}element face {}\n\
         property list uchar uint vertex_indices\nend_header\n",
        vertices.len() / 48,
        triangles.len() / 13
    );
    [header.into_bytes(), vertices, triangles].concat()
}
