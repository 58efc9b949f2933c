//! From the things of a scene file and their assets to a scene that can be rendered.

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use super::asset_uses::environment_uses;
use super::assets::{Assets, asset_bytes};
use super::build_meshes::{Meshes, decode_textures};
use super::build_panes::build_panes;
use super::build_step::BuildStep;
use super::camera::Camera;
use super::media::Media;
use super::memory::SceneMemory;
use super::mesh_surface::MeshSurface;
use super::openings::Openings;
use super::pane_tree::PaneTree;
use super::parts::SceneParts;
use super::shining::{lights_of_meshes, shining_surfaces};
use super::surface_coverage::SurfaceCoverage;
use super::validate_faces::check_faces;
use super::validate_places::Obstacles;
use crate::geometry::closed::{is_closed, is_convex};
use crate::geometry::{Accelerator, Coverage, Pane};
use crate::light::{EnvironmentMap, EnvironmentMaps, Light, LightAssets, LightSampler};
use crate::settings::SceneError;
use crate::texture::RadiancePicture;

/// A scene that can be rendered. It does not change any more.
#[derive(Debug)]
pub struct Scene {
    camera: Camera,
    accelerator: Accelerator,
    specular_ball: (DVec3, f64),
    mesh_bounds: Vec<[DVec3; 2]>,
    pane_tree: PaneTree,
    media: Media,
    light_assets: LightAssets,
    lights: Vec<Light>,
    /// For each mesh, the light that it is; empty where no mesh is one.
    lights_of_meshes: Vec<Option<u32>>,
    light_sampler: LightSampler,
    meshes: Arc<[MeshSurface]>,
    /// Their triangles that light goes straight through, if there are any.
    openings: Option<Openings>,
    /// Whether each mesh has an inside, found when it is asked for first.
    closed: Vec<OnceLock<bool>>,
    normals: Vec<DVec3>,
}

