//! Scenes that both renderers can render: every light, material and camera that is exported.
//!
//! What models differ in is left out by construction:
//!
//! - Light of points through glass is found by us alone: lights behind glass are large.
//! - Mitsuba moves rays off surfaces, here by up to 0.4 mm. The light behind the pane is nearer by that, and the way in
//!   the glass shorter, so its picture is brighter by some 0.04 percent. The pane is large and thick, and absorbs
//!   little.
//! - Light is unpolarised at each surface there. Panes and thin walls are seen by light near their normals, above dark
//!   floors. Blocks of glass are seen at all angles. What they do to polarised light is hardly more than the noise.
//! - Facets that shade each other, and light that several of them reflect: rough surfaces are not very rough.
//! - Spots dim in another way there: the one here is sharp.
//! - Meshes shine to the side of their normals there: lanterns are closed. Light of a picture beyond its first period
//!   is lost there: screens have one.
//! - Mitsuba has no coat that is like ours: surfaces are matt or metal.
//! - Terminators of rounded meshes are soft here: meshes are flat.
//! - Mitsuba counts surfaces that are not there as vertices: paths are long. Normals that lean away from the viewer are
//!   turned there: only direct light falls on normal maps.

use std::collections::BTreeMap;
use std::io::Cursor;

use clerestory_film::{FrameImage, ImageLayers};
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::Asset;
use image::{ImageBuffer, ImageFormat, Rgb, Rgba};
use serde_json::{Value, json};

use super::interior::interior;
use super::mitsuba::Fault;
use super::shapes::{block, box_meshes, camera, ceiling_light, grey, paints, quad, room};

/// A scene, and how much of it is rendered.
#[derive(Clone, Debug)]
pub struct ParityScene {
    /// Its name.
    pub name: &'static str,
    /// As in a scene file.
    pub description: Value,
    /// The files that it names.
    pub files: Vec<(String, Vec<u8>)>,
    /// Samples in each pixel of a picture by Mitsuba.
    pub samples: u32,
    /// Samples in each pixel of a picture of ours.
    pub our_samples: u32,
    /// What Mitsuba has to be told of boundaries between two bodies: each is right, and what stands there is not.
    pub corrections: &'static [Fault],
    /// A fault that must be noticed.
    pub fault: Option<Fault>,
}

/// Reflectance of the walls of the furnace.
const FURNACE: &str = "value=\"0.75, 0.75, 0.75\"";

/// What stands behind a wall of the furnace that is too bright by one part in 200.
const BRIGHTER_FURNACE: &str = "value=\"0.75375, 0.75375, 0.75375\"";

/// The glass of the pane.
const GLASS: &str = "<float name=\"ext_ior\" value=\"1\"/>";

/// Glass that loses four parts in a hundred at one of two faces once more, as by a Fresnel term that counts twice.
const DARKER_GLASS: &str =
    "<float name=\"ext_ior\" value=\"1\"/><rgb name=\"specular_transmittance\" value=\"0.978, 0.978, 0.978\"/>";

impl ParityScene {
    /// All scenes.
    pub fn all() -> Vec<Self> {
        vec![
            furnace(),
            cornell_box(),
            lamps(),
            textures(),
            mirrors(),
            glass(),
            nested(),
            pane("path"),
            pane("cone"),
            orthographic(),
            sun(),
            metals(),
            rough_glass(),
            window(),
            sky(),
            overcast(),
            interior(),
            cut_out(),
            relief(),
        ]
    }

    /// Those that are enough to see that export works, and that a fault is noticed.
    pub fn few() -> Vec<Self> {
        vec![furnace(), textures(), pane("cone"), metals(), sky()]
    }

    pub(super) fn new(name: &'static str, camera: Value, things: &Value) -> Self {
        let mut description = json!({
            "version": 2, "name": name, "film": {"width": 1, "height": 1}, "camera": camera,
            "integrator": {"path": {"max_depth": 8}},
        });
        for (member, value) in things.as_object().into_iter().flatten() {
            description[member] = value.clone();
        }
        Self { name, description, files: Vec::new(), samples: 32, our_samples: 32, corrections: &[], fault: None }
    }

    /// The scene in pictures of another height, with a part of their samples. Wide pictures stay wide.
    #[must_use]
    pub fn with_size(mut self, height: u32, part: u32) -> Self {
        self.samples = (self.samples / part).max(1);
        self.our_samples = (self.our_samples / part).max(1);
        let film = &mut self.description["film"];
        let wide = film["width"].as_u64() > film["height"].as_u64();
        let width = if wide { height * 3 / 2 } else { height };
        *film = json!({"width": width, "height": height});
        self.description["sampling"] =
            json!({"samples_per_pass": self.our_samples, "samples_per_block": self.our_samples});
        self
    }

