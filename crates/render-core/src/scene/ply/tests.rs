//! What exporters write into PLY files, and what is refused.

use super::*;

fn decode(bytes: impl AsRef<[u8]>) -> Result<TriangleMesh, AssetProblem> {
    let file = PlyFile::open(bytes.as_ref())?;
    let mesh = file.decode()?;
    assert_eq!(mesh.triangles.len(), file.triangles(), "the count before decoding");
    Ok(mesh)
}

const TEXT: &str = "ply\nformat ascii 1.0\ncomment a square\nelement vertex 4\nproperty float x\nproperty float y\n\
                    property float z\nproperty uchar red\nproperty float s\nproperty float t\nelement face 1\n\
                    property list uchar int vertex_indices\nelement edge 1\nproperty int vertex1\nend_header\n\
                    0 0 0 255 0 0\n1 0 0 0 1 0\n1 1 0 0 1 1\n0 1 0.5 0 0 1\n4 0 1 2 3\n2\n";

fn binary(big_endian: bool) -> Vec<u8> {
    let format = if big_endian { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = format!(
        "ply\nformat {format} 1.0\nelement vertex 4\nproperty double x\nproperty float y\nproperty short z\n\
         element face 2\nproperty list uchar uint vertex_index\nproperty uchar flags\nend_header\n"
    )
    .into_bytes();
    let order = |mut value: Vec<u8>| {
        if !big_endian {
            value.reverse();
        }
        value
    };
    for (x, y, z) in [(0.0, 0.0, 0), (1.0, 0.0, 0), (1.0, 1.0, 0), (0.0, 1.0, -7)] {
        bytes.extend(order(f64::to_be_bytes(x).to_vec()));
        bytes.extend(order(f32::to_be_bytes(y).to_vec()));
        bytes.extend(order(i16::to_be_bytes(z).to_vec()));
    }
    for face in [[0, 1, 2], [0, 2, 3]] {
        bytes.push(3);
        face.into_iter().for_each(|index| bytes.extend(order(u32::to_be_bytes(index).to_vec())));
        bytes.push(9);
    }
    bytes
}

#[test]
fn a_text_file_is_read_with_its_texture_coordinates_and_polygons() {
    let mesh = decode(TEXT).unwrap();
    assert_eq!(mesh.positions[3], DVec3::new(0.0, 1.0, 0.5));
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.texture_coordinates[2], DVec2::ONE);
    assert!(mesh.normals.is_empty());
}

