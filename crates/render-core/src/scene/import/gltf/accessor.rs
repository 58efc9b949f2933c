//! Accessors: numbers in buffers. All bounds are checked before a number is read.

use super::buffers::{Buffers, View};
use super::fault::{fault, lookup};
use super::schema::{self, Document};
use crate::settings::AssetProblem;

/// How a number is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: u32, place: &str) -> Result<Self, AssetProblem> {
        match code {
            5120 => Ok(Self::I8),
            5121 => Ok(Self::U8),
            5122 => Ok(Self::I16),
            5123 => Ok(Self::U16),
            5125 => Ok(Self::U32),
            5126 => Ok(Self::F32),
            _ => {
                let message = format!("found {code}, must be 5120, 5121, 5122, 5123, 5125 or 5126");
                Err(fault(format_args!("{place}.componentType"), message))
            }
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Its name in messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::I8 => "i8",
            Self::U8 => "u8",
            Self::I16 => "i16",
            Self::U16 => "u16",
            Self::U32 => "u32",
            Self::F32 => "f32",
        }
    }

    /// The index that restarts a strip, which glTF forbids.
    pub(super) fn restart(self) -> u32 {
        match self {
            Self::I8 | Self::U8 => u32::from(u8::MAX),
            Self::I16 | Self::U16 => u32::from(u16::MAX),
            Self::U32 | Self::F32 => u32::MAX,
        }
    }

    /// The number at a place in bytes; 0 behind their end, where no accessor reads.
    fn read(self, bytes: &[u8], place: usize) -> f64 {
        match self {
            Self::I8 => f64::from(i8::from_le_bytes(array(bytes, place))),
            Self::U8 => f64::from(u8::from_le_bytes(array(bytes, place))),
            Self::I16 => f64::from(i16::from_le_bytes(array(bytes, place))),
            Self::U16 => f64::from(u16::from_le_bytes(array(bytes, place))),
            Self::U32 => f64::from(u32::from_le_bytes(array(bytes, place))),
            Self::F32 => f64::from(f32::from_le_bytes(array(bytes, place))),
        }
    }

    /// The fraction that a normalized integer means.
    fn normalized(self, number: f64) -> f64 {
        match self {
            Self::I8 => f64::max(number / 127.0, -1.0),
            Self::U8 => number / 255.0,
            Self::I16 => f64::max(number / 32_767.0, -1.0),
            Self::U16 => number / 65_535.0,
            Self::U32 | Self::F32 => number,
        }
    }
}

fn array<const N: usize>(bytes: &[u8], place: usize) -> [u8; N] {
    bytes.get(place..).and_then(<[u8]>::first_chunk).copied().unwrap_or([0; N])
}

/// Limit for the elements of an accessor that stores none. Geometry that lies all at the origin is of no use.
const MAX_ZEROS: usize = 1 << 20;

/// An accessor whose bounds have been checked.
pub(super) struct Accessor<'b> {
    /// Its place in the file.
    pub(super) place: String,
    /// Elements.
    pub(super) count: usize,
    /// Its type, such as `VEC3`.
    pub(super) shape: &'b str,
    pub(super) component: Component,
    pub(super) normalized: bool,
    /// Where its elements lie; all are 0 without.
    elements: Option<Elements<'b>>,
    sparse: Option<Sparse<'b>>,
}

/// Elements at equal distances.
struct Elements<'b> {
    /// Begins with the first element and holds all of them.
    bytes: &'b [u8],
    stride: usize,
}

/// Elements that are replaced.
struct Sparse<'b> {
    count: usize,
    indices: Elements<'b>,
    index: Component,
    values: Elements<'b>,
}

impl<'b> Accessor<'b> {
    /// The accessor that `place` names.
    pub(super) fn open(
        document: &'b Document<'_>,
        buffers: &'b Buffers<'_>,
        index: usize,
        place: &str,
    ) -> Result<Self, AssetProblem> {
        let accessor = lookup(&document.accessors, index, "accessors", place)?;
        let place = format!("accessors[{index}]");
        let component = Component::of(accessor.component_type, &place)?;
        let Some(numbers) = numbers(&accessor.shape) else {
            let message = format!("found \"{}\", must be SCALAR, VEC2, VEC3 or VEC4 here", accessor.shape);
            return Err(fault(format_args!("{place}.type"), message));
        };
        if u32::try_from(accessor.count).is_err() {
            let message = format!("found {}, must be a number of 32 bits", accessor.count);
            return Err(fault(format_args!("{place}.count"), message));
        }
        let element = component.bytes() * numbers;
        let layout = Layout { count: accessor.count, element, component, place: &place };
        let elements = match accessor.buffer_view {
            Some(view) => {
                let view = buffers.view(document, view, &format!("{place}.bufferView"))?;
                Some(layout.elements(view, accessor.byte_offset)?)
            }
            None if accessor.count > MAX_ZEROS => {
                let message = format!("{} elements without a buffer, must be at most {MAX_ZEROS}", accessor.count);
                return Err(fault(format_args!("{place}.count"), message));
            }
            None => None,
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => Some(Sparse::open(document, buffers, sparse, &layout)?),
            None => None,
        };
        let (count, shape, normalized) = (accessor.count, accessor.shape.as_str(), accessor.normalized);
        Ok(Self { place, count, shape, component, normalized, elements, sparse })
    }

    /// Whether the file stores its elements, or some of them.
    pub(super) fn is_stored(&self) -> bool {
        self.elements.is_some() || self.sparse.is_some()
    }

