//! The raw form of a node: what a coordinator keeps of the nodes that it has merged.
//!
//! All numbers are little-endian:
//!
//! | bytes | what |
//! | --- | --- |
//! | 8 | `CLRSNODE` |
//! | 4 | 1 for a node of the camera plane, 2 for one of the light plane; 3 and 4 with the layer `caustic` |
//! | 4 x 4 | frame, tile, level, index |
//! | 4 x 4 | tile: left, top, width, height in pixels |
//! | 2 x 4 | samples in a pass, samples in a block |
//! | 4 for each value | the layers of the node, as 32-bit floats |
//! | 32 | BLAKE3 hash of everything before it |
//!
//! The layers are one after the other: beauty, moment, caustic, albedo, normal (three values for each pixel) and depth
//! (one). A node may lack some of them.

use thiserror::Error;

use super::address::{NodeAddress, Plane, Tile};
use super::node::{FirstHitLayers, Node, NodeError, NodeLayers};
use super::sampling::{Sampling, SamplingError};

const MAGIC: &[u8; 8] = b"CLRSNODE";
const HEADER_BYTES: usize = 52;
const HASH_BYTES: usize = blake3::OUT_LEN;

/// Why bytes are not a stored node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum StoreError {
    /// They do not begin as a stored node does.
    #[error("not a stored node: it does not begin with CLRSNODE")]
    NotANode,
    /// They are of another version.
    #[error("the stored node has version {found}; this build reads versions 1 to 4")]
    WrongVersion {
        /// Their version.
        found: u32,
    },
    /// There are fewer or more bytes than the header says.
    #[error("the stored node has {found} bytes; its header says {expected}")]
    WrongLength {
        /// Bytes that there are.
        found: u64,
        /// Bytes that there should be.
        expected: u64,
    },
    /// The hash is wrong: the storage or the transfer has lost bits.
    #[error("the stored node is damaged: its hash does not match")]
    Damaged,
    /// The numbers of samples are impossible.
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    /// The layers are impossible.
    #[error(transparent)]
    Node(#[from] NodeError),
}

/// The raw form of a node.
pub fn encode(node: &Node) -> Vec<u8> {
    let NodeAddress { frame, tile: tile_index, level, index } = node.address();
    let tile = node.tile();
    let sampling = node.sampling();
    let mut bytes = Vec::with_capacity(HEADER_BYTES + node.bytes() + HASH_BYTES);
    bytes.extend_from_slice(MAGIC);
    let version: u32 = match (tile.plane, tile.has_caustic) {
        (Plane::Camera, false) => 1,
        (Plane::Light, false) => 2,
        (Plane::Camera, true) => 3,
        (Plane::Light, true) => 4,
    };
    for number in [
        version,
        frame,
        tile_index,
        level,
        index,
        tile.x,
        tile.y,
        tile.width,
        tile.height,
        sampling.samples_per_pass(),
        sampling.samples_per_block(),
    ] {
        bytes.extend_from_slice(&number.to_le_bytes());
    }
    let mut write = |values: &[f32]| bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    let layers = node.layers();
    write(layers.beauty.as_flattened());
    if let Some(moment) = &layers.moment {
        write(moment.as_flattened());
    }
    if let Some(caustic) = &layers.caustic {
        write(caustic.as_flattened());
    }
    if let Some(first_hit) = &layers.first_hit {
        write(first_hit.albedo.as_flattened());
        write(first_hit.normal.as_flattened());
        write(&first_hit.depth);
    }
    let hash = blake3::hash(&bytes);
    bytes.extend_from_slice(hash.as_bytes());
    bytes
}

/// The hash that ends the raw form of a node.
pub(super) fn hash(node: &Node) -> [u8; HASH_BYTES] {
    encode(node).last_chunk().copied().unwrap_or_default()
}

