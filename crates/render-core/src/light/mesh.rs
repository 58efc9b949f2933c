//! A mesh of the scene that shines.
//!
//! The light is one thing with a name, however many triangles shine. A tree over its triangles, like that over lights,
//! chooses one for a point of a surface. Rays meet the light among the surfaces of the scene: its triangles are not
//! tested twice, and it scatters light as other surfaces do.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::assets::{LightAssets, ShiningSurface};
use super::{
    Body, Chosen, Cluster, EmissionCone, Emitter, LiSample, LightBounds, LightHit, LightSettings, LightTree, Receiver,
    Source, SourceSample,
};
use crate::exchange::{ColourModel, LightModel, TextureModel};
use crate::geometry::{Ray, ShearedRay};
use crate::settings::check::{check_name, check_triple};
use crate::settings::limits::MAX_EMISSION;
use crate::settings::{Check, JsonPath, Triple};
use crate::texture::{Bitmaps, Encoding, MappedPicture, TextureDescription, TextureUse};

/// A mesh of the scene that shines to both of its sides. It scatters light as its material says, besides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct MeshLight {
    /// A short name, used in messages; no two lights share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Name of the mesh; no two lights share one.
    pub mesh: String,
    /// Emitted radiance, W/(m2 sr).
    #[schemars(inner(range(min = 0.0)))]
    pub radiance: Triple,
    /// A picture by which radiance is multiplied.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub texture: Option<Box<TextureDescription>>,
}

impl LightSettings for MeshLight {
    fn name(&self) -> &str {
        &self.name
    }

    fn place(&self) -> Option<&'static str> {
        None
    }

    fn mesh(&self) -> Option<&str> {
        Some(&self.mesh)
    }

    fn texture(&self) -> Option<TextureUse<'_>> {
        let texture = self.texture.as_deref()?;
        Some(TextureUse { place: "texture".to_owned(), texture, encoding: Encoding::Colour })
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_name(&self.mesh, &path.member("mesh"))?;
        check_triple(self.radiance, 0.0, MAX_EMISSION, &path.member("radiance"))?;
        self.texture.as_ref().map_or(Ok(()), |texture| texture.check(&path.member("texture")))
    }

    fn model(&self, bitmaps: &Bitmaps<'_>) -> Option<LightModel> {
        let radiance = match &self.texture {
            Some(texture) => {
                let picture = texture.build(Encoding::Colour, bitmaps);
                let radiance = DVec3::from(self.radiance) * picture.factor;
                ColourModel::Texture(TextureModel::of(&MappedPicture { factor: radiance, ..picture }, None))
            }
            None => ColourModel::Colour(self.radiance),
        };
        Some(LightModel::Mesh { mesh: self.mesh.clone(), radiance })
    }

    fn build(&self, assets: &LightAssets) -> Arc<dyn Emitter> {
        let surface = assets.surfaces.get(&self.mesh).expect("every mesh that shines is there before lights are built");
        Arc::new(ShiningMesh::new(surface.clone(), self.radiance.into()))
    }
}

/// Points along an edge of a triangle at which a picture is looked up for its power.
const POINTS: u32 = 6;

/// The least part of the radiance that a triangle counts with: its picture may be bright between those points.
const LEAST_PART: f64 = 0.01;

/// A ray that begins on a triangle meets it no more than this part of its edge away.
const BEGINNING: f64 = 1e-9;

/// A mesh that shines.
#[derive(Debug)]
struct ShiningMesh {
    surface: Arc<ShiningSurface>,
    /// Emitted radiance, W/(m2 sr), where the picture is white.
    radiance: DVec3,
    /// Over the triangles.
    tree: LightTree,
    /// For each triangle, the area of all triangles up to it, square metres.
    areas: Vec<f64>,
    /// W.
    power: f64,
    cone: EmissionCone,
    bounding_box: [DVec3; 2],
    /// Around the middle of the box, metres.
    radius: f64,
}

