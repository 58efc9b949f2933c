//! Small glTF files, changed member by member.

use serde_json::{Value, json};

use super::super::GltfFile;
use crate::settings::AssetProblem;

/// A file in the making. Its JSON has one buffer, which the binary container holds.
pub(in crate::scene::import) struct Builder {
    pub(in crate::scene::import) json: Value,
    pub(in crate::scene::import) binary: Vec<u8>,
}

pub(in crate::scene::import) const F32: u32 = 5126;
pub(in crate::scene::import) const U16: u32 = 5123;
pub(in crate::scene::import) const U8: u32 = 5121;

/// Numbers of single precision as bytes.
pub(in crate::scene::import) fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

/// Numbers of 16 bits as bytes.
pub(in crate::scene::import) fn shorts(numbers: &[u16]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

/// The corners of a square, counterclockwise.
pub(in crate::scene::import) const SQUARE: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];

impl Builder {
    /// An empty scene.
    pub(in crate::scene::import) fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": 0}],
            "bufferViews": [], "accessors": [], "materials": [], "textures": [], "images": [], "samplers": [],
            "meshes": [], "nodes": [], "scenes": [{"nodes": []}], "scene": 0,
        });
        Self { json, binary: Vec::new() }
    }

    /// Two triangles: positions are accessor 0, indices accessor 1, one mesh, one node.
    pub(in crate::scene::import) fn square() -> Self {
        let mut builder = Self::new();
        builder.accessor(&floats(&SQUARE), json!({"componentType": F32, "type": "VEC3", "count": 4}));
        let indices = json!({"componentType": U16, "type": "SCALAR", "count": 6});
        builder.accessor(&shorts(&[0, 1, 2, 0, 2, 3]), indices);
        builder.push("meshes", json!({"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}));
        builder.node(json!({"mesh": 0}));
        builder
    }

    /// Adds an element to a list of the file, and answers its number.
    pub(in crate::scene::import) fn push(&mut self, list: &str, element: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(element);
        list.len() - 1
    }

    /// Adds bytes to the buffer, at a multiple of four, as a view.
    pub(in crate::scene::import) fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let offset = self.binary.len();
        self.binary.extend(bytes);
        self.json["buffers"][0]["byteLength"] = json!(self.binary.len());
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    /// Adds an accessor with a view of its own.
    pub(in crate::scene::import) fn accessor(&mut self, bytes: &[u8], mut accessor: Value) -> usize {
        accessor["bufferView"] = json!(self.view(bytes));
        self.push("accessors", accessor)
    }

    /// Adds an attribute of single precision to the primitive.
    pub(in crate::scene::import) fn attribute(&mut self, name: &str, shape: &str, numbers: &[f32], count: usize) {
        let accessor = json!({"componentType": F32, "type": shape, "count": count});
        let accessor = self.accessor(&floats(numbers), accessor);
        self.json["meshes"][0]["primitives"][0]["attributes"][name] = json!(accessor);
    }

    /// Adds a root to the scene.
    pub(in crate::scene::import) fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    /// Sets the member at a JSON pointer, whose parent is there.
    pub(in crate::scene::import) fn set(&mut self, pointer: &str, value: Value) -> &mut Self {
        let (parent, name) = pointer.rsplit_once('/').unwrap();
        let parent = self.json.pointer_mut(parent).unwrap();
        match parent {
            Value::Array(list) => list[name.parse::<usize>().unwrap()] = value,
            object => object[name] = value,
        }
        self
    }

    /// The file as a binary container.
    pub(in crate::scene::import) fn glb(&self) -> Vec<u8> {
        let json = self.json.to_string().into_bytes();
        container(&[(b"JSON", &padded(json, b' ')), (b"BIN\0", &padded(self.binary.clone(), 0))])
    }
}

fn padded(mut bytes: Vec<u8>, with: u8) -> Vec<u8> {
    bytes.resize(bytes.len().next_multiple_of(4), with);
    bytes
}

/// A binary container with these chunks.
pub(in crate::scene::import) fn container(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    let chunk =
        |(kind, content): &(&[u8; 4], &[u8])| [&(content.len() as u32).to_le_bytes()[..], &kind[..], content].concat();
    let body: Vec<u8> = chunks.iter().flat_map(chunk).collect();
    [&b"glTF"[..], &2_u32.to_le_bytes(), &(12 + body.len() as u32).to_le_bytes(), &body].concat()
}

/// Opens a file that names no other, and decodes all of it.
pub(in crate::scene::import) fn open(bytes: &[u8]) -> Result<GltfFile<'_>, AssetProblem> {
    let file = GltfFile::open(bytes, &|_| None)?;
    let sizes: Vec<usize> = file.meshes().map(|mesh| mesh.primitives.len()).collect();
    for (mesh, primitives) in sizes.into_iter().enumerate() {
        for primitive in 0..primitives {
            let decoded = file.decode(mesh, primitive)?;
            let info = &file.meshes().nth(mesh).unwrap().primitives[primitive];
            assert_eq!(decoded.triangles.len(), info.triangles, "the count before decoding");
            assert!(decoded.positions.len() <= info.vertices, "the count before decoding");
        }
    }
    Ok(file)
}