#[test]
fn both_byte_orders_hold_the_same_mesh() {
    let big = decode(binary(true)).unwrap();
    assert_eq!(big.positions[3], DVec3::new(0.0, 1.0, -7.0));
    assert_eq!(big.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert!(big.texture_coordinates.is_empty());
    assert_eq!(decode(binary(false)).unwrap(), big);
    // What comes behind the elements is not of them.
    assert_eq!(decode([binary(false), b"more".to_vec()].concat()).unwrap(), big);
}

#[test]
fn line_ends_of_a_binary_header_are_those_of_its_first_line() {
    let with = |line_end: &str| {
        let file = binary(false);
        let end = file.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
        let header = String::from_utf8(file[..end].to_vec()).unwrap();
        // The first byte of the first number looks like a line end.
        let mut body = file[end..].to_vec();
        body[0] = b'\n';
        [header.replace('\n', line_end).into_bytes(), body].concat()
    };
    let expected = decode(with("\n")).unwrap();
    assert!(expected.positions[0].x > 0.0);
    for line_end in ["\r\n", "\r"] {
        assert_eq!(decode(with(line_end)).unwrap(), expected, "{line_end:?}");
    }
}

#[test]
fn what_exporters_write_is_the_same_square() {
    let plain = decode(TEXT).unwrap();
    let replaced = |old: &str, new: &str| {
        assert!(TEXT.contains(old), "{old}");
        TEXT.replace(old, new).into_bytes()
    };
    let latin_1 = |text: &str| text.chars().map(|character| character as u8).collect::<Vec<u8>>();
    let cases: [(&str, Vec<u8>); 26] = [
        ("CRLF", replaced("\n", "\r\n")),
        ("CR", replaced("\n", "\r")),
        ("no end of the last line", TEXT.trim_end().as_bytes().to_vec()),
        ("a byte-order mark", [b"\xef\xbb\xbf", TEXT.as_bytes()].concat()),
        ("blank lines", replaced("\n", "\n \n")),
        ("tabs and more blanks", replaced(" ", " \t ")),
        ("blanks at the ends", replaced("\n", " \n ")),
        ("numbers of C", replaced("1 1 0 0 1 1", "1. +1 .0 0 1.000e+0 1E0")),
        ("zeros of C", replaced("0 0 0 255 0 0", "-0. +.0 0e5 255 0. 0")),
        ("a Latin-1 comment", latin_1(&TEXT.replace("a square", "fen\u{ea}tre"))),
        ("Latin-1 information", latin_1(&TEXT.replace("comment a square", "obj_info verre sal\u{e9}"))),
        ("an empty comment", replaced("comment a square", "comment\nobj_info")),
        ("a comment between properties", replaced("property float y", "comment y\nproperty float y")),
        ("the other name of corners", replaced("vertex_indices", "vertex_index")),
        ("new names of types", replaced("property float", "property float32")),
        ("other types of lists", replaced("list uchar int", "list int ushort")),
        ("a face without corners", replaced("face 1", "face 2")),
        ("faces of one and two corners", replaced("face 1", "face 3")),
        (
            "more properties of faces",
            replaced("vertex_indices\n", "vertex_indices\nproperty uchar flags\nproperty list uchar float texcoord\n"),
        ),
        ("properties of faces before", replaced("property list", "property list uchar float quality\nproperty list")),
        ("no number in what is left out", replaced("255", "nan")),
        ("a fraction in what is left out", replaced("255", "0.75")),
        ("elements before", replaced("element vertex", "element camera 1\nproperty float fov\nelement vertex")),
        ("elements without records", replaced("element edge 1", "element material 0\nproperty int a\nelement edge 1")),
        (
            "strips without records",
            replaced("element edge 1", "element tristrips 0\nproperty list int int i\nelement edge 1"),
        ),
        ("what comes behind", [TEXT.as_bytes(), b"a b c"].concat()),
    ];
    let bodies = [
        ("a face without corners", "4 0 1 2 3\n", "0\n4 0 1 2 3\n"),
        ("faces of one and two corners", "4 0 1 2 3\n", "1 3\n4 0 1 2 3\n2 1 2\n"),
        ("more properties of faces", "4 0 1 2 3\n", "4 0 1 2 3 7 2 .5 nan\n"),
        ("properties of faces before", "4 0 1 2 3\n", "0 4 0 1 2 3\n"),
        ("elements before", "end_header\n", "end_header\n35.\n"),
    ];
    for (what, mut bytes) in cases {
        for (_, old, new) in bodies.iter().filter(|(name, ..)| *name == what) {
            bytes = String::from_utf8(bytes).unwrap().replace(old, new).into_bytes();
        }
        let mesh = decode(&bytes).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(mesh, plain, "{what}");
    }
}

#[test]
fn faces_may_come_before_the_vertices_that_they_name() {
    let text = "ply\nformat ascii 1.0\nelement face 2\nproperty list uchar int vertex_indices\nelement vertex 4\n\
                property float x\nproperty float y\nproperty float z\nend_header\n\
                4 1 2 3 0\n3 0 1 2\n0 0 0\n2 -1 0\n.5 0 0\n2 1 0\n";
    let mesh = decode(text).unwrap();
    assert_eq!(mesh.positions[1], DVec3::new(2.0, -1.0, 0.0));
    // The first has a dent at vertex 2.
    let area = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).z / 2.0;
    let areas: Vec<f64> = mesh.triangles.iter().map(|face| area(face.map(|at| mesh.positions[at as usize]))).collect();
    assert_eq!(areas[..2], [0.25, 0.25]);
    assert_eq!(mesh.triangles[2], [0, 1, 2]);
}

#[test]
fn normals_and_texture_coordinates_that_are_none_are_judged_where_they_count() {
    let text = TEXT.replace("uchar red", "float nx\nproperty float ny\nproperty float nz");
    let text = text.replace("0 0 0 255 0 0", "0 0 0 nan 0 1 inf 0").replace("1 0 0 0 1 0", "1 0 0 0 0 1 1 0");
    let text = text.replace("1 1 0 0 1 1", "1 1 0 0 0 1 1 1").replace("0 1 0.5 0 0 1", "0 1 .5 0 0 1 0 1");
    let mesh = decode(text).unwrap();
    assert!(mesh.normals[0].is_nan() && mesh.texture_coordinates[0].x.is_nan());
    assert_eq!(mesh.normals[3], DVec3::Z);
}

#[test]
fn counts_that_the_file_cannot_hold_are_refused_before_reading() {
    for (element, encoding) in [("vertex 4", "ascii"), ("face 1", "ascii"), ("vertex 4", "binary_little_endian")] {
        let (name, _) = element.split_once(' ').unwrap();
        let text = TEXT.replace(element, &format!("{name} 4000000000")).replace("ascii", encoding);
        let message = decode(text).unwrap_err().to_string();
        assert!(message.contains("too short to hold"), "{message}");
    }
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 0\n\
                  property int x\nproperty int y\nproperty int z\nelement face 0\n\
                  property list uchar int vertex_index\nelement nothing 4000000000\nend_header\n";
    assert!(decode(header).unwrap_err().to_string().contains("too short to hold"));
}

