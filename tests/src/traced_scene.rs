//! A scene as the forward tracer sees it.
//!
//! Splines, triangles and the camera are built here anew from the scene file and its height maps and meshes. Only data
//! that are no geometry of paths come from the renderer's scene: coefficients of procedural profiles, and colours of
//! textures.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clerestory_render_core::document::{SceneBundle, load};
use clerestory_render_core::geometry::Face;
use clerestory_render_core::light::LightDescription;
use clerestory_render_core::light::{DiskLight, PointLight, RectangleLight, SphereLight, SunLight};
use clerestory_render_core::scene::Scene;
use clerestory_render_core::scene::SceneError;
use clerestory_render_core::scene::description::{
    CameraDescription, MeshDescription, MeshSource, PaneDescription, ProfileDescription, SheetDescription,
};
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};
use glam::{DVec2, DVec3};

use crate::spline::Spline;
use crate::traced_pane::TracedPane;
use crate::triangle_tree::TriangleTree;

/// Why a scene cannot be traced.
#[derive(Debug, thiserror::Error)]
pub enum TracedSceneError {
    /// The scene is malformed.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A height map is malformed.
    #[error("{path} is not a height map")]
    HeightMap {
        /// The file.
        path: PathBuf,
        /// Why.
        source: exr::error::Error,
    },
    /// A mesh file is malformed.
    #[error("{path} is not an OBJ file")]
    Mesh {
        /// The file.
        path: PathBuf,
        /// Why.
        source: tobj::LoadError,
    },
    /// The scene has something that the tracer does not know.
    #[error("{what} cannot be traced forward; {remedy}")]
    Unsupported {
        /// What it is.
        what: String,
        /// What would work.
        remedy: &'static str,
    },
}

/// A triangle with Lambertian reflection on both sides.
#[derive(Clone, Copy, Debug)]
pub struct TracedTriangle {
    /// A corner.
    pub corner: DVec3,
    /// From there to the second corner.
    pub edge1: DVec3,
    /// From there to the third corner.
    pub edge2: DVec3,
    /// Unit normal, `edge1` cross `edge2`.
    pub normal: DVec3,
}

impl TracedTriangle {
    /// Distance along a ray, within `reach` (Möller and Trumbore 1997); borders belong to the triangle. Surfaces nearer
    /// than a nanometre are those that the ray leaves.
    pub fn intersect(&self, origin: DVec3, direction: DVec3, reach: f64) -> Option<f64> {
        const NEAREST: f64 = 1e-9;
        const SLACK: f64 = 1e-12;
        let s = origin - self.corner;
        let distance = -s.dot(self.normal) / direction.dot(self.normal);
        if !(distance > NEAREST && distance < reach) {
            return None;
        }
        let p = direction.cross(self.edge2);
        let inverse = 1.0 / self.edge1.dot(p);
        let b1 = s.dot(p) * inverse;
        let b2 = direction.dot(s.cross(self.edge1)) * inverse;
        (b1 >= -SLACK && b2 >= -SLACK && b1 + b2 <= 1.0 + SLACK).then_some(distance)
    }
}

/// A light.
#[derive(Clone, Copy, Debug)]
pub enum TracedLight {
    /// A point of equal intensity in all directions, W/sr.
    Point {
        /// Where it is.
        position: DVec3,
        /// Radiant intensity, W/sr.
        intensity: DVec3,
    },
    /// A sphere of uniform radiance, W/(m2 sr).
    Sphere {
        /// Its centre.
        centre: DVec3,
        /// Its radius, metres.
        radius: f64,
        /// Emitted radiance.
        radiance: DVec3,
    },
    /// A rectangle that shines to one side.
    Rectangle {
        /// Its centre.
        centre: DVec3,
        /// Its edges.
        edges: [DVec3; 2],
        /// Emitted radiance.
        radiance: DVec3,
    },
    /// A disk that shines to one side.
    Disk {
        /// Its centre.
        centre: DVec3,
        /// Unit vector to which it shines.
        normal: DVec3,
        /// Its radius, metres.
        radius: f64,
        /// Emitted radiance.
        radiance: DVec3,
    },
    /// A distant disc.
    Sun {
        /// Unit vector towards its middle.
        direction: DVec3,
        /// One minus the cosine of its angular radius.
        one_minus_cos: f64,
        /// Emitted radiance.
        radiance: DVec3,
    },
}

