//! A scene with the bytes of its assets: what is hashed, sent to the farm, and built.

use std::collections::BTreeSet;
use std::collections::btree_map::Entry;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use super::SceneDescription;
use super::canonical::scene_hash;
use super::timeline::place_in_frame;
#[cfg(test)]
use crate::scene::Scene;
use crate::scene::asset_uses::asset_uses;
use crate::scene::{Asset, Assets, SceneHash, SceneMemory};
use crate::settings::limits::{MAX_ASSET_BYTES, MAX_SCENE_BYTES};
use crate::settings::{AssetProblem, SceneError};

/// A valid description and exactly the assets that it names. Their contents are judged when the scene is built.
#[derive(Clone, Debug)]
pub struct SceneBundle {
    description: SceneDescription,
    assets: Assets,
    hash: SceneHash,
}

impl SceneBundle {
    /// Puts a scene together. Assets that the description does not name are left out.
    ///
    /// # Errors
    ///
    /// When the description is not valid, or an asset is missing or too large.
    pub fn from_parts(description: SceneDescription, mut assets: Assets) -> Result<Self, SceneError> {
        description.validate()?;
        let mut names = BTreeSet::new();
        for (path, name) in asset_uses_of_frames(&description)? {
            let problem = match assets.get(&name) {
                None => AssetProblem::Missing,
                Some(asset) if asset.bytes().len() as u64 > MAX_ASSET_BYTES => too_large(asset.bytes().len() as u64),
                Some(_) => {
                    names.insert(name);
                    continue;
                }
            };
            return Err(SceneError::Asset { path, name, problem });
        }
        assets.retain(|name, _| names.contains(name));
        let hashes = assets.iter().map(|(name, asset)| (name.as_str(), asset.hash())).collect();
        let hash = scene_hash(&description, &hashes);
        Ok(Self { description, assets, hash })
    }

    /// The description.
    pub fn description(&self) -> &SceneDescription {
        &self.description
    }

    /// The assets by name.
    pub fn assets(&self) -> &Assets {
        &self.assets
    }

    /// Builds the things of the scene, without the method that its settings name.
    #[cfg(test)]
    pub(crate) fn build_scene(&self) -> Result<Scene, SceneError> {
        Scene::build(self.description.expanded(&self.assets)?.parts(), &self.assets, &mut |_| ())
    }

    /// What the scene is made of, and how much memory that takes.
    ///
    /// # Errors
    ///
    /// When an import or a window of the scene makes no sense.
    pub fn memory(&self) -> Result<SceneMemory, SceneError> {
        Ok(self.memory_and_missing_light()?.0)
    }

    /// The same, and the light that an image lacks: [`SceneDescription::missing_light`] with the things of imports and
    /// windows.
    ///
    /// # Errors
    ///
    /// As [`Self::memory`].
    pub fn memory_and_missing_light(&self) -> Result<(SceneMemory, Vec<String>), SceneError> {
        let expanded = self.description.expanded(&self.assets)?;
        Ok((SceneMemory::of(expanded.parts(), &self.assets), expanded.missing_light()))
    }

    /// The identity of the scene: everything that can change a pixel goes into it, and no white space or order of
    /// members in the scene file does.
    pub fn scene_hash(&self) -> SceneHash {
        self.hash
    }

    /// The scene of a frame, with the files that it names.
    ///
    /// # Errors
    ///
    /// When there is no such frame.
    pub fn frame(&self, number: u32) -> Result<Self, SceneError> {
        Self::from_parts(self.description.frame(number)?, self.assets.clone())
    }

    /// The same scene with a changed description, such as another seed.
    ///
    /// # Errors
    ///
    /// When the new description is not valid or names an asset that is not there.
    pub fn with_description(self, description: SceneDescription) -> Result<Self, SceneError> {
        Self::from_parts(description, self.assets)
    }
}

