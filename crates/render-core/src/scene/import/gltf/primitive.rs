//! Primitives of meshes: what they hold, known before they are decoded.

use super::accessor::{Accessor, Component};
use super::buffers::Buffers;
use super::extensions::{DRACO, QUANTIZATION};
use super::fault::{fault, no_element};
use super::schema::{self, Document};
use super::topology::Topology;
use crate::settings::AssetProblem;
use crate::settings::limits::MAX_TRIANGLES;

/// What a primitive holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PrimitiveInfo {
    /// Triangles, with those that have no area. Points and lines have none.
    pub(crate) triangles: usize,
    /// Vertices that it will have, at the most.
    pub(crate) vertices: usize,
    /// The number of its material; without one it has the default material.
    pub(crate) material: Option<usize>,
    /// Whether its vertices have normals.
    pub(crate) has_normals: bool,
    /// Whether its vertices have tangents.
    pub(crate) has_tangents: bool,
    /// Which sets of texture coordinates its vertices have.
    pub(crate) has_texture_coordinates: [bool; 2],
    /// Whether its vertices have colours.
    pub(crate) has_colours: bool,
}

/// A way to store numbers: their type, and whether integers are fractions.
type Storage = (Component, bool);

const FLOATS: &[Storage] = &[(Component::F32, false)];
const UNSIGNED_FRACTIONS: &[Storage] = &[(Component::U8, true), (Component::U16, true)];
const SIGNED_FRACTIONS: &[Storage] = &[(Component::I8, true), (Component::I16, true)];
const INTEGERS: &[Storage] =
    &[(Component::I8, false), (Component::U8, false), (Component::I16, false), (Component::U16, false)];

/// An attribute of vertices and how it may be stored.
pub(super) struct Semantic {
    pub(super) name: &'static str,
    shapes: &'static [&'static str],
    storage: &'static [&'static [Storage]],
    /// What `KHR_mesh_quantization` adds.
    quantized: &'static [&'static [Storage]],
}

pub(super) const POSITION: Semantic = Semantic {
    name: "POSITION",
    shapes: &["VEC3"],
    storage: &[FLOATS],
    quantized: &[UNSIGNED_FRACTIONS, SIGNED_FRACTIONS, INTEGERS],
};
pub(super) const NORMAL: Semantic =
    Semantic { name: "NORMAL", shapes: &["VEC3"], storage: &[FLOATS], quantized: &[SIGNED_FRACTIONS] };
pub(super) const TANGENT: Semantic =
    Semantic { name: "TANGENT", shapes: &["VEC4"], storage: &[FLOATS], quantized: &[SIGNED_FRACTIONS] };
pub(super) const TEXTURE_COORDINATES: [Semantic; 2] =
    [texture_coordinates("TEXCOORD_0"), texture_coordinates("TEXCOORD_1")];
pub(super) const COLOUR: Semantic =
    Semantic { name: "COLOR_0", shapes: &["VEC3", "VEC4"], storage: &[FLOATS, UNSIGNED_FRACTIONS], quantized: &[] };

const fn texture_coordinates(name: &'static str) -> Semantic {
    Semantic {
        name,
        shapes: &["VEC2"],
        storage: &[FLOATS, UNSIGNED_FRACTIONS],
        quantized: &[SIGNED_FRACTIONS, INTEGERS],
    }
}

/// A primitive with its accessors, whose bounds have been checked.
pub(super) struct Geometry<'b> {
    /// Its place in the file.
    pub(super) place: String,
    pub(super) topology: Topology,
    pub(super) positions: Option<Accessor<'b>>,
    pub(super) normals: Option<Accessor<'b>>,
    pub(super) tangents: Option<Accessor<'b>>,
    pub(super) texture_coordinates: [Option<Accessor<'b>>; 2],
    pub(super) colours: Option<Accessor<'b>>,
    pub(super) indices: Option<Accessor<'b>>,
}

impl<'b> Geometry<'b> {
    /// Opens the accessors of primitive `number` of mesh `mesh`.
    pub(super) fn open(
        document: &'b Document<'_>,
        buffers: &'b Buffers<'_>,
        [mesh, number]: [usize; 2],
        primitive: &schema::Primitive,
    ) -> Result<Self, AssetProblem> {
        let place = format!("meshes[{mesh}].primitives[{number}]");
        let topology = Topology::of(primitive.mode, &place)?;
        let attributes = Attributes { document, buffers, primitive, place: &place };
        let positions = attributes.open(&POSITION, None)?;
        if let Some(positions) = &positions
            && !positions.is_stored()
            && primitive.extensions.contains_key(DRACO)
        {
            return Err(fault(place, "has compressed geometry alone: export the scene without Draco compression"));
        }
        let count = positions.as_ref().map(|positions| positions.count);
        let [first, second] = &TEXTURE_COORDINATES;
        let normals = attributes.open(&NORMAL, count)?;
        let tangents = attributes.open(&TANGENT, count)?;
        let texture_coordinates = [attributes.open(first, count)?, attributes.open(second, count)?];
        let colours = attributes.open(&COLOUR, count)?;
        let indices = attributes.indices()?;
        Ok(Self { topology, positions, normals, tangents, texture_coordinates, colours, indices, place })
    }