impl Scene {
    /// Builds a scene of the things in a valid file: decodes its assets, computes its profiles and sorts its triangles
    /// and panes into a hierarchy. Tells of each step before it begins.
    ///
    /// # Errors
    ///
    /// When an asset makes no sense, the faces of a pane touch, or something stands in glass that may not.
    pub fn build(
        parts: SceneParts<'_>,
        assets: &Assets,
        begin: &mut dyn FnMut(BuildStep<'_>),
    ) -> Result<Self, SceneError> {
        let Decoded { light_assets, panes, positions, triangles, meshes, coverage } =
            Decoded::of(parts, assets, begin)?;
        let mesh_bounds: Vec<[DVec3; 2]> =
            meshes.iter().map(|mesh| mesh_bounds(&positions, &triangles, mesh)).collect();
        let specular: Vec<_> =
            meshes.iter().filter(|mesh| mesh.is_specular()).map(MeshSurface::triangle_range).collect();
        begin(BuildStep::Hierarchy { triangles: triangles.len() });
        let accelerator = Accelerator::build(&positions, &triangles, &specular, panes)
            .map_err(|error| SceneError::Structure { path: "meshes".to_owned(), message: error.to_string() })?;
        let accelerator = match coverage {
            Some(coverage) => accelerator.with_coverage(coverage),
            None => accelerator,
        };
        let corners = |triangle: u32| *accelerator.corners(triangle);
        let lights = build_lights(parts, &light_assets);
        let lights_of_meshes = lights_of_meshes(&lights, &meshes);
        let is_light = |mesh: u32| lights_of_meshes.get(mesh as usize).is_some_and(Option::is_some);
        let media = Media::new(parts, &accelerator, &meshes, &mesh_bounds, &lights, &is_light)?;
        check_faces(corners, &meshes)?;
        Obstacles.check(parts)?;
        let straight = meshes.iter().filter(|mesh| mesh.is_straight()).flat_map(MeshSurface::triangle_range).collect();
        Ok(Self {
            camera: Camera::new(parts.camera, parts.film),
            light_sampler: LightSampler::new(&lights),
            lights_of_meshes,
            lights,
            media,
            light_assets,
            normals: triangles.iter().map(|&triangle| normal(&positions, triangle)).collect(),
            specular_ball: specular_ball(&accelerator, &meshes, &mesh_bounds),
            pane_tree: PaneTree::new(accelerator.panes()),
            mesh_bounds,
            closed: meshes.iter().map(|_| OnceLock::new()).collect(),
            openings: Openings::new(&accelerator, straight),
            meshes,
            accelerator,
        })
    }

    /// The scene seen with the camera and the film of `parts`. [`Obstacles::check`] tells whether the camera may stand
    /// there.
    #[must_use]
    pub fn with_view(self, parts: SceneParts<'_>) -> Self {
        Self { camera: Camera::new(parts.camera, parts.film), ..self }
    }

    /// The scene under the lights of `parts`, which name the same pictures and meshes. [`Obstacles::check`] tells
    /// whether they may stand there.
    #[must_use]
    pub fn with_lights(self, parts: SceneParts<'_>) -> Self {
        let lights = build_lights(parts, &self.light_assets);
        let lights_of_meshes = lights_of_meshes(&lights, &self.meshes);
        let mut media = self.media;
        media.set_lights(self.accelerator.panes(), &lights);
        Self { light_sampler: LightSampler::new(&lights), lights_of_meshes, lights, media, ..self }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Centre and radius, metres, of a ball around all panes and specular meshes; radius 0 without any.
    pub fn specular_ball(&self) -> (DVec3, f64) {
        self.specular_ball
    }

    /// The smallest and the largest corner of a box around a mesh, metres.
    pub fn mesh_bounds(&self, mesh: u32) -> [DVec3; 2] {
        self.mesh_bounds[mesh as usize]
    }

    /// The hierarchy over triangles and panes.
    pub fn accelerator(&self) -> &Accelerator {
        &self.accelerator
    }

    /// The panes, in the order of the scene file.
    pub fn panes(&self) -> &[Pane] {
        self.accelerator.panes()
    }

    /// What the camera and the lights must keep out of.
    pub fn obstacles(&self) -> Obstacles {
        Obstacles
    }

    /// Which body a place belongs to.
    pub fn media(&self) -> &Media {
        &self.media
    }

    /// The tree over the panes.
    pub(crate) fn pane_tree(&self) -> &PaneTree {
        &self.pane_tree
    }

    /// The lights, in the order of the scene file.
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// The light that a mesh is. Which mesh is asked for only where any is a light.
    pub(super) fn shining_mesh(&self, mesh: impl FnOnce() -> u32) -> Option<u32> {
        if self.lights_of_meshes.is_empty() { None } else { self.lights_of_meshes[mesh() as usize] }
    }

    /// The choice among the lights.
    pub fn light_sampler(&self) -> &LightSampler {
        &self.light_sampler
    }

    /// Whether a mesh has an inside: each of its edges has a triangle on both sides.
    pub(crate) fn is_closed(&self, mesh: u32) -> bool {
        let triangles = self.meshes[mesh as usize].triangle_range();
        let look = || is_closed(triangles.map(|triangle| *self.accelerator.corners(triangle)));
        *self.closed[mesh as usize].get_or_init(look)
    }

    /// Whether a closed mesh is known to be convex, so that no light goes through it twice.
    pub(crate) fn is_convex(&self, mesh: u32) -> bool {
        let triangles = self.meshes[mesh as usize].triangle_range();
        is_convex(&triangles.map(|triangle| *self.accelerator.corners(triangle)).collect::<Vec<_>>())
    }

    /// The meshes, in the order of the scene file and of their triangles.
    pub fn meshes(&self) -> &[MeshSurface] {
        &self.meshes
    }

    /// Whether light goes straight through any mesh, such as a thin wall, and shadow rays with it.
    pub fn has_straight_meshes(&self) -> bool {
        self.openings.is_some()
    }

    /// The triangles that light goes straight through, in ascending order.
    pub fn straight_triangles(&self) -> &[u32] {
        self.openings.as_ref().map_or(&[], Openings::triangles)
    }

    /// The same as openings, if there are any.
    pub(super) fn openings(&self) -> Option<&Openings> {
        self.openings.as_ref()
    }

    /// The unit normal of a triangle, on the side from which its corners are seen counterclockwise.
    pub fn triangle_normal(&self, triangle: u32) -> DVec3 {
        self.normals[triangle as usize]
    }

    /// The smallest and the largest corner of a box around all triangles and panes, metres; `None` when there are none.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        self.accelerator.bounds()
    }
}

fn build_lights(parts: SceneParts<'_>, assets: &LightAssets) -> Vec<Light> {
    parts.lights.iter().map(|light| Light::new(light, assets)).collect()
}

/// Decodes the pictures of all lights, each file once.
fn decode_environments(parts: SceneParts<'_>, assets: &Assets) -> Result<EnvironmentMaps, SceneError> {
    let mut maps = EnvironmentMaps::new();
    for (path, file) in environment_uses(parts) {
        if !maps.contains_key(file) {
            let map = asset_bytes(assets, file).and_then(EnvironmentMap::decode);
            let map = map.map_err(|problem| SceneError::Asset { path, name: file.to_owned(), problem })?;
            maps.insert(file.to_owned(), Arc::new(map));
        }
    }
    Ok(maps)
}

/// Decodes a picture that a light names.
///
/// # Errors
///
/// When it is missing or makes no sense.
pub fn decode_radiance(assets: &Assets, file: &str) -> Result<RadiancePicture, SceneError> {
    let picture = asset_bytes(assets, file).and_then(RadiancePicture::decode);
    picture.map_err(|problem| SceneError::Asset { path: "lights".to_owned(), name: file.to_owned(), problem })
}

/// What a scene is made of, decoded and checked.
struct Decoded {
    light_assets: LightAssets,
    panes: Vec<Pane>,
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    meshes: Arc<[MeshSurface]>,
    coverage: Option<Arc<dyn Coverage>>,
}

impl Decoded {
    fn of(parts: SceneParts<'_>, assets: &Assets, begin: &mut dyn FnMut(BuildStep<'_>)) -> Result<Self, SceneError> {
        SceneMemory::of(parts, assets).check_counts()?;
        begin(BuildStep::Textures);
        let textures = decode_textures(parts, assets)?;
        let environments = decode_environments(parts, assets)?;
        let panes = build_panes(parts, assets, begin)?;
        let mut meshes = Meshes::new(parts, assets, &textures);
        for (index, mesh) in parts.meshes.iter().enumerate() {
            let (number, count) = (index + 1, parts.meshes.len());
            begin(BuildStep::Mesh { name: &mesh.name, number, count });
            meshes.add(index, mesh)?;
        }
        let Meshes { positions, triangles, surfaces, .. } = meshes;
        let corners = |triangle: u32| triangles[triangle as usize].map(|vertex| positions[vertex as usize]);
        let meshes: Arc<[MeshSurface]> = surfaces.into();
        let coverage = SurfaceCoverage::of(&meshes).map(|coverage| Arc::new(coverage) as Arc<dyn Coverage>);
        let surfaces = shining_surfaces(parts, &textures, &meshes, &corners, coverage.as_ref())?;
        let light_assets = LightAssets { environments, surfaces };
        Ok(Self { light_assets, panes, positions, triangles, meshes, coverage })
    }
}

