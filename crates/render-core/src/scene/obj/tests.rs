//! What exporters write into OBJ files, and what is refused.

use glam::{DVec2, DVec3};

use super::*;

fn decode(text: impl AsRef<[u8]>) -> Result<TriangleMesh, AssetProblem> {
    let file = ObjFile::open(text.as_ref())?;
    let mesh = file.decode()?;
    assert_eq!(mesh.triangles.len(), file.triangles(), "the count before decoding");
    assert!(mesh.positions.len() <= file.vertices(), "the count before decoding");
    Ok(mesh)
}

const SQUARE: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n";

#[test]
fn polygons_become_fans_and_groups_one_mesh() {
    let text = "mtllib wood.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0.5 1.5 0\nv 0 1 0\ng frame\nusemtl wood\nf 1 2 3 4 5\n\
                g bar\nusemtl lead\nf -5 -4 -3\n";
    let mesh = decode(text).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [5, 6, 7]]);
    assert_eq!(mesh.positions[3], DVec3::new(0.5, 1.5, 0.0));
    assert_eq!(mesh.positions[5..8], mesh.positions[0..3]);
    assert!(mesh.texture_coordinates.is_empty());
}

#[test]
fn texture_coordinates_and_normals_follow_their_vertices() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0.25 0.5\nvt 1 0\nvt 0 1\nvn 0 0 2\nf 1/2/1 2/1/1 3/3/1\n";
    let mesh = decode(text).unwrap();
    assert_eq!(mesh.texture_coordinates, [DVec2::new(1.0, 0.0), DVec2::new(0.25, 0.5), DVec2::new(0.0, 1.0)]);
    assert_eq!(mesh.normals, [DVec3::new(0.0, 0.0, 2.0); 3]);
}

#[test]
fn a_vertex_is_one_corner_of_one_group() {
    // The seam at vertex 1 has two texture coordinates; each is one vertex, however often it is named.
    let seam = format!("{SQUARE}vt 0 0\nvt 1 1\nf 1/1 2/1 3/1\nf 1/2 3/1 4/1\nf 1/2 2/1 4/1\nf 1/1 3/1 4/1\n");
    let mesh = decode(seam).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [3, 2, 4], [3, 1, 4], [0, 2, 4]]);
    assert_eq!(mesh.positions[3], mesh.positions[0]);
    let groups = format!("{SQUARE}vn 0 0 1\ng a\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\no b\ng\nf 1 2 3\nf 1//1 2 3\n");
    let mesh = decode(groups).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6], [7, 5, 6]]);
    assert!(mesh.normals.is_empty(), "some corners have none");
}

#[test]
fn vertices_that_every_group_has_for_itself_are_counted_before_decoding() {
    let vertices = |text: &str| ObjFile::open(text.as_bytes()).unwrap().vertices();
    let faces = "f 1 2 3\nf 1 3 4\nf 2 3 4\n";
    assert_eq!(vertices(&format!("o a\n{SQUARE}g b\n{faces}g c\n")), 4);
    let twice = format!("{SQUARE}o a\n{faces}o b\n{faces}");
    assert_eq!(vertices(&twice), 8);
    assert_eq!(decode(&twice).unwrap().positions.len(), 8);
    // No more than corners of triangles.
    let often = format!("{SQUARE}{}", "g\nf 1 2 3\n".repeat(100));
    assert_eq!(vertices(&often), 300);
    assert_eq!(decode(&often).unwrap().positions.len(), 300);
}