    /// Pixels across and down.
    pub fn size(&self) -> [usize; 2] {
        ["width", "height"].map(|edge| self.description["film"][edge].as_u64().unwrap_or_default() as usize)
    }

    /// The scene as this renderer has it.
    ///
    /// # Panics
    ///
    /// When it cannot be built.
    pub fn prepared(&self) -> PreparedScene {
        let description = SceneDescription::parse(self.description.to_string().as_bytes()).expect("a valid scene");
        let files: BTreeMap<String, Asset> =
            self.files.iter().map(|(name, bytes)| (name.clone(), Asset::new(bytes.clone()))).collect();
        let bundle = SceneBundle::from_parts(description, files).expect("a complete scene");
        PreparedScene::build(&bundle).expect("a scene that can be built")
    }
}

/// A closed room with light walls and a globe, almost a furnace: every fault of a wall counts many times.
fn furnace() -> ParityScene {
    let mut scene = ParityScene::new(
        "furnace",
        camera(),
        &json!({
            "materials": {"plaster": grey(0.75)},
            "meshes": room(["plaster"; 6]),
            "lights": [{"sphere": {"name": "globe", "centre": [0, 0.3, 1.2], "radius": 0.25, "radiance": [1, 1, 1]}}]
        }),
    );
    scene.description["integrator"]["path"]["max_depth"] = json!(60);
    scene.fault = Some(Fault { name: "an albedo times 1.005", text: FURNACE, fault: BRIGHTER_FURNACE });
    scene
}

fn cornell_box() -> ParityScene {
    let things = json!({"materials": paints(), "meshes": box_meshes(), "lights": [ceiling_light(0.6)]});
    ParityScene::new("box", camera(), &things)
}

/// One light of each kind that is somewhere. Mitsuba chooses one of them for each vertex.
fn lamps() -> ParityScene {
    let lights = json!([
        {"sphere": {"name": "globe", "centre": [-0.5, 0.4, 1.5], "radius": 0.15, "radiance": [12, 8, 4]}},
        {"disk": {"name": "downlight", "centre": [0.2, 0.98, 1.5], "normal": [0, -1, 0], "radius": 0.3,
            "radiance": [2, 4, 8]}},
        {"spot": {"name": "sharp", "position": [-0.6, -0.7, 1.9], "direction": [0.5, 0.7, -1],
            "intensity": [1.2, 0.9, 1.5], "inner_angle": 25, "outer_angle": 25}},
        {"point": {"name": "bulb", "position": [0.6, -0.5, 1.4], "intensity": [0.5, 0.6, 0.4]}},
        {"mesh": {"name": "lantern", "mesh": "lantern", "radiance": [6, 3, 5]}},
        {"mesh": {"name": "screen", "mesh": "back", "radiance": [0.4, 0.8, 0.6], "texture": {"file": "screen.png"}}},
        ceiling_light(0.3)
    ]);
    let mut meshes = box_meshes();
    meshes.push(block("lantern", "red", [-0.2, -0.3, 1.0], [0.06, 0.08, 0.2], 35.0));
    meshes[4]["source"]["inline"]["texture_coordinates"] = json!([[0, 0], [1, 0], [1, 1], [0, 1]]);
    let texel = |x: u32, y: u32| Rgb([(200 * x) as u8, (230 - 60 * y) as u8, if (x, y) == (0, 0) { 250 } else { 20 }]);
    let files = vec![("screen.png".to_owned(), png(2, 3, texel))];
    let things = json!({"materials": paints(), "meshes": meshes, "lights": lights});
    ParityScene { files, samples: 64, our_samples: 64, ..ParityScene::new("lamps", camera(), &things) }
}