/// The camera, as a map from points to the picture.
#[derive(Clone, Copy, Debug)]
pub struct TracedCamera {
    position: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    /// Edge of a pixel: metres, or, with perspective, metres on a plane one metre away.
    pixel: f64,
    perspective: bool,
    width: f64,
    height: f64,
}

/// Where and how strongly a point of a surface is seen.
#[derive(Clone, Copy, Debug)]
pub struct Sighting {
    /// Place in the picture, in pixels from the top left.
    pub position: DVec2,
    /// Unit vector from the point towards the camera.
    pub direction: DVec3,
    /// Distance to the camera, metres.
    pub distance: f64,
    /// Pixels' area of picture for each square metre that faces the camera: the inverse of the area that a pixel sees.
    pub density: f64,
}

impl TracedCamera {
    /// The pixel that sees `point`, if nothing is in the way.
    pub fn sight(&self, point: DVec3) -> Option<Sighting> {
        let v = point - self.position;
        let depth = v.dot(self.forward);
        if depth <= 0.0 {
            return None;
        }
        let scale = if self.perspective { depth * self.pixel } else { self.pixel };
        let x = self.width / 2.0 + v.dot(self.right) / scale;
        let y = self.height / 2.0 - v.dot(self.up) / scale;
        if x < 0.0 || y < 0.0 || x >= self.width || y >= self.height {
            return None;
        }
        let (direction, distance, density) = if self.perspective {
            let distance = v.length();
            let cosine = depth / distance;
            (-v / distance, distance, 1.0 / (distance * distance * cosine.powi(3) * self.pixel * self.pixel))
        } else {
            (-self.forward, depth, 1.0 / (self.pixel * self.pixel))
        };
        Some(Sighting { position: DVec2::new(x, y), direction, distance, density })
    }
}

/// A scene to be traced.
#[derive(Clone, Debug)]
pub struct TracedScene {
    /// Pixels across and down.
    pub film: [usize; 2],
    /// The camera.
    pub camera: TracedCamera,
    /// The panes.
    pub panes: Vec<TracedPane>,
    /// The surfaces, in the order of the scene file.
    pub triangles: Vec<TracedTriangle>,
    /// The same as a tree.
    pub tree: TriangleTree,
    /// The lights.
    pub lights: Vec<TracedLight>,
    colours: Arc<Scene>,
}

impl TracedScene {
    /// Reads a scene file and the files that it names.
    ///
    /// # Errors
    ///
    /// See [`Self::build`].
    pub fn load(path: &Path) -> Result<Self, TracedSceneError> {
        Self::build(&load(path)?, path.parent().unwrap_or(Path::new(".")))
    }

    /// Builds the scene of a bundle whose files are in `folder`.
    ///
    /// # Errors
    ///
    /// A scene that cannot be built, a file that cannot be understood, PLY files, rotated meshes, spots and
    /// environments.
    pub fn build(bundle: &SceneBundle, folder: &Path) -> Result<Self, TracedSceneError> {
        let description = &*bundle.description().expanded(bundle.assets())?;
        let colours = Arc::new(Scene::build(description.parts(), bundle.assets(), &mut |_| ())?);
        let film = [description.film.width as usize, description.film.height as usize];
        let mut triangles = Vec::new();
        for (mesh, surface) in description.meshes.iter().zip(colours.meshes()) {
            let part = mesh_triangles(mesh, folder)?;
            if part.len() != surface.triangles() as usize {
                return Err(TracedSceneError::Unsupported {
                    what: format!("mesh `{}` with triangles without area", mesh.name),
                    remedy: "remove them",
                });
            }
            triangles.extend(part);
        }
        let panes = description
            .panes
            .iter()
            .enumerate()
            .map(|(i, pane)| traced_pane(pane, &description.sheets, folder, &colours, i));
        Ok(Self {
            film,
            camera: camera(&description.camera, film),
            panes: panes.collect::<Result<_, _>>()?,
            tree: TriangleTree::over(&triangles),
            triangles,
            lights: description.lights.iter().map(light).collect::<Result<_, _>>()?,
            colours,
        })
    }

