//! What the types of a scene file cannot say: ranges, references between members, and geometry that makes sense.
//!
//! What needs the contents of assets is checked when the scene is built.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, UVec3};

use super::description::{
    CameraDescription, MeshDescription, MeshSource, PaneDescription, SheetDescription, WaveDescription,
};
use super::import::{ImportDescription, check_imports};
use super::mesh::is_degenerate;
use super::parts::SceneParts;
use super::profile_limits::{SizedFace, check_profile, check_sheet};
use super::waves::MAX_CELLS;
use super::window::check_windows;
use crate::bsdf::{MaterialDescription, check_priority};
use crate::settings::Check;
use crate::settings::JsonPath;
use crate::settings::SceneError;
use crate::settings::Triple;
use crate::settings::check::{
    MIN_SINE, Names, Numbers, Quoted, check_above, check_count, check_direction, check_name, check_pair, check_range,
    check_triple,
};
use crate::settings::limits::{
    MAX_COORDINATE, MAX_IMAGE_EDGE, MAX_LIGHTS, MAX_PANES, MAX_TRIANGLES, MAX_WINDOWS, PANE_EDGES,
};

impl SceneParts<'_> {
    /// Checks film and camera.
    ///
    /// # Errors
    ///
    /// The first thing that is wrong, with its place, what stands there and what would be right.
    pub(crate) fn check_view(&self) -> Check {
        let root = JsonPath::Root;
        let film = root.member("film");
        check_range(self.film.width, 1, MAX_IMAGE_EDGE, &film.member("width"))?;
        check_range(self.film.height, 1, MAX_IMAGE_EDGE, &film.member("height"))?;
        check_camera(self.camera, &root.member("camera"))
    }

    /// Checks all other things, as far as they can be checked without the assets.
    ///
    /// # Errors
    ///
    /// As [`Self::check_view`].
    pub(crate) fn check_things(&self) -> Check {
        let root = JsonPath::Root;
        self.check_materials(&root.member("materials"))?;
        self.check_meshes(&root.member("meshes"))?;
        let is_material = |name: &str| self.materials.contains_key(name);
        check_imports(self.imports, &is_material, &root.member("imports"))?;
        check_count(self.windows.len(), MAX_WINDOWS, &root.member("windows"))?;
        check_windows(self.windows, &root.member("windows"))?;
        for (name, sheet) in self.sheets {
            let sheets = root.member("sheets");
            let path = sheets.member(name);
            check_name(name, &path)?;
            check_sheet(sheet, &path)?;
        }
        check_count(self.panes.len(), MAX_PANES, &root.member("panes"))?;
        let mut names = Names::default();
        for (index, pane) in self.panes.iter().enumerate() {
            let panes = root.member("panes");
            check_pane(pane, self.sheets, &panes.element(index))?;
            names.add(&pane.name, &panes.element(index))?;
        }
        check_count(self.lights.len(), MAX_LIGHTS, &root.member("lights"))?;
        let mut names = Names::default();
        let mut environment = None;
        let mut shining = ShiningMeshes::of(self);
        for (index, light) in self.lights.iter().enumerate() {
            let lights = root.member("lights");
            let light_path = lights.element(index);
            let settings = light_path.member(light.kind());
            if light.is_environment()
                && let Some(first) = environment.replace(index)
            {
                let expected = format!("one environment in a scene, and lights[{first}] is one");
                return Err(SceneError::value(&settings, "a second environment", expected));
            }
            check_name(light.name(), &settings.member("name"))?;
            light.check(&settings)?;
            if let Some(mesh) = light.mesh() {
                shining.check(mesh, &settings.member("mesh"))?;
            }
            names.add(light.name(), &settings)?;
        }
        Ok(())
    }

    fn check_materials(&self, path: &JsonPath<'_>) -> Check {
        for (name, material) in self.materials {
            let material_path = path.member(name);
            check_name(name, &material_path)?;
            material.check(&material_path.member(material.kind()))?;
        }
        Ok(())
    }

    fn check_meshes(&self, path: &JsonPath<'_>) -> Check {
        let mut names = Names::default();
        for (index, mesh) in self.meshes.iter().enumerate() {
            self.check_mesh(mesh, &path.element(index))?;
            names.add(&mesh.name, &path.element(index))?;
        }
        Ok(())
    }

    fn check_mesh(&self, mesh: &MeshDescription, path: &JsonPath<'_>) -> Check {
        check_name(&mesh.name, &path.member("name"))?;
        let Some(material) = self.materials.get(&mesh.material) else {
            let known: Vec<&str> = self.materials.keys().map(String::as_str).collect();
            let expected = format!("the name of one of the materials ({})", known.join(", "));
            return Err(SceneError::value(&path.member("material"), Quoted(&mesh.material), expected));
        };
        let matrix = path.member("matrix");
        for (index, row) in mesh.matrix.iter().flatten().enumerate() {
            let row_path = matrix.element(index);
            for (column, number) in row.iter().enumerate() {
                check_range(*number, -MAX_COORDINATE, MAX_COORDINATE, &row_path.element(column))?;
            }
        }
        check_range(mesh.scale, 1e-6, 1e6, &path.member("scale"))?;
        check_triple(mesh.rotate, -36_000.0, 36_000.0, &path.member("rotate"))?;
        check_triple(mesh.translate, -MAX_COORDINATE, MAX_COORDINATE, &path.member("translate"))?;
        let source = path.member("source");
        match &mesh.source {
            MeshSource::Inline { positions, triangles, texture_coordinates, normals } => {
                let inline = source.member("inline");
                check_inline_triangles(positions, triangles, &inline)?;
                check_normals(normals, positions.len(), &inline)?;
                check_texture_coordinates(texture_coordinates, positions.len(), material, &inline)
            }
            MeshSource::Waves(waves) => check_waves(waves, &source.member("waves")),
            from_file => from_file.file().map_or(Ok(()), |file| file.check(&source)),
        }
    }
}

