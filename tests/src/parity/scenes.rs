//! Scenes that both renderers can render: every light, material and camera that is exported.
//!
//! What models differ in is left out by construction. Light of points through glass is found by us alone. Mitsuba moves
//! rays off surfaces by some 0.1 mm, which shortens their way. So the pane is large and thick, and absorbs little.

use std::collections::BTreeMap;
use std::io::Cursor;

use clerestory_film::{FrameImage, ImageLayers};
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::Asset;
use image::{ImageBuffer, ImageFormat, Rgb};
use serde_json::{Value, json};

use super::mitsuba::Fault;

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
            pane("path"),
            pane("cone"),
            orthographic(),
            sun(),
        ]
    }

    /// Those that are enough to see that export works, and that a fault is noticed.
    pub fn few() -> Vec<Self> {
        vec![furnace(), textures(), pane("cone")]
    }

    fn new(name: &'static str, camera: Value, things: &Value) -> Self {
        let mut description = json!({
            "version": 2, "name": name, "film": {"width": 1, "height": 1}, "camera": camera,
            "integrator": {"path": {"max_depth": 8}},
        });
        for (member, value) in things.as_object().into_iter().flatten() {
            description[member] = value.clone();
        }
        Self { name, description, files: Vec::new(), samples: 32, our_samples: 32, fault: None }
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

/// The materials of the box.
fn paints() -> Value {
    json!({
        "white": {"diffuse": {"reflectance": {"colour": [0.73, 0.7, 0.65]}}},
        "red": {"diffuse": {"reflectance": {"colour": [0.63, 0.06, 0.05]}}},
        "green": {"diffuse": {"reflectance": {"colour": [0.14, 0.45, 0.09]}}}
    })
}

/// A box with coloured walls and two blocks.
fn box_meshes() -> Vec<Value> {
    let mut meshes = room(["white", "white", "red", "green", "white", "white"]);
    meshes.push(block("tall", "white", [0.3, 0.3, 0.0], [0.25, 0.25, 1.1], 20.0));
    meshes.push(block("short", "white", [-0.4, -0.1, 0.0], [0.3, 0.25, 0.5], -15.0));
    meshes
}

fn ceiling_light(edge: f64) -> Value {
    json!({"rectangle": {"name": "panel", "centre": [0, 0, 1.98], "edge_u": [0, edge, 0], "edge_v": [edge, 0, 0],
        "radiance": [10, 9, 7]}})
}

fn cornell_box() -> ParityScene {
    let things = json!({"materials": paints(), "meshes": box_meshes(), "lights": [ceiling_light(0.6)]});
    ParityScene::new("box", camera(), &things)
}

/// One light of each kind that is somewhere. Mitsuba chooses one of them for each vertex.
fn lamps() -> ParityScene {
    let lights = json!([
        {"sphere": {"name": "globe", "centre": [-0.5, 0.4, 1.5], "radius": 0.15, "radiance": [12, 8, 4]}},
        {"disk": {"name": "spot", "centre": [0.2, 0.98, 1.5], "normal": [0, -1, 0], "radius": 0.3,
            "radiance": [2, 4, 8]}},
        {"point": {"name": "bulb", "position": [0.6, -0.5, 1.4], "intensity": [0.5, 0.6, 0.4]}},
        ceiling_light(0.3)
    ]);
    let things = json!({"materials": paints(), "meshes": box_meshes(), "lights": lights});
    ParityScene { samples: 64, our_samples: 64, ..ParityScene::new("lamps", camera(), &things) }
}

/// Pictures that have no symmetry: 8-bit sRGB, repeated, on the floor, and linear on the walls.
fn textures() -> ParityScene {
    let textured = |file: &str| json!({"diffuse": {"reflectance": {"texture": {"file": file}}}});
    let mut things = json!({"materials": paints(), "meshes": room(["tiles", "white", "red", "green", "mural", "white"]),
        "lights": [ceiling_light(1.0)]});
    things["materials"]["tiles"] = textured("tiles.png");
    things["materials"]["mural"] = textured("mural.exr");
    things["meshes"][0]["source"]["inline"]["texture_coordinates"] =
        json!([[0.1, 0.2], [2.6, 0.2], [2.6, 2.9], [0.1, 2.9]]);
    things["meshes"][4]["source"]["inline"]["texture_coordinates"] = json!([[0, 0], [1, 0], [1, 1], [0, 1]]);
    let mut scene = ParityScene::new("textures", camera(), &things);
    let tile = |x: u32, y: u32| {
        Rgb([(40 + 50 * x) as u8, (230 - 60 * y) as u8, if (x, y) == (0, 0) { 250 } else { (30 * (x + y)) as u8 }])
    };
    let mut png = Cursor::new(Vec::new());
    ImageBuffer::from_fn(4, 3, tile).write_to(&mut png, ImageFormat::Png).expect("a PNG");
    let mural = (0..15_u8).map(|index| {
        let (x, y) = (f32::from(index % 5) / 5.0, f32::from(index / 5) / 3.0);
        [0.1 + 0.8 * x, 0.9 - 0.7 * y, 0.5 * x * y + 0.05]
    });
    let layers = ImageLayers { mean: mural.collect(), ..ImageLayers::default() };
    let mural = FrameImage::new(5, 3, layers, None).expect("a picture").encode().expect("an EXR file");
    scene.files = vec![("tiles.png".to_owned(), png.into_inner()), ("mural.exr".to_owned(), mural)];
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

/// A floor below a pane of coloured crown glass below a large light, at incidence below 25 degrees. The orthographic
/// camera stands between floor and pane.
fn pane(integrator: &'static str) -> ParityScene {
    let crown = |centre: [f64; 2]| json!({"crown": {"centre": centre, "wavelength": 0.5, "amplitude": 2e-4}});
    let things = json!({
        "materials": {"white": grey(0.8)},
        "meshes": [quad("floor", "white", [-2.0, -2.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0])],
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

/// A camera inside the room that looks along y.
fn camera() -> Value {
    json!({"perspective":
        {"position": [0.05, -0.95, 1.1], "look_at": [0, 1, 0.9], "up": [0, 0, 1], "vertical_field_of_view": 65}})
}

fn grey(reflectance: f64) -> Value {
    json!({"diffuse": {"reflectance": {"colour": [reflectance, reflectance, reflectance]}}})
}

/// Six walls around [-1, 1] x [-1, 1] x [0, 2]: floor, ceiling, left, right, back and front.
fn room(materials: [&str; 6]) -> Vec<Value> {
    let [floor, ceiling, left, right, back, front] = materials;
    let [x, y, z] = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
    vec![
        quad("floor", floor, [-1.0, -1.0, 0.0], x, y),
        quad("ceiling", ceiling, [-1.0, -1.0, 2.0], y, x),
        quad("left", left, [-1.0, -1.0, 0.0], y, z),
        quad("right", right, [1.0, -1.0, 0.0], z, y),
        quad("back", back, [-1.0, 1.0, 0.0], x, z),
        quad("front", front, [-1.0, -1.0, 0.0], z, x),
    ]
}

/// A parallelogram, counterclockwise along u and v.
fn quad(name: &str, material: &str, corner: [f64; 3], u: [f64; 3], v: [f64; 3]) -> Value {
    let at = |i: f64, j: f64| [0, 1, 2].map(|axis| corner[axis] + i * u[axis] + j * v[axis]);
    json!({"name": name, "material": material, "source": {"inline": {
        "positions": [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)],
        "triangles": [[0, 1, 2], [0, 2, 3]]}}})
}

/// A block of half the width and depth, and the height, turned about its vertical axis. Its normals point outwards.
fn block(name: &str, material: &str, foot: [f64; 3], [width, depth, height]: [f64; 3], turn: f64) -> Value {
    let corner = |index: usize| {
        let side = |bit: usize| if index >> bit & 1 == 1 { 1.0 } else { -1.0 };
        [side(0) * width, side(1) * depth, if index >> 2 & 1 == 1 { height } else { 0.0 }]
    };
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[usize; 3]> = sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    json!({"name": name, "material": material, "rotate": [0, 0, turn], "translate": foot, "source": {"inline": {
        "positions": (0..8).map(corner).collect::<Vec<_>>(), "triangles": triangles}}})
}
