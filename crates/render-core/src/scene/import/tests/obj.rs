//! OBJ files with their material libraries: what is glass, what has colours, and what comes in although a picture or a
//! number is missing.

use glam::DVec3;
use image::{DynamicImage, Rgb, RgbImage};

use super::*;
use crate::bsdf::{MetallicRoughnessMaterial, ThinWallMaterial};
use crate::texture::TextureDescription;

/// A square with texture coordinates, of the material `a`.
const SQUARE: &str = "mtllib a.mtl\no Wall\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                      usemtl a\nf 1/1 2/2 3/3 4/4\n";

fn assets(text: &str, library: &str, others: &[(&str, Vec<u8>)]) -> Assets {
    let mut files = vec![("a.obj", text.as_bytes().to_vec()), ("a.mtl", library.as_bytes().to_vec())];
    files.extend(others.iter().cloned());
    files.into_iter().map(|(name, bytes)| (name.to_owned(), Asset::new(bytes))).collect()
}

fn source(assets: &Assets) -> Value {
    let files: Vec<&String> = assets.keys().filter(|name| *name != "a.obj").collect();
    json!({"source": {"obj": {"file": "a.obj", "files": files}}})
}

fn imported(text: &str, library: &str, others: &[(&str, Vec<u8>)]) -> Expansion {
    let assets = assets(text, library, others);
    expanded(source(&assets), &assets)
}

fn prepared(text: &str, library: &str, others: &[(&str, Vec<u8>)]) -> PreparedScene {
    let assets = assets(text, library, others);
    built(json!([import(source(&assets))]), assets).unwrap()
}

fn grey_png() -> Vec<u8> {
    encode_png(RgbImage::from_pixel(1, 1, Rgb([128; 3])).into())
}

/// The material of the square with these statements, and the notes on it.
fn material(statements: &str) -> (MaterialDescription, Vec<String>) {
    let library = format!("newmtl a\n{}\n", statements.replace(", ", "\n"));
    let expansion = imported(SQUARE, &library, &[("a.png", grey_png())]);
    (expansion.materials["hall/a"].clone(), expansion.notes)
}

fn glass(statements: &str) -> Option<ThinWallMaterial> {
    match material(statements).0 {
        MaterialDescription::ThinWall(glass) => Some(glass),
        _ => None,
    }
}

fn surface(statements: &str) -> MetallicRoughnessMaterial {
    match material(statements).0 {
        MaterialDescription::MetallicRoughness(surface) => surface,
        other => panic!("{statements}: {other:?}"),
    }
}

#[test]
fn what_exporters_write_for_opaque_things_is_no_glass() {
    for statements in [
        // Maya, for any Lambert; with an index of refraction; and with a black filter.
        "illum 4, Kd .5 .4 .3, Tf 1 1 1, Ni 1",
        "illum 4, Kd .5 .4 .3, Tf 1 1 1, Ni 1.5",
        "illum 4, Kd .5 .4 .3, Tf 0 0 0, Ni 1.5",
        "illum 4, Kd .5 .4 .3, Tf .5 .5 .5, Ni 1.5, d 1",
        "illum 2, Kd .5 .4 .3, d 1.0, Tf .5882 .5882 .5882",
        "illum 2, Kd .5 .4 .3, Tr 0, Tf .5882 .5882 .5882, Ni 1.5",
        "illum 2, Kd .5 .4 .3, Tf .5882 .5882 .5882, Ni 1.5",
        "illum 9, Kd .5 .4 .3, Ni 1",
        "illum 7, Kd .5 .4 .3",
    ] {
        let (material, notes) = material(statements);
        let MaterialDescription::Diffuse(matt) = material else { panic!("{statements}: {material:?}") };
        assert_eq!(matt.reflectance, ColourDescription::Colour([0.5, 0.4, 0.3]), "{statements}");
        assert_eq!(notes, Vec::<String>::new(), "{statements}");
    }
    assert_eq!(surface("illum 2, Kd .5 .4 .3, d .95").opacity, ValueDescription::number(0.95));
}