#[test]
fn what_exporters_write_is_the_same_square() {
    let plain = decode(format!("{SQUARE}f 1 2 3 4\n")).unwrap();
    let with = |rest: &str| format!("{SQUARE}{rest}").into_bytes();
    let replaced = |old: &str, new: &str| format!("{SQUARE}f 1 2 3 4\n").replace(old, new).into_bytes();
    let latin_1 = |text: &str| text.chars().map(|character| character as u8).collect::<Vec<u8>>();
    let cases: [(&str, Vec<u8>); 36] = [
        ("CRLF", replaced("\n", "\r\n")),
        ("CR", replaced("\n", "\r")),
        ("no end of the last line", with("f 1 2 3 4")),
        ("a byte-order mark", [&b"\xef\xbb\xbf"[..], &with("f 1 2 3 4")].concat()),
        ("blank lines and comments", replaced("\n", "\n\n  \n# a comment\n#\n")),
        ("tabs and leading blanks", replaced("v ", " \tv\t ")),
        ("blanks at the end", replaced("\n", " \t\n")),
        ("a continued face", with("f 1 2 3 \\\n4\n")),
        ("a continued face, CRLF", with("f 1 \\\r\n2\\\r\n 3 \\\r\n4\r\n")),
        ("a continued vertex", replaced("v 1 1", "v 1 \\\n1")),
        ("a comment behind", with("f 1 2 3 4 # quad\n")),
        ("a comment directly behind", with("f 1 2 3 4#quad \\\n")),
        ("a comment behind a vertex", replaced("0\nv", "0 # corner, with \\ in it\nv")),
        ("a comment that ends with a backslash", with("# C:\\glass\\\nf 1 2 3 4\n")),
        ("a group that ends with a backslash", with("g C:\\glass\\\nf 1 2 3 4\n")),
        ("Latin-1", [latin_1("# fen\u{ea}tre\no verre sal\u{e9}\n"), with("usemtl gr\u{fc}n\nf 1 2 3 4\n")].concat()),
        ("colours", replaced("0\nv", "0 0.5 0.5 1\nv")),
        ("colours of some vertices", replaced("v -1 1 0\n", "v -1 1 0 .2 .3 .4\n")),
        ("colours with opacity", replaced("0\nv", "0 0.5 0.5 1 1\nv")),
        ("weights", replaced("v -1 -1 0", "v -2 -2 0 2")),
        ("weights of one", replaced("0\nv", "0 1.0\nv")),
        ("numbers of C", replaced("v -1 -1 0", "v -1. -1.000000E+00 +.0")),
        ("negative indices", with("f -4 -3 -2 -1\n")),
        ("signs", with("f +1 +2 +3 +4\n")),
        (
            "lines, points and curves",
            with("l 1 2 3 4\np 1\np 1 2 3\nl 1 2 \\\n3 4\ncurv 0 1 1 2\nf 1 2 3 4\nsurf 0 1 0 1 1\n"),
        ),
        ("faces of one or two corners", with("f 1\nf 2 3\nf 1 2 3 4\n")),
        ("groups, objects and smoothing", with("o a b\ng\ng c d\ns off\ns 1\nusemtl\nmtllib\nlod 1\nf 1 2 3 4\n")),
        ("texture coordinates of some corners", with("vt 0 0\nf 1/1 2/1 3 4/1\n")),
        ("normals of some corners", with("vn 0 0 1\nf 1//1 2 3 4\n")),
        ("slashes without indices", with("f 1/ 2// 3/ 4\n")),
        ("indices of what is not written", with("f 1/1/1 2/2/2 3/3/3 4/4/4\n")),
        ("normals that are none", with("vn nan -nan(ind) inf\nf 1 2 3 4\n")),
        ("vertices behind their face", format!("f 1 2 3 4\n{SQUARE}").into_bytes()),
        ("more vertices", with("v 7 7 7\nf 1 2 3 4\n")),
        ("unknown statements", with("vp 1 2\ncall other.obj\nMade with love\nf 1 2 3 4\n")),
        ("form feeds", replaced(" ", "\x0b \x0c")),
    ];
    for (what, text) in cases {
        let mesh = decode(&text).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(mesh, plain, "{what}");
    }
}

#[test]
fn texture_coordinates_may_have_one_two_or_three_numbers() {
    let text = format!("{SQUARE}vt .5\nvt .5 .25\nvt .5 .25 1\nf 1/1 2/2 3/3\n");
    let [half, quarter] = [DVec2::new(0.5, 0.0), DVec2::new(0.5, 0.25)];
    assert_eq!(decode(text).unwrap().texture_coordinates, [half, quarter, quarter]);
}