    /// The nearest triangle on a ray but for one, with its distance.
    pub fn nearest_triangle(
        &self,
        origin: DVec3,
        direction: DVec3,
        reach: f64,
        skipped: usize,
    ) -> Option<(f64, usize)> {
        let (mut nearest, mut limit) = (None, reach);
        self.tree.visit(origin, direction, reach, &mut |index| {
            if index != skipped
                && let Some(distance) = self.triangles[index].intersect(origin, direction, limit)
            {
                (nearest, limit) = (Some((distance, index)), distance);
            }
            limit
        });
        nearest
    }

    /// The fraction of light that triangle `index` reflects at a point on it.
    pub fn reflectance(&self, index: usize, point: DVec3) -> DVec3 {
        let triangle = &self.triangles[index];
        let (offset, across) = (point - triangle.corner, triangle.edge1.cross(triangle.edge2));
        let second = offset.cross(triangle.edge2).dot(across) / across.length_squared();
        let third = triangle.edge1.cross(offset).dot(across) / across.length_squared();
        self.colours.bsdf(index as u32).albedo(&self.colours.surface_point(index as u32, [second, third]))
    }
}

fn mesh_triangles(mesh: &MeshDescription, folder: &Path) -> Result<Vec<TracedTriangle>, TracedSceneError> {
    let unsupported =
        |what: &str, remedy| TracedSceneError::Unsupported { what: format!("mesh `{}` {what}", mesh.name), remedy };
    if mesh.rotate != [0.0; 3] {
        return Err(unsupported("with a rotation", "rotate its positions"));
    }
    let corners: Vec<[DVec3; 3]> = match &mesh.source {
        MeshSource::Inline { positions, triangles, .. } => {
            triangles.iter().map(|triangle| triangle.map(|i| DVec3::from(positions[i as usize]))).collect()
        }
        MeshSource::Obj { file, part: None } => obj_triangles(&folder.join(file))?,
        MeshSource::Obj { .. } => return Err(unsupported("from a part of an OBJ file", "use all of it")),
        MeshSource::Ply { .. } => return Err(unsupported("from a PLY file", "use OBJ")),
        MeshSource::Gltf(_) => return Err(unsupported("from a glTF file", "use OBJ")),
        MeshSource::Waves(_) => return Err(unsupported("of waves", "use OBJ")),
    };
    let moved = |point: DVec3| match mesh.matrix {
        Some(rows) => DVec3::from(rows.map(|[x, y, z, offset]| DVec3::new(x, y, z).dot(point) + offset)),
        None => point,
    };
    let place = |point: DVec3| moved(point) * mesh.scale + DVec3::from(mesh.translate);
    Ok(corners
        .into_iter()
        .map(|corners| corners.map(place))
        .map(|[a, b, c]| {
            let (edge1, edge2) = (b - a, c - a);
            TracedTriangle { corner: a, edge1, edge2, normal: edge1.cross(edge2).normalize() }
        })
        .collect())
}

fn obj_triangles(path: &Path) -> Result<Vec<[DVec3; 3]>, TracedSceneError> {
    let options = tobj::LoadOptions { triangulate: true, ..tobj::LoadOptions::default() };
    let (models, _) =
        tobj::load_obj(path, &options).map_err(|source| TracedSceneError::Mesh { path: path.into(), source })?;
    let mut triangles = Vec::new();
    for model in &models {
        let (positions, _) = model.mesh.positions.as_chunks::<3>();
        let (indices, _) = model.mesh.indices.as_chunks::<3>();
        triangles
            .extend(indices.iter().map(|corners| corners.map(|i| DVec3::from(positions[i as usize].map(f64::from)))));
    }
    Ok(triangles)
}

fn camera(description: &CameraDescription, film: [usize; 2]) -> TracedCamera {
    let (position, look_at, up, perspective, height) = match description {
        CameraDescription::Perspective { position, look_at, up, vertical_field_of_view } => {
            (position, look_at, up, true, 2.0 * libm::tan(vertical_field_of_view.to_radians() / 2.0))
        }
        CameraDescription::Orthographic { position, look_at, up, height } => (position, look_at, up, false, *height),
    };
    let position = DVec3::from(*position);
    let forward = (DVec3::from(*look_at) - position).normalize();
    let right = forward.cross(DVec3::from(*up)).normalize();
    TracedCamera {
        position,
        right,
        up: right.cross(forward),
        forward,
        pixel: height / film[1] as f64,
        perspective,
        width: film[0] as f64,
        height: film[1] as f64,
    }
}