/// The meshes that may be lights.
struct ShiningMeshes<'a> {
    meshes: BTreeSet<&'a str>,
    imports: &'a [ImportDescription],
    /// Those that are.
    taken: BTreeSet<&'a str>,
}

impl<'a> ShiningMeshes<'a> {
    fn of(scene: &SceneParts<'a>) -> Self {
        let is_needed = scene.lights.iter().any(|light| light.mesh().is_some());
        let meshes = scene.meshes.iter().filter(|_| is_needed).map(|mesh| mesh.name.as_str()).collect();
        Self { meshes, imports: scene.imports, taken: BTreeSet::new() }
    }

    /// Checks the name of a mesh that is a light. What the files of imports hold is not known yet.
    fn check(&mut self, mesh: &'a str, path: &JsonPath<'_>) -> Check {
        let of_import =
            |import: &ImportDescription| mesh.strip_prefix(&import.name).is_some_and(|rest| rest.starts_with('/'));
        if !self.meshes.contains(mesh) && !self.imports.iter().any(of_import) {
            return Err(SceneError::value(path, Quoted(mesh), "the name of a mesh of the scene"));
        }
        if !self.taken.insert(mesh) {
            return Err(SceneError::value(path, Quoted(mesh), "a mesh that no other light is"));
        }
        Ok(())
    }
}

fn check_camera(camera: &CameraDescription, path: &JsonPath<'_>) -> Check {
    match camera {
        CameraDescription::Perspective { position, look_at, up, vertical_field_of_view } => {
            let path = path.member("perspective");
            check_view(*position, *look_at, *up, &path)?;
            check_above(*vertical_field_of_view, 0.0, 179.0, &path.member("vertical_field_of_view"))
        }
        CameraDescription::Orthographic { position, look_at, up, height } => {
            let path = path.member("orthographic");
            check_view(*position, *look_at, *up, &path)?;
            check_above(*height, 0.0, MAX_COORDINATE, &path.member("height"))
        }
    }
}

fn check_view(position: Triple, look_at: Triple, up: Triple, path: &JsonPath<'_>) -> Check {
    check_triple(position, -MAX_COORDINATE, MAX_COORDINATE, &path.member("position"))?;
    check_triple(look_at, -MAX_COORDINATE, MAX_COORDINATE, &path.member("look_at"))?;
    let view = DVec3::from(look_at) - DVec3::from(position);
    let Some(view) = view.try_normalize() else {
        let expected = format!("another point than position ({})", Numbers(&position));
        return Err(SceneError::value(&path.member("look_at"), Numbers(&look_at), expected));
    };
    let up_direction = check_direction(up, &path.member("up"))?;
    if up_direction.cross(view).length() < MIN_SINE {
        let expected = "a direction that is not parallel to the line from position to look_at";
        return Err(SceneError::value(&path.member("up"), Numbers(&up), expected));
    }
    Ok(())
}

fn check_waves(waves: &WaveDescription, path: &JsonPath<'_>) -> Check {
    let WaveDescription { size, cells, wavelengths: [shortest, longest], height, time, .. } = waves;
    let each = |name: &'static str| path.member(name);
    for axis in 0..2 {
        check_range(size[axis], 1e-3, 1e5, &each("size").element(axis))?;
        check_range(cells[axis], 1, MAX_CELLS, &each("cells").element(axis))?;
    }
    let wavelengths = path.member("wavelengths");
    check_above(*shortest, 0.0, MAX_COORDINATE, &wavelengths.element(0))?;
    check_range(*longest, *shortest, MAX_COORDINATE, &wavelengths.element(1))?;
    check_range(*height, 0.0, 1e3, &path.member("height"))?;
    check_range(*time, -1e9, 1e9, &path.member("time"))
}