/// The files that a scene names and those of its frames, with the places that name them.
fn asset_uses_of_frames(description: &SceneDescription) -> Result<Vec<(String, String)>, SceneError> {
    let owned = |scene: &SceneDescription| -> Vec<(String, String)> {
        asset_uses(scene.parts()).into_iter().map(|(path, name)| (path, name.to_owned())).collect()
    };
    let mut uses = owned(description);
    for (number, scene) in description.frame_scenes() {
        uses.extend(owned(&scene?).into_iter().map(|(path, name)| (place_in_frame(number, &path), name)));
    }
    Ok(uses)
}

/// Names of all files that must be supplied with a scene without a timeline.
pub fn asset_names(description: &SceneDescription) -> BTreeSet<&str> {
    asset_uses(description.parts()).into_iter().map(|(_, name)| name).collect()
}

/// Reads a scene file and the files that it names. Files are read from the folder of the scene file alone: a symbolic
/// link that leads out of it could send any file of the user to a farm with a scene that came from elsewhere.
///
/// # Errors
///
/// When a file cannot be read, lies outside the folder or is too large, or the description is not valid.
pub fn load(file: &Path) -> Result<SceneBundle, SceneError> {
    let unreadable = |source| SceneError::Unreadable { file: file.to_owned(), source };
    let json = read_at_most(file, MAX_SCENE_BYTES as u64).map_err(unreadable)?;
    let description = SceneDescription::parse(&json)?;
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let assets = load_assets(folder, asset_uses_of_frames(&description)?)?;
    SceneBundle::from_parts(description, assets)
}

/// Reads files of a folder, with the places that name them.
pub(super) fn load_assets(
    folder: &Path,
    uses: impl IntoIterator<Item = (String, String)>,
) -> Result<Assets, SceneError> {
    let unreadable = |source| SceneError::Unreadable { file: folder.to_owned(), source };
    let folder = fs::canonicalize(folder).map_err(unreadable)?;
    let mut assets = Assets::new();
    for (path, name) in uses {
        if let Entry::Vacant(place) = assets.entry(name) {
            let asset = load_asset(&folder, place.key());
            let asset = asset.map_err(|problem| SceneError::Asset { path, name: place.key().clone(), problem })?;
            place.insert(asset);
        }
    }
    Ok(assets)
}

fn load_asset(folder: &Path, name: &str) -> Result<Asset, AssetProblem> {
    let file = &fs::canonicalize(folder.join(name))?;
    if !file.starts_with(folder) {
        return Err(AssetProblem::Outside { target: file.clone() });
    }
    let bytes = read_at_most(file, MAX_ASSET_BYTES)?;
    if bytes.len() as u64 > MAX_ASSET_BYTES {
        return Err(too_large(fs::metadata(file)?.len()));
    }
    Ok(Asset::new(bytes))
}