/// Pictures that have no symmetry: 8-bit sRGB, repeated, on the floor, and linear on the walls.
fn textures() -> ParityScene {
    let textured = |file: &str| json!({"diffuse": {"reflectance": {"texture": {"file": file}}}});
    let mut things = json!({"materials": paints(), "meshes": room(["tiles", "white", "red", "green", "mural", "white"]),
        "lights": [ceiling_light(1.0)]});
    things["materials"]["tiles"] = textured("tiles.png");
    things["materials"]["mural"] = json!({"diffuse": {"reflectance": {"texture": {"file": "mural.exr",
        "wrap": ["clamp", "clamp"], "transform": [[1.1, 0.5, -0.2], [-0.3, 0.9, 0.3]], "factor": [1, 0.8, 0.6]}}}});
    things["meshes"][0]["source"]["inline"]["texture_coordinates"] =
        json!([[0.1, 0.2], [2.6, 0.2], [2.6, 2.9], [0.1, 2.9]]);
    things["meshes"][4]["source"]["inline"]["texture_coordinates"] = json!([[0, 0], [1, 0], [1, 1], [0, 1]]);
    let mut scene = ParityScene::new("textures", camera(), &things);
    let tile = |x: u32, y: u32| {
        Rgb([(40 + 50 * x) as u8, (230 - 60 * y) as u8, if (x, y) == (0, 0) { 250 } else { (30 * (x + y)) as u8 }])
    };
    let mural = |index: usize| {
        let (x, y) = ((index % 5) as f32 / 5.0, (index / 5) as f32 / 3.0);
        [0.1 + 0.8 * x, 0.9 - 0.7 * y, 0.5 * x * y + 0.05]
    };
    scene.files = vec![("tiles.png".to_owned(), png(4, 3, tile)), ("mural.exr".to_owned(), exr(5, 3, mural))];
    scene
}

/// A mirror that leans against the wall, and a block of tinted mirrors.
fn mirrors() -> ParityScene {
    let mut things = json!({"materials": paints(), "meshes": room(["white", "white", "red", "green", "white", "white"]),
        "lights": [ceiling_light(1.0)]});
    things["materials"]["silver"] = json!({"mirror": {}});
    things["materials"]["gold"] = json!({"mirror": {"reflectance": [0.95, 0.7, 0.3]}});
    let meshes = things["meshes"].as_array_mut().expect("meshes");
    meshes.push(quad("mirror", "silver", [-0.9, 0.8, 0.3], [0.9, 0.1, 0.0], [0.0, 0.05, 1.2]));
    meshes.push(block("block", "gold", [0.35, 0.1, 0.1], [0.25, 0.25, 0.6], 30.0));
    ParityScene { samples: 64, our_samples: 64, ..ParityScene::new("mirrors", camera(), &things) }
}

/// Blocks of glass below a light that is so large that chance finds it through them.
fn glass() -> ParityScene {
    let mut things = json!({"materials": paints(), "meshes": room(["white", "white", "red", "green", "white", "white"]),
        "lights": [ceiling_light(1.8)]});
    things["materials"]["crown"] = json!({"dielectric": {"index_of_refraction": 1.52}});
    things["materials"]["flint"] = json!({"dielectric": {"index_of_refraction": 1.7}});
    let meshes = things["meshes"].as_array_mut().expect("meshes");
    meshes.push(block("tall", "crown", [-0.4, 0.0, 0.2], [0.3, 0.3, 0.8], 25.0));
    meshes.push(block("short", "flint", [0.4, 0.2, 0.5], [0.25, 0.2, 0.25], -40.0));
    let mut scene = ParityScene { samples: 64, our_samples: 64, ..ParityScene::new("glass", camera(), &things) };
    scene.description["integrator"]["path"]["max_depth"] = json!(16);
    scene
}

/// In air, as exported.
const FLINT: &str = "<float name=\"int_ior\" value=\"1.7\"/>\n        <float name=\"ext_ior\" value=\"1\"/>";

/// In water.
const FLINT_IN_WATER: &str =
    "<float name=\"int_ior\" value=\"1.7\"/>\n        <float name=\"ext_ior\" value=\"1.33\"/>";

/// As exported, a boundary that does nothing.
const BUBBLE: &str = "<float name=\"int_ior\" value=\"1\"/>\n        <float name=\"ext_ior\" value=\"1\"/>";

const BUBBLE_IN_WATER: &str = "<float name=\"int_ior\" value=\"1\"/>\n        <float name=\"ext_ior\" value=\"1.33\"/>";