impl ShiningMesh {
    fn new(surface: Arc<ShiningSurface>, radiance: DVec3) -> Self {
        let cluster = |(number, corners): (usize, &[DVec3; 3])| {
            let [a, b, c] = *corners;
            let cross = doubled_area(corners);
            let area = 0.5 * cross.length();
            let (min, max) = (a.min(b).min(c), a.max(b).max(c));
            let power = 2.0 * PI * area * ((radiance * mean_part(&surface, number)).element_sum() / 3.0);
            let cone = EmissionCone::from_both_sides(cross.normalize());
            Cluster { min, max, power, cone, radius: 0.5 * (max - min).length(), can_be_met: true }
        };
        let clusters: Vec<Cluster> = surface.corners.iter().enumerate().map(cluster).collect();
        let add = |sum: &mut f64, corners: &[DVec3; 3]| {
            *sum += 0.5 * doubled_area(corners).length();
            Some(*sum)
        };
        let tree = LightTree::over(clusters.into_iter().map(Some));
        let whole = tree.root().expect("a mesh has triangles");
        let [min, max] = [whole.min, whole.max];
        let middle = 0.5 * (min + max);
        let corners = surface.corners.iter().flatten();
        let radius = corners.map(|corner| corner.distance_squared(middle)).fold(0.0, f64::max).sqrt();
        Self {
            radiance,
            areas: surface.corners.iter().scan(0.0, add).collect(),
            power: whole.power,
            cone: whole.cone,
            bounding_box: [min, max],
            radius,
            tree,
            surface,
        }
    }

    fn middle(&self) -> DVec3 {
        let [min, max] = self.bounding_box;
        0.5 * (min + max)
    }

    /// Square metres.
    fn area(&self) -> f64 {
        self.areas.last().copied().unwrap_or(0.0)
    }

    /// The number of a triangle of the scene in this mesh.
    fn number(&self, hit: &LightHit) -> Option<usize> {
        let number = hit.triangle?.checked_sub(self.surface.first_triangle)? as usize;
        (number < self.surface.corners.len()).then_some(number)
    }

    fn radiance(&self, number: usize, barycentric: [f64; 2]) -> DVec3 {
        self.radiance * self.surface.part_of_radiance(number, barycentric)
    }

    /// The mean radiance over all rays that may meet a point, whether the surface is there for them or not.
    fn mean_radiance(&self, number: usize, barycentric: [f64; 2]) -> DVec3 {
        self.radiance(number, barycentric) * self.surface.opacity(number, barycentric)
    }

    fn triangle(&self, number: usize) -> u32 {
        self.surface.first_triangle + number as u32
    }
}

