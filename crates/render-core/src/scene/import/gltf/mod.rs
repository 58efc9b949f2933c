//! glTF 2.0 files (`.gltf`, `.glb`), which may come from strangers.
//!
//! A file is opened first: JSON, bounds of all accessors, the tree of nodes, materials and sizes are checked. Then its
//! primitives are decoded one by one. No input makes the reader panic, hang, or exceed its limits of memory.

mod accessor;
mod buffers;
mod cameras;
mod container;
mod decode;
mod extensions;
mod fault;
mod lights;
mod list;
mod materials;
mod nodes;
mod notes;
mod primitive;
mod schema;
mod textures;
mod topology;
mod uri;

use std::collections::BTreeSet;

use glam::DAffine3;
use serde_json::Value;

pub(crate) use self::cameras::{Camera, Projection};
pub(crate) use self::decode::Primitive;
pub(crate) use self::lights::{Light, LightKind};
pub(crate) use self::materials::{AlphaMode, Material, Volume};
pub(crate) use self::primitive::PrimitiveInfo;
pub(crate) use self::textures::{Image, ImageSource, Texture, TextureTransform, Wrap};

use self::buffers::Buffers;
use self::container::Container;
use self::fault::{lookup, no_element};
use self::nodes::Placed;
use self::notes::{Note, Notes};
use self::primitive::Geometry;
use self::schema::Document;
use self::textures::{Images, StoredImage};
use self::topology::Topology;
use self::uri::Resource;
use crate::settings::AssetProblem;
use crate::settings::limits::MAX_TRIANGLES;

/// A file whose structure has been checked, of which no triangle is decoded yet.
pub(crate) struct GltfFile<'a> {
    document: Document<'a>,
    buffers: Buffers<'a>,
    /// The primitives of each mesh.
    primitives: Vec<Vec<PrimitiveInfo>>,
    placed: Vec<Placed>,
    materials: Vec<Material>,
    images: Images,
    cameras: Vec<Camera>,
    lights: Vec<Light>,
    /// The light of each node of the file.
    node_lights: Vec<Option<usize>>,
    notes: Vec<String>,
}

/// A mesh of a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mesh<'f> {
    /// Its name, as written.
    pub(crate) name: Option<&'f str>,
    /// What other programs stored with it; null without.
    pub(crate) extras: &'f Value,
    /// Its primitives, by their numbers in the file.
    pub(crate) primitives: &'f [PrimitiveInfo],
}

/// A node of the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node<'f> {
    /// Its number in the file.
    #[cfg(test)]
    index: usize,
    /// Its name, as written.
    pub(crate) name: Option<&'f str>,
    /// What other programs stored with it; null without.
    pub(crate) extras: &'f Value,
    /// From its coordinates to those of the scene. A negative determinant turns triangles inside out.
    pub(crate) world: DAffine3,
    /// The number of its mesh.
    pub(crate) mesh: Option<usize>,
    /// The number of its camera.
    pub(crate) camera: Option<usize>,
    /// The number of its light.
    pub(crate) light: Option<usize>,
}

impl<'a> GltfFile<'a> {
    /// Opens a file. `beside` gives the bytes of a file by its decoded name, relative to this one.
    ///
    /// # Errors
    ///
    /// When the file, or what it holds with all instances, is not readable or too large.
    pub(crate) fn open(bytes: &'a [u8], beside: &dyn Fn(&str) -> Option<&'a [u8]>) -> Result<Self, AssetProblem> {
        let container = Container::open(bytes)?;
        let document = Document::parse(container.json)?;
        extensions::check_required(&document)?;
        let mut notes = Notes::default();
        let buffers = Buffers::open(&document, container.binary, beside)?;
        let materials = materials::read(&document, &mut notes)?;
        let images = textures::open(&document, &buffers, used_images(&materials))?;
        let primitives = primitives(&document, &buffers, &mut notes)?;
        let placed = nodes::flatten(&document)?;
        check_size(&document, &placed, &primitives)?;
        let cameras = cameras::read(&document)?;
        check_cameras(&document, &cameras)?;
        let lights = lights::read(&document)?;
        let node_lights = lights::of_nodes(&document, lights.len())?;
        notes.add_all(Note::Animations, document.animations.len());
        notes.add_all(Note::Skins, document.skins.len());
        notes.add_all(Note::LightRanges, lights.iter().filter(|light| light.range.is_some()).count());
        let notes = notes.sentences(&document);
        Ok(Self { document, buffers, primitives, placed, materials, images, cameras, lights, node_lights, notes })
    }

    /// The names of the files that must be supplied with it, relative to it: buffers and the pictures that materials
    /// use, in the order of the file, each once.
    ///
    /// # Errors
    ///
    /// When the file is not readable.
    pub(crate) fn files(bytes: &[u8]) -> Result<Vec<String>, AssetProblem> {
        let document = Document::parse(Container::open(bytes)?.json)?;
        extensions::check_required(&document)?;
        let mut names = Vec::new();
        for (index, buffer) in document.buffers.iter().enumerate() {
            if let Some(uri) = &buffer.uri
                && let Some(name) = Resource::file_of(&uri.0, format_args!("buffers[{index}].uri"))?
            {
                names.push(name);
            }
        }
        let materials = materials::read(&document, &mut Notes::default())?;
        names.extend(textures::files(&document, used_images(&materials))?);
        let mut seen = BTreeSet::new();
        names.retain(|name| seen.insert(name.clone()));
        Ok(names)
    }

