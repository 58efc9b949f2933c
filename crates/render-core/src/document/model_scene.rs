//! A whole scene around a file of another program, such as a building from Blender. What a scene has beyond the file is
//! assumed, and said.

use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::Path;

use super::bundle::load_assets;
use super::{SceneBundle, SceneDescription};
use crate::bsdf::{MaterialDescription, ThinWallMaterial};
use crate::light::{EnvironmentLight, EnvironmentRadiance, LightDescription, SunLight};
use crate::scene::description::{CameraDescription, FilmDescription};
use crate::scene::import::{
    Expansion, GlazeRule, ImportDescription, ImportFiles, ImportSource, LeadingRule, MaterialRule, UpAxis, Window,
    expand, files_of,
};
use crate::scene::{Assets, Scene, SceneError, View, view_of};
use crate::settings::{AssetProblem, JsonPath, SCENE_FORMAT_VERSION, Triple};

/// How a file of another program becomes a scene.
#[derive(Clone, Debug, Default)]
pub struct ModelOptions {
    /// Metres of a unit of the file.
    pub metres_per_unit: Option<f64>,
    /// The axis of the file that points up.
    pub up: Option<UpAxis>,
    /// What becomes window panes.
    pub glaze: Vec<GlazeRule>,
    /// What becomes leaded windows.
    pub lead: Vec<LeadingRule>,
    /// Materials in place of those of the file, with their names.
    pub materials: Vec<(MaterialRule, MaterialDescription)>,
}

/// A scene around a file.
#[derive(Clone, Debug)]
pub struct ModelScene {
    /// The scene.
    pub bundle: SceneBundle,
    /// What is in the file.
    pub expansion: Expansion,
    /// What was assumed, one sentence each.
    pub assumptions: Vec<String>,
}

/// Pixels across and down where the file does not say.
const SIZE: [u32; 2] = [960, 600];

/// Whether a file is of a kind that other programs write, by its name.
pub fn is_model(file: &Path) -> bool {
    format_of(file).is_some()
}

/// The kind of the file, by its name.
fn format_of(file: &Path) -> Option<fn(ImportFiles) -> ImportSource> {
    let extension = file.extension()?.to_str()?.to_lowercase();
    match extension.as_str() {
        "gltf" | "glb" => Some(ImportSource::Gltf),
        "obj" => Some(ImportSource::Obj),
        _ => None,
    }
}