#[test]
fn glass_has_the_tint_of_its_filter_or_what_its_opacity_leaves() {
    for (statements, tint, index) in [
        // The glass of Blender's exporter with an opacity, which writes an index of 1.
        ("Kd .8 .6 .4, Ks .5 .5 .5, Ni 1, d .5, illum 3", [0.9, 0.8, 0.7], 1.5),
        ("Kd 0 0 0, Ks 1 1 1, d .25, Ni 1.52", [0.75; 3], 1.52),
        ("Kd 0 0 0, Tr .75", [0.75; 3], 1.5),
        ("Kd 0 0 0, d 0", [1.0; 3], 1.5),
        ("Kd 1 1 1, illum 2, Tf .5882 .5882 .5882, d .5", [1.0; 3], 1.5),
        ("Kd 0 0 0, illum 7, Ni 1.5, d 1", [1.0; 3], 1.5),
        ("Kd 0 0 0, illum 6, Ni 4, Tf 1 1 1", [1.0; 3], 3.0),
        ("Kd 0 0 0, illum 9, Ni 1.5, Tf .2 .5 .9, d 1", [0.2, 0.5, 0.9], 1.5),
        ("Kd 0 0 0, illum 4, Ni 1.5, Tf .2 .5 .9", [0.2, 0.5, 0.9], 1.5),
        ("Kd 0 0 0, illum 7, Ni 1.5, Tf .2 .5 .9, d .5", [0.2, 0.5, 0.9], 1.5),
        ("Kd 0 0 0, illum 7, Ni 1.5, Tf 1 1 1, d .5", [0.5; 3], 1.5),
    ] {
        let glass = glass(statements).unwrap_or_else(|| panic!("{statements} is no glass"));
        let ColourDescription::Colour(found) = glass.tint else { panic!("{glass:?}") };
        assert!(DVec3::from(found).abs_diff_eq(DVec3::from(tint), 1e-12), "{statements}: {found:?}");
        assert_eq!(glass.index_of_refraction, index, "{statements}");
        assert_eq!(material(statements).1, ["a.mtl: material a: it is taken for window glass"], "{statements}");
    }
}

#[test]
fn the_picture_of_glass_is_its_tint() {
    let (material, notes) = material("Kd 1 1 1, d .5, map_Kd a.png, norm a.png");
    let MaterialDescription::ThinWall(glass) = material else { panic!("{material:?}") };
    let picture = TextureDescription::of_file("a.png");
    assert_eq!(glass.tint, ColourDescription::Texture(Box::new(picture)));
    assert!(notes[1].contains("map_Kd) tints") && notes[2].contains("normal map is left out"), "{notes:?}");
    // A picture of opacity cuts holes, also into glass.
    let cut = self::glass("illum 7, Ni 1.5, map_d a.png").unwrap();
    assert!(matches!(cut.opacity, ValueDescription::Texture(_)), "{cut:?}");
    assert!(self::glass("d .5, map_d a.png").is_none());
}

#[test]
fn a_highlight_is_a_coat_with_the_width_of_its_exponent() {
    let coated = surface("Kd .5 .4 .3, Ks .2 .4 .1, Ns 48, illum 2");
    assert_eq!(coated.base_colour, ColourDescription::Colour([0.5, 0.4, 0.3]));
    assert_eq!((coated.metallic, coated.specular), (ValueDescription::number(0.0), ValueDescription::number(0.4)));
    assert_eq!(coated.specular_colour, ColourDescription::Colour([0.5, 1.0, 0.25]));
    // Alpha is a fifth for an exponent of 48.
    let ValueDescription::Uniform(roughness) = coated.roughness else { panic!("{:?}", coated.roughness) };
    assert!((roughness * roughness - 0.2).abs() < 1e-12, "{roughness}");
    assert_eq!((coated.index_of_refraction, surface("Ks 1, Ni 1.4").index_of_refraction), (1.5, 1.4));
    for matt in ["Kd 1 1 1, Ks 1 1 1, illum 1", "Kd 1 1 1, Ks 0 0 0, Ns 90, illum 2", "Kd 1 1 1, Ns 90"] {
        assert!(matches!(material(matt).0, MaterialDescription::Diffuse(_)), "{matt}");
    }
    let mirror = surface("Kd 0 0 0, Ks .9 .8 .7, Ns 1000, illum 3");
    assert_eq!(mirror.base_colour, ColourDescription::Colour([0.9, 0.8, 0.7]));
    assert_eq!(mirror.metallic, ValueDescription::number(1.0));
    // The metallic-roughness extension says more than Phong's model.
    let extended = surface("Kd 1 1 1, Ks .2 .2 .2, Ns 48, Pr .3");
    assert_eq!(extended.roughness, ValueDescription::number(0.3));
    assert_eq!(extended.specular, ValueDescription::number(1.0));
}

