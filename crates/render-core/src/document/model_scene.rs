//! A whole scene around a file of another program, such as a building from Blender. What a scene has beyond the file is
//! assumed, and said.

use std::path::Path;

use super::bundle::load_assets;
use super::{SceneBundle, SceneDescription};
use crate::bsdf::{MaterialDescription, ThinWallMaterial};
use crate::light::{EnvironmentLight, EnvironmentRadiance, LightDescription, SunLight};
use crate::scene::asset_uses::asset_uses;
use crate::scene::description::{CameraDescription, FilmDescription};
use crate::scene::import::{
    Expansion, GlazeRule, ImportDescription, ImportFiles, ImportSource, MaterialRule, UpAxis, expand, files_of,
};
use crate::scene::{Scene, SceneError, view_of};
use crate::settings::{JsonPath, SCENE_FORMAT_VERSION};

/// How a file of another program becomes a scene.
#[derive(Clone, Debug, Default)]
pub struct ModelOptions {
    /// Metres of a unit of the file.
    pub metres_per_unit: Option<f64>,
    /// The axis of the file that points up.
    pub up: Option<UpAxis>,
    /// What becomes window panes.
    pub glaze: Vec<GlazeRule>,
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
    let main = load_assets(folder, [("imports[0].source".to_owned(), name.to_owned())])?;
    let others = files_of(&source, &main).map_err(|problem| SceneError::Asset {
        path: "imports[0].source".to_owned(),
        name: name.to_owned(),
        problem,
    })?;
    source.files_mut().files = others;
    let import = ImportDescription {
        metres_per_unit: options.metres_per_unit.unwrap_or(1.0),
        up: options.up.unwrap_or_default(),
        materials: options.materials.iter().map(|(rule, _)| rule.clone()).collect(),
        glaze: options.glaze.clone(),
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
        panes: Vec::new(),
        lights: Vec::new(),
    };
    description.validate()?;
    let uses = asset_uses(description.parts());
    let assets = load_assets(folder, uses.into_iter().map(|(path, name)| (path, name.to_owned())))?;
    let root = JsonPath::Root;
    let imports = root.member("imports");
    let expansion = expand(&description.imports[0], &assets, &imports.element(0))?;
    let mut assumptions = Vec::new();
    if options.glaze.is_empty() && !expansion.glazable.is_empty() {
        assumptions.push(see_through(&mut description, &expansion.glazable));
    }
    if expansion.lights.is_empty() {
        description.lights = daylight();
        assumptions.push("The file has no light: a sun from the south and a uniform sky were added".to_owned());
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
            // Without panes, which take longest to build: windows are open.
            let mut walls = description.expanded(&assets)?.into_owned();
            walls.panes.clear();
            if !walls.meshes.is_empty() {
                description.camera = view_of(&Scene::build(walls.parts(), &assets, &mut |_| ())?);
            }
            assumptions.push("The file has no camera: one was placed where most of the space is seen".to_owned());
        }
    }
    let bundle = SceneBundle::from_parts(description, assets)?;
    Ok(ModelScene { bundle, expansion, assumptions })
}

/// Makes clear sheets of what is called a window, so that daylight comes in. Answers what that is.
fn see_through(description: &mut SceneDescription, windows: &[(String, usize)]) -> String {
    let glass = "window glass";
    let material = MaterialDescription::ThinWall(ThinWallMaterial::default());
    description.materials.insert(glass.to_owned(), material);
    let mut names: Vec<&str> = windows.iter().map(|(name, _)| name.as_str()).collect();
    names.dedup();
    let rule = |name: &&str| MaterialRule { pattern: (*name).to_owned(), material: glass.to_owned() };
    description.imports[0].materials.extend(names.iter().map(rule));
    let more = if names.len() > 3 { " and others" } else { "" };
    format!(
        "{}{more} look like windows: they are clear sheets, and --glaze of the command import makes old panes of them",
        names.iter().take(3).map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ")
    )
}

/// A name of a scene and an import.
fn short(name: &str) -> String {
    let name: String = name.chars().filter(|character| !character.is_control()).take(25).collect();
    if name.is_empty() { "model".to_owned() } else { name }
}

/// A sun in the south, half way up, and a sky that is as bright everywhere: together some 100 klx.
fn daylight() -> Vec<LightDescription> {
    vec![
        LightDescription::Sun(SunLight {
            name: "sun".to_owned(),
            direction: [0.35, -0.7, 0.6],
            angular_radius: 0.267,
            radiance: [1.5e7, 1.4e7, 1.25e7],
        }),
        LightDescription::Environment(EnvironmentLight {
            name: "sky".to_owned(),
            radiance: EnvironmentRadiance::Colour([28.0, 33.0, 42.0]),
            scale: 1.0,
            rotate: [0.0; 3],
        }),
    ]
}
