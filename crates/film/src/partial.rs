//! Partials: the nodes that a worker sends for a lease, as one multi-part OpenEXR file of 32-bit floats.
//!
//! Each node is a part. Its data window is the place of its tile in the image. Its channels are the sums of the node as
//! they are in memory, so that the bits survive. Its attribute `clerestory` names the node, its job and the work that
//! it took. The attribute also holds a hash of everything, because OpenEXR files have none. A partial is not trusted.
//! The headers of all parts are compared with the lease before a pixel is decoded. Then every value is checked.

use std::collections::BTreeMap;

use super::address::{NodeAddress, Tile, TileGrid};
use super::node::{FirstHitLayers, Node, NodeLayers};
use super::openexr::{self, ChannelKind, DecodeBudget, InputPart, OpenExr, OutputPart, Plane, Samples};
use super::openexr_error::OpenExrError;
use super::partial_error::PartialError;
use super::partial_format::{COMPRESSION, Expectation, PartialHeader, Rendered};
use super::partial_header::{self, NodeHeader};
use super::sampling::Sampling;

const BEAUTY: [&str; 3] = ["R", "G", "B"];
const MOMENT: [&str; 3] = ["moment.R", "moment.G", "moment.B"];
const CAUSTIC: [&str; 3] = ["caustic.R", "caustic.G", "caustic.B"];
const ALBEDO: [&str; 3] = ["albedo.R", "albedo.G", "albedo.B"];
const NORMAL: [&str; 3] = ["normal.X", "normal.Y", "normal.Z"];
const DEPTH: &str = "depth.Z";

/// The partial with these nodes, for an image of `grid`. The same nodes give the same bytes.
///
/// # Errors
///
/// [`OpenExrError`] when there is no node, or the same node twice.
pub fn encode<'a>(
    nodes: impl IntoIterator<Item = &'a Rendered>,
    header: &PartialHeader,
    grid: &TileGrid,
) -> Result<Vec<u8>, OpenExrError> {
    let parts: Vec<OutputPart<'_>> =
        nodes.into_iter().map(|node| output_part(node, header)).collect::<Result<_, _>>()?;
    openexr::write([grid.width, grid.height], &parts, COMPRESSION)
}

fn output_part<'a>(rendered: &'a Rendered, header: &PartialHeader) -> Result<OutputPart<'a>, OpenExrError> {
    let node = &rendered.node;
    let NodeAddress { frame, tile, level, index } = node.address();
    let json = openexr::ascii_json(&NodeHeader::new(rendered, header));
    let json = json.map_err(|error| OpenExrError::Damaged(error.to_string()))?;
    let name = format!("frame{frame}.tile{tile}.level{level}.index{index}");
    let mut part = OutputPart { name, json, window: node.tile(), channels: BTreeMap::new() };
    let layers = node.layers();
    part.add_triples(BEAUTY, &layers.beauty);
    if let Some(moment) = &layers.moment {
        part.add_triples(MOMENT, moment);
    }
    if let Some(caustic) = &layers.caustic {
        part.add_triples(CAUSTIC, caustic);
    }
    if let Some(first_hit) = &layers.first_hit {
        part.add_triples(ALBEDO, &first_hit.albedo);
        part.add_triples(NORMAL, &first_hit.normal);
        part.channels.insert(DEPTH.to_owned(), Samples::Float(&first_hit.depth));
    }
    Ok(part)
}

/// The nodes of a partial that may come from anyone, in the order of its parts.
///
/// # Errors
///
/// [`PartialError`] when anything about it is not as expected; nothing of it is then to be used.
pub fn decode(bytes: &[u8], expected: &Expectation, budget: DecodeBudget) -> Result<Vec<Rendered>, PartialError> {
    let file = OpenExr::open(bytes)?;
    let mut headers: Vec<NodeHeader> = Vec::new();
    for (index, part) in file.parts().iter().enumerate() {
        let (header, tile) = NodeHeader::read(index, part.json.as_deref(), expected)?;
        check_part(header.address(), part, tile, expected.sampling)?;
        header.check_counters(tile)?;
        if headers.iter().any(|earlier| earlier.address() == header.address()) {
            return Err(PartialError::RepeatedNode { address: header.address() });
        }
        headers.push(header);
    }
    let planes = file.decode(budget, |_, _| true)?;
    headers.into_iter().zip(planes).map(|(header, planes)| rendered(header, planes, expected)).collect()
}