/// A block of glass and a bubble in a block of water.
fn nested() -> ParityScene {
    let mut things = json!({"materials": paints(), "meshes": room(["white", "white", "red", "green", "white", "white"]),
        "lights": [ceiling_light(1.8)]});
    for (name, index) in [("water", 1.33), ("flint", 1.7), ("bubble", 1.0)] {
        things["materials"][name] = json!({"dielectric": {"index_of_refraction": index}});
    }
    let meshes = things["meshes"].as_array_mut().expect("meshes");
    meshes.push(block("tank", "water", [0.0, 0.2, 0.1], [0.7, 0.5, 1.0], 15.0));
    meshes.push(block("glass", "flint", [-0.25, 0.15, 0.3], [0.2, 0.15, 0.5], -25.0));
    meshes.push(block("air", "bubble", [0.3, 0.25, 0.4], [0.15, 0.2, 0.3], 40.0));
    let mut scene = ParityScene { samples: 64, our_samples: 64, ..ParityScene::new("nested", camera(), &things) };
    scene.description["integrator"]["path"]["max_depth"] = json!(40);
    scene.corrections = &[
        Fault { name: "glass in water", text: FLINT, fault: FLINT_IN_WATER },
        Fault { name: "a bubble in water", text: BUBBLE, fault: BUBBLE_IN_WATER },
    ];
    scene.fault = Some(Fault { name: "glass that is in air", text: FLINT_IN_WATER, fault: FLINT });
    scene
}

/// A dark floor below a pane of coloured crown glass below a large light, at incidence below 25 degrees. The
/// orthographic camera stands between floor and pane.
fn pane(integrator: &'static str) -> ParityScene {
    let crown = |centre: [f64; 2]| json!({"crown": {"centre": centre, "wavelength": 0.5, "amplitude": 2e-4}});
    let things = json!({
        "materials": {"dark": grey(0.2)},
        "meshes": [quad("floor", "dark", [-2.0, -2.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0])],
        "panes": [{"name": "pane", "centre": [0, 0, 3], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": 3.2,
            "height": 3.2, "thickness": 0.1, "absorption": [0.2, 0.6, 1.2],
            "front": crown([0.5, 0.1]), "back": crown([-1.0, 0.5])}],
        "lights": [{"rectangle": {"name": "panel", "centre": [0, 0, 7], "edge_u": [0, 5, 0], "edge_v": [5, 0, 0],
            "radiance": [3, 3, 3]}}]
    });
    let camera = json!({"orthographic":
        {"position": [0, 0, 2], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1.5}});
    let name = if integrator == "path" { "pane" } else { "pane by cone" };
    let mut scene = ParityScene::new(name, camera, &things);
    scene.description["integrator"] = json!({integrator: {"max_depth": 12}});
    scene.fault = Some(Fault { name: "a Fresnel term that counts twice", text: GLASS, fault: DARKER_GLASS });
    // Methods find what chance finds by many samples.
    (scene.samples, scene.our_samples) = (128, if integrator == "path" { 128 } else { 8 });
    scene
}

/// The box in parallel projection, in a wide picture.
fn orthographic() -> ParityScene {
    let camera = json!({"orthographic":
        {"position": [0.1, -0.95, 1], "look_at": [0, 1, 0.8], "up": [0.1, 0, 1], "height": 1.2}});
    let things = json!({"materials": paints(), "meshes": box_meshes(), "lights": [ceiling_light(0.6)],
        "film": {"width": 3, "height": 2}});
    ParityScene::new("orthographic", camera, &things)
}

/// Blocks on a floor, in a sun that is larger than the real one.
fn sun() -> ParityScene {
    let mut meshes = vec![quad("floor", "white", [-2.0, -2.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0])];
    meshes.push(block("tall", "red", [0.3, 0.3, 0.0], [0.25, 0.25, 1.1], 20.0));
    meshes.push(block("short", "green", [-0.4, -0.1, 0.0], [0.3, 0.25, 0.5], -15.0));
    let things = json!({"materials": paints(), "meshes": meshes, "lights": [
        {"sun": {"name": "sun", "direction": [-1, -0.5, 1.2], "angular_radius": 3, "radiance": [100, 90, 70]}}]});
    ParityScene::new("sun", camera(), &things)
}