    /// Prepares reading: finds out which elements are replaced.
    pub(super) fn reader(&self) -> Result<Reader<'_, 'b>, AssetProblem> {
        let replaced = match &self.sparse {
            Some(sparse) => sparse.replaced(self.count, &self.place)?,
            None => Vec::new(),
        };
        Ok(Reader { accessor: self, replaced })
    }
}

/// The numbers of an element.
fn numbers(shape: &str) -> Option<usize> {
    match shape {
        "SCALAR" => Some(1),
        "VEC2" => Some(2),
        "VEC3" => Some(3),
        "VEC4" => Some(4),
        _ => None,
    }
}

/// How elements should lie in a view.
struct Layout<'p> {
    count: usize,
    /// Bytes of an element.
    element: usize,
    component: Component,
    place: &'p str,
}

impl Layout<'_> {
    /// The elements that begin at a byte of a view, when it holds all of them.
    fn elements<'b>(&self, view: View<'b>, offset: usize) -> Result<Elements<'b>, AssetProblem> {
        let Self { count, element, component, place } = *self;
        let stride = view.stride.unwrap_or(element);
        if stride != element && !(stride >= element && (4..=252).contains(&stride) && stride.is_multiple_of(4)) {
            let message = format!(
                "its elements of {element} bytes lie {stride} bytes apart (byteStride), must be {element}, or a \
                 multiple of 4 from there to 252"
            );
            return Err(fault(place, message));
        }
        let start = view.offset.checked_add(offset);
        if !start.is_some_and(|start| start.is_multiple_of(component.bytes())) {
            let message = format!(
                "byteOffset {offset} in a view at byte {}, must be together a multiple of the {} bytes of a number",
                view.offset,
                component.bytes()
            );
            return Err(fault(place, message));
        }
        let last = count.saturating_sub(1).checked_mul(stride);
        let length = last.and_then(|last| last.checked_add(if count == 0 { 0 } else { element }));
        let bytes = length.and_then(|length| view.bytes.get(offset..offset.checked_add(length)?));
        let Some(bytes) = bytes else {
            let message = format!(
                "{count} elements of {element} bytes, {stride} bytes apart from byte {offset} on, do not fit into the \
                 {} bytes of their view",
                view.bytes.len()
            );
            return Err(fault(place, message));
        };
        Ok(Elements { bytes, stride })
    }
}

impl<'b> Sparse<'b> {
    fn open(
        document: &'b Document<'_>,
        buffers: &'b Buffers<'_>,
        sparse: &schema::Sparse,
        layout: &Layout<'_>,
    ) -> Result<Self, AssetProblem> {
        let place = format!("{}.sparse", layout.place);
        if sparse.count > layout.count {
            let message = format!("found {}, must be at most {}, the elements there are", sparse.count, layout.count);
            return Err(fault(format_args!("{place}.count"), message));
        }
        let indices_place = format!("{place}.indices");
        let index = Component::of(sparse.indices.component_type, &indices_place)?;
        if !matches!(index, Component::U8 | Component::U16 | Component::U32) {
            let message = format!("are {}, must be u8, u16 or u32", index.name());
            return Err(fault(indices_place, message));
        }
        let view = |view, place: &str| buffers.view(document, view, &format!("{place}.bufferView"));
        let element = index.bytes();
        let of_indices = Layout { count: sparse.count, element, component: index, place: &indices_place };
        let indices =
            of_indices.elements(view(sparse.indices.buffer_view, &indices_place)?, sparse.indices.byte_offset)?;
        let values_place = format!("{place}.values");
        let of_values = Layout { count: sparse.count, place: &values_place, ..*layout };
        let values = of_values.elements(view(sparse.values.buffer_view, &values_place)?, sparse.values.byte_offset)?;
        Ok(Self { count: sparse.count, indices, index, values })
    }

    /// The elements that are replaced, in ascending order.
    fn replaced(&self, elements: usize, place: &str) -> Result<Vec<usize>, AssetProblem> {
        let mut replaced = Vec::with_capacity(self.count);
        for number in 0..self.count {
            let index = self.index.read(self.indices.bytes, number * self.indices.stride) as usize;
            if index >= elements || replaced.last().is_some_and(|last| *last >= index) {
                let message = format!("index {number} is {index}, must ascend and be below {elements}");
                return Err(fault(format_args!("{place}.sparse.indices"), message));
            }
            replaced.push(index);
        }
        Ok(replaced)
    }
}

/// Reads the elements of an accessor.
pub(super) struct Reader<'r, 'b> {
    accessor: &'r Accessor<'b>,
    replaced: Vec<usize>,
}

impl Reader<'_, '_> {
    /// Element `index`, of which `N` are all numbers or the first ones. Elements that are not there are 0.
    pub(super) fn element<const N: usize>(&self, index: usize) -> [f64; N] {
        let Accessor { component, normalized, elements, sparse, .. } = self.accessor;
        let place = match (sparse, self.replaced.binary_search(&index)) {
            (Some(sparse), Ok(number)) => Some((&sparse.values, number)),
            _ => elements.as_ref().map(|elements| (elements, index)),
        };
        let Some((Elements { bytes, stride }, index)) = place else { return [0.0; N] };
        let start = index.saturating_mul(*stride);
        std::array::from_fn(|number| {
            let stored = component.read(bytes, start.saturating_add(number * component.bytes()));
            if *normalized { component.normalized(stored) } else { stored }
        })
    }
}