/// Bytes of the pixels of a partial, as its header has them; nothing is decoded. 0 when it has no header.
pub fn decoded_bytes(bytes: &[u8]) -> u64 {
    let Ok(file) = OpenExr::open(bytes) else { return 0 };
    let part_bytes = |part: &InputPart| {
        let [width, height] = part.size;
        width.saturating_mul(height).saturating_mul(4 * part.channels.len() as u64)
    };
    file.parts().iter().map(part_bytes).fold(0, u64::saturating_add)
}

fn rendered(
    header: NodeHeader,
    planes: BTreeMap<String, Plane>,
    expected: &Expectation,
) -> Result<Rendered, PartialError> {
    let address = header.address();
    let rendered = Rendered { node: node_of_planes(address, planes, expected)?, counters: header.counters };
    let found = partial_header::hash(&rendered);
    if found == header.hash {
        Ok(rendered)
    } else {
        Err(PartialError::Damaged { address, found, announced: header.hash })
    }
}

/// Compares the pixels that a part has with those that the node must have, before they are decoded.
fn check_part(address: NodeAddress, part: &InputPart, tile: Tile, sampling: Sampling) -> Result<(), PartialError> {
    let window_is_tile =
        part.position == [tile.x as i32, tile.y as i32] && part.size == [u64::from(tile.width), u64::from(tile.height)];
    if !window_is_tile {
        let (position, size) = (part.position, part.size);
        return Err(PartialError::WrongDimensions { address, position, size, expected: tile });
    }
    if part.compression != COMPRESSION {
        return Err(PartialError::WrongCompression { address, found: part.compression.to_string() });
    }
    check_channels(address, part, tile, sampling)
}

fn check_channels(address: NodeAddress, part: &InputPart, tile: Tile, sampling: Sampling) -> Result<(), PartialError> {
    let mut names = BEAUTY.to_vec();
    if sampling.has_moment(address) {
        names.extend(MOMENT);
    }
    if tile.has_caustic {
        names.extend(CAUSTIC);
    }
    if sampling.has_first_hit(address, tile.plane) {
        names.extend(ALBEDO.iter().chain(&NORMAL).chain([&DEPTH]));
    }
    for &channel in &names {
        if !part.channels.iter().any(|(name, kind)| name == channel && *kind == ChannelKind::Float) {
            return Err(PartialError::MissingChannel { address, channel });
        }
    }
    match part.channels.iter().find(|(name, _)| !names.contains(&name.as_str())) {
        Some((channel, _)) => Err(PartialError::UnexpectedChannel { address, channel: channel.clone() }),
        None if part.channels.len() > names.len() => {
            Err(PartialError::UnexpectedChannel { address, channel: "of a name that is there twice".to_owned() })
        }
        None => Ok(()),
    }
}

