//! The pixels of all scenes that ship, under every method that applies, are those that were recorded.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clerestory_film::{FilmTile, ImageRows, LayerChoice, NodeAddress};
use clerestory_render_core::document;
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::document::water::{WaterSettings, WaterView, lagoon, pool};
use clerestory_render_core::document::{SamplingDescription, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::integrator::render_node;
use clerestory_render_core::scene::description::FilmDescription;
use clerestory_render_core::specular::path::PathSettings;
use clerestory_render_core::specular::registry::IntegratorDescription;
use clerestory_tests::pixel_digests::{DigestTable, PixelDigest};
use serde_json::{Value, json};

/// How large the pictures are.
struct Effort {
    /// The file with what was recorded, in `tests/data`.
    table: &'static str,
    /// Rows of a picture; its columns follow from the scene's own size.
    height: u32,
    passes: u32,
    sampling: SamplingDescription,
    /// Of a surface of water.
    triangles: &'static str,
}

/// Two blocks and a pass: there are standard errors, and the film sums nodes of different sizes.
const SMALL: Effort = Effort {
    table: "pixels.txt",
    height: 12,
    passes: 5,
    sampling: SamplingDescription { samples_per_pass: 1, samples_per_block: 2 },
    triangles: "400",
};

const LARGE: Effort = Effort {
    table: "pixels-large.txt",
    height: 36,
    passes: 5,
    sampling: SamplingDescription { samples_per_pass: 2, samples_per_block: 4 },
    triangles: "100000",
};

/// An integrator with settings.
struct Method {
    /// As in a scene file.
    settings: String,
    integrator: IntegratorDescription,
    /// Whether one pass has to do.
    is_slow: bool,
}

/// The methods that apply to a scene, each with each of its settings that has code of its own.
fn methods(scene: &SceneDescription) -> Vec<Method> {
    let few = json!({"biased": {"trials": 2}});
    let (mut fast, mut slow) =
        (vec![json!({"path": {}}), json!({"auto": {}}), json!({"light": {"subpaths": 2}})], Vec::new());
    if !scene.panes.is_empty() {
        fast.extend([
            json!({"cone": {}}),
            json!({"fnee": {}}),
            json!({"fnee": {"reflected": true}}),
            json!({"fnee": {"selection": "sharp"}}),
            json!({"fnee": {"selection": "bleed"}}),
            json!({"fnee": {"selection": "random"}}),
            json!({"fnee": {"solver": "published", "max_trials": 20}}),
            json!({"sms": {"estimator": few, "selection": "sharp"}}),
            json!({"sms": {"estimator": few, "selection": "random", "steps": "published"}}),
            json!({"mnee": {}}),
            json!({"mnee": {"missed": "dropped"}}),
        ]);
    }
    // Walks to hundreds of panes from every surface would take minutes.
    if (1..=6).contains(&scene.panes.len()) {
        slow.extend([
            json!({"sms": {"estimator": few}}),
            json!({"sms": {"estimator": few, "constraint": "half_vector"}}),
            json!({"sms": {"estimator": few, "chains": ["TT", "R"]}}),
            json!({"sms": {"estimator": {"unbiased": {"max_trials": 20}}}}),
        ]);
    }
    let is_specular = |name| scene.materials.get(name).is_some_and(|material| material.is_delta());
    if scene.meshes.iter().any(|mesh| is_specular(&mesh.material)) {
        fast.extend([
            json!({"sms": {"estimator": few, "chains": ["T"]}}),
            json!({"sms": {"estimator": {"unbiased": {"max_trials": 20}}, "chains": ["T", "R"]}}),
            json!({"mnee": {"chains": ["T"]}}),
            json!({"conic": {}}),
            json!({"conic": {"chains": ["T", "R"]}}),
            json!({"conic": {"search": "without_rays"}}),
            json!({"conic": {"search": "published"}}),
        ]);
    }
    let method = |settings: Value, is_slow| Method {
        settings: settings.to_string(),
        integrator: serde_json::from_value(settings).expect("settings that the scene format knows"),
        is_slow,
    };
    let fast = fast.into_iter().map(|settings| method(settings, false));
    fast.chain(slow.into_iter().map(|settings| method(settings, true))).collect()
}

/// All JSON files below a folder that hold a scene.
fn scene_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("the scenes ship") {
        let path = entry.expect("the scenes ship").path();
        if path.is_dir() {
            files.extend(scene_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "json") {
            let content: Value = serde_json::from_slice(&fs::read(&path).expect("a file")).expect("JSON");
            files.extend(content.get("camera").is_some().then_some(path));
        }
    }
    files.sort();
    files
}

/// The scenes that ship, and those of water that are computed: two frames of each, and each view.
fn scenes(effort: &Effort) -> Vec<(String, SceneBundle)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let shipped = scene_files(&folder).into_iter().map(|file| {
        let name = file.strip_prefix(&folder).expect("it lies there").display().to_string();
        (name, document::load(&file).expect("a scene that ships"))
    });
    let triangles = effort.triangles.parse().expect("so many triangles");
    let views = [
        ("above", WaterView::Above, 0.0),
        ("above", WaterView::Above, 0.04),
        ("below", WaterView::Below, 0.0),
        ("floor", WaterView::Floor, 0.0),
        ("floor", WaterView::Floor, 0.04),
    ];
    let water = views.into_iter().flat_map(|(view_name, view, time)| {
        let settings = WaterSettings { triangles, time, view };
        [("pool", pool(&settings)), ("lagoon", lagoon(&settings))].map(|(name, description)| {
            let bundle = SceneBundle::from_parts(description, [].into()).expect("a valid scene");
            (format!("{name}, {view_name}, {time} s"), bundle)
        })
    });
    shipped.chain([("probe.json".to_owned(), probe())]).chain(water).collect()
}

