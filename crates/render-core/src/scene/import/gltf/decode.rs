//! Decoding of primitives: triangles, and what their vertices have.

use std::ops::RangeInclusive;

use glam::{DVec2, DVec3, DVec4};

use super::accessor::{Accessor, Reader};
use super::fault::fault;
use super::primitive::{COLOUR, Geometry, NORMAL, POSITION, Semantic, TANGENT, TEXTURE_COORDINATES};
use crate::settings::AssetProblem;

/// The triangles of a primitive in the coordinates of its mesh. Lists of attributes that it does not have are empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Primitive {
    /// Positions of the vertices that triangles name, in the order of the file.
    pub(crate) positions: Vec<DVec3>,
    /// Three vertices for each triangle, counterclockwise as seen from its front.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Normals of any length.
    pub(crate) normals: Vec<DVec3>,
    /// Tangents; `w` is the sign of the bitangent.
    pub(crate) tangents: Vec<DVec4>,
    /// Two sets of texture coordinates as in the file: v = 0 is the top row of a picture.
    pub(crate) texture_coordinates: [Vec<DVec2>; 2],
    /// Linear red, green, blue and opacity, 0 to 1.
    pub(crate) colours: Vec<[f32; 4]>,
}

/// Colours that leave 0 to 1 by no more than this are rounding errors.
const COLOUR_TOLERANCE: f64 = 1e-3;

impl Primitive {
    /// Reads all numbers of a primitive.
    pub(super) fn read(geometry: &Geometry<'_>) -> Result<Self, AssetProblem> {
        let Some(positions) = &geometry.positions else { return Ok(Self::default()) };
        let mut triangles = read_triangles(geometry, positions.count)?;
        let vertices = Vertices::of(&mut triangles, positions.count);
        let vectors = Vectors { vertices: &vertices, place: &geometry.place };
        let any = f64::MIN..=f64::MAX;
        let [first, second] = &geometry.texture_coordinates;
        let [first_name, second_name] = &TEXTURE_COORDINATES;
        Ok(Self {
            positions: vectors.read(Some(positions), &POSITION, &any, DVec3::from_array)?,
            normals: vectors.read(geometry.normals.as_ref(), &NORMAL, &any, DVec3::from_array)?,
            tangents: vectors.read(geometry.tangents.as_ref(), &TANGENT, &any, DVec4::from_array)?,
            texture_coordinates: [
                vectors.read(first.as_ref(), first_name, &any, DVec2::from_array)?,
                vectors.read(second.as_ref(), second_name, &any, DVec2::from_array)?,
            ],
            colours: vectors.colours(geometry.colours.as_ref())?,
            triangles,
        })
    }
}

/// The triangles of a primitive with the numbers of their vertices in the file.
fn read_triangles(geometry: &Geometry<'_>, vertices: usize) -> Result<Vec<[u32; 3]>, AssetProblem> {
    let topology = geometry.topology;
    let triangles = (0..topology.triangles(geometry.corners())).map(|number| topology.triangle(number));
    let Some(accessor) = &geometry.indices else {
        // Checked before: there are no more corners than `u32` can number.
        return Ok(triangles.map(|corners| corners.map(|corner| corner as u32)).collect());
    };
    let reader = accessor.reader()?;
    let vertex = |number: usize| {
        let [index] = reader.element(number);
        let index = index as u32;
        if (index as usize) < vertices {
            return Ok(index);
        }
        let is_restart = index == accessor.component.restart();
        let why = if is_restart { ": values that restart a strip are not allowed" } else { "" };
        let message = format!("index {number} is {index}, must be below {vertices}, the number of vertices{why}");
        Err(fault(format_args!("{}.indices", geometry.place), message))
    };
    let mut read = Vec::with_capacity(triangles.len());
    for [a, b, c] in triangles {
        read.push([vertex(a)?, vertex(b)?, vertex(c)?]);
    }
    Ok(read)
}

/// Which vertices of a file a primitive has.
enum Vertices {
    /// All up to this number.
    All(usize),
    /// These, in ascending order.
    Some(Vec<u32>),
}

impl Vertices {
    /// The vertices that triangles name, which are numbered anew without the others. Many primitives may share one list
    /// of vertices, and each names few of them.
    fn of(triangles: &mut [[u32; 3]], count: usize) -> Self {
        let used = used_vertices(triangles, count);
        if used.len() == count {
            return Self::All(count);
        }
        // Every corner is in the list.
        let renumbered = |vertex: u32| used.binary_search(&vertex).unwrap_or_default() as u32;
        triangles.iter_mut().for_each(|corners| *corners = corners.map(renumbered));
        Self::Some(used)
    }

    fn iter(&self) -> Box<dyn Iterator<Item = usize> + '_> {
        match self {
            Self::All(count) => Box::new(0..*count),
            Self::Some(used) => Box::new(used.iter().map(|vertex| *vertex as usize)),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::All(count) => *count,
            Self::Some(used) => used.len(),
        }
    }
}

/// The vertices that triangles name, in ascending order. The work depends on the triangles, not on all vertices.
fn used_vertices(triangles: &[[u32; 3]], count: usize) -> Vec<u32> {
    let corners = triangles.as_flattened();
    if corners.len() < count / 64 {
        let mut used = corners.to_vec();
        used.sort_unstable();
        used.dedup();
        return used;
    }
    let mut is_used = vec![false; count];
    corners.iter().for_each(|vertex| is_used[*vertex as usize] = true);
    (0..).zip(&is_used).filter_map(|(vertex, is_used)| is_used.then_some(vertex)).collect()
}

/// Reads attributes of vertices.
struct Vectors<'v> {
    vertices: &'v Vertices,
    /// The place of the primitive.
    place: &'v str,
}

impl Vectors<'_> {
    /// The vectors of an attribute; empty when there is no such attribute.
    fn read<const N: usize, T>(
        &self,
        accessor: Option<&Accessor<'_>>,
        semantic: &Semantic,
        range: &RangeInclusive<f64>,
        convert: impl Fn([f64; N]) -> T,
    ) -> Result<Vec<T>, AssetProblem> {
        let Some(accessor) = accessor else { return Ok(Vec::new()) };
        let reader: Reader<'_, '_> = accessor.reader()?;
        let mut vectors = Vec::with_capacity(self.vertices.len());
        for vertex in self.vertices.iter() {
            let vector: [f64; N] = reader.element(vertex);
            if !vector.iter().all(|number| range.contains(number)) {
                let place = format_args!("{}.attributes.{}", self.place, semantic.name);
                let expected = if *range.end() == f64::MAX { "finite" } else { "0 to 1" };
                return Err(fault(place, format_args!("element {vertex} is {vector:?}, must be {expected}")));
            }
            vectors.push(convert(vector));
        }
        Ok(vectors)
    }

    fn colours(&self, accessor: Option<&Accessor<'_>>) -> Result<Vec<[f32; 4]>, AssetProblem> {
        let range = -COLOUR_TOLERANCE..=1.0 + COLOUR_TOLERANCE;
        let clamped = |number: f64| number.clamp(0.0, 1.0) as f32;
        if accessor.is_some_and(|accessor| accessor.shape == "VEC4") {
            return self.read(accessor, &COLOUR, &range, |colour: [f64; 4]| colour.map(clamped));
        }
        self.read(accessor, &COLOUR, &range, |[red, green, blue]: [f64; 3]| [red, green, blue, 1.0].map(clamped))
    }
}