/// The node of a raw form. Nothing is allocated before its length has been compared with its header.
///
/// # Errors
///
/// [`StoreError`] when the bytes are no node or have been damaged.
pub fn decode(bytes: &[u8]) -> Result<Node, StoreError> {
    let (magic, rest) = bytes.split_first_chunk::<8>().ok_or(StoreError::NotANode)?;
    if magic != MAGIC {
        return Err(StoreError::NotANode);
    }
    let found = bytes.len() as u64;
    let too_short = StoreError::WrongLength { found, expected: (HEADER_BYTES + HASH_BYTES) as u64 };
    let (header, _) = rest.split_first_chunk::<{ HEADER_BYTES - 8 }>().ok_or(too_short)?;
    let (words, _) = header.as_chunks::<4>();
    let mut numbers = words.iter().map(|word| u32::from_le_bytes(*word));
    let mut next = || numbers.next().unwrap_or_default();

    let (plane, has_caustic) = match next() {
        1 => (Plane::Camera, false),
        2 => (Plane::Light, false),
        3 => (Plane::Camera, true),
        4 => (Plane::Light, true),
        found => return Err(StoreError::WrongVersion { found }),
    };
    let address = NodeAddress { frame: next(), tile: next(), level: next(), index: next() };
    let tile = Tile { x: next(), y: next(), width: next(), height: next(), plane, has_caustic };
    let sampling = Sampling::new(next(), next())?;
    if !address.exists() {
        return Err(NodeError::NoSuchNode { level: address.level, index: address.index }.into());
    }

    let moment_values = if sampling.has_moment(address) { 3 } else { 0 };
    let caustic_values = if has_caustic { 3 } else { 0 };
    let first_hit_values = if sampling.has_first_hit(address, plane) { 7 } else { 0 };
    let pixels = u64::from(tile.width) * u64::from(tile.height);
    let value_bytes = pixels.saturating_mul(4 * (3 + moment_values + caustic_values + first_hit_values));
    let expected = value_bytes.saturating_add((HEADER_BYTES + HASH_BYTES) as u64);
    if found != expected {
        return Err(StoreError::WrongLength { found, expected });
    }
    let (hashed, hash) = bytes.split_at(bytes.len() - HASH_BYTES);
    if blake3::hash(hashed).as_bytes() != hash {
        return Err(StoreError::Damaged);
    }

    let mut values = Values { bytes: &hashed[HEADER_BYTES..], pixels: pixels as usize };
    let beauty = values.triples();
    let moment = (moment_values > 0).then(|| values.triples());
    let caustic = has_caustic.then(|| values.triples());
    let first_hit = (first_hit_values > 0).then(|| FirstHitLayers {
        albedo: values.triples(),
        normal: values.triples(),
        depth: values.singles(),
    });
    Ok(Node::from_layers(address, tile, sampling, NodeLayers { beauty, moment, caustic, first_hit })?)
}

/// The layers that have not been read yet.
struct Values<'a> {
    bytes: &'a [u8],
    pixels: usize,
}

impl Values<'_> {
    fn triples(&mut self) -> Vec<[f32; 3]> {
        let mut layer = vec![[0.0; 3]; self.pixels];
        self.fill(layer.as_flattened_mut());
        layer
    }

    fn singles(&mut self) -> Vec<f32> {
        let mut layer = vec![0.0; self.pixels];
        self.fill(&mut layer);
        layer
    }

    fn fill(&mut self, layer: &mut [f32]) {
        let (words, _) = self.bytes.as_chunks::<4>();
        for (value, word) in layer.iter_mut().zip(words) {
            *value = f32::from_le_bytes(*word);
        }
        self.bytes = &self.bytes[size_of_val(layer)..];
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::test_nodes::{bits, noise_node, odd_node};

    const TILE: Tile = Tile::new([16, 32], [5, 3]);

    fn node(level: u32, index: u32) -> Node {
        let address = NodeAddress { frame: 2, tile: 9, level, index };
        noise_node(address, TILE, Sampling::new(4, 16).unwrap())
    }

    #[test]
    fn a_stored_node_comes_back_with_the_same_bits() {
        let with_caustic = Tile { has_caustic: true, ..TILE };
        let with_caustic = noise_node(node(4, 0).address(), with_caustic, node(4, 0).sampling());
        for node in [node(0, 0), node(1, 3), node(2, 1), node(4, 0), with_caustic, odd_node()] {
            let stored = encode(&node);
            let found = decode(&stored).unwrap();
            assert_eq!(found, node);
            assert_eq!(bits(&found), bits(&node));
            assert_eq!(encode(&found), stored);
        }
    }

    #[test]
    fn a_stored_node_that_is_not_whole_is_refused() {
        let stored = encode(&node(2, 0));
        assert_eq!(decode(b""), Err(StoreError::NotANode));
        assert_eq!(decode(b"CLRSNODX and more"), Err(StoreError::NotANode));
        for length in 8..stored.len() {
            assert!(matches!(decode(&stored[..length]), Err(StoreError::WrongLength { .. })), "{length} bytes");
        }
        let longer = [&stored[..], &[0]].concat();
        assert!(matches!(decode(&longer), Err(StoreError::WrongLength { .. })));
    }

    #[test]
    fn a_header_that_claims_more_pixels_than_there_are_is_refused() {
        let mut stored = encode(&node(2, 0));
        stored[36..44].fill(0xff);
        assert!(matches!(decode(&stored), Err(StoreError::WrongLength { .. })));
    }

    #[test]
    fn another_version_is_refused_by_name() {
        let mut stored = encode(&node(0, 0));
        stored[8] = 5;
        assert_eq!(
            decode(&stored).unwrap_err().to_string(),
            "the stored node has version 5; this build reads versions 1 to 4"
        );
    }

    proptest! {
        #[test]
        fn a_stored_node_with_a_flipped_bit_is_refused(bit in any::<prop::sample::Index>()) {
            let mut stored = encode(&node(2, 0));
            let bit = bit.index(stored.len() * 8);
            stored[bit / 8] ^= 1 << (bit % 8);
            prop_assert!(decode(&stored).is_err());
        }

        #[test]
        fn random_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let with_magic = [&MAGIC[..], &1u32.to_le_bytes(), &bytes].concat();
            prop_assert!(decode(&bytes).is_err());
            prop_assert!(decode(&with_magic).is_err());
        }
    }
}
