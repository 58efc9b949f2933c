//! Parts of a picture for which errors are stated apart.

use std::collections::BTreeMap;

use clerestory_film::counters::Counters;
use clerestory_film::{FrameImage, ImageLayers};
use clerestory_render_core::geometry::{Surface, SurfaceId};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::Source;
use clerestory_render_core::scene::ShadingPoint;
use glam::DVec2;

use crate::error::ExperimentError;

/// Some pixels of a picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Region {
    pub(crate) name: String,
    /// Indices of its pixels, in rows from the top left.
    pub(crate) pixels: Vec<usize>,
}

/// Where the straight line from a surface point to a light leads first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Way {
    /// To this pane.
    Pane(u32),
    /// To something opaque.
    Blocked,
    /// To the light; or the pixel shows no surface.
    Open,
}

impl Region {
    /// All pixels.
    pub(crate) fn whole(image: &FrameImage) -> Self {
        let pixels = image.layers().mean.len();
        Self { name: "whole picture".to_owned(), pixels: (0..pixels).collect() }
    }

    /// The picture cut into the neighbourhoods of the panes' caustics. A pixel belongs to the pane whose straight-line
    /// shadow has the nearest middle (the "approximate caustic area" of Huan et al. 2023, section 3.3). Panes that
    /// throw no light into the picture have no region.
    pub(crate) fn of_panes(scene: &PreparedScene) -> Vec<Self> {
        let width = scene.description().film.width;
        let place = |index: usize| DVec2::new((index % width as usize) as f64, (index / width as usize) as f64);
        let mut sums: BTreeMap<u32, (DVec2, f64)> = BTreeMap::new();
        let ways = ways(scene);
        for (index, way) in ways.iter().enumerate() {
            if let Way::Pane(pane) = way {
                let (sum, count) = sums.entry(*pane).or_default();
                *sum += place(index);
                *count += 1.0;
            }
        }
        let centres: Vec<(u32, DVec2)> = sums.into_iter().map(|(pane, (sum, count))| (pane, sum / count)).collect();
        let mut regions: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for index in 0..ways.len() {
            let distance = |centre: DVec2| (centre - place(index)).length_squared();
            let nearest =
                centres.iter().min_by(|(_, first), (_, second)| distance(*first).total_cmp(&distance(*second)));
            if let Some((pane, _)) = nearest {
                regions.entry(*pane).or_default().push(index);
            }
        }
        let name = |pane: u32| scene.scene().panes()[pane as usize].name.clone();
        regions.into_iter().map(|(pane, pixels)| Self { name: name(pane), pixels }).collect()
    }

    /// The picture cut into the straight-line shadow of the panes and the rest: where light would fall without
    /// refraction, and where it bleeds to.
    pub(crate) fn by_straight_line(scene: &PreparedScene) -> Vec<Self> {
        let ways = ways(scene);
        let of = |name: &str, is_wanted: fn(&Way) -> bool| Self {
            name: name.to_owned(),
            pixels: (0..ways.len()).filter(|&pixel| is_wanted(&ways[pixel])).collect(),
        };
        vec![
            of("straight line through a pane", |way| matches!(way, Way::Pane(_))),
            of("straight line blocked", |way| matches!(way, Way::Blocked)),
        ]
    }

    /// Its pixels of an image, as an image of one row.
    pub(crate) fn of(&self, image: &FrameImage) -> Result<FrameImage, ExperimentError> {
        let layers = image.layers();
        let picked = |layer: &Vec<[f32; 3]>| self.pixels.iter().map(|&pixel| layer[pixel]).collect();
        let layers = ImageLayers {
            mean: picked(&layers.mean),
            standard_error: layers.standard_error.as_ref().map(picked),
            ..ImageLayers::default()
        };
        FrameImage::new(self.pixels.len() as u32, 1, layers, None).map_err(ExperimentError::BadImage)
    }
}

/// The way of every pixel's middle to the first light that any pixel sees through a pane.
fn ways(scene: &PreparedScene) -> Vec<Way> {
    let (centre, radius) = scene.scene().specular_ball();
    let of_light = |light: &clerestory_render_core::light::Light| {
        // Somewhere on the side that faces the panes: the middle, of most lights.
        let sample = light.sample_source(centre, radius, DVec2::splat(0.5));
        let source = (sample.source, sample.triangle);
        points(scene).into_iter().map(|point| way(scene, point.as_ref(), source)).collect::<Vec<Way>>()
    };
    let mut lights = scene.scene().lights().iter().map(of_light);
    let is_seen = |ways: &Vec<Way>| ways.iter().any(|way| matches!(way, Way::Pane(_)));
    lights.find(is_seen).unwrap_or_else(|| vec![Way::Open; pixels(scene)])
}

fn pixels(scene: &PreparedScene) -> usize {
    let film = scene.description().film;
    film.width as usize * film.height as usize
}

fn way(scene: &PreparedScene, point: Option<&ShadingPoint>, source: (Source, Option<u32>)) -> Way {
    let counters = &mut Counters::default();
    let Some(point) = point else { return Way::Open };
    match scene.scene().first_pane_towards(point, source, counters) {
        Some(pane) => Way::Pane(pane),
        None if scene.scene().is_blocked_towards(point, source, counters) => Way::Blocked,
        None => Way::Open,
    }
}

/// The surface that the middle of each pixel shows, if it is no pane.
pub(crate) fn points(scene: &PreparedScene) -> Vec<Option<ShadingPoint>> {
    let film = scene.description().film;
    let middle = |x: u32, y: u32| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    let places = (0..film.height).flat_map(|y| (0..film.width).map(move |x| middle(x, y)));
    places.map(|place| point(scene, place)).collect()
}

fn point(scene: &PreparedScene, pixel: DVec2) -> Option<ShadingPoint> {
    let ray = scene.scene().camera().ray(pixel);
    let hit =
        scene.scene().accelerator().closest_hit(&ray, f64::INFINITY, SurfaceId::Nothing, &mut Counters::default())?;
    let Surface::Triangle { index, .. } = hit.surface else { return None };
    let geometric = scene.scene().triangle_normal(index);
    let normal = if geometric.dot(ray.direction) > 0.0 { -geometric } else { geometric };
    let ray_origin = SurfaceId::Triangle(index);
    Some(ShadingPoint { position: ray.at(hit.distance), normal, surface: ray_origin, bounces: 0 })
}