/// Metals, polished and rough, one of them only in the squares of a picture.
fn metals() -> ParityScene {
    let mut things = json!({"materials": paints(), "meshes": room(["white", "white", "red", "green", "sheet", "white"]),
        "lights": [ceiling_light(1.2)]});
    let picture = |file: &str| json!({"file": file, "filter": "nearest", "wrap": ["mirror", "mirror"]});
    let materials = &mut things["materials"];
    materials["copper"] = json!({"conductor": {"reflectance": {"colour": [0.93, 0.6, 0.45]}, "roughness": 0.1}});
    materials["chrome"] = json!({"conductor": {"reflectance": {"colour": [1, 1, 1]}, "roughness": 0}});
    materials["sheet"] = json!({"metallic_roughness": {
        "base_colour": {"colour": [0.8, 0.5, 0.3]}, "roughness": 0.1, "specular": 0,
        "metallic": {"texture": picture("squares.png"), "channel": "blue"}}});
    let meshes = things["meshes"].as_array_mut().expect("meshes");
    meshes[4]["source"]["inline"]["texture_coordinates"] = json!([[0.2, -0.5], [2.2, -0.5], [2.2, 1.5], [0.2, 1.5]]);
    meshes.push(block("tall", "copper", [0.35, 0.3, 0.0], [0.25, 0.25, 1.1], 20.0));
    meshes.push(block("short", "chrome", [-0.4, 0.1, 0.0], [0.3, 0.25, 0.5], -15.0));
    let square = |x: u32, y: u32| Rgb([90, 20, if (x + y).is_multiple_of(2) { 255 } else { 51 * (x as u8 % 3) }]);
    let files = vec![("squares.png".to_owned(), png(4, 3, square))];
    ParityScene { files, samples: 64, our_samples: 64, ..ParityScene::new("metals", camera(), &things) }
}

/// A block of frosted glass below a large light.
fn rough_glass() -> ParityScene {
    let mut things = json!({"materials": paints(), "meshes": room(["white", "white", "red", "green", "white", "white"]),
        "lights": [ceiling_light(1.8)]});
    things["materials"]["frosted"] = json!({"rough_dielectric": {"index_of_refraction": 1.5, "roughness": 0.15}});
    let meshes = things["meshes"].as_array_mut().expect("meshes");
    meshes.push(block("block", "frosted", [0.1, 0.1, 0.4], [0.4, 0.3, 0.4], 25.0));
    let mut scene = ParityScene { samples: 64, our_samples: 64, ..ParityScene::new("rough glass", camera(), &things) };
    scene.description["integrator"]["path"]["max_depth"] = json!(16);
    scene
}

/// Sheets of tinted glass above a dark floor below a large light, as the pane.
fn window() -> ParityScene {
    let things = json!({
        "materials": {
            "dark": grey(0.2),
            "clear": {"thin_wall": {"index_of_refraction": 1.5}},
            "amber": {"thin_wall": {"tint": {"colour": [0.9, 0.6, 0.2]}}}},
        "meshes": [
            quad("floor", "dark", [-2.0, -2.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]),
            quad("clear", "clear", [-0.9, -1.6, 3.0], [2.5, 0.0, 0.1], [0.0, 3.2, 0.0]),
            quad("amber", "amber", [-1.6, -0.2, 3.3], [3.2, 0.0, 0.0], [0.0, 1.8, -0.1])],
        "lights": [{"rectangle": {"name": "panel", "centre": [0, 0, 7], "edge_u": [0, 5, 0], "edge_v": [5, 0, 0],
            "radiance": [3, 3, 3]}}]
    });
    let camera = json!({"orthographic":
        {"position": [0, 0, 2], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1.5}});
    ParityScene { samples: 64, our_samples: 64, ..ParityScene::new("window", camera, &things) }
}

/// Blocks on a floor under a picture of all directions, which is turned.
fn sky() -> ParityScene {
    let texel = |index: usize| {
        let (x, y) = ((index % 16) as f32 / 16.0, (index / 16) as f32 / 8.0);
        let sun = if index == 37 { 40.0 } else { 0.0 };
        [0.3 + x + sun, 0.8 - 0.5 * y + 0.9 * sun, 0.2 + x * y + 0.6 * sun]
    };
    let light = json!({"name": "sky", "radiance": {"picture": {"file": "sky.exr"}}, "scale": 1.5,
        "rotate": [20, -15, 70]});
    let mut scene = outdoors("sky", light);
    scene.files = vec![("sky.exr".to_owned(), exr(16, 8, texel))];
    scene
}

/// The same under an even sky.
fn overcast() -> ParityScene {
    outdoors("overcast", json!({"name": "sky", "radiance": {"colour": [0.9, 1, 1.2]}}))
}

fn outdoors(name: &'static str, environment: Value) -> ParityScene {
    let mut meshes = vec![quad("floor", "white", [-2.0, -2.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0])];
    meshes.push(block("tall", "red", [0.3, 0.3, 0.0], [0.25, 0.25, 1.1], 20.0));
    meshes.push(block("short", "green", [-0.4, -0.1, 0.0], [0.3, 0.25, 0.5], -15.0));
    let things = json!({"materials": paints(), "meshes": meshes, "lights": [{"environment": environment}]});
    ParityScene::new(name, camera(), &things)
}