fn node_of_planes(
    address: NodeAddress,
    mut planes: BTreeMap<String, Plane>,
    expected: &Expectation,
) -> Result<Node, PartialError> {
    let sampling = expected.sampling;
    let tile = expected.grid.tile(address.tile).ok_or(PartialError::UnexpectedNode { address })?;
    let mut plane = |channel: &'static str| match planes.remove(channel) {
        Some(Plane::Float(values)) => Ok(values),
        Some(Plane::Integer(_)) | None => Err(PartialError::MissingChannel { address, channel }),
    };
    let beauty = openexr::interleave(BEAUTY, &mut plane)?;
    let moment = if sampling.has_moment(address) { Some(openexr::interleave(MOMENT, &mut plane)?) } else { None };
    let caustic = if tile.has_caustic { Some(openexr::interleave(CAUSTIC, &mut plane)?) } else { None };
    let first_hit = if sampling.has_first_hit(address, tile.plane) {
        Some(FirstHitLayers {
            albedo: openexr::interleave(ALBEDO, &mut plane)?,
            normal: openexr::interleave(NORMAL, &mut plane)?,
            depth: plane(DEPTH)?,
        })
    } else {
        None
    };
    Node::from_layers(address, tile, sampling, NodeLayers { beauty, moment, caustic, first_hit })
        .map_err(|source| PartialError::BadValue { address, source })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use exr::meta::attribute::Compression;

    use super::*;
    use crate::address::Tile;
    use crate::counters::Counters;
    use crate::openexr::tests::{TESTS_BESIDE, address_space_bytes, attribute, patch};
    use crate::test_nodes::{bits, noise_node, odd_node};

    const GRID: TileGrid = TileGrid::new(7, 6, 4);
    const BUDGET: DecodeBudget = DecodeBudget { pixel_bytes: 1 << 20 };

    fn sampling() -> Sampling {
        Sampling::new(4, 16).unwrap()
    }

    fn address(tile: u32, level: u32, index: u32) -> NodeAddress {
        NodeAddress { frame: 1, tile, level, index }
    }

    fn node(address: NodeAddress) -> Rendered {
        counted(noise_node(address, GRID.tile(address.tile).unwrap(), sampling()))
    }

    /// A node with counters as a renderer might bring.
    fn counted(node: Node) -> Rendered {
        let samples = node.samples() * node.tile().pixels() as u64;
        Rendered { node, counters: Counters { rays: 3 * samples + 1, samples, ..Counters::default() } }
    }

    fn nodes() -> Vec<Rendered> {
        [address(0, 3, 0), address(1, 0, 9), address(2, 2, 1), address(3, 1, 1)].map(node).to_vec()
    }

    fn header() -> PartialHeader {
        PartialHeader {
            job: "job-7".to_owned(),
            scene_hash: "5ce7e".to_owned(),
            build: "test \u{1F6E0} build".to_owned(),
        }
    }

    fn expectation(nodes: &[Rendered]) -> Expectation {
        Expectation {
            job: header().job,
            scene_hash: header().scene_hash,
            grid: GRID,
            sampling: sampling(),
            allowed: nodes.iter().map(|rendered| rendered.node.address()).collect(),
        }
    }

    fn encoded(nodes: &[Rendered]) -> Vec<u8> {
        encode(nodes, &header(), &GRID).unwrap()
    }

    fn all_bits(nodes: &[Rendered]) -> Vec<Vec<u32>> {
        nodes.iter().map(|rendered| bits(&rendered.node)).collect()
    }

    #[test]
    fn nodes_of_the_light_plane_come_back_as_they_were() {
        check_light_nodes(GRID.with_light_plane(true));
        check_light_nodes(GRID.with_light_plane(true).with_caustic(true));
    }

    #[track_caller]
    fn check_light_nodes(grid: TileGrid) {
        let tile = grid.light_tiles().start;
        let nodes: Vec<Rendered> = [(0, 0), (2, 1)]
            .map(|(level, index)| address(tile, level, index))
            .map(|address| counted(noise_node(address, grid.tile(tile).unwrap(), sampling())))
            .to_vec();
        assert!(nodes.iter().all(|rendered| rendered.node.layers().first_hit.is_none()));
        let expected = Expectation { grid, ..expectation(&nodes) };
        let bytes = encode(&nodes, &header(), &grid).unwrap();
        assert_eq!(decode(&bytes, &expected, BUDGET).unwrap(), nodes);
        for rendered in &nodes {
            assert_eq!(crate::store::decode(&crate::store::encode(&rendered.node)).unwrap(), rendered.node);
        }
        let without = Expectation { grid: GRID, ..expected };
        assert_refused(&bytes, &without, "tile 4");
    }

    #[test]
    fn nodes_have_the_layer_caustic_where_the_film_has_it() {
        let grid = GRID.with_caustic(true);
        let with = [address(0, 3, 0), address(3, 0, 9)]
            .map(|address| counted(noise_node(address, grid.tile(address.tile).unwrap(), sampling())));
        let bytes = encode(&with, &header(), &grid).unwrap();
        let expected = Expectation { grid, ..expectation(&with) };
        let found = decode(&bytes, &expected, expected.budget()).unwrap();
        assert_eq!(all_bits(&found), all_bits(&with));
        for rendered in &with {
            assert_eq!(crate::store::decode(&crate::store::encode(&rendered.node)).unwrap(), rendered.node);
        }
        // Of a worker of an older build, and for a job that an older build began.
        let without = nodes();
        assert_refused(&encoded(&without[..1]), &expected, "lacks the 32-bit float channel caustic.R");
        assert_refused(&bytes, &expectation(&with), "has a channel caustic.B, which it must not have");
        let values = vec![f32::NAN; with[0].node.tile().pixels()];
        let nan = forged(&with[0], |part| _ = part.channels.insert("caustic.G".to_owned(), Samples::Float(&values)));
        assert_refused(&nan, &expected, "layer caustic has the value NaN at pixel (0, 0)");
    }

    #[track_caller]
    fn assert_refused(bytes: &[u8], expected: &Expectation, message: &str) {
        let error = decode(bytes, expected, BUDGET).unwrap_err().to_string();
        assert!(error.contains(message), "{error:?} does not say {message:?}");
    }

    #[test]
    fn nodes_come_back_with_the_same_bits() {
        for nodes in [nodes(), nodes()[..1].to_vec()] {
            let bytes = encoded(&nodes);
            let found = decode(&bytes, &expectation(&nodes), BUDGET).unwrap();
            assert_eq!(found, nodes);
            assert_eq!(all_bits(&found), all_bits(&nodes));
        }
    }

    #[test]
    fn subnormal_and_extreme_values_and_negative_zero_come_back_with_the_same_bits() {
        let node = odd_node();
        let grid = TileGrid::new(16, 8, 4);
        let tile = grid.tile(6).unwrap();
        assert_eq!(tile, Tile::new([8, 4], [4, 4]));
        let node = counted(
            Node::from_layers(
                NodeAddress { tile: 2, ..node.address() },
                Tile { has_caustic: true, ..Tile::new([8, 0], [4, 2]) },
                node.sampling(),
                node.layers().clone(),
            )
            .unwrap(),
        );
        let grid = TileGrid::new(16, 2, 4).with_caustic(true);
        let bytes = encode(std::slice::from_ref(&node), &header(), &grid).unwrap();
        let expected = Expectation { grid, ..expectation(std::slice::from_ref(&node)) };
        let found = decode(&bytes, &expected, BUDGET).unwrap();
        assert_eq!(bits(&found[0].node), bits(&node.node));
    }

    #[test]
    fn the_same_nodes_give_the_same_bytes() {
        let nodes = nodes();
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let bytes = encoded(&nodes);
        assert_eq!(one_thread.install(|| encoded(&nodes)), bytes);
        assert_eq!(encoded(&nodes), bytes);
    }

    #[test]
    fn a_part_of_what_was_leased_is_taken() {
        let nodes = nodes();
        let found = decode(&encoded(&nodes[1..2]), &expectation(&nodes), BUDGET).unwrap();
        assert_eq!(found, nodes[1..2]);
    }

    #[test]
    fn nodes_with_all_their_layers_need_no_more_than_expected() {
        for nodes in [[address(0, 3, 0), address(3, 2, 0)], [address(1, 4, 0), address(2, 5, 0)]] {
            let nodes = nodes.map(node);
            let layers = || nodes.iter().map(|rendered| rendered.node.layers());
            assert!(layers().all(|layers| layers.moment.is_some() && layers.first_hit.is_some()));
            let expected = expectation(&nodes);
            assert_eq!(decode(&encoded(&nodes), &expected, expected.budget()).unwrap(), nodes);
        }
    }

    #[test]
    fn what_is_not_as_expected_is_refused_by_name() {
        let nodes = nodes();
        let bytes = encoded(&nodes);
        let good = expectation(&nodes);
        let job = Expectation { job: "job-8".to_owned(), ..good.clone() };
        assert_refused(&bytes, &job, "the partial is of job job-7; it was sent for job job-8");
        let scene = Expectation { scene_hash: "0ther".to_owned(), ..good.clone() };
        assert_refused(&bytes, &scene, "a scene with hash 5ce7e; the job's scene has 0ther");
        let fewer = expectation(&nodes[1..]);
        assert_refused(&bytes, &fewer, "level 3, index 0) was not leased");
        let sampling = Expectation { sampling: Sampling::new(8, 16).unwrap(), ..good.clone() };
        assert_refused(
            &bytes,
            &sampling,
            "was rendered with 4 samples in a pass and 16 in a block; the job has 8 samples",
        );
        let grid = Expectation { grid: TileGrid { width: 8, ..GRID }, ..good.clone() };
        assert_refused(&bytes, &grid, "has a data window of 3 x 4 pixels at (4, 0); its tile is 4 x 4 at (4, 0)");
        let budget = DecodeBudget { pixel_bytes: 1000 };
        assert!(matches!(
            decode(&bytes, &good, budget),
            Err(PartialError::OpenExr(OpenExrError::TooLarge { allowed: 1000, .. }))
        ));
        assert_refused(b"PNG or anything else", &good, "not an OpenEXR file");
        assert_refused(&bytes[..bytes.len() - 1], &good, "damaged");
        assert_refused(&bytes[..100], &good, "damaged");
    }

    #[test]
    fn nodes_that_are_no_longer_in_the_grid_are_refused() {
        let nodes = nodes();
        let grid = Expectation { grid: TileGrid::new(4, 4, 4), ..expectation(&nodes) };
        assert_refused(&encoded(&nodes[3..]), &grid, "tile 3, level 1, index 1) was not leased");
    }

    /// The partial of `node` with its header or channels changed.
    fn forged<'a>(node: &'a Rendered, change: impl Fn(&mut OutputPart<'a>)) -> Vec<u8> {
        let mut part = output_part(node, &header()).unwrap();
        change(&mut part);
        openexr::write([GRID.width, GRID.height], &[part], COMPRESSION).unwrap()
    }

    #[test]
    fn forged_headers_are_refused_by_name() {
        let nodes = nodes();
        let good = expectation(&nodes);
        let check = |from: &str, to: &str, message: &str| {
            let bytes = forged(&nodes[0], |part| {
                assert!(part.json.contains(from), "{}", part.json);
                part.json = part.json.replace(from, to);
            });
            assert_refused(&bytes, &good, message);
        };
        check(r#""version":2"#, r#""version":1"#, "part 0: the header has version 1; this build reads version 2");
        check(r#""version":2,"#, "", "missing field `version`");
        check(r#""passes":8"#, r#""passes":16"#, "claims passes 16; it must be 8");
        check(r#""first_pass":0"#, r#""first_pass":8"#, "claims first_pass 8; it must be 0");
        check(r#""samples":32"#, r#""samples":-32"#, "node: samples: invalid value: integer `-32`, expected u64");
        check(r#""samples":32"#, r#""samples":33"#, "claims samples 33; it must be 32");
        check(r#""samples":32"#, r#""pixels":32"#, "unknown field `pixels`");
        check(r#""samples":512"#, r#""samples":511"#, "claims counters.samples 511; it must be 512");
        check(r#""rays":1537,"#, "", "counters: missing field `rays`");
        check(r#""rays":1537"#, r#""rays":-1"#, "counters.rays: invalid value: integer `-1`, expected u64");
        check(
            r#""rays":1537"#,
            r#""rays":18000000000000000000"#,
            "claims counters.rays 18000000000000000000; it must be at",
        );
        check(r#""rays":1537"#, r#""rays":1538"#, "is damaged: its values have the hash");
        check(r#""level":3"#, r#""level":40"#, "level 40, index 0) was not leased");
        check(r#""samples_per_block":16"#, r#""samples_per_block":17"#, "samples_per_block is 17");
        check(r#""hash":""#, r#""hash":"0"#, "is damaged: its values have the hash");
        let longer = forged(&nodes[0], |part| part.json.push('x'));
        assert_refused(
            &longer,
            &good,
            "part 0: the attribute clerestory is not the header of a node: trailing characters",
        );
        let all = forged(&nodes[0], |part| part.json = "{".to_owned());
        assert_refused(&all, &good, "part 0: the attribute clerestory is not the header of a node: EOF");
    }

    #[test]
    fn forged_channels_and_values_are_refused_by_name() {
        let nodes = nodes();
        let good = expectation(&nodes);
        let missing = forged(&nodes[0], |part| _ = part.channels.remove("moment.G"));
        assert_refused(&missing, &good, "lacks the 32-bit float channel moment.G");
        let added = forged(&nodes[1], |part| _ = part.channels.insert("A".to_owned(), part.channels["R"]));
        assert_refused(&added, &good, "has a channel A, which it must not have");
        let integers = vec![0; nodes[1].node.tile().pixels()];
        let integer = forged(&nodes[1], |part| _ = part.channels.insert("R".to_owned(), Samples::Integer(&integers)));
        assert_refused(&integer, &good, "lacks the 32-bit float channel R");

        for (value, message) in
            [(f32::NAN, "value NaN"), (f32::INFINITY, "value inf"), (f32::NEG_INFINITY, "value -inf")]
        {
            let mut values = vec![1.0; nodes[0].node.tile().pixels()];
            values[5] = value;
            for channel in ["G", "moment.B", "albedo.R", "normal.Z", "depth.Z"] {
                let bytes =
                    forged(&nodes[0], |part| _ = part.channels.insert(channel.to_owned(), Samples::Float(&values)));
                assert_refused(&bytes, &good, message);
                assert_refused(&bytes, &good, "at pixel (1, 1)");
            }
        }
        let mut values: Vec<f32> = nodes[0].node.layers().beauty.iter().map(|sums| sums[1]).collect();
        values[5] = values[5].next_up();
        let off = forged(&nodes[0], |part| _ = part.channels.insert("G".to_owned(), Samples::Float(&values)));
        assert_refused(&off, &good, "node (frame 1, tile 0, level 3, index 0) is damaged: its values have the hash");
        let negative = vec![-1.0; nodes[0].node.tile().pixels()];
        let moment =
            forged(&nodes[0], |part| _ = part.channels.insert("moment.R".to_owned(), Samples::Float(&negative)));
        assert_refused(&moment, &good, "layer moment is negative at pixel (0, 0)");
    }

    #[test]
    fn a_node_that_is_there_twice_is_refused() {
        let nodes = nodes();
        let parts =
            ["a", "b"].map(|name| OutputPart { name: name.to_owned(), ..output_part(&nodes[1], &header()).unwrap() });
        let bytes = openexr::write([GRID.width, GRID.height], &parts, COMPRESSION).unwrap();
        assert_refused(&bytes, &expectation(&nodes), "level 0, index 9) is there twice");
    }

    #[test]
    fn another_compression_is_refused() {
        let nodes = nodes();
        let part = output_part(&nodes[1], &header()).unwrap();
        let bytes = openexr::write([GRID.width, GRID.height], &[part], Compression::PIZ).unwrap();
        assert_refused(&bytes, &expectation(&nodes), "it must be");
    }

    #[test]
    fn a_header_that_claims_sixty_thousand_pixels_each_way_is_refused_without_allocating() {
        let nodes = nodes();
        let mut bytes = encoded(&nodes[..1]);
        let window = attribute(&[0, 0, 60_000, 60_000]);
        patch(&mut bytes, "dataWindow", &window);
        patch(&mut bytes, "displayWindow", &window);
        patch(&mut bytes, "chunkCount", &attribute(&[60_001]));
        let before = address_space_bytes();
        assert_refused(
            &bytes,
            &expectation(&nodes),
            "has a data window of 60001 x 60001 pixels at (0, 0); its tile is 4 x 4",
        );
        assert!(address_space_bytes() - before < TESTS_BESIDE, "memory was allocated");
    }

    /// A change that a broken or hostile sender might make.
    fn mutation() -> impl Strategy<Value = Vec<(prop::sample::Index, u8)>> {
        prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)
    }

    proptest! {
        #![proptest_config(crate::test_nodes::fixed_seed(2000))]

        #[test]
        fn a_changed_partial_is_an_error_or_the_same_nodes_never_a_crash(
            changes in mutation(),
            length in prop::option::of(any::<prop::sample::Index>()),
        ) {
            let nodes = nodes();
            let mut bytes = encoded(&nodes[1..3]);
            for (position, value) in changes {
                let position = position.index(bytes.len());
                bytes[position] = value;
            }
            if let Some(length) = length {
                bytes.truncate(length.index(bytes.len()));
            }
            let before = address_space_bytes();
            if let Ok(found) = decode(&bytes, &expectation(&nodes), BUDGET) {
                prop_assert_eq!(&found, &nodes[1..3]);
                prop_assert_eq!(all_bits(&found), all_bits(&nodes[1..3]));
            }
            prop_assert!(address_space_bytes() - before < TESTS_BESIDE);
        }

        #[test]
        fn random_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let nodes = nodes();
            prop_assert!(decode(&bytes, &expectation(&nodes), BUDGET).is_err());
            let with_magic = [&[0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0][..], &bytes].concat();
            prop_assert!(decode(&with_magic, &expectation(&nodes), BUDGET).is_err());
        }
    }
}