/// The scene by which workers show what bits they compute.
fn probe() -> SceneBundle {
    let mut scene: Value =
        serde_json::from_str(include_str!("../../../crates/render-core/src/probe.json")).expect("JSON");
    scene["integrator"] = json!({"path": {}});
    let description = SceneDescription::parse(scene.to_string().as_bytes()).expect("a valid scene");
    SceneBundle::from_parts(description, [].into()).expect("no files")
}

/// A scene with an integrator, in a small picture with few samples. What takes time to build is taken over from the
/// scene before, where it is the same.
fn prepared(
    before: Option<PreparedScene>,
    bundle: &SceneBundle,
    effort: &Effort,
    integrator: &IntegratorDescription,
) -> PreparedScene {
    let FilmDescription { width, height } = bundle.description().film;
    let description = SceneDescription {
        name: "pixels".to_owned(),
        film: FilmDescription { width: effort.height * width / height, height: effort.height },
        sampling: effort.sampling,
        integrator: integrator.clone(),
        ..bundle.description().clone()
    };
    let bundle = bundle.clone().with_description(description).expect("a valid change");
    let scene = match before {
        Some(before) => before.changed(&bundle),
        None => PreparedScene::build(&bundle),
    };
    scene.expect("the scene can be built")
}

/// The digest of a picture of a frame of a scene, made as `clerestory render` makes it.
fn rendered(scene: &PreparedScene, frame: u32, passes: u32) -> PixelDigest {
    let FilmDescription { width, height } = scene.description().film;
    let grid = scene.description().grid(width.max(height));
    let mut rows = ImageRows::new(grid, 0..height, LayerChoice::all(true));
    for tile in 0..grid.len() {
        let mut film = FilmTile::new(frame, tile, grid.tile(tile).expect("a tile"), scene.sampling());
        for index in 0..passes {
            let address = NodeAddress { frame, tile, level: 0, index };
            let rendered = render_node(scene, &grid, address, &AtomicBool::new(false)).expect("a pass");
            film.insert(rendered.node).expect("a pass that is not there yet");
        }
        rows.fill(&film.sum(passes).expect("all passes")).expect("the tile is of the picture");
    }
    PixelDigest::of(rows.layers())
}