/// A matt material of glTF in the form of scene files, with other members.
fn matt(members: &Value) -> Value {
    let mut settings = json!({"metallic": 0, "specular": 0, "base_colour": {"colour": [0.7, 0.6, 0.5]},
        "soft_terminator": false});
    settings.as_object_mut().expect("members").extend(members.as_object().expect("members").clone());
    json!({"metallic_roughness": settings})
}

/// A screen with holes, and one that is half there, below a large light.
fn cut_out() -> ParityScene {
    let mut things = json!({"materials": paints(), "meshes": room(["white", "white", "red", "green", "white", "white"]),
        "lights": [ceiling_light(0.8)]});
    let holes = json!({"texture": {"file": "holes.png", "filter": "nearest"}, "channel": "alpha"});
    things["materials"]["screen"] = matt(&json!({"opacity": holes, "opacity_threshold": 0.5}));
    things["materials"]["veil"] = matt(&json!({"opacity": 0.35}));
    let meshes = things["meshes"].as_array_mut().expect("meshes");
    let mut screen = quad("screen", "screen", [-0.9, 0.1, 0.5], [1.6, 0.2, 0.0], [0.0, 0.5, 0.6]);
    screen["source"]["inline"]["texture_coordinates"] = json!([[0, 0], [2, 0], [2, 1.5], [0, 1.5]]);
    meshes.push(screen);
    meshes.push(quad("veil", "veil", [-0.3, -0.2, 0.2], [1.0, 0.3, 0.1], [0.0, 0.4, 0.9]));
    let mut scene = ParityScene::new("cut out", camera(), &things);
    let picture = ImageBuffer::from_fn(4, 3, |x, y| Rgba([0, 0, 0, if (x + 2 * y) % 3 == 0 { 40 } else { 220_u8 }]));
    let mut png = Cursor::new(Vec::new());
    picture.write_to(&mut png, ImageFormat::Png).expect("a PNG");
    scene.files = vec![("holes.png".to_owned(), png.into_inner())];
    scene.fault = Some(Fault {
        name: "a veil that is more there",
        text: "<float name=\"opacity\" value=\"0.35\"/>",
        fault: "<float name=\"opacity\" value=\"0.5\"/>",
    });
    // Mitsuba counts what is not there as a vertex: paths are as long as light lasts.
    scene.description["integrator"]["path"]["max_depth"] = json!(60);
    (scene.samples, scene.our_samples) = (64, 64);
    scene
}

/// Walls with a normal map, of which direct light is seen: where normals lean away from the viewer, renderers differ.
fn relief() -> ParityScene {
    let mut things = json!({"materials": paints(), "meshes": room(["brick", "white", "red", "green", "brick", "white"]),
        "lights": [ceiling_light(0.8)]});
    things["materials"]["brick"] = matt(&json!({"normal_map": {"texture": {"file": "relief.png"}}}));
    for wall in [0, 4] {
        things["meshes"][wall]["source"]["inline"]["texture_coordinates"] = json!([[0, 0], [2, 0], [2, 2], [0, 2]]);
    }
    let mut scene = ParityScene::new("relief", camera(), &things);
    scene.description["integrator"]["path"]["max_depth"] = json!(1);
    let texel = |x: u32, y: u32| Rgb([(98 + 20 * x) as u8, (158 - 30 * y) as u8, 240]);
    scene.files = vec![("relief.png".to_owned(), png(4, 3, texel))];
    scene.fault = Some(Fault {
        name: "a normal map that is mirrored instead of repeated",
        text: "<string name=\"wrap_mode\" value=\"repeat\"/>",
        fault: "<string name=\"wrap_mode\" value=\"mirror\"/>",
    });
    scene
}

/// The bytes of a picture of 8 bits.
pub(super) fn png(width: u32, height: u32, texel: impl Fn(u32, u32) -> Rgb<u8>) -> Vec<u8> {
    let mut png = Cursor::new(Vec::new());
    ImageBuffer::from_fn(width, height, texel).write_to(&mut png, ImageFormat::Png).expect("a PNG");
    png.into_inner()
}

/// The bytes of a picture of floats.
fn exr(width: u32, height: u32, texel: impl Fn(usize) -> [f32; 3]) -> Vec<u8> {
    let mean = (0..(width * height) as usize).map(texel).collect();
    let layers = ImageLayers { mean, ..ImageLayers::default() };
    FrameImage::new(width, height, layers, None).expect("a picture").encode().expect("an EXR file")
}