    /// Corners of all triangles: one for each index, or for each vertex.
    pub(super) fn corners(&self) -> usize {
        match (&self.positions, &self.indices) {
            (None, _) => 0,
            (_, Some(indices)) => indices.count,
            (Some(positions), None) => positions.count,
        }
    }

    /// What the primitive holds.
    pub(super) fn info(&self, document: &Document<'_>, material: Option<usize>) -> Result<PrimitiveInfo, AssetProblem> {
        let materials = document.materials.len();
        if let Some(index) = material.filter(|index| *index >= materials) {
            return Err(no_element(index, materials, "materials", format_args!("{}.material", self.place)));
        }
        let corners = self.corners();
        let triangles = self.topology.triangles(corners);
        if triangles > MAX_TRIANGLES {
            let found = format!("{triangles} triangles at {}", self.place);
            return Err(AssetProblem::TooLarge { found, limit: MAX_TRIANGLES.to_string() });
        }
        let vertices = self.positions.as_ref().map_or(0, |positions| positions.count);
        Ok(PrimitiveInfo {
            triangles,
            vertices: if triangles == 0 { 0 } else { vertices.min(corners) },
            material,
            has_normals: self.normals.is_some(),
            has_tangents: self.tangents.is_some(),
            has_texture_coordinates: self.texture_coordinates.each_ref().map(Option::is_some),
            has_colours: self.colours.is_some(),
        })
    }
}

/// Opens the accessors that a primitive names.
struct Attributes<'b, 'p, 'a> {
    document: &'b Document<'a>,
    buffers: &'b Buffers<'a>,
    primitive: &'p schema::Primitive,
    place: &'p str,
}

impl<'b> Attributes<'b, '_, '_> {
    /// The accessor of an attribute, which must have `count` elements.
    fn open(&self, semantic: &Semantic, count: Option<usize>) -> Result<Option<Accessor<'b>>, AssetProblem> {
        let Some(&index) = self.primitive.attributes.get(semantic.name) else { return Ok(None) };
        let place = format!("{}.attributes.{}", self.place, semantic.name);
        let accessor = Accessor::open(self.document, self.buffers, index, &place)?;
        let Accessor { shape, component, normalized, .. } = accessor;
        // Numbers with a fraction cannot be normalized, so the flag means nothing.
        let storage = (component, normalized && component != Component::F32);
        let declared = &self.document.extensions_used;
        let may_be_quantized = declared.iter().any(|name| name == QUANTIZATION);
        let allows = |storages: &[&[Storage]]| storages.iter().any(|storages| storages.contains(&storage));
        let is_allowed = allows(semantic.storage) || may_be_quantized && allows(semantic.quantized);
        if !is_allowed || !semantic.shapes.contains(&shape) {
            let normalized = if storage.1 { "normalized " } else { "" };
            let mut expected = format!("{} of f32", semantic.shapes.join(" or "));
            if semantic.storage.len() > 1 {
                expected += ", normalized u8 or normalized u16";
            }
            if allows(semantic.quantized) {
                expected += &format!(" unless the file uses {QUANTIZATION}");
            }
            let found = format!("{} is {shape} of {normalized}{}", accessor.place, component.name());
            return Err(fault(place, format_args!("{found}, must be {expected}")));
        }
        if let Some(count) = count.filter(|count| *count != accessor.count) {
            let message =
                format!("{} has {} elements, must have {count} as POSITION has", accessor.place, accessor.count);
            return Err(fault(place, message));
        }
        Ok(Some(accessor))
    }

    fn indices(&self) -> Result<Option<Accessor<'b>>, AssetProblem> {
        let Some(index) = self.primitive.indices else { return Ok(None) };
        let place = format!("{}.indices", self.place);
        let accessor = Accessor::open(self.document, self.buffers, index, &place)?;
        let Accessor { shape, component, .. } = accessor;
        if shape != "SCALAR" || !matches!(component, Component::U8 | Component::U16 | Component::U32) {
            let found = format!("{} is {shape} of {}", accessor.place, component.name());
            return Err(fault(place, format_args!("{found}, must be SCALAR of u8, u16 or u32")));
        }
        Ok(Some(accessor))
    }
}