    /// The meshes, by their numbers in the file.
    pub(crate) fn meshes(&self) -> impl ExactSizeIterator<Item = Mesh<'_>> {
        self.document.meshes.iter().zip(&self.primitives).map(|(mesh, primitives)| Mesh {
            name: mesh.name.as_deref(),
            extras: &mesh.extras,
            primitives,
        })
    }

    /// Decodes a primitive of a mesh.
    ///
    /// # Errors
    ///
    /// When there is none of these numbers, or its numbers make no sense.
    pub(crate) fn decode(&self, mesh: usize, primitive: usize) -> Result<Primitive, AssetProblem> {
        let primitives = &lookup(&self.document.meshes, mesh, "meshes", "the mesh")?.primitives;
        let stored = lookup(primitives, primitive, "primitives", format_args!("meshes[{mesh}]"))?;
        Primitive::read(&Geometry::open(&self.document, &self.buffers, [mesh, primitive], stored)?)
    }

    /// The nodes of the default scene, each before its children. Without a default scene they are those of the first
    /// one, and without any scene all nodes.
    pub(crate) fn nodes(&self) -> impl ExactSizeIterator<Item = Node<'_>> {
        self.placed.iter().map(|&Placed { node: index, world }| {
            let node = &self.document.nodes[index];
            Node {
                #[cfg(test)]
                index,
                name: node.name.as_deref(),
                extras: &node.extras,
                world,
                mesh: node.mesh,
                camera: node.camera,
                light: self.node_lights[index],
            }
        })
    }

    /// The materials, by their numbers in the file.
    pub(crate) fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// Picture `index` of the file, when a material uses it.
    pub(crate) fn image(&self, index: usize) -> Option<Image<'_>> {
        let source = match self.images.get(&index)? {
            StoredImage::View(view) => {
                let view = self.buffers.view(&self.document, *view, "image").ok()?;
                ImageSource::Embedded(view.bytes)
            }
            StoredImage::Data(bytes) => ImageSource::Embedded(bytes),
            StoredImage::File(name) => ImageSource::File(name),
        };
        let name = self.document.images.get(index).and_then(|image| image.name.as_deref());
        Some(Image { name, source })
    }

    /// The numbers of the pictures that materials use, in ascending order.
    #[cfg(test)]
    fn images(&self) -> impl Iterator<Item = usize> {
        self.images.keys().copied()
    }

    /// The cameras, by their numbers in the file.
    pub(crate) fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// The lights, by their numbers in the file.
    pub(crate) fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// The program that wrote the file, as written.
    pub(crate) fn generator(&self) -> &str {
        &self.document.generator
    }

    /// What the file holds and this build leaves out, one sentence for each kind.
    pub(crate) fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// The pictures that materials use, in the order of the file.
fn used_images(materials: &[Material]) -> BTreeSet<usize> {
    materials.iter().flat_map(Material::textures).map(|texture| texture.image).collect()
}

/// Opens the accessors of all primitives, so that their sizes are known and their bounds checked.
fn primitives(
    document: &Document<'_>,
    buffers: &Buffers<'_>,
    notes: &mut Notes,
) -> Result<Vec<Vec<PrimitiveInfo>>, AssetProblem> {
    let mut meshes = Vec::with_capacity(document.meshes.len());
    for (mesh, stored) in document.meshes.iter().enumerate() {
        let mut primitives = Vec::with_capacity(stored.primitives.len());
        for (number, primitive) in stored.primitives.iter().enumerate() {
            let geometry = Geometry::open(document, buffers, [mesh, number], primitive)?;
            if geometry.topology == Topology::PointsOrLines {
                notes.add(Note::PointsAndLines);
            } else if geometry.positions.is_none() {
                notes.add(Note::WithoutPositions);
            }
            if !primitive.targets.is_empty() {
                notes.add(Note::MorphTargets);
            }
            primitives.push(geometry.info(document, primitive.material)?);
        }
        meshes.push(primitives);
    }
    Ok(meshes)
}

/// Checks the sizes of all instances together: a file of a few bytes may place a mesh a million times.
fn check_size(
    document: &Document<'_>,
    placed: &[Placed],
    primitives: &[Vec<PrimitiveInfo>],
) -> Result<(), AssetProblem> {
    let sizes: Vec<[usize; 2]> = primitives
        .iter()
        .map(|primitives| {
            let sum = |size: fn(&PrimitiveInfo) -> usize| primitives.iter().map(size).fold(0, usize::saturating_add);
            [sum(|primitive| primitive.triangles), sum(|primitive| primitive.vertices)]
        })
        .collect();
    let [mut triangles, mut vertices] = [0_usize; 2];
    for Placed { node, .. } in placed {
        let Some(mesh) = document.nodes[*node].mesh else { continue };
        let Some(size) = sizes.get(mesh) else {
            return Err(no_element(mesh, sizes.len(), "meshes", format_args!("nodes[{node}].mesh")));
        };
        triangles = triangles.saturating_add(size[0]);
        vertices = vertices.saturating_add(size[1]);
    }
    for (found, limit, unit) in [(triangles, MAX_TRIANGLES, "triangles"), (vertices, 3 * MAX_TRIANGLES, "vertices")] {
        if found > limit {
            let found = format!("{found} {unit} in all places of its meshes together");
            return Err(AssetProblem::TooLarge { found, limit: limit.to_string() });
        }
    }
    Ok(())
}

/// Checks that nodes name cameras of the file.
fn check_cameras(document: &Document<'_>, cameras: &[Camera]) -> Result<(), AssetProblem> {
    for (index, node) in document.nodes.iter().enumerate() {
        if let Some(camera) = node.camera {
            lookup(cameras, camera, "cameras", format_args!("nodes[{index}].camera"))?;
        }
    }
    Ok(())
}

#[cfg(test)]
pub(super) mod tests;
