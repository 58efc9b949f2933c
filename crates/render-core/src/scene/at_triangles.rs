//! What the scene is at its triangles.

use glam::DVec3;

use super::build::Scene;
use super::mesh_surface::{MeshSurface, mesh_of};
use crate::bsdf::{Bsdf, DeltaBsdf, Normals, StraightBsdf, SurfacePoint};
use crate::geometry::{Hit, Surface, SurfaceDifferential, mapped_normal};
use crate::light::LightHit;

impl Scene {
    /// The mesh to which a triangle belongs.
    pub fn mesh_of(&self, triangle: u32) -> u32 {
        mesh_of(self.meshes(), triangle)
    }

    fn surface_of(&self, triangle: u32) -> &MeshSurface {
        &self.meshes()[self.mesh_of(triangle) as usize]
    }

    /// What a triangle does to light.
    pub fn bsdf(&self, triangle: u32) -> &dyn Bsdf {
        &*self.surface_of(triangle).surface.bsdf
    }

    /// What a triangle does to light that scatters into single directions.
    pub fn delta_bsdf(&self, triangle: u32) -> Option<&dyn DeltaBsdf> {
        self.bsdf(triangle).as_delta()
    }

    /// What a triangle does to light that goes straight through it.
    pub fn straight_bsdf(&self, triangle: u32) -> Option<&dyn StraightBsdf> {
        self.bsdf(triangle).as_straight()
    }

    /// The light that a ray meets at a surface of the scene that shines.
    pub fn light_on(&self, hit: &Hit) -> Option<(u32, LightHit)> {
        let Surface::Triangle { index, barycentric } = hit.surface else { return None };
        let light = self.shining_mesh(|| self.mesh_of(index))?;
        let radiance = self.lights()[light as usize].radiance_at(index, barycentric);
        Some((light, LightHit { distance: hit.distance, radiance, triangle: Some(index) }))
    }

    /// A point of a triangle. The weights of its second and third corner are `barycentric`.
    pub fn surface_point(&self, triangle: u32, barycentric: [f64; 2]) -> SurfacePoint {
        let mesh = self.surface_of(triangle);
        let mut normals = self.normals_on(mesh, triangle, barycentric);
        let texture = mesh.texture_coordinates(triangle, barycentric);
        if let (Some(map), Some(tangents)) = (mesh.surface.bsdf.normal_map(), mesh.tangents(triangle)) {
            normals.shading = mapped_normal(normals.shading, tangents, barycentric, map.at(texture));
        }
        SurfacePoint { normals, texture, colour: mesh.colour(triangle, barycentric).truncate() }
    }

    /// The normals at a point of a triangle. The weights of its second and third corner are `barycentric`.
    pub fn normals(&self, triangle: u32, barycentric: [f64; 2]) -> Normals {
        self.normals_on(self.surface_of(triangle), triangle, barycentric)
    }

    fn normals_on(&self, mesh: &MeshSurface, triangle: u32, barycentric: [f64; 2]) -> Normals {
        let geometric = self.triangle_normal(triangle);
        let shading = mesh.corner_normals(triangle).map_or(geometric, |[a, b, c]| {
            let [v, w] = barycentric;
            (*a * (1.0 - v - w) + *b * v + *c * w).normalize_or(geometric)
        });
        Normals { geometric, shading }
    }

    /// The surface around a point of a triangle.
    pub fn differential(&self, triangle: u32, position: DVec3, barycentric: [f64; 2]) -> SurfaceDifferential {
        let flat = [self.triangle_normal(triangle); 3];
        let normals = self.surface_of(triangle).corner_normals(triangle).unwrap_or(&flat);
        SurfaceDifferential::of_triangle(self.accelerator().corners(triangle), normals, position, barycentric)
    }

    /// A point on a specular mesh, uniform over its area.
    pub fn sample_mesh(&self, mesh: u32, random: [f64; 3]) -> Option<DVec3> {
        let surface = &self.meshes()[mesh as usize];
        let areas = surface.surface.areas.as_ref()?;
        let target = areas.last()? * random[0];
        let index = areas.partition_point(|area| *area <= target).min(areas.len() - 1);
        let [a, b, c] = self.accelerator().corners(surface.first_triangle + index as u32);
        let root = random[1].sqrt();
        Some(*a * (1.0 - root) + *b * (root * (1.0 - random[2])) + *c * (root * random[2]))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde_json::json;

    use super::*;
    use crate::document::malformed_scenes::valid_scene;
    use crate::document::{SceneBundle, SceneDescription};
    use crate::scene::Asset;
    use crate::texture::picture_samples::encode_exr;

    /// A square in the plane of x and y over which u grows along y and v against x, with a normal map of one texel.
    fn mapped(texel: [f32; 3], strength: f64) -> SurfacePoint {
        let mut scene = valid_scene();
        scene["panes"] = json!([]);
        let map = json!({"texture": {"file": "n.exr"}, "strength": strength});
        scene["materials"]["brick"] = json!({"metallic_roughness": {"normal_map": map}});
        scene["meshes"] = json!([{
            "name": "wall", "material": "brick",
            "source": {"inline": {
                "positions": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "triangles": [[0, 1, 2], [0, 2, 3]],
                "texture_coordinates": [[0, 1], [0, 0], [2, 0], [2, 1]]
            }},
            "translate": [0, 0, -5]
        }]);
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        let [red, green, blue] = texel.each_ref().map(std::slice::from_ref);
        let picture = encode_exr(1, 1, &[("R", red), ("G", green), ("B", blue)]);
        let assets = BTreeMap::from([("n.exr".to_owned(), Asset::new(picture))]);
        let scene = SceneBundle::from_parts(description, assets).unwrap().build_scene().unwrap();
        scene.surface_point(1, [0.25, 0.5])
    }

    #[test]
    fn a_normal_map_bends_the_normal_along_the_texture_coordinates() {
        for (texel, strength, expected) in [
            ([0.5, 0.5, 1.0], 1.0, [0.0, 0.0, 1.0]),
            ([0.9, 0.5, 0.8], 1.0, [0.0, 0.8, 0.6]),
            ([0.5, 0.9, 0.8], 1.0, [-0.8, 0.0, 0.6]),
            ([0.7, 0.5, 0.8], 2.0, [0.0, 0.8, 0.6]),
            ([0.7, 0.5, 0.8], -2.0, [0.0, -0.8, 0.6]),
        ] {
            let normals = mapped(texel, strength).normals;
            assert!((normals.geometric - DVec3::Z).length() < 1e-12);
            let expected = DVec3::from(expected).normalize();
            assert!((normals.shading - expected).length() < 1e-6, "{texel:?}: {} not {expected}", normals.shading);
        }
    }
}