/// Reads a regular file. Of one that is longer than `limit`, only `limit + 1` bytes: enough to know.
fn read_at_most(file: &Path, limit: u64) -> std::io::Result<Vec<u8>> {
    // Opening a pipe would wait for a writer, so the kind of file is looked at first.
    if !fs::metadata(file)?.is_file() {
        return Err(std::io::Error::other("not a regular file"));
    }
    let mut bytes = Vec::new();
    File::open(file)?.take(limit + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn too_large(bytes: u64) -> AssetProblem {
    AssetProblem::TooLarge { found: format!("{bytes} bytes"), limit: format!("{MAX_ASSET_BYTES} bytes") }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde_json::{Value, json};

    use super::super::malformed_scenes::valid_scene;
    use super::*;
    use crate::scene::ContentHash;
    use crate::specular::registry::IntegratorDescription;

    fn bundle(scene: &Value) -> Result<SceneBundle, SceneError> {
        let assets = BTreeMap::from([("floor.ply".to_owned(), Asset::new(*b"ply"))]);
        SceneBundle::from_parts(SceneDescription::parse(scene.to_string().as_bytes())?, assets)
    }

    fn with_file(name: &str) -> Value {
        let mut scene = valid_scene();
        scene["meshes"][0]["source"] = json!({"ply": {"file": name}});
        scene
    }

    #[test]
    fn the_hash_does_not_see_how_a_scene_is_written() {
        let compact = bundle(&valid_scene()).unwrap();
        let canonical = super::super::canonical_json(compact.description());
        let spaced = serde_json::to_string_pretty(&valid_scene()).unwrap().replace("0.002", "2e-3");
        for text in [canonical, spaced] {
            let description = SceneDescription::parse(text.as_bytes()).unwrap();
            let rewritten = SceneBundle::from_parts(description, BTreeMap::new()).unwrap();
            assert_eq!(rewritten.scene_hash(), compact.scene_hash());
        }
        let mut with_defaults = valid_scene();
        with_defaults["seed"] = json!(0);
        with_defaults["panes"][0]["absorption"] = json!([0, 0, 0]);
        with_defaults["integrator"]["fnee"]["max_trials"] = json!(1000);
        assert_eq!(bundle(&with_defaults).unwrap().scene_hash(), compact.scene_hash());
    }

    #[test]
    fn the_hash_sees_every_value_and_every_byte_of_an_asset() {
        let original = bundle(&with_file("floor.ply")).unwrap();
        let mut moved = with_file("floor.ply");
        moved["panes"][0]["centre"][0] = json!(1e-300);
        assert_ne!(bundle(&moved).unwrap().scene_hash(), original.scene_hash());

        let seeded = original.clone().with_description(original.description().clone().with_seed(1)).unwrap();
        assert_ne!(seeded.scene_hash(), original.scene_hash());

        let assets = BTreeMap::from([("floor.ply".to_owned(), Asset::new(*b"plx"))]);
        let other_bytes = SceneBundle::from_parts(original.description().clone(), assets).unwrap();
        assert_ne!(other_bytes.scene_hash(), original.scene_hash());
    }

    #[test]
    fn only_the_assets_that_are_named_belong_to_a_scene() {
        assert!(bundle(&valid_scene()).unwrap().assets().is_empty());
        let error = bundle(&with_file("other.ply")).unwrap_err().to_string();
        assert!(error.contains("meshes[0].source.ply.file: file \"other.ply\" is missing"), "{error}");
    }

    #[test]
    fn a_scene_is_loaded_with_the_files_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("scene.json");
        let error = load(&file).unwrap_err().to_string();
        assert!(error.contains("cannot read the scene file"), "{error}");

        fs::write(&file, with_file("meshes/floor.ply").to_string()).unwrap();
        let error = load(&file).unwrap_err().to_string();
        assert!(error.contains("\"meshes/floor.ply\" cannot be read"), "{error}");

        fs::create_dir(folder.path().join("meshes")).unwrap();
        fs::write(folder.path().join("meshes/floor.ply"), "ply").unwrap();
        let loaded = load(&file).unwrap();
        assert_eq!(loaded.assets()["meshes/floor.ply"].hash(), ContentHash::of(b"ply"));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_that_leads_out_of_the_folder_of_the_scene_is_refused() {
        use std::os::unix::fs::symlink;

        let [inside, outside] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let path = |name: &str| inside.path().join(name);
        fs::write(outside.path().join("secret"), "secret").unwrap();
        fs::create_dir(path("scene")).unwrap();
        fs::write(path("beside.ply"), "ply").unwrap();
        let file = path("scene/scene.json");
        let link = path("scene/floor.ply");
        fs::write(&file, with_file("floor.ply").to_string()).unwrap();
        let refused = |expected: &Path| {
            let error = load(&file).unwrap_err().to_string();
            let target = fs::canonicalize(expected).unwrap();
            assert!(error.contains("meshes[0].source.ply.file: file \"floor.ply\" leads to"), "{error}");
            assert!(error.contains(&*target.to_string_lossy()) && error.contains("copy it"), "{error}");
        };
        symlink(outside.path().join("secret"), &link).unwrap();
        refused(&outside.path().join("secret"));
        fs::remove_file(&link).unwrap();
        symlink("../beside.ply", &link).unwrap();
        refused(&path("beside.ply"));
        // The folder's name begins in the same way, and it is another.
        fs::remove_file(&link).unwrap();
        fs::create_dir(path("scene2")).unwrap();
        fs::write(path("scene2/floor.ply"), "ply").unwrap();
        symlink("../scene2/floor.ply", &link).unwrap();
        refused(&path("scene2/floor.ply"));
        // So is a folder that leads out.
        fs::write(outside.path().join("floor.ply"), "ply").unwrap();
        symlink(outside.path(), path("scene/meshes")).unwrap();
        fs::write(&file, with_file("meshes/floor.ply").to_string()).unwrap();
        let error = load(&file).unwrap_err().to_string();
        assert!(error.contains("\"meshes/floor.ply\" leads to"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn links_within_the_folder_and_to_the_scene_are_followed() {
        use std::os::unix::fs::symlink;

        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir_all(path("scene/meshes")).unwrap();
        fs::write(path("scene/meshes/real.ply"), "ply").unwrap();
        symlink("meshes/real.ply", path("scene/floor.ply")).unwrap();
        fs::write(path("scene/real.json"), with_file("floor.ply").to_string()).unwrap();
        symlink("real.json", path("scene/link.json")).unwrap();
        symlink("scene", path("other")).unwrap();
        for file in ["scene/real.json", "scene/link.json", "other/link.json", "scene/meshes/../real.json"] {
            assert_eq!(load(&path(file)).unwrap().assets()["floor.ply"].hash(), ContentHash::of(b"ply"), "{file}");
        }
        // A link to a scene elsewhere: the files are looked for beside the link.
        fs::create_dir(path("own")).unwrap();
        symlink("../scene/real.json", path("own/scene.json")).unwrap();
        fs::write(path("own/floor.ply"), "own").unwrap();
        assert_eq!(load(&path("own/scene.json")).unwrap().assets()["floor.ply"].hash(), ContentHash::of(b"own"));
    }

    #[test]
    fn changing_the_integrator_keeps_its_depth_and_the_settings_that_the_scene_has() {
        let description = SceneDescription::parse(valid_scene().to_string().as_bytes()).unwrap();
        let mut scene = valid_scene();
        scene["integrator"] = serde_json::json!({"fnee": {"max_depth": 7, "solver": "published", "max_trials": 50}});
        let published = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        assert_eq!(published.clone().with_integrator_named("fnee").unwrap().integrator, published.integrator);
        let mut deep = description.clone();
        deep.integrator = IntegratorDescription::Path(crate::specular::path::PathSettings { max_depth: 5 });
        let cone = deep.with_integrator_named("cone").unwrap();
        assert_eq!((cone.integrator.kind(), cone.integrator.max_depth()), ("cone", 5));
        // Chains that it cannot look for are not kept.
        scene["integrator"] = serde_json::json!({"sms": {"max_depth": 6, "chains": ["TT", "R"]}});
        let chains = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        let conic = serde_json::to_value(chains.with_integrator_named("conic").unwrap().integrator).unwrap();
        assert_eq!(conic, serde_json::json!({"conic": {"max_depth": 6, "search": "complete", "chains": ["R"]}}));
        let conic = serde_json::to_value(cone.clone().with_integrator_named("conic").unwrap().integrator).unwrap();
        assert_eq!(conic["conic"]["chains"], serde_json::json!(["T"]));
        let error = cone.with_integrator_named("magic").unwrap_err().to_string();
        assert!(
            error.contains(
                "integrator: found \"magic\", must be \"auto\" or \"path\" or \"light\" or \"cone\" or \"fnee\" or \
                 \"sms\" or \"mnee\" or \"conic\""
            ),
            "{error}"
        );
        assert!(description.with_size(0, 5).unwrap_err().to_string().contains("film.width"));
    }
}