#[test]
fn faces_with_a_dent_are_covered_once() {
    let text = "v 0 0 0\nv 2 -1 0\nv .5 0 0\nv 2 1 0\nf 2 3 4 1\n";
    let mesh = decode(text).unwrap();
    let area = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).z / 2.0;
    let areas = mesh.triangles.iter().map(|corners| area(corners.map(|corner| mesh.positions[corner as usize])));
    assert!(areas.clone().all(|area| area > 0.0), "{:?}", areas.collect::<Vec<_>>());
    assert_eq!(areas.sum::<f64>(), 0.5);
}

#[test]
fn lines_and_points_are_no_triangles() {
    let mesh = decode(format!("{SQUARE}l 1 2 3 4\np 1 2 3\n")).unwrap();
    assert!(mesh.triangles.is_empty() && mesh.positions.is_empty());
}

#[test]
fn errors_name_the_line_the_text_and_what_would_be_right() {
    let cases = [
        ("v 0 0\n", "line 1, \"v 0 0\": has 2 numbers, must have 3 (x y z)"),
        ("\nv 0 0 0 1 1\n", "line 2, \"v 0 0 0 1 1\": has 5 numbers"),
        ("v 0 0 0 1 1 1 1 1\n", "has 8 numbers"),
        ("v 0,5 1,5 2,5\n", "\"0,5\" must be a number with a point, not a comma"),
        ("v 1 2 three\n", "line 1, \"v 1 2 three\": \"three\" must be a number such as"),
        ("v 1 2 nan\n", "\"nan\" must be a finite number"),
        ("v 1 2 1e39\n", "\"1e39\" must be a finite number"),
        ("v 1 2 3 0\n", "the weight 0.0 must not be 0"),
        ("v 1 2 3 0.5 x 0.5\n", "\"x\" must be a number"),
        ("vt\n", "line 1, \"vt\": has 0 numbers, must have 1 to 3"),
        ("vn 0 1\n", "has 2 numbers, must have 3"),
        ("v 0 0 0\n\n\nf 1 2 3\n", "line 4, \"f 1 2 3\": \"2\" names vertices that are not there: the file has 1 (v)"),
        ("v 0 0 0\nf 0 1 1\n", "an index must be 1 to 1, or -1 to -1"),
        ("v 0 0 0\nf 1 1 -2\nv 0 0 0\n", "\"-2\" names vertices"),
        ("v 0 0 0\nf 1 1 99999999999999999999\n", "names vertices that are not there"),
        (
            "v 0 0 0\nvt 0 0\nf 1/1 1/2 1/1\n",
            "\"1/2\" names texture coordinates that are not there: the file has 1 (vt)",
        ),
        ("v 0 0 0\nvn 0 0 1\nf 1//1 1//2 1//1\n", "\"1//2\" names normals"),
        ("v 0 0 0\nf 1 1.0 1\n", "\"1.0\" must be of whole numbers"),
        ("v 0 0 0\nf /1 1 1\n", "\"/1\" must be of whole numbers"),
        ("v 0 0 0\nf 1,1,1\n", "\"1,1,1\" must be of whole numbers"),
        ("v 0 0 0\nf 1/1/1/1 1 1\n", "\"1/1/1/1\" must be one to three indices"),
        ("f\n", "line 1, \"f\": a face must have corners"),
        ("v 0 0 0\r\n# stone\r\nf 1 1 \\\r\n 2\r\n", "line 3, \"f 1 1 \\\""),
        ("glTF\x02", "it looks like a glTF binary (GLB); meshes are OBJ or PLY files"),
        ("ply\nformat ascii 1.0\n", "it looks like a PLY mesh; name it as the source \"ply\""),
        ("solid ball\n", "an STL mesh"),
        ("", "it is an empty file"),
    ];
    for (text, fragment) in cases {
        let message = decode(text).unwrap_err().to_string();
        assert!(message.starts_with("is not a readable OBJ file: "), "{message}");
        assert!(message.contains(fragment), "no {fragment:?} in: {message}");
    }
    let utf_16: Vec<u8> = "\u{feff}v 0 0 0\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(decode(utf_16).unwrap_err().to_string().contains("UTF-16 text; save it as ASCII or UTF-8"));
    let long = format!("v 0 {} 0\n", "1".repeat(10_000));
    assert!(decode(long).unwrap_err().to_string().len() < 400);
}