#[test]
fn errors_name_the_place_and_what_would_be_right() {
    let cases = [
        ("ply\n", "plx\n", "it begins with \"plx\", must begin with \"ply\""),
        ("format ascii 1.0\n", "", "its header has no line \"format\""),
        ("ascii", "utf8", "line 2, \"format utf8 1.0\": the format must be ascii"),
        ("ascii 1.0", "ascii 2.0", "the version must be 1.0"),
        (
            "comment a square",
            "format binary_big_endian 1.0",
            "line 3, \"format binary_big_endian 1.0\": an earlier line",
        ),
        ("comment a square", "coment a square", "line 3, \"coment a square\": a header has the lines format"),
        ("comment a square", "property float x", "must come after an element"),
        ("vertex 4", "vertex four", "must have a whole number of elements"),
        ("vertex 4", "vertex -4", "must have a whole number of elements"),
        ("element edge", "element face", "an earlier element has the same name"),
        ("float y", "float x", "line 6, \"property float x\": an earlier property has the same name"),
        ("float y", "half y", "the type must be char, uchar"),
        ("list uchar int", "list float int", "the length of a list must be a whole number"),
        ("list uchar int", "list uchar float", "\"vertex_indices\" of its faces must be of whole numbers"),
        ("property float y", "property list int float y", "\"y\" of its vertices must not be a list"),
        ("end_header", "comment", "line 16, \"0 0 0 255 0 0\": a header has the lines format"),
        ("property float z\n", "", "vertices are without the property \"z\""),
        ("element vertex", "element vertices", "it has no element \"vertex\", only \"vertices\", \"face\", \"edge\""),
        (
            "element face",
            "element polygon",
            "it has no element \"face\", only \"vertex\", \"polygon\", \"edge\": points",
        ),
        ("element edge", "element tristrips", "it has 1 elements \"tristrips\", which are not read"),
        ("vertex_indices", "corners", "its faces have no list \"vertex_indices\""),
        ("1 1 0 0 1 1", "1 1 nan 0 1 1", "line 18, \"1 1 nan 0 1 1\": vertex 2 is at [1, 1, NaN], must have finite"),
        ("1 1 0 0 1 1", "1 1e39 0 0 1 1", "vertex 2 is at [1, inf, 0], must have finite coordinates"),
        ("1 1 0 0 1 1", "1 1,5 0 0 1 1", "vertex 2 has \"1,5\", must be a number with a point, not a comma"),
        ("1 1 0 0 1 1", "1 one 0 0 1 1", "vertex 2 has \"one\", must be a number such as"),
        ("1 1 0 0 1 1", "1 1 0 0 1", "line 18, \"1 1 0 0 1\": vertex 2 has fewer numbers than the header says"),
        ("1 1 0 0 1 1", "1 1 0 0 1 1 1", "line 18, \"1 1 0 0 1 1 1\": vertex 2 has more numbers than the header says"),
        ("4 0 1 2 3", "4 0 1 2", "line 20, \"4 0 1 2\": face 0 has fewer numbers"),
        ("4 0 1 2 3", "4 0 1 2 -3", "line 20, \"4 0 1 2 -3\": face 0 has the vertex -3, must have indices below 4"),
        ("4 0 1 2 3", "3 0 1 4", "line 20, \"3 0 1 4\": face 0 has the vertex 4, must have indices below 4"),
        ("4 0 1 2 3", "3 0 1 2.5", "face 0 has \"2.5\", must be a whole number"),
        ("4 0 1 2 3", "-1 0 1 2", "face 0 has a list of -1 numbers"),
        ("4 0 1 2 3\n2\n", "4 0 1 2 3\n   \n", "it ends before or in edge 0; the header says that there are 1"),
    ];
    for (old, new, fragment) in cases {
        assert!(TEXT.contains(old), "{old}");
        let message = decode(TEXT.replace(old, new)).unwrap_err().to_string();
        assert!(message.starts_with("is not a readable PLY file: "), "{message}");
        assert!(message.contains(fragment), "no {fragment:?} in: {message}");
    }
    for (bytes, fragment) in [
        (&b"glTF\x02"[..], "it looks like a glTF binary (GLB); meshes are OBJ or PLY files"),
        (b"v 0 0 0\n", "it looks like an OBJ mesh; name it as the source \"obj\""),
        (b"\x1f\x8b\x08", "a gzip archive; unpack it"),
        (b"", "it is an empty file"),
        (b"ply\nformat ascii 1.0\n", "its header does not end with a line \"end_header\""),
    ] {
        let message = decode(bytes).unwrap_err().to_string();
        assert!(message.starts_with("is not a readable PLY file: ") && message.contains(fragment), "{message}");
    }
}

#[test]
fn a_binary_file_that_ends_early_or_lies_is_refused() {
    let file = binary(false);
    for length in file.len() - 83..file.len() {
        assert!(decode(&file[..length]).is_err(), "{length}");
    }
    let mut nan = file.clone();
    let body = file.len() - 56 - 28;
    nan[body + 14..body + 22].copy_from_slice(&f64::NAN.to_le_bytes());
    assert!(decode(&nan).unwrap_err().to_string().contains("vertex 1 is at [NaN, 0, 0]"));
    let mut index = file.clone();
    let last = file.len() - 14;
    index[last + 1..last + 5].copy_from_slice(&9_u32.to_le_bytes());
    assert!(decode(&index).unwrap_err().to_string().contains("face 1 has the vertex 9, must have indices below 4"));
}