#[test]
fn a_picture_of_roughness_needs_no_number() {
    let textured = surface("map_Pr a.png, map_Pm a.png");
    for value in [textured.roughness, textured.metallic] {
        let ValueDescription::Texture(value) = value else { panic!("{value:?}") };
        assert_eq!((value.texture.factor, value.channel), ([1.0; 3], Channel::Red));
    }
    assert_eq!(surface("Pr .3").metallic, ValueDescription::number(0.0));
}

#[test]
fn norm_is_a_normal_map_and_bump_is_named() {
    let bumpy = "newmtl a\nKd 1 1 1\nnorm -bm .5 n.png\nmap_Bump b.png\n";
    let normals = encode_png(RgbImage::from_pixel(1, 1, Rgb([229, 128, 204])).into());
    let expansion = imported(SQUARE, bumpy, &[("n.png", normals.clone())]);
    let MaterialDescription::MetallicRoughness(material) = &expansion.materials["hall/a"] else { panic!() };
    let map = material.normal_map.as_ref().unwrap();
    assert_eq!((map.texture.file.as_str(), map.strength), ("n.png", 0.5));
    let [note] = &expansion.notes[..] else { panic!("{:?}", expansion.notes) };
    assert!(note.contains("material a: its bump map is left out: bake it"), "{note}");
    let prepared = prepared(SQUARE, bumpy, &[("n.png", normals)]);
    let normals = prepared.scene().surface_point(0, [0.2, 0.2]).normals;
    // The square lies along x and z of the scene, and looks along -y.
    let bump = |code: f64| 2.0 * code / 255.0 - 1.0;
    let expected = DVec3::new(0.5 * bump(229.0), -bump(204.0), 0.5 * bump(128.0)).normalize();
    assert!((normals.shading - expected).length() < 1e-5, "{normals:?}, not {expected}");
    let assets = assets(SQUARE, bumpy, &[]);
    let import: ImportDescription = import(source(&assets));
    assert_eq!(files_of(&import.source, &assets).unwrap(), ["a.mtl", "n.png"]);
}

#[test]
fn colours_of_vertices_multiply_what_is_matt() {
    let text = SQUARE.replacen("0\nv", "0 1 0.735357 0\nv", 3);
    // 0.735357 is half the light in sRGB. The last vertex has no colour: it is white.
    let middle = |text: &str, library: &str| {
        let prepared = prepared(text, library, &[]);
        let scene = prepared.scene();
        [[0.0, 0.0], [0.0, 1.0]].map(|corner| scene.bsdf(1).albedo(&scene.surface_point(1, corner)))
    };
    let kd = "newmtl a\nKd .5 .5 1\n";
    let [coloured, white] = middle(&text, kd);
    assert!(coloured.abs_diff_eq(DVec3::new(0.5, 0.25, 0.0), 1e-5), "{coloured}");
    assert!(white.abs_diff_eq(DVec3::new(0.5, 0.5, 1.0), 1e-5), "{white}");
    let [of_bytes, _] = middle(&SQUARE.replacen("0\nv", "0 255 187.516 0\nv", 3), kd);
    assert!(of_bytes.abs_diff_eq(DVec3::new(0.5, 0.25, 0.0), 1e-5), "{of_bytes}");
    // A scan without materials has these colours alone.
    let [scan, _] = middle(&text, "");
    assert!(scan.abs_diff_eq(DVec3::new(1.0, 0.5, 0.0), 1e-5), "{scan}");
    assert!(imported(&text, "", &[]).notes[0].contains("it has the colours of its vertices"));
    let bare = |text: &str| imported(&text.replace("usemtl a\n", ""), "", &[]).notes[0].clone();
    assert!(bare(&text).contains("some faces have no material, but the colours of their vertices"), "{}", bare(&text));
    assert!(bare(SQUARE).contains("some faces have no material: they are grey"), "{}", bare(SQUARE));
}

#[test]
fn a_building_in_the_coordinates_of_a_country_keeps_its_millimetres() {
    let text = "o Pane\nv 530000.000 180000 7.001\nv 530000.012 180000 7.001\nv 530000.012 180000.012 7.001\n\
                v 530000 180000.012 7.001\nf 1 2 3 4\n";
    let assets = assets(text, "", &[]);
    let mut settings = source(&assets);
    settings["up"] = json!("z");
    let prepared = built(json!([import(settings)]), assets).unwrap();
    let scene = prepared.scene();
    assert_eq!((scene.meshes()[0].triangles(), scene.meshes()[0].omitted_triangles()), (2, 0));
    let [least, most] = scene.bounds().unwrap();
    assert!(least.abs_diff_eq(DVec3::new(530_000.0, 180_000.0, 7.001), 1e-9), "{least}");
    assert!(most.abs_diff_eq(DVec3::new(530_000.012, 180_000.012, 7.001), 1e-9), "{most}");
}