/// Makes a scene around a file of another program.
///
/// # Errors
///
/// When the file cannot be read or makes no sense.
pub fn scene_around(file: &Path, options: &ModelOptions) -> Result<ModelScene, SceneError> {
    let unreadable = |source| SceneError::Unreadable { file: file.to_owned(), source };
    let not_a_name = || std::io::Error::other("its name is not valid UTF-8");
    let name = file.file_name().and_then(|name| name.to_str()).ok_or_else(|| unreadable(not_a_name()))?;
    let make = format_of(file).ok_or_else(|| unreadable(std::io::Error::other("not a glTF or OBJ file")))?;
    let stem = file.file_stem().and_then(|stem| stem.to_str()).unwrap_or(name);
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut source = make(ImportFiles { file: name.to_owned(), files: Vec::new() });
    let assets = read_files(folder, &mut source)?;
    let import = ImportDescription {
        metres_per_unit: options.metres_per_unit.unwrap_or(1.0),
        up: options.up.unwrap_or_default(),
        materials: options.materials.iter().map(|(rule, _)| rule.clone()).collect(),
        glaze: options.glaze.clone(),
        lead: options.lead.clone(),
        ..ImportDescription::of(short(stem), source)
    };
    let mut description = SceneDescription {
        version: SCENE_FORMAT_VERSION,
        name: short(stem),
        seed: 0,
        film: FilmDescription { width: SIZE[0], height: SIZE[1] },
        camera: CameraDescription::Perspective {
            position: [0.0, -1.0, 0.0],
            look_at: [0.0; 3],
            up: [0.0, 0.0, 1.0],
            vertical_field_of_view: 60.0,
        },
        integrator: crate::specular::registry::IntegratorDescription::default(),
        path_filter: None,
        sampling: super::SamplingDescription::default(),
        materials: options.materials.iter().map(|(rule, material)| (rule.material.clone(), material.clone())).collect(),
        meshes: Vec::new(),
        imports: vec![import],
        windows: Vec::new(),
        sheets: std::collections::BTreeMap::new(),
        panes: Vec::new(),
        lights: Vec::new(),
        site: None,
        moment: None,
        daylight: None,
        timeline: Vec::new(),
    };
    description.validate()?;
    let root = JsonPath::Root;
    let imports = root.member("imports");
    let expansion = expand(&description.imports[0], &assets, &imports.element(0))?;
    let mut assumptions = Vec::new();
    assumptions.extend(see_through(&mut description, &expansion.windows));
    // Surfaces that shine are seldom meant to light a building.
    if expansion.lights.iter().all(|light| light.mesh().is_some()) {
        description.lights = daylight();
        let found = if expansion.lights.is_empty() { "" } else { ", beside surfaces that shine" };
        assumptions
            .push(format!("The file has no lamp and no sun{found}: a sun from the south and a uniform sky were added"));
    } else if let Some(sun) = brightest_sun(&expansion.lights)
        && expansion.lights.iter().all(|light| !light.is_environment())
    {
        description.lights.push(sky(sun));
        assumptions.push("The file has a sun and no sky: a uniform sky was added, which is in proportion".to_owned());
    }
    match expansion.cameras.first() {
        Some(camera) => {
            description.camera = camera.camera.clone();
            if let Some(aspect) = camera.aspect {
                let width = (f64::from(SIZE[1]) * aspect).round().clamp(1.0, 16384.0);
                description.film.width = width as u32;
            }
            if expansion.cameras.len() > 1 {
                let names: Vec<&str> = expansion.cameras.iter().map(|camera| camera.name.as_str()).collect();
                assumptions.push(format!(
                    "The file has {} cameras ({}): the first was taken",
                    names.len(),
                    names.join(", ")
                ));
            }
        }
        None => {
            // Without panes and sheets, which take longest to build, and without walls of glass: windows are open.
            let expanded = description.expanded(&assets)?;
            let mut walls = expanded.clone().into_owned();
            walls.panes.clear();
            walls.sheets.clear();
            walls.meshes.retain(|mesh| !expanded.parts().is_left_to_chance(mesh));
            if walls.meshes.is_empty() {
                walls.meshes.clone_from(&expanded.meshes);
            }
            let kept: BTreeSet<&str> = walls.meshes.iter().map(|mesh| mesh.name.as_str()).collect();
            walls.lights.retain(|light| light.mesh().is_none_or(|mesh| kept.contains(mesh)));
            if walls.meshes.is_empty() {
                assumptions.push("The file has no camera, and no surface that one could look at".to_owned());
            } else {
                let scene = Scene::build(walls.parts(), &assets, &mut |_| ());
                let View { camera, is_inside } = view_of(&scene.map_err(|error| walls.named(error))?);
                description.camera = camera;
                let place = if is_inside { "where most of the space is seen" } else { "outside, in front of it all" };
                assumptions.push(format!("The file has no camera: one was placed {place}"));
            }
        }
    }
    let bundle = SceneBundle::from_parts(description, assets)?;
    Ok(ModelScene { bundle, expansion, assumptions })
}

/// Reads the file and the files that it refers to, and lists these. Files that a file can do without are left out where
/// they are not there: what is made of it says so.
fn read_files(folder: &Path, source: &mut ImportSource) -> Result<Assets, SceneError> {
    let path = || format!("imports[0].source.{}", source.format());
    let main = source.files().file.clone();
    let mut assets = load_assets(folder, [(path(), main.clone())])?;
    let mut absent = BTreeSet::new();
    // A material library names pictures once it has been read.
    let files = loop {
        let files = files_of(source, &assets);
        let mut files = files.map_err(|problem| SceneError::Asset { path: path(), name: main.clone(), problem })?;
        files.retain(|file| !absent.contains(file));
        let unread: Vec<&String> = files.iter().filter(|file| !assets.contains_key(*file)).collect();
        if unread.is_empty() {
            break files;
        }
        for file in unread {
            match load_assets(folder, [(path(), file.clone())]) {
                Ok(read) => assets.extend(read),
                Err(SceneError::Asset { problem: AssetProblem::Unreadable(error), .. })
                    if !source.needs_all_files()
                        && matches!(error.kind(), ErrorKind::NotFound | ErrorKind::IsADirectory) =>
                {
                    absent.insert(file.clone());
                }
                Err(error) => return Err(error),
            }
        }
    };
    source.files_mut().files = files;
    Ok(assets)
}

/// Makes sheets of windows that let no light through, so that daylight comes in. Answers which, if there are any.
fn see_through(description: &mut SceneDescription, windows: &[Window]) -> Option<String> {
    let mut sheets: Vec<(&ThinWallMaterial, String)> = Vec::new();
    let mut names = Vec::new();
    for Window { name, sheet, .. } in windows {
        let Some(sheet) = sheet else { continue };
        let known = sheets.iter().find(|(other, _)| *other == sheet).map(|(_, glass)| glass.clone());
        let glass = known.unwrap_or_else(|| {
            let names = (1..).map(|number: usize| match number {
                1 => "window glass".to_owned(),
                number => format!("window glass {number}"),
            });
            let mut free = names.filter(|name| !description.materials.contains_key(name));
            let glass = free.next().unwrap_or_default();
            description.materials.insert(glass.clone(), MaterialDescription::ThinWall(sheet.clone()));
            sheets.push((sheet, glass.clone()));
            glass
        });
        description.imports[0].materials.push(MaterialRule { pattern: name.clone(), material: glass });
        names.push(name);
    }
    let more = if names.len() > 3 { " and others" } else { "" };
    let first = names.iter().take(3).map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ");
    (!names.is_empty()).then(|| {
        format!(
            "{first}{more} look like windows: they are sheets of glass, and --glaze of the command import makes old \
             panes of them"
        )
    })
}