/// The vector along the normal of a triangle, twice as long as its area.
fn doubled_area([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (*b - *a).cross(*c - *a)
}

/// The weights of the second and the third corner of a point that is uniform over a triangle.
fn uniform(random: DVec2) -> [f64; 2] {
    let root = random.x.sqrt();
    [root * (1.0 - random.y), root * random.y]
}

fn at([a, b, c]: &[DVec3; 3], [v, w]: [f64; 2]) -> DVec3 {
    *a * (1.0 - v - w) + *b * v + *c * w
}

/// About the mean over a triangle of the picture by which radiance is multiplied.
fn mean_part(surface: &ShiningSurface, number: usize) -> DVec3 {
    if surface.picture.is_none() {
        return DVec3::ONE;
    }
    let place = |step: u32| (f64::from(step) + 1.0 / 3.0) / f64::from(POINTS);
    let points = (0..POINTS).flat_map(|row| (0..POINTS - row).map(move |column| [place(row), place(column)]));
    let (sum, count) = points
        .fold((DVec3::ZERO, 0.0), |(sum, count), point| (sum + surface.part_of_radiance(number, point), count + 1.0));
    (sum / count).max(DVec3::splat(LEAST_PART))
}

impl Emitter for ShiningMesh {
    fn emission(&self) -> DVec3 {
        self.radiance
    }

    fn power(&self) -> f64 {
        self.power
    }

    fn emission_cone(&self) -> EmissionCone {
        self.cone
    }

    fn bounds(&self) -> LightBounds {
        LightBounds::Ball { centre: self.middle(), radius: self.radius }
    }

    fn bounding_box(&self) -> Option<[DVec3; 2]> {
        Some(self.bounding_box)
    }

    fn body(&self) -> Option<Body> {
        None
    }

    fn triangles(&self) -> Option<std::ops::Range<u32>> {
        Some(self.surface.first_triangle..self.triangle(self.surface.corners.len()))
    }

    fn radiance_at(&self, triangle: u32, barycentric: [f64; 2]) -> DVec3 {
        self.radiance((triangle - self.surface.first_triangle) as usize, barycentric)
    }

    fn largest_solid_angle(&self, [min, max]: [DVec3; 2]) -> Option<f64> {
        let whole = 4.0 * PI;
        let distance = self.middle().distance(self.middle().clamp(min, max));
        let nearest = distance - self.radius;
        if nearest <= 0.0 {
            return Some(whole);
        }
        // No more than all its triangles seen head on, or the ball around them.
        let sine = self.radius / distance;
        let ball = 2.0 * PI * (1.0 - (1.0 - sine * sine).max(0.0).sqrt());
        Some((self.area() / (nearest * nearest)).min(ball))
    }

    /// Uniform over the area.
    fn sample_source(&self, _: DVec3, _: f64, random: DVec2) -> SourceSample {
        let target = random.x * self.area();
        let number = self.areas.partition_point(|area| *area <= target).min(self.areas.len() - 1);
        let before = if number > 0 { self.areas[number - 1] } else { 0.0 };
        let rest = ((target - before) / (self.areas[number] - before)).clamp(0.0, 1.0);
        let (corners, weights) = (&self.surface.corners[number], uniform(DVec2::new(rest, random.y)));
        SourceSample {
            source: Source::Point(at(corners, weights)),
            normal: Some(doubled_area(corners).normalize()),
            triangle: Some(self.triangle(number)),
            weight: self.mean_radiance(number, weights) * self.area(),
        }
    }

    fn source_density(&self, _: DVec3, _: f64, _: Source) -> f64 {
        1.0 / self.area()
    }

    fn source_at(&self, ray: &Ray, hit: &LightHit) -> (Source, f64) {
        let source = Source::Point(ray.at(hit.distance));
        (source, self.normal_at(source, hit).map_or(0.0, |normal| normal.dot(ray.direction).abs()))
    }

    fn normal_at(&self, _: Source, hit: &LightHit) -> Option<DVec3> {
        Some(doubled_area(&self.surface.corners[self.number(hit)?]).normalize())
    }

    fn sample_li(&self, receiver: &Receiver, random: DVec2) -> Option<LiSample> {
        let Chosen { light: number, probability, rest } = self.tree.choose(receiver, random.x)?;
        let (number, weights) = (number as usize, uniform(DVec2::new(rest, random.y)));
        let corners = &self.surface.corners[number];
        let offset = at(corners, weights) - receiver.position;
        let distance_squared = offset.length_squared();
        let distance = distance_squared.sqrt();
        let direction = offset / distance;
        let solid_angle = 0.5 * doubled_area(corners).dot(direction).abs() / distance_squared;
        // A light that is too far or too small for a density sends nothing.
        if !solid_angle.is_normal() {
            return None;
        }
        // The hierarchy over the scene finds the triangle at the same distance, so it does not stand before itself.
        let met = ShearedRay::new(&Ray::new(receiver.position, direction)).intersect(corners);
        Some(LiSample {
            direction,
            distance: met.map_or(distance, |hit| hit.distance),
            weight: self.mean_radiance(number, weights) * (solid_angle / probability),
            pdf: Some(probability / solid_angle),
        })
    }

    fn pdf_li(&self, receiver: &Receiver, ray: &Ray, hit: &LightHit) -> f64 {
        let Some(number) = self.number(hit) else { return 0.0 };
        let doubled = doubled_area(&self.surface.corners[number]).dot(ray.direction).abs();
        let solid_angle = 0.5 * doubled / (hit.distance * hit.distance);
        if solid_angle > 0.0 { self.tree.probability(number as u32, receiver) / solid_angle } else { 0.0 }
    }

    fn intersect(&self, ray: &Ray) -> Option<LightHit> {
        let sheared = ShearedRay::new(ray);
        let mut nearest: Option<LightHit> = None;
        self.tree.on_ray(ray, f64::INFINITY, &mut |number| {
            let corners = &self.surface.corners[number as usize];
            let edge = (corners[0] - corners[1]).abs().max_element();
            let triangle = self.triangle(number as usize);
            if let Some(hit) = sheared.intersect(corners).filter(|hit| hit.distance > BEGINNING * edge)
                && nearest.is_none_or(|other| (hit.distance, Some(triangle)) < (other.distance, other.triangle))
            {
                let radiance = self.mean_radiance(number as usize, hit.barycentric);
                nearest = Some(LightHit { distance: hit.distance, radiance, triangle: Some(triangle) });
            }
            false
        });
        nearest
    }
}
