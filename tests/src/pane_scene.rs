//! Small scenes for tests of laws: panes between a light and a flat white receiver, and the light that a method finds
//! there.
//!
//! The receiver lies at `z = -distance` and looks along +z; panes hang at `z >= 0`. Only the light that comes through
//! panes is rendered.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::geometry::SurfaceId;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::Asset;
use clerestory_render_core::scene::ShadingPoint;
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use crate::estimate::Estimate;
use crate::rendering::block_means;

/// Panes between a light and a receiver.
#[derive(Clone, Debug)]
pub struct PaneScene {
    /// The panes, as in a scene file.
    pub panes: Vec<Value>,
    /// The lights, as in a scene file.
    pub lights: Vec<Value>,
    /// Height maps by the names of their files.
    pub assets: BTreeMap<String, Asset>,
    /// From the receiver to the plane `z = 0`, metres.
    pub distance: f64,
    /// Half the edge of the receiver, metres.
    pub reach: f64,
    /// Middle of the picture on the receiver, metres.
    pub centre: [f64; 2],
    /// Edge of the picture on the receiver, metres.
    pub edge: f64,
    /// Pixels along an edge of the picture.
    pub pixels: u32,
    /// Light path expression of what is rendered.
    pub filter: &'static str,
    /// Seed of every random number; estimates with different seeds are independent.
    pub seed: u64,
}

/// Edge of a picture that shows one point, as a part of the distance.
const POINT: f64 = 1e-9;

impl PaneScene {
    /// The light through `panes` at the receiver's point below their middle.
    pub fn new(panes: Vec<Value>, light: Value) -> Self {
        let assets = BTreeMap::new();
        let filter = "D TT L";
        Self {
            panes,
            lights: vec![light],
            assets,
            distance: 1.0,
            reach: 10.0,
            centre: [0.0; 2],
            edge: POINT,
            pixels: 8,
            filter,
            seed: 17,
        }
    }

    /// The same, with a picture of one point: `x` and `y` of the receiver.
    #[must_use]
    pub fn at(self, centre: [f64; 2]) -> Self {
        let edge = POINT * self.distance;
        Self { centre, edge, ..self }
    }

    /// The scene for an integrator, with independent passes of `samples` samples in each pixel.
    ///
    /// # Panics
    ///
    /// When the scene is not valid.
    pub fn build(&self, integrator: &Value, samples: u32) -> PreparedScene {
        PreparedScene::build(&self.bundle(integrator, samples)).expect("a scene that can be built")
    }

    /// As [`Self::build`], not yet built.
    ///
    /// # Panics
    ///
    /// When the scene is not valid.
    pub fn bundle(&self, integrator: &Value, samples: u32) -> SceneBundle {
        let ([x, y], reach, depth) = (self.centre, self.reach, -self.distance);
        let description = json!({
            "version": 1, "name": "law", "seed": self.seed,
            "film": {"width": self.pixels, "height": self.pixels},
            "camera": {"orthographic": {
                "position": [x, y, 0.9 * depth], "look_at": [x, y, depth], "up": [0, 1, 0], "height": self.edge}},
            "sampling": {"samples_per_pass": samples, "samples_per_block": samples},
            "integrator": integrator,
            "path_filter": self.filter,
            "materials": {"white": {"diffuse": {"reflectance": {"colour": [1, 1, 1]}}}},
            "meshes": [{"name": "receiver", "material": "white", "source": {"inline": {
                "positions": [
                    [-reach, -reach, depth], [reach, -reach, depth], [reach, reach, depth], [-reach, reach, depth]],
                "triangles": [[0, 1, 2], [0, 2, 3]]}}}],
            "panes": self.panes,
            "lights": self.lights,
        });
        let description = SceneDescription::parse(description.to_string().as_bytes()).expect("a valid scene");
        SceneBundle::from_parts(description, self.assets.clone()).expect("a complete scene")
    }

    /// Irradiance in W/m2 of the red channel, from `passes` independent passes: for `cells` by `cells` equal squares of
    /// the picture, row by row.
    ///
    /// # Panics
    ///
    /// When the scene is not valid.
    pub fn irradiance(&self, integrator: &Value, samples: u32, passes: u32, cells: usize) -> Vec<Estimate> {
        // The receiver is white.
        let radiance = block_means(&self.build(integrator, samples), passes, cells);
        radiance.iter().map(|radiance| radiance.scaled(PI)).collect()
    }

    /// The irradiance over the whole picture.
    ///
    /// # Panics
    ///
    /// When the scene is not valid.
    pub fn mean_irradiance(&self, integrator: &Value, samples: u32, passes: u32) -> Estimate {
        self.irradiance(integrator, samples, passes, 1)[0]
    }

    /// A point of the receiver.
    pub fn point(&self, [x, y]: [f64; 2]) -> ShadingPoint {
        let position = DVec3::new(x, y, -self.distance);
        ShadingPoint { position, normal: DVec3::Z, surface: SurfaceId::Triangle(0), bounces: 0 }
    }
}

/// One estimate, by the scene's specular method, of the light at a point over all chains of the method. Each piece is a
/// direction, and radiance times solid angle in W/m2 of the red channel. Other streams are independent.
///
/// # Panics
///
/// When the scene's integrator is the path tracer alone.
pub fn gather(scene: &PreparedScene, point: &ShadingPoint, stream: u32, counters: &mut Counters) -> Vec<(DVec3, f64)> {
    let method = scene.method().expect("a specular method");
    let settings = SamplerSettings { seed: 5, samples_per_block: 1 };
    let mut stream = SampleStream::new(&settings, 0, [0, 0], stream);
    let mut arrivals = Vec::new();
    for light in (0u32..).take(scene.scene().lights().len()) {
        for events in method.chains() {
            method.sample_li(scene.scene(), point, light, &events, &mut stream, counters, &mut |arrival| {
                arrivals.push((arrival.direction, arrival.weight.x));
            });
        }
    }
    arrivals
}

/// A pane of `size` metres around `centre` whose x axis is the world's, seen from the receiver in front.
pub fn pane(name: &str, centre: [f64; 3], size: [f64; 2], thickness: f64, faces: [Value; 2]) -> Value {
    let [front, back] = faces;
    json!({
        "name": name, "centre": centre, "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": size[0], "height": size[1],
        "thickness": thickness, "index_of_refraction": INDEX, "front": front, "back": back,
    })
}

/// Index of refraction of all panes here.
pub const INDEX: f64 = 1.5;

/// A height map of `size` metres with `columns` by `rows` coefficients, as a file: `height` at the coefficients'
/// places.
///
/// # Panics
///
/// When it cannot be encoded.
pub fn height_map(size: [f64; 2], [columns, rows]: [usize; 2], height: impl Fn(DVec2) -> f64) -> Asset {
    let along = |index: usize, count: usize, size: f64| ((index as f64 + 0.5) / count as f64 - 0.5) * size;
    let place = |k: usize| DVec2::new(along(k % columns, columns, size[0]), along(k / columns, rows, size[1]));
    let values: Vec<f32> = (0..columns * rows).map(|k| height(place(k)) as f32).collect();
    let channels = AnyChannels::sort([AnyChannel::new("Y", FlatSamples::F32(values))].into_iter().collect());
    let layer = Layer::new((columns, rows), LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).expect("memory can be written");
    Asset::new(bytes.into_inner())
}