/// Names, materials and triangles of the parts of a file, whose counts and triangles are checked.
fn parts(text: impl AsRef<[u8]>) -> Vec<(String, Option<String>, usize)> {
    let file = ObjFile::open(text.as_ref()).unwrap();
    let parts = file.parts().unwrap();
    let meshes = file.decode_parts().unwrap();
    assert_eq!(meshes.len(), parts.len());
    assert_eq!(parts.iter().map(|part| part.triangles).sum::<usize>(), file.triangles());
    for (number, (part, mesh)) in parts.iter().zip(&meshes).enumerate() {
        assert_eq!(mesh.triangles.len(), part.triangles, "the count before decoding");
        assert!(mesh.positions.len() <= part.vertices, "the count before decoding");
        assert_eq!(&file.decode_part(number).unwrap(), mesh, "alone and among others");
    }
    let whole = file.decode().unwrap();
    let corners = |mesh: &TriangleMesh| {
        let corner = |vertex: u32| mesh.positions[vertex as usize].to_array().map(f64::to_bits);
        mesh.triangles.iter().map(|triangle| triangle.map(corner)).collect::<Vec<_>>()
    };
    let [mut together, mut sorted] = [corners(&whole), meshes.iter().flat_map(corners).collect()];
    together.sort_unstable();
    sorted.sort_unstable();
    assert_eq!(together, sorted, "the same triangles");
    parts.into_iter().map(|ObjPart { name, material, triangles, .. }| (name, material, triangles)).collect()
}

fn part(name: &str, material: &str, triangles: usize) -> (String, Option<String>, usize) {
    (name.to_owned(), (!material.is_empty()).then(|| material.to_owned()), triangles)
}

#[test]
fn parts_are_faces_of_one_name_and_one_material_in_order_of_appearance() {
    let text = format!(
        "{SQUARE}f 1 2 3\no frame\nf 1 2 3 4\nusemtl wood\nf 1 2 3\ng pane\nf 1 3 4\nusemtl stained glass\n\
         f 1 2 3 4\nusemtl wood\nf 2 3 4\nf 2 3\ng\nf 1 2 4\no sill\nf 1 2 3\no empty\n"
    );
    let expected = [
        part("", "", 1),
        part("frame", "", 2),
        part("frame", "wood", 2),
        part("pane", "wood", 2),
        part("pane", "stained glass", 2),
        part("sill", "wood", 1),
    ];
    assert_eq!(parts(&text), expected);
    assert!(parts("v 0 0 0\nf 1 1\n").is_empty());
    let file = ObjFile::open(text.as_bytes()).unwrap();
    assert!(file.decode_part(6).unwrap_err().to_string().contains("has 6 parts of triangles"));
}

#[test]
fn a_part_has_texture_coordinates_and_normals_where_any_of_its_corners_has() {
    let text = format!(
        "{SQUARE}vt 0 1\nvn 0 0 1\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3\nusemtl a\nf 1/1 3/1 4/1\nusemtl c\n\
         f 1 2 3\nf 1//1 2//1 3//1\nf 1//1 2 3\n"
    );
    assert_eq!(parts(&text), [part("", "a", 2), part("", "b", 1), part("", "c", 3)]);
    let file = ObjFile::open(text.as_bytes()).unwrap();
    let meshes = file.decode_parts().unwrap();
    assert_eq!(meshes[0].texture_coordinates, [DVec2::Y; 6]);
    assert_eq!(meshes[0].triangles, [[0, 1, 2], [3, 4, 5]]);
    assert_eq!(meshes[1].texture_coordinates, [DVec2::Y, DVec2::Y, DVec2::ZERO]);
    let [none, up] = [DVec3::ZERO, DVec3::Z];
    assert_eq!(meshes[2].normals, [none, none, none, up, up, up]);
    assert!(meshes[0].normals.is_empty() && meshes[2].texture_coordinates.is_empty());
    let coverage: Vec<[(bool, usize); 2]> = file.parts().unwrap().iter().map(of_part).collect();
    assert_eq!(coverage, [[(true, 0), (false, 2)], [(true, 1), (false, 1)], [(false, 3), (true, 2)]]);
    // Indices of what the file does not have name nothing.
    let unwritten = format!("{SQUARE}f 1/1/1 2/2/2 3/3/3\n");
    let parts = ObjFile::open(unwritten.as_bytes()).unwrap().parts().unwrap();
    assert!(!parts[0].texture_coordinates.is_any && !parts[0].normals.is_any);
}