fn check_inline_triangles(positions: &[Triple], triangles: &[[u32; 3]], path: &JsonPath<'_>) -> Check {
    let positions_path = path.member("positions");
    for (index, position) in positions.iter().enumerate() {
        check_triple(*position, -MAX_COORDINATE, MAX_COORDINATE, &positions_path.element(index))?;
    }
    let triangles_path = path.member("triangles");
    if triangles.is_empty() {
        return Err(SceneError::value(&triangles_path, "no triangle", "at least one"));
    }
    check_count(triangles.len(), MAX_TRIANGLES, &triangles_path)?;
    for (index, triangle) in triangles.iter().enumerate() {
        let triangle_path = triangles_path.element(index);
        let found = || UVec3::from(*triangle);
        let corners = triangle.map(|vertex| positions.get(vertex as usize).copied().map(DVec3::from));
        let [Some(a), Some(b), Some(c)] = corners else {
            let expected = format!("indices below {}, the number of positions", positions.len());
            return Err(SceneError::value(&triangle_path, found(), expected));
        };
        if is_degenerate([a, b, c]) {
            return Err(SceneError::value(&triangle_path, found(), "three corners that are not on one line"));
        }
    }
    Ok(())
}

fn check_normals(normals: &[Triple], vertices: usize, path: &JsonPath<'_>) -> Check {
    let path = path.member("normals");
    for (index, normal) in normals.iter().enumerate() {
        check_direction(*normal, &path.element(index))?;
    }
    if normals.is_empty() || normals.len() == vertices {
        return Ok(());
    }
    let found = format!("{} normals", normals.len());
    Err(SceneError::value(&path, found, format!("{vertices} normals, one for each position, or none")))
}

fn check_texture_coordinates(
    coordinates: &[[f64; 2]],
    vertices: usize,
    material: &MaterialDescription,
    path: &JsonPath<'_>,
) -> Check {
    let path = path.member("texture_coordinates");
    for (index, pair) in coordinates.iter().enumerate() {
        check_pair(*pair, -MAX_COORDINATE, MAX_COORDINATE, &path.element(index))?;
    }
    if coordinates.is_empty() && material.textures().is_empty() {
        return Ok(());
    }
    if coordinates.len() != vertices {
        let found = format!("{} pairs", coordinates.len());
        return Err(SceneError::value(&path, found, format!("{vertices} pairs, one for each position")));
    }
    Ok(())
}

fn check_pane(pane: &PaneDescription, sheets: &BTreeMap<String, SheetDescription>, path: &JsonPath<'_>) -> Check {
    check_name(&pane.name, &path.member("name"))?;
    check_triple(pane.centre, -MAX_COORDINATE, MAX_COORDINATE, &path.member("centre"))?;
    let x = check_direction(pane.x_axis, &path.member("x_axis"))?;
    let y = check_direction(pane.y_axis, &path.member("y_axis"))?;
    if x.cross(y).length() < MIN_SINE {
        let expected = format!("a direction that is not parallel to x_axis ({})", Numbers(&pane.x_axis));
        return Err(SceneError::value(&path.member("y_axis"), Numbers(&pane.y_axis), expected));
    }
    let [least, most] = PANE_EDGES;
    check_range(pane.width, least, most, &path.member("width"))?;
    check_range(pane.height, least, most, &path.member("height"))?;
    check_above(pane.thickness, 0.0, 1.0, &path.member("thickness"))?;
    check_range(pane.index_of_refraction, 1.0, 3.0, &path.member("index_of_refraction"))?;
    check_triple(pane.absorption, 0.0, 1e9, &path.member("absorption"))?;
    let layers = path.member("layers");
    check_triple(pane.layers.front, 0.0, 100.0, &layers.member("front"))?;
    check_triple(pane.layers.back, 0.0, 100.0, &layers.member("back"))?;
    check_priority(pane.priority, path)?;
    pane.paint.as_ref().map_or(Ok(()), |paint| paint.check(&path.member("paint")))?;
    pane.check_cut(sheets, path)?;
    let face = SizedFace { width: pane.width, height: pane.height, relief: pane.thickness };
    check_profile(&pane.front, &face, &path.member("front"))?;
    check_profile(&pane.back, &face, &path.member("back"))
}