fn traced_pane(
    description: &PaneDescription,
    sheets: &BTreeMap<String, SheetDescription>,
    folder: &Path,
    scene: &Scene,
    index: usize,
) -> Result<TracedPane, TracedSceneError> {
    let spline = |profile: &ProfileDescription, face: Face| -> Result<Spline, TracedSceneError> {
        match profile {
            ProfileDescription::Flat => Ok(Spline::flat()),
            ProfileDescription::HeightMap { file, scale, offset } => {
                let (values, columns, rows) = read_height_map(&folder.join(file))?;
                let coefficients: Vec<f64> = values.iter().map(|h| f64::from(*h) * scale + offset).collect();
                Ok(Spline::new(&coefficients, columns, rows))
            }
            _ => {
                let field = scene.panes()[index].surface(face);
                let [columns, rows] = field.grid();
                let coefficients: Vec<f64> = field.coefficients().collect();
                Ok(Spline::new(&coefficients, columns, rows))
            }
        }
    };
    let sheet = description.sheet.as_ref().and_then(|cut| sheets.get(&cut.name));
    let (front, back) = match sheet {
        Some(sheet) => (&sheet.front, &sheet.back),
        None => (&description.front, &description.back),
    };
    let size = sheet.map(|sheet| DVec2::new(sheet.width, sheet.height));
    Ok(TracedPane::new(description, size, spline(front, Face::Front)?, spline(back, Face::Back)?))
}

/// Reads the heights of a height map: row by row from the top of the file, with the number of columns and rows.
///
/// # Errors
///
/// A file that is no OpenEXR image of 32-bit floats.
pub fn read_height_map(path: &Path) -> Result<(Vec<f32>, usize, usize), TracedSceneError> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .map_err(|source| TracedSceneError::HeightMap { path: path.into(), source })?;
    let size = image.layer_data.size;
    match image.layer_data.channel_data.list.into_iter().next().map(|channel| channel.sample_data) {
        Some(FlatSamples::F32(values)) => Ok((values, size.width(), size.height())),
        _ => Err(TracedSceneError::Unsupported {
            what: format!("{} without 32-bit float heights", path.display()),
            remedy: "store one channel of 32-bit floats",
        }),
    }
}

fn light(description: &LightDescription) -> Result<TracedLight, TracedSceneError> {
    Ok(match description {
        LightDescription::Point(PointLight { position, intensity, .. }) => {
            TracedLight::Point { position: DVec3::from(*position), intensity: DVec3::from(*intensity) }
        }
        LightDescription::Sphere(SphereLight { centre, radius, radiance, .. }) => {
            TracedLight::Sphere { centre: DVec3::from(*centre), radius: *radius, radiance: DVec3::from(*radiance) }
        }
        LightDescription::Rectangle(RectangleLight { centre, edge_u, edge_v, radiance, .. }) => {
            TracedLight::Rectangle {
                centre: DVec3::from(*centre),
                edges: [DVec3::from(*edge_u), DVec3::from(*edge_v)],
                radiance: DVec3::from(*radiance),
            }
        }
        LightDescription::Disk(DiskLight { centre, normal, radius, radiance, .. }) => TracedLight::Disk {
            centre: DVec3::from(*centre),
            normal: DVec3::from(*normal).normalize(),
            radius: *radius,
            radiance: DVec3::from(*radiance),
        },
        LightDescription::Sun(SunLight { direction, angular_radius, radiance, .. }) => {
            let half = libm::sin(angular_radius.to_radians() / 2.0);
            TracedLight::Sun {
                direction: DVec3::from(*direction).normalize(),
                one_minus_cos: 2.0 * half * half,
                radiance: DVec3::from(*radiance),
            }
        }
        LightDescription::Spot(_) | LightDescription::Environment(_) | LightDescription::Mesh(_) => {
            return Err(TracedSceneError::Unsupported {
                what: format!("the light {:?}", description.name()),
                remedy: "use a light of another kind",
            });
        }
    })
}