/// What every scene looks like now.
fn looked_at(effort: &Effort) -> DigestTable {
    let mut table = DigestTable::default();
    let mut before = None;
    for (name, bundle) in scenes(effort) {
        let shipped = &bundle.description().integrator;
        let mut scene = prepared(before.take(), &bundle, effort, shipped);
        table.add(&name, "as shipped", rendered(&scene, 0, effort.passes));
        table.add(&name, "as shipped, frame 1", rendered(&scene, 1, effort.passes));
        for Method { settings, integrator, is_slow } in methods(bundle.description()) {
            if integrator != *shipped {
                scene = prepared(Some(scene), &bundle, effort, &integrator);
                table.add(&name, &settings, rendered(&scene, 0, if is_slow { 1 } else { effort.passes }));
            }
        }
        before = Some(scene);
    }
    table
}

/// A digest of nothing but black guards little: every scene and every method has light in it, though not both in every
/// picture.
fn check_light(table: &DigestTable) {
    let with_light = |key: for<'a> fn((&'a str, &'a str)) -> &'a str| -> BTreeSet<&str> {
        table
            .cases()
            .filter(|(_, _, digest)| !digest.is_black())
            .map(|(scene, settings, _)| key((scene, settings)))
            .collect()
    };
    let (scenes, settings) = (with_light(|case| case.0), with_light(|case| case.1));
    for (scene, setting, _) in table.cases() {
        assert!(scenes.contains(scene), "no light in any picture of {scene}");
        assert!(settings.contains(setting), "no light in any picture by {setting}");
    }
}

fn check(effort: &Effort) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(effort.table);
    let now = looked_at(effort);
    check_light(&now);
    if std::env::var_os("UPDATE_PIXELS").is_some() {
        now.write(&file, COMMENT);
    }
    let differences = DigestTable::read(&file).differences(&now);
    assert!(
        differences.is_empty(),
        "tests/data/{} is out of date in {} lines; where that is meant, write it with UPDATE_PIXELS=1 and say in the \
         commit why each changes:\n{}",
        effort.table,
        differences.len(),
        differences.join("\n")
    );
}

/// What the tables say about themselves.
const COMMENT: &str = "Scene, settings, mean of the picture, and digest of its pixels and other layers. \
    Whoever changes a line says why in the commit. Written by\n\
    UPDATE_PIXELS=1 cargo test --release --workspace --test statistics pixels:: -- --include-ignored";

#[test]
fn pixels_are_those_that_were_recorded() {
    check(&SMALL);
}

#[test]
fn a_scene_whose_integrator_is_changed_has_the_pixels_of_one_that_is_built_with_it() {
    let shipped: Vec<_> =
        scenes(&SMALL).into_iter().filter(|(name, _)| name == "pool.json" || name == "slab.json").collect();
    assert_eq!(shipped.len(), 2);
    for (name, bundle) in shipped {
        let digests = methods(bundle.description()).into_iter().map(|Method { settings, integrator, .. }| {
            let path = IntegratorDescription::Path(PathSettings { max_depth: 16 });
            let changed = prepared(Some(prepared(None, &bundle, &SMALL, &path)), &bundle, &SMALL, &integrator);
            let built = prepared(None, &bundle, &SMALL, &integrator);
            let [changed, built] = [changed, built].map(|scene| rendered(&scene, 0, 1));
            assert_eq!(changed, built, "{name} {settings}");
            built
        });
        assert!(digests.filter(|digest| !digest.is_black()).count() > 5, "{name}");
    }
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn pixels_of_larger_pictures_are_those_that_were_recorded() {
    check(&LARGE);
}