/// Whether any corner of a part has texture coordinates, and normals, and how many faces have a corner without.
fn of_part(part: &ObjPart) -> [(bool, usize); 2] {
    [part.texture_coordinates, part.normals].map(|coverage| (coverage.is_any, coverage.faces_without))
}

#[test]
fn a_part_has_all_digits_and_one_mesh_has_those_of_32_bits() {
    let text = "v 530000.012 0.1 0 1 0 0\nv 1 0.3 0 3\nv 0 1 0\nf 1 2 3\n";
    let file = ObjFile::open(text.as_bytes()).unwrap();
    let [part, whole] = [file.decode_part(0).unwrap(), file.decode().unwrap()];
    assert_eq!(part.positions[0], DVec3::new(530_000.012, 0.1, 0.0));
    assert_eq!(part.positions[1], DVec3::new(1.0 / 3.0, 0.3 / 3.0, 0.0));
    // As the images of scenes that name such a file were rendered.
    let rounded = [[530_000.012_f32, 0.1, 0.0], [1.0 / 3.0, 0.3 / 3.0, 0.0], [0.0, 1.0, 0.0]];
    assert_eq!(whole.positions, rounded.map(|position| DVec3::from(position.map(f64::from))));
    assert!(file.has_colours() && whole.colours.is_empty());
    assert_eq!(part.colours, [[1.0, 0.0, 0.0, 1.0], [1.0; 4], [1.0; 4]]);
    assert!(!ObjFile::open(b"v 0 0 0\nv 1 0 0 2\n").unwrap().has_colours());
}

#[test]
fn names_of_parts_are_kept_as_written() {
    let latin_1 = [SQUARE.as_bytes(), b"o Material #25 \\\r\nusemtl gr\xfcn\r\nf 1 2 3\r\n"].concat();
    assert_eq!(parts(latin_1), [part("Material #25 \\", "gr\u{fc}n", 1)]);
}

#[test]
fn material_libraries_are_files_beside_it() {
    let libraries = |text: &str| ObjFile::open(text.as_bytes()).unwrap().material_libraries();
    let text = "mtllib wood.mtl Lead.MTL\nmtllib old glass.mtl\nmtllib .\\wood.mtl\nmtllib C:\\a\\b.mtl\nf 1 1 1\n";
    assert_eq!(libraries(text).unwrap(), ["wood.mtl", "Lead.MTL", "old glass.mtl", "b.mtl"]);
    assert!(libraries(SQUARE).unwrap().is_empty());
    let error = libraries("v 0 0 0\nmtllib ..\n").unwrap_err().to_string();
    assert!(error.contains("line 2, \"mtllib ..\": must name a file beside this one"), "{error}");
}

#[test]
fn materials_of_parts_are_found_in_their_library() {
    let library = MtlFile::read(b"newmtl Glass\nNi 1.52\nmap_d leaves.png\nnewmtl Frame\nKd 0.9 0.9 0.9\n").unwrap();
    let text = format!("mtllib window.mtl\n{SQUARE}o panes\nusemtl Glass\nf 1 2 3\nusemtl Frame\nf 1 3 4\n");
    let parts = ObjFile::open(text.as_bytes()).unwrap().parts().unwrap();
    let materials: Vec<&MtlMaterial> =
        parts.iter().map(|part| library.material(part.material.as_deref().unwrap()).unwrap()).collect();
    let map: Option<&MtlMap> = materials[0].opacity_map.as_ref();
    assert_eq!(map.unwrap().file, "leaves.png");
    assert_eq!((materials[0].ior, materials[1].diffuse), (Some(1.52), Some([0.9; 3])));
}
