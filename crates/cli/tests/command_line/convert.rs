//! PNGs of images that are there already.

use std::fs;

use crate::support::Folder;

/// Width and height of a PNG.
fn size(png: &[u8]) -> [u32; 2] {
    assert!(png.starts_with(b"\x89PNG"));
    [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().unwrap()))
}

#[test]
fn an_image_becomes_the_png_that_render_writes_beside_it() {
    let folder = Folder::new();
    folder.succeeds(&["render", "scene.json", "--spp", "4", "--png", "-o", "image.exr"]);
    let rendered = fs::read(folder.path("image.png")).unwrap();
    let line = folder.succeeds(&["convert", "image.exr", "again.png"]);
    assert!(line.starts_with("Wrote again.png: 24x16 pixels, exposure "), "{line}");
    assert!(fs::read(folder.path("again.png")).unwrap() == rendered);
    let convert = |options: &[&str]| {
        folder.succeeds(&[&["convert", "image.exr", "other.png"], options].concat());
        fs::read(folder.path("other.png")).unwrap()
    };
    assert!(convert(&["--exposure", "auto", "--curve", "filmic"]) == rendered);
    let brighter = convert(&["--exposure", "auto+1"]);
    assert!(brighter != rendered && brighter != convert(&["--exposure", "1"]));
    assert!(convert(&["--curve", "srgb"]) != rendered);
    // The printed exposure is what shows other images as bright.
    let stops: f64 = line.trim().rsplit(' ').next().unwrap().parse().unwrap();
    let again = folder.succeeds(&["convert", "image.exr", "other.png", "--exposure", &(stops + 1.0).to_string()]);
    assert!(again.trim().ends_with(&format!("{:.2}", stops + 1.0)), "{again}");
}

#[test]
fn parts_and_layers_of_an_image_are_shown() {
    let folder = Folder::new();
    folder.succeeds(&["render", "scene.json", "--spp", "16", "-o", "image.exr"]);
    let convert = |options: &[&str]| {
        folder.succeeds(&[&["convert", "image.exr", "part.png"], options].concat());
        fs::read(folder.path("part.png")).unwrap()
    };
    let whole = convert(&[]);
    assert_eq!(size(&whole), [24, 16]);
    assert_eq!(size(&convert(&["--crop", "5x3+19+13"])), [5, 3]);
    assert!(convert(&["--crop", "24x16+0+0"]) == whole);
    let layers = ["albedo", "normal", "depth", "samples", "stderr"].map(|layer| convert(&["--layer", layer]));
    assert!(layers.iter().all(|png| size(png) == [24, 16] && *png != whole));
    assert!(convert(&["--layer", "RGB"]) == whole);
}

#[test]
fn what_cannot_be_converted_is_refused_with_what_would_be_right() {
    let folder = Folder::new();
    folder.succeeds(&["render", "scene.json", "--spp", "4", "-o", "image.exr"]);
    folder.fails(
        &["convert", "image.exr", "out.png", "--layer", "albdo"],
        1,
        &["image.exr", "found no layer albdo", "RGB, samples, albedo, depth, normal"],
    );
    folder.fails(
        &["convert", "image.exr", "out.png", "--crop", "5x3+20+13"],
        2,
        &["--crop 5x3+20+13", "24x16 pixels", "x + width of at most 24"],
    );
    folder.fails(&["convert", "image.exr", "out.png", "--crop", "5x3"], 2, &["--crop", "for instance 640x480+10+20"]);
    folder.fails(&["convert", "image.exr", "out.jpg"], 2, &["out.jpg", "expected out.png"]);
    folder.fails(&["convert", "image.exr", "image.exr"], 2, &["image.exr", "expected image.png"]);
    folder.fails(&["convert", "image.exr", "out.png", "--exposure", "bright"], 2, &["--exposure", "auto+1.5"]);
    folder.fails(
        &["convert", "image.exr", "out.png", "--layer", "normal", "--exposure", "1"],
        2,
        &["--exposure", "vectors", "expected no --exposure"],
    );
    folder.fails(&["convert", "scene.json", "out.png"], 1, &["scene.json", "not an OpenEXR file"]);
    folder.fails(&["convert", "absent.exr", "out.png"], 1, &["cannot read absent.exr"]);
    assert!(!folder.path("out.png").exists());
}