/// A box around a mesh.
fn mesh_bounds(positions: &[DVec3], triangles: &[[u32; 3]], mesh: &MeshSurface) -> [DVec3; 2] {
    let range = mesh.triangle_range();
    let corners = triangles[range.start as usize..range.end as usize].iter().flatten();
    let empty = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    corners.map(|vertex| positions[*vertex as usize]).fold(empty, |[min, max], at| [min.min(at), max.max(at)])
}

/// A ball around all panes and specular meshes.
fn specular_ball(accelerator: &Accelerator, meshes: &[MeshSurface], mesh_bounds: &[[DVec3; 2]]) -> (DVec3, f64) {
    let specular = meshes.iter().zip(mesh_bounds).filter(|(mesh, _)| mesh.is_specular()).map(|(_, bounds)| *bounds);
    let bounds = accelerator.panes().iter().map(Pane::world_bounds).chain(specular);
    let Some([min, max]) = bounds.reduce(|[min, max], [other_min, other_max]| [min.min(other_min), max.max(other_max)])
    else {
        return (DVec3::ZERO, 0.0);
    };
    ((min + max) * 0.5, (max - min).length() * 0.5)
}

/// The unit normal of a triangle that has an area.
fn normal(positions: &[DVec3], triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
    (b - a).cross(c - a).normalize()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::{DVec2, DVec3};
    use serde_json::{Value, json};

    use super::super::Asset;
    use super::*;
    use crate::document::malformed_scenes::valid_scene;
    use crate::document::{SceneBundle, SceneDescription};
    use crate::geometry::{Surface, SurfaceId};
    use crate::integrator::PreparedScene;
    use crate::texture::picture_samples::{encode_exr, encode_png};
    use clerestory_film::counters::Counters;

    fn build(scene: &Value, assets: &[(&str, Vec<u8>)]) -> Result<Scene, SceneError> {
        let description = SceneDescription::parse(scene.to_string().as_bytes())?;
        let assets: BTreeMap<String, Asset> =
            assets.iter().map(|(name, bytes)| ((*name).to_owned(), Asset::new(bytes.clone()))).collect();
        SceneBundle::from_parts(description, assets)?.build_scene()
    }

    #[test]
    fn each_step_is_told_before_it_begins() {
        let description = SceneDescription::parse(valid_scene().to_string().as_bytes()).unwrap();
        let bundle = SceneBundle::from_parts(description, BTreeMap::new()).unwrap();
        let mut steps = Vec::new();
        PreparedScene::build_step_by_step(&bundle, &mut |step| steps.push(step.to_string())).unwrap();
        let meshes = bundle.description().meshes.len();
        assert_eq!(steps.len(), 4 + meshes, "{steps:?}");
        assert!(steps[1].starts_with("Building the panes, ") && steps[2].contains(&format!("mesh 1 of {meshes}, \"")));
    }

    fn albedo(scene: &Scene, triangle: u32, barycentric: [f64; 2]) -> DVec3 {
        scene.bsdf(triangle).albedo(&scene.surface_point(triangle, barycentric))
    }

    #[track_caller]
    fn check_refused(scene: &Value, assets: &[(&str, Vec<u8>)], path: &str, fragment: &str) {
        let error = build(scene, assets).expect_err("this scene cannot be built");
        assert_eq!(error.path(), path, "{error}");
        assert!(error.to_string().contains(fragment), "no {fragment:?} in: {error}");
    }

    fn with_mesh(source: Value) -> Value {
        let mut scene = valid_scene();
        scene["meshes"][0]["source"] = source;
        scene
    }

    #[test]
    fn the_camera_sees_what_the_file_describes() {
        let mut scene = valid_scene();
        scene["meshes"][0]["rotate"] = json!([0, 90, 0]);
        scene["meshes"][0]["translate"] = json!([0, 0, 1]);
        scene["camera"]["perspective"]["position"] = json!([-2, 0, 1]);
        scene["camera"]["perspective"]["look_at"] = json!([0, 0, 1]);
        let scene = build(&scene, &[]).unwrap();
        let ray = scene.camera().ray(DVec2::new(15.0, 11.0));
        let accelerator = scene.accelerator();
        let hit = accelerator.closest_hit(&ray, f64::INFINITY, SurfaceId::Nothing, &mut Counters::default()).unwrap();
        let Surface::Triangle { index, barycentric } = hit.surface else { panic!("{hit:?} is no triangle") };
        assert!((ray.at(hit.distance).x).abs() < 1e-12);
        assert!((scene.triangle_normal(index) - DVec3::X).length() < 1e-12);
        assert_eq!(albedo(&scene, index, barycentric), DVec3::new(0.6, 0.5, 0.4));
    }

    #[test]
    fn a_texture_lies_on_its_mesh_as_its_coordinates_say() {
        let mut scene = valid_scene();
        let texture = json!({"diffuse": {"reflectance": {"texture": {"file": "t.exr"}}}});
        scene["materials"]["painted"] = texture;
        scene["meshes"].as_array_mut().unwrap().push(json!({
            "name": "wall", "material": "painted", "source": {"obj": {"file": "wall.obj"}}
        }));
        // The first face has no area; the picture's left column is black and its right column white.
        let wall =
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 2/2\nf 1/1 2/2 3/3 4/4\n";
        let picture = encode_exr(2, 1, &[("Y", &[0.0, 1.0])]);
        let scene = build(&scene, &[("t.exr", picture), ("wall.obj", wall.as_bytes().to_vec())]).unwrap();
        let wall = &scene.meshes()[1];
        assert_eq!((wall.name(), wall.triangles(), wall.omitted_triangles()), ("wall", 2, 1));
        // Triangle 2 of the scene has the corners (0, 0), (1, 0) and (1, 1).
        assert_eq!(albedo(&scene, 2, [0.0, 0.25]), DVec3::ZERO);
        assert_eq!(albedo(&scene, 2, [0.5, 0.25]), DVec3::ONE);
        assert_eq!(albedo(&scene, 2, [0.5, 0.0]), DVec3::splat(0.5));
    }

    #[test]
    fn a_pane_hangs_where_its_axes_say_and_has_its_profiles() {
        let mut scene = valid_scene();
        scene["panes"][0]["x_axis"] = json!([0, 2, 0]);
        scene["panes"][0]["y_axis"] = json!([0, 5, 3]);
        let built = build(&scene, &[]).unwrap();
        let pane = &built.panes()[0];
        assert_eq!(pane.frame.vector_to_world(DVec3::X), DVec3::Y);
        assert_eq!(pane.frame.vector_to_world(DVec3::Y), DVec3::Z);
        assert_eq!(pane.frame.vector_to_world(DVec3::Z), DVec3::X);
        // The bump of the back face is 0.1 mm high in the middle; its spline smooths it a little.
        let height = pane.back.height(DVec2::ZERO);
        assert!((0.97e-4..1e-4).contains(&height), "{height}");
    }

    #[test]
    fn height_maps_become_the_coefficients_of_the_face() {
        let mut scene = valid_scene();
        scene["panes"][0]["front"] = json!({"height_map": {"file": "h.exr", "scale": 1e-3, "offset": 1e-4}});
        let heights = [0.1, 0.1, 0.1, 0.1];
        let built = build(&scene, &[("h.exr", encode_exr(2, 2, &[("Y", &heights)]))]).unwrap();
        assert!((built.panes()[0].front.height(DVec2::new(0.1, -0.1)) - 2e-4).abs() < 1e-11);
    }

    #[test]
    fn what_only_the_assets_show_is_refused_with_its_place() {
        let ply = json!({"ply": {"file": "m.ply"}});
        let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
        let faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
        let triangle =
            |vertices: &str, face: &str| vec![("m.ply", format!("{header}{faces}{vertices}{face}").into_bytes())];
        let corners = "0 0 0\n1 0 0\n0 1 0\n";
        assert!(build(&with_mesh(ply.clone()), &triangle(corners, "3 0 1 2\n")).is_ok());

        let source = "meshes[0].source";
        check_refused(&with_mesh(ply.clone()), &triangle(corners, "3 0 1 1\n"), source, "none with an area");
        check_refused(&with_mesh(ply.clone()), &triangle("0 0 0\n1e9 0 0\n0 1 0\n", "3 0 1 2\n"), source, "1000000 m");
        let file = "meshes[0].source.ply.file";
        check_refused(&with_mesh(ply.clone()), &triangle(corners, "3 0 1 3\n"), file, "indices below 3");
        check_refused(&with_mesh(ply.clone()), &[("m.ply", b"solid".to_vec())], file, "not a readable PLY file");
        check_refused(&with_mesh(ply.clone()), &[], file, "\"m.ply\" is missing");
        let empty = format!("{header}{faces}").replace("vertex 3", "vertex 0").replace("face 1", "face 0");
        check_refused(&with_mesh(ply.clone()), &[("m.ply", empty.into_bytes())], source, "0 triangles");

        let mut painted = with_mesh(ply);
        painted["materials"]["stone"]["diffuse"]["reflectance"] = json!({"texture": {"file": "t.png"}});
        let assets = |picture: Vec<u8>| [triangle(corners, "3 0 1 2\n"), vec![("t.png", picture)]].concat();
        let picture = encode_png(image::DynamicImage::new_rgb8(2, 2));
        check_refused(&painted, &assets(picture.clone()), source, "material \"stone\" has a texture");
        let texture = "materials.stone.diffuse.reflectance.texture.file";
        check_refused(&painted, &assets(picture[..40].to_vec()), texture, "not a readable PNG file");
    }

    #[test]
    fn glass_of_no_thickness_is_refused_with_its_place() {
        let mut scene = valid_scene();
        scene["panes"][1]["thickness"] = json!(3e-5);
        scene["panes"][1]["front"] = json!({"bump": {"centre": [0, 0], "radius": [0.1, 0.1], "amplitude": 3e-5}});
        check_refused(&scene, &[], "panes[1].thickness", "x = ");

        scene["panes"][1]["back"] = json!({"height_map": {"file": "h.exr"}});
        let heights = encode_exr(2, 1, &[("Y", &[0.0, f32::INFINITY])]);
        check_refused(&scene, &[("h.exr", heights)], "panes[1].back.height_map.file", "column 1 of row 0");
    }

    #[test]
    fn scenes_that_would_take_too_much_memory_are_refused_before_it_is_taken() {
        let mut scene = valid_scene();
        let mut pane = scene["panes"][1].clone();
        pane["front"] = json!({"hammered": {"wavelength": 0.0094, "amplitude": 1e-6}});
        let panes = (0..60).map(|index| {
            pane["name"] = json!(format!("pane {index}"));
            pane.clone()
        });
        scene["panes"] = panes.collect();
        check_refused(&scene, &[], "panes", "spline coefficients in all panes, must be at most 33554432");
    }
}