/// A name of a scene and an import.
fn short(name: &str) -> String {
    let name: String = name.chars().filter(|character| !character.is_control()).take(25).collect();
    if name.is_empty() { "model".to_owned() } else { name }
}

/// A sun in the south, half way up, and a sky that is as bright everywhere: together some 100 klx.
fn daylight() -> Vec<LightDescription> {
    let sun = SunLight {
        name: "sun".to_owned(),
        direction: [0.35, -0.7, 0.6],
        angular_radius: 0.267,
        radiance: [1.5e7, 1.4e7, 1.25e7],
    };
    let sky = sky(irradiance(&sun));
    vec![LightDescription::Sun(sun), sky]
}

/// Radiance of a clear sky over the irradiance of the sun, square to its light, 1/sr.
const SKY_OF_SUN: Triple = [0.029, 0.034, 0.044];

/// The sky that goes with a sun of this irradiance, W/m2.
fn sky(irradiance: f64) -> LightDescription {
    LightDescription::Environment(EnvironmentLight {
        name: "sky".to_owned(),
        radiance: EnvironmentRadiance::Colour(SKY_OF_SUN.map(|part| part * irradiance)),
        scale: 1.0,
        rotate: [0.0; 3],
    })
}

/// The irradiance of a sun square to its light, W/m2, as the mean over the channels.
fn irradiance(sun: &SunLight) -> f64 {
    let sine = libm::sin(sun.angular_radius.to_radians());
    std::f64::consts::PI * sine * sine * sun.radiance.iter().sum::<f64>() / 3.0
}

/// The irradiance of the brightest sun, W/m2.
fn brightest_sun(lights: &[LightDescription]) -> Option<f64> {
    let suns = lights.iter().filter_map(|light| match light {
        LightDescription::Sun(sun) => Some(irradiance(sun)),
        _ => None,
    });
    suns.reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    /// The lights beside those of a file with these lamps.
    fn added(lamps: &[Value]) -> Vec<LightDescription> {
        let node = |light: usize| json!({"extensions": {"KHR_lights_punctual": {"light": light}}});
        let mut file = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{}],
            "nodes": [{"camera": 0}],
            "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}]
        });
        if !lamps.is_empty() {
            file["extensionsUsed"] = json!(["KHR_lights_punctual"]);
            file["extensions"] = json!({"KHR_lights_punctual": {"lights": lamps}});
            file["nodes"].as_array_mut().unwrap().extend((0..lamps.len()).map(node));
        }
        let nodes: Vec<usize> = (0..=lamps.len()).collect();
        file["scenes"][0]["nodes"] = json!(nodes);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hall.gltf");
        std::fs::write(&path, file.to_string()).unwrap();
        scene_around(&path, &ModelOptions::default()).unwrap().bundle.description().lights.clone()
    }

    #[test]
    fn glass_that_shines_is_no_wall_for_the_camera_and_no_fault() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lamp.obj");
        let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 0 2\nv 1 0 2\nv 1 1 2\nusemtl stone\nf 1 2 3\n\
                    usemtl shade\nf 4 5 6\n";
        std::fs::write(&path, text).unwrap();
        std::fs::write(folder.path().join("a.mtl"), "newmtl stone\nnewmtl shade\nd 0.2\nNi 1.5\nKe 1 2 3\n").unwrap();
        let model = scene_around(&path, &ModelOptions::default()).unwrap();
        assert_eq!(model.expansion.lights.len(), 1);
        assert!(model.bundle.build_scene().unwrap().lights().iter().any(|light| light.triangles().is_some()));
    }

    #[test]
    fn daylight_is_added_where_the_file_has_none_and_a_sky_beside_a_sun() {
        let sun = |lux: f64| json!({"type": "directional", "intensity": lux});
        let lamp = json!({"type": "point", "intensity": 100});
        assert_eq!(added(&[]), daylight());
        assert_eq!(added(std::slice::from_ref(&lamp)), []);
        for (lamps, irradiance) in [(vec![sun(683.0)], 1.0), (vec![sun(683.0), lamp, sun(1366.0)], 2.0)] {
            let [LightDescription::Environment(sky)] = &added(&lamps)[..] else { panic!("{lamps:?}") };
            let EnvironmentRadiance::Colour(radiance) = sky.radiance else { panic!("{sky:?}") };
            // An even sky gives pi times its radiance: a tenth of what the sun does.
            let part = std::f64::consts::PI * radiance[1] / irradiance;
            assert!((0.09..0.12).contains(&part), "{part}");
        }
    }
}