#[test]
fn a_face_without_coordinates_or_normals_leaves_those_of_others() {
    let text = "mtllib a.mtl\no Wall\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.25 0.5\nvn 0 0.6 0.8\nusemtl a\n\
                f 1/1/1 2/1/1 3/1/1\nf 1//1 3//1 4//1\nf 1/1 2 4/1/1\n";
    let library = "newmtl a\nKd 1 1 1\nKs .1 .1 .1\nmap_Kd a.png\n";
    let pictures = [("a.png", grey_png())];
    let notes = imported(text, library, &pictures).notes;
    assert!(notes[0].contains("corners without texture coordinates") && notes[0].contains("(faces: 2)"), "{notes:?}");
    assert!(notes[1].contains("corners without normals") && notes[1].contains("(faces: 1)"), "{notes:?}");
    assert_eq!(notes.len(), 2, "{notes:?}");
    let prepared = prepared(text, library, &pictures);
    let scene = prepared.scene();
    let [own, written] = [scene.triangle_normal(0), DVec3::new(0.0, -0.8, 0.6)];
    let normals = |triangle: u32| scene.meshes()[0].corner_normals(triangle).unwrap().map(|normal| normal.normalize());
    for (triangle, expected) in [(0, [written; 3]), (1, [written; 3]), (2, [own, own, written])] {
        let found = normals(triangle);
        assert!(found.iter().zip(expected).all(|(found, right)| found.abs_diff_eq(right, 1e-6)), "{found:?}");
    }
    let coordinates = |triangle: u32| scene.surface_point(triangle, [0.0, 0.0]).texture.0[0].to_array();
    assert_eq!([coordinates(0), coordinates(1)], [[0.25, 0.5], [0.0, 0.0]]);
    // Faces without texture coordinates are worth a note where there is a picture, and no face has any.
    let bare = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl a\nf 1 2 3\n";
    assert!(imported(bare, library, &pictures).notes[0].contains("(faces: 1)"));
    assert_eq!(imported(bare, "newmtl a\nKd 1 1 1\n", &[]).notes, Vec::<String>::new());
}

#[test]
fn a_building_comes_in_without_the_pictures_that_cannot_be_read() {
    let library = "newmtl a\nKd .5 .4 .3\nmap_Kd wall.tga\nmap_Ke\nmap_d gone.png\nnorm broken.png\n";
    let mut broken = encode_png(DynamicImage::new_rgb8(8, 8));
    broken.truncate(broken.len() - 20);
    let others = [("wall.tga", vec![0, 0, 2, 0, 0, 0, 0, 0]), ("broken.png", broken)];
    let expansion = imported(SQUARE, library, &others);
    let MaterialDescription::Diffuse(matt) = &expansion.materials["hall/a"] else { panic!("{expansion:?}") };
    assert_eq!(matt.reflectance, ColourDescription::Colour([0.5, 0.4, 0.3]));
    let expected = [
        "a.mtl: map_ke of material a names no file beside it",
        "a.mtl: the picture wall.tga of material a is left out: it is no PNG, JPEG, WebP or OpenEXR file; convert it",
        "a.mtl: the picture gone.png of material a is not there: put it beside the library",
        "a.mtl: the picture broken.png of material a is left out: it is a PNG file that ends too early; save it again",
    ];
    assert_eq!(expansion.notes.len(), expected.len(), "{:?}", expansion.notes);
    for (note, expected) in expansion.notes.iter().zip(expected) {
        assert!(note.starts_with(expected), "{note}, not {expected}");
    }
    assert_eq!(prepared(SQUARE, library, &others).scene().meshes()[0].triangles(), 2);
}

#[test]
fn a_fault_in_a_library_names_the_library() {
    let assets = assets(SQUARE, "newmtl a\nKd 0,5 0 0\n", &[]);
    let import = import(source(&assets));
    let errors = [
        files_of(&import.source, &assets).unwrap_err().to_string(),
        expand(&import, &assets, &JsonPath::Root).unwrap_err().to_string(),
    ];
    for error in errors {
        assert!(error.contains("names a.mtl, which is not a readable MTL file: line 2, \"Kd 0,5 0 0\""), "{error}");
    }
}
