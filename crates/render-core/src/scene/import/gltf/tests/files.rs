//! Containers, and the files beside a file.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;

use super::builder::{SQUARE, container, floats, shorts};
use super::*;

/// A square whose buffer is a file beside it.
fn beside() -> (Vec<u8>, Vec<u8>) {
    let mut builder = Builder::square();
    builder.set("/buffers/0/uri", json!("./geometry%20of/hall.bin"));
    builder.push("images", json!({"uri": "wood.jpg"}));
    builder.push("images", json!({"uri": "unused.png"}));
    builder.push("textures", json!({"source": 0}));
    builder.push("materials", json!({"normalTexture": {"index": 0}, "emissiveTexture": {"index": 0}}));
    (builder.json.to_string().into_bytes(), builder.binary)
}

#[test]
fn files_beside_it_are_known_before_they_are_there() {
    let (json, binary) = beside();
    assert_eq!(GltfFile::files(&json).unwrap(), ["geometry of/hall.bin", "wood.jpg"]);
    assert!(GltfFile::files(&Builder::square().glb()).unwrap().is_empty());
    let file = GltfFile::open(&json, &|name| (name == "geometry of/hall.bin").then_some(&binary[..])).unwrap();
    assert_eq!(file.decode(0, 0).unwrap().triangles.len(), 2);
    let missing = GltfFile::open(&json, &|_| None).err().unwrap().to_string();
    assert!(missing.contains("buffers[0].uri: file \"geometry of/hall.bin\" is missing"), "{missing}");
    let cut = GltfFile::open(&json, &|_| Some(&binary[..10])).err().unwrap().to_string();
    assert!(cut.contains("buffers[0].byteLength: says 60 bytes, but there are 10: it was cut off"), "{cut}");
}

#[test]
fn buffers_may_be_within_the_json() {
    let mut builder = Builder::square();
    let bytes = builder.binary.clone();
    let escaped: String = bytes.iter().map(|byte| format!("%{byte:02x}")).collect();
    let unpadded = STANDARD.encode(&bytes).trim_end_matches('=').to_owned();
    for uri in [
        format!("data:application/octet-stream;base64,{}", STANDARD.encode(&bytes)),
        format!("DATA:;BASE64,{unpadded}"),
        format!("data:application/gltf-buffer;base64,{}", unpadded.replace('+', "%2B").replace('/', "%2F")),
        format!("data:,{escaped}"),
    ] {
        builder.set("/buffers/0/uri", json!(uri));
        for text in [builder.json.to_string(), format!("\u{feff}\n{:#}", builder.json)] {
            let file = open(text.as_bytes()).unwrap();
            assert_eq!(file.decode(0, 0).unwrap().positions.len(), 4, "{uri}");
            assert!(GltfFile::files(text.as_bytes()).unwrap().is_empty());
        }
    }
}

#[test]
fn containers_are_read_as_programs_write_them() {
    let builder = Builder::square();
    let json = builder.json.to_string().into_bytes();
    let zeros = [&json[..], &[0; 3]].concat();
    let other: [(&[u8; 4], &[u8]); 3] = [(b"JSON", &json[..]), (b"BIN\0", &builder.binary), (b"XTRA", b"more")];
    let mut longer = container(&other);
    longer.extend(b"behind the end");
    for bytes in [container(&[(b"JSON", &zeros), (b"BIN\0", &builder.binary)]), container(&other), longer] {
        assert_eq!(open(&bytes).unwrap().decode(0, 0).unwrap().triangles.len(), 2);
    }
}

#[test]
fn containers_that_lie_are_refused() {
    let bytes = Builder::square().glb();
    let changed = |place: usize, number: u32| {
        let mut bytes = bytes.clone();
        bytes[place..place + 4].copy_from_slice(&number.to_le_bytes());
        bytes
    };
    let cases = [
        (changed(4, 1), "header: is of version 1, must be 2: export the scene as glTF 2.0"),
        (changed(8, 1 << 30), "header: says 1073741824 bytes, but the file has"),
        (changed(8, 3), "header: says 3 bytes"),
        (changed(8, 12), "header: no chunk of JSON follows it"),
        (changed(12, u32::MAX), "chunk 0: says 4294967295 bytes, has"),
        (changed(16, 0), "chunk 0: must be the JSON of the file"),
        (bytes[..bytes.len() - 1].to_vec(), "it was cut off"),
        (b"glTF".to_vec(), "header: the file ends after 4 bytes"),
        (container(&[(b"JSON", b"")]), "JSON: EOF while parsing"),
        (container(&[(b"JSON", b"{\"asset\":{\"version\":\"2.0\"}} x")]), "JSON: trailing characters"),
    ];
    for (bytes, expected) in cases {
        let error = open(&bytes).err().unwrap().to_string();
        assert!(error.starts_with("is not a readable glTF file: "), "{error}");
        assert!(error.contains(expected), "no {expected:?} in: {error}");
    }
}

#[test]
fn other_files_are_named() {
    let cases: [(&[u8], &str); 5] = [
        (b"ply\nformat", "it looks like a PLY mesh"),
        (b"", "it looks like an empty file"),
        (b"\xff\xfe{\0", "it looks like UTF-16 text"),
        (b"fox", "it is neither JSON nor a binary container"),
        (b"{\"asset\": 1", "asset: invalid type: integer `1`"),
    ];
    for (bytes, expected) in cases {
        let error = open(bytes).err().unwrap().to_string();
        assert!(error.contains(expected), "no {expected:?} in: {error}");
    }
}

#[test]
fn truncated_and_damaged_files_never_panic() {
    let mut builder = Builder::square();
    builder.attribute("NORMAL", "VEC3", &[0.0, 0.0, 1.0].repeat(4), 4);
    let indices = builder.view(&shorts(&[1, 2]));
    let values = builder.view(&floats(&SQUARE[..6]));
    builder.set(
        "/accessors/0/sparse",
        json!({
            "count": 2,
            "indices": {"bufferView": indices, "componentType": 5123},
            "values": {"bufferView": values},
        }),
    );
    let bytes = builder.glb();
    assert!(open(&bytes).is_ok());
    for length in 0..bytes.len() {
        assert!(open(&bytes[..length]).is_err(), "{length} bytes");
    }
    // Flips every bit and replaces every digit. Whether a file is refused does not matter here.
    let json = builder.json.to_string().into_bytes();
    let attempt = |json: &[u8], binary: &[u8]| _ = open(&container(&[(b"JSON", json), (b"BIN\0", binary)]));
    for (place, byte) in json.iter().enumerate() {
        let replaced = |by: &[u8]| [&json[..place], by, &json[place + 1..]].concat();
        (0..8).for_each(|bit| attempt(&replaced(&[byte ^ 1 << bit]), &builder.binary));
        if byte.is_ascii_digit() {
            for number in ["0", "7", "99", "99999999999", "18446744073709551615", "-1", "1.5", "null"] {
                attempt(&replaced(number.as_bytes()), &builder.binary);
            }
        }
    }
    for place in 0..builder.binary.len() {
        for bit in 0..8 {
            let mut binary = builder.binary.clone();
            binary[place] ^= 1 << bit;
            attempt(&json, &binary);
        }
    }
}

#[test]
fn long_strings_do_not_count_as_json() {
    let mut builder = Builder::square();
    builder.set("/nodes/0/extras", json!("\"".repeat(5 << 20)));
    assert!(open(&builder.glb()).is_ok());
}
