//! Odd pictures: what is read, and what is refused.

use exr::meta::attribute::{Chromaticities, IntegerBounds};
use exr::prelude::Vec2;
use glam::{DVec2, DVec3};

use super::super::height_map::HeightMap;
use super::super::picture_samples::{
    encode_exr, encode_exr_with, encode_png, encode_whole_numbers, png_of, profile_chunk,
};
use super::super::picture_size::picture_size;
use super::super::png_metadata::number;
use super::super::{Bitmap, Encoding, Filter, Wrap};
use crate::settings::AssetProblem;

const HEIGHTS: [f32; 6] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625];

/// A picture of colours.
fn bitmap(bytes: &[u8]) -> Result<Bitmap, AssetProblem> {
    Bitmap::decode(bytes, Encoding::Colour)
}

/// A file of 3 x 2 pixels at a place, in a picture of some size at another.
fn windows(data: (i32, i32), display: (i32, i32), [width, height]: [usize; 2]) -> Vec<u8> {
    encode_exr_with(3, 2, &[("Y", &HEIGHTS)], |image, layer| {
        image.display_window = IntegerBounds::new(display, (width, height));
        layer.layer_position = Vec2(data.0, data.1);
    })
}

#[track_caller]
fn check_both_refused(bytes: &[u8], fragments: &[&str]) {
    let [height_map, texture] =
        [HeightMap::decode(bytes).err(), bitmap(bytes).err()].map(|error| error.unwrap().to_string());
    for fragment in fragments {
        assert!(height_map.contains(fragment), "no {fragment:?} in: {height_map}");
        assert!(texture.contains(fragment), "no {fragment:?} in: {texture}");
    }
}

#[test]
fn the_windows_of_a_picture_are_of_one_size() {
    let plain = HeightMap::decode(&encode_exr(3, 2, &[("Y", &HEIGHTS)])).unwrap();
    // Where they lie is nobody's business.
    for (data, display) in [((0, 0), (0, 0)), ((-16, -7), (0, 0)), ((5, 5), (5, 5)), ((0, 0), (100, -100))] {
        assert_eq!(HeightMap::decode(&windows(data, display, [3, 2])).unwrap(), plain, "{data:?} {display:?}");
    }
    let crop = windows((8, 9), (0, 0), [32, 31]);
    check_both_refused(&crop, &["data window) are 3 x 2 from (8, 9) on", "display window) is 32 x 31 from (0, 0) on"]);
    let overscan = windows((-1, 0), (0, 0), [1, 2]);
    check_both_refused(&overscan, &["are 3 x 2 from (-1, 0) on", "is 1 x 2 from (0, 0) on", "both of one size"]);
}

/// A file whose attribute has another value of the same size.
fn patched(file: &[u8], attribute: &str, value: &[u8]) -> Vec<u8> {
    let mut file = file.to_vec();
    let place = file.windows(attribute.len()).position(|window| window == attribute.as_bytes()).unwrap();
    let kind = place + attribute.len() + 1;
    let start = kind + file[kind..].iter().position(|byte| *byte == 0).unwrap() + 5;
    file[start..start + value.len()].copy_from_slice(value);
    file
}

#[test]
fn windows_that_make_no_sense_are_damage() {
    let file = encode_exr(3, 2, &[("Y", &HEIGHTS)]);
    let window = |numbers: [i32; 4]| numbers.into_iter().flat_map(i32::to_le_bytes).collect::<Vec<u8>>();
    let cases = [
        ([2, 0, 0, 1], "ends before it begins"),
        ([0, 1, 2, 0], "ends before it begins"),
        ([0, 0, -1, -1], "ends before it begins"),
        ([i32::MIN, i32::MIN, i32::MAX, i32::MAX], "is out of range"),
        ([0, 0, i32::MAX, 1], "is out of range"),
        ([i32::MAX - 2, 0, i32::MAX, 1], "is out of range"),
    ];
    for (numbers, problem) in cases {
        for kind in ["data", "display"] {
            let file = patched(&file, &format!("{kind}Window"), &window(numbers));
            let [a, b, c, d] = numbers;
            let expected = format!("damaged: the {kind} window from ({a}, {b}) to ({c}, {d}) {problem}");
            check_both_refused(&file, &["is not a readable OpenEXR file: ", &expected]);
        }
    }
}

#[test]
fn what_is_not_read_is_named_once_with_the_way_out() {
    let file = encode_exr(3, 2, &[("Y", &HEIGHTS)]);
    let way_out = " is not supported: save the image flat, as scan lines with ZIP compression";
    for (method, name) in [(8, "DWAA"), (9, "DWAB"), (10, "HTJ2K256"), (11, "HTJ2K32"), (77, "unknown")] {
        let expected = format!("readable OpenEXR file: {name} compression{way_out}");
        check_both_refused(&patched(&file, "compression", &[method]), &[&expected]);
    }
    let version = |flags: u8| [&file[..5], &[flags], &file[6..]].concat();
    let deep = format!("readable OpenEXR file: deep data{way_out}");
    check_both_refused(&version(0x08), &[&deep]);
    check_both_refused(&version(0x20), &["a version of OpenEXR other than 2 is not supported"]);
    let channels =
        [b"Y\0", &2_i32.to_le_bytes()[..], &[0; 4], &2_i32.to_le_bytes(), &2_i32.to_le_bytes(), b"\0"].concat();
    check_both_refused(&patched(&file, "channels", &channels), &["channel Y, which has no value in some pixels"]);
    check_both_refused(&file[..60], &["damaged: its header is cut off"]);
    check_both_refused(&file[..file.len() - 5], &["damaged: it ends too early"]);
}

#[test]
fn channels_that_were_found_are_listed_where_others_are_needed() {
    let of = |names: &[&str]| encode_exr(3, 2, &names.iter().map(|name| (*name, &HEIGHTS[..])).collect::<Vec<_>>());
    check_both_refused(&of(&["A", "Z", "diffuse.Y"]), &["has the channels A, Z, diffuse.Y, must have"]);
    check_both_refused(
        &encode_whole_numbers(3, 2, "Y", &[1; 6]),
        &["has whole numbers in channel Y, must have floats"],
    );
    let refused = |names: &[&str]| bitmap(&of(names)).unwrap_err().to_string();
    for names in [&["X", "Y", "Z"][..], &["BY", "RY", "Y"], &["R", "Y"], &["G", "R"]] {
        let expected = format!("has the channels {}, must have the channels R, G and B, or Y", names.join(", "));
        assert_eq!(refused(names), expected);
    }
    assert!(bitmap(&of(&["A", "Y"])).is_ok() && bitmap(&of(&["A", "B", "G", "R", "Y"])).is_ok());
    assert!(HeightMap::decode(&of(&["A", "B", "G", "R"])).is_ok());
}

#[test]
fn colours_are_those_of_rec_709() {
    let primaries = |numbers: [f32; 8], channels: &[&str]| {
        let channels: Vec<_> = channels.iter().map(|name| (*name, &HEIGHTS[..])).collect();
        encode_exr_with(3, 2, &channels, |image, _| {
            let [red_x, red_y, green_x, green_y, blue_x, blue_y, white_x, white_y] = numbers;
            image.chromaticities = Some(Chromaticities {
                red: Vec2(red_x, red_y),
                green: Vec2(green_x, green_y),
                blue: Vec2(blue_x, blue_y),
                white: Vec2(white_x, white_y),
            });
        })
    };
    let rec_709 = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.312_71, 0.329_02];
    let aces_cg = [0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.321_68, 0.337_67];
    let own = [0.7, 0.3, 0.2, 0.7, 0.15, 0.06, 0.3127, 0.329];
    let rgb = ["B", "G", "R"];
    assert!(bitmap(&primaries(rec_709, &rgb)).is_ok());
    let refused = |numbers| bitmap(&primaries(numbers, &rgb)).unwrap_err().to_string();
    assert!(refused(aces_cg).contains("(attribute chromaticities) are ACEScg; convert it to linear Rec. 709"));
    assert!(refused(own).contains("are red (0.7000, 0.3000), green (0.2000, 0.7000), blue"), "{}", refused(own));
    // Grey has no colour, and heights have none either.
    assert!(bitmap(&primaries(aces_cg, &["Y"])).is_ok());
    assert!(HeightMap::decode(&primaries(aces_cg, &rgb)).is_ok());
    let luminance = encode_exr_with(3, 2, &rgb.map(|name| (name, &HEIGHTS[..])), |image, layer| {
        image.pixel_aspect = 2.0;
        layer.white_luminance = Some(100.0);
        layer.adopted_neutral = Some(Vec2(0.321_68, 0.337_67));
    });
    assert!(bitmap(&luminance).is_ok());
}

/// What a texture of one row shows in its columns, as sRGB values of 8 bits.
fn row(png: &[u8], columns: u32) -> Vec<[f64; 3]> {
    let texture = bitmap(png).unwrap();
    let srgb = |linear: f64| {
        let value = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
        (value * 255.0 * 100.0).round() / 100.0
    };
    let centre = |column| DVec2::new((f64::from(column) + 0.5) / f64::from(columns), 0.5);
    (0..columns)
        .map(|column| DVec3::to_array(&texture.lookup(centre(column), [Wrap::Repeat; 2], Filter::Linear)).map(srgb))
        .collect()
}

#[test]
fn png_files_of_every_kind_show_their_colours() {
    let pixels = |bytes: &[u8]| (b"IDAT", bytes.to_vec());
    let grey = |value: f64| [value; 3];
    let palette = (b"PLTE", vec![255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 99, 199]);
    let opacity = (b"tRNS", vec![0, 128]);
    let colours = [[255.0, 0.0, 0.0], [9.0, 99.0, 199.0]];
    let frames = (b"acTL", vec![0, 0, 0, 1, 0, 0, 0, 0]);
    type Chunks = Vec<(&'static [u8; 4], Vec<u8>)>;
    type Case = (&'static str, [u8; 3], Chunks, Vec<[f64; 3]>);
    let cases: Vec<Case> = vec![
        ("1 bit", [1, 0, 0], vec![pixels(&[0, 0b0100_0000])], vec![grey(0.0), grey(255.0)]),
        ("2 bits", [2, 0, 0], vec![pixels(&[0, 0b0110_0000])], vec![grey(85.0), grey(170.0)]),
        ("4 bits", [4, 0, 0], vec![pixels(&[0, 0x3c])], vec![grey(51.0), grey(204.0)]),
        ("8 bits", [8, 0, 0], vec![pixels(&[0, 7, 77])], vec![grey(7.0), grey(77.0)]),
        ("16 bits", [16, 0, 0], vec![pixels(&[0, 7, 7, 77, 77])], vec![grey(7.0), grey(77.0)]),
        ("grey, opacity", [8, 4, 0], vec![pixels(&[0, 7, 0, 77, 9])], vec![grey(7.0), grey(77.0)]),
        ("palette", [8, 3, 0], vec![palette.clone(), pixels(&[0, 0, 3])], colours.to_vec()),
        ("palette of 2 bits", [2, 3, 0], vec![palette.clone(), pixels(&[0, 0b0011_0000])], colours.to_vec()),
        ("palette, opacity", [8, 3, 0], vec![palette, opacity, pixels(&[0, 0, 3])], colours.to_vec()),
        ("colour", [8, 2, 0], vec![pixels(&[0, 255, 0, 0, 9, 99, 199])], colours.to_vec()),
        ("colour, opacity", [8, 6, 0], vec![pixels(&[0, 255, 0, 0, 1, 9, 99, 199, 0])], colours.to_vec()),
        (
            "transparent colour",
            [8, 2, 0],
            vec![(b"tRNS", vec![0, 255, 0, 0, 0, 0]), pixels(&[0, 255, 0, 0, 9, 99, 199])],
            colours.to_vec(),
        ),
        ("interlaced", [8, 0, 1], vec![pixels(&[0, 7, 0, 77])], vec![grey(7.0), grey(77.0)]),
        ("animated", [8, 0, 0], vec![frames, pixels(&[0, 7, 77])], vec![grey(7.0), grey(77.0)]),
    ];
    for (what, kind, chunks, expected) in cases {
        let png = png_of([2, 1], kind, &chunks);
        assert_eq!(row(&png, 2), expected, "{what}");
        let heights = HeightMap::decode(&png);
        assert_eq!(heights.is_ok(), what == "16 bits", "{what}");
        if let Err(error) = heights {
            assert!(error.to_string().contains("must be 16-bit grey"), "{what}: {error}");
        }
    }
}

/// A colour profile of these tags.
fn profile(tags: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
    let mut bytes = vec![0; 128];
    bytes.extend((tags.len() as u32).to_be_bytes());
    let mut start = bytes.len() + 12 * tags.len();
    for (name, content) in tags {
        bytes.extend(*name);
        bytes.extend((start as u32).to_be_bytes());
        bytes.extend((content.len() as u32).to_be_bytes());
        start += content.len();
    }
    bytes.extend(tags.iter().flat_map(|(_, content)| content));
    let length = (bytes.len() as u32).to_be_bytes();
    bytes[..4].copy_from_slice(&length);
    bytes[36..40].copy_from_slice(b"acsp");
    bytes
}

#[test]
fn png_files_of_other_colours_are_refused() {
    let fixed = |value: f64| ((value * 65_536.0).round() as i32).to_be_bytes();
    let column = |xyz: [f64; 3]| [b"XYZ \0\0\0\0".to_vec(), xyz.into_iter().flat_map(fixed).collect()].concat();
    let gamma = |value: f64| [&b"curv\0\0\0\0\0\0\0\x01"[..], &((value * 256.0) as u16).to_be_bytes()].concat();
    let srgb_curve = [
        b"para\0\0\0\0\0\x03\0\0".to_vec(),
        [2.4, 0.947_87, 0.052_13, 0.0774, 0.040_45].into_iter().flat_map(fixed).collect(),
    ]
    .concat();
    let name = |text: &str| [b"desc\0\0\0\0\0\0\0\x20", text.as_bytes(), b"\0"].concat();
    let colours = |text: &str, red: [f64; 3], curve: &Vec<u8>| {
        profile(&[
            (b"desc", name(text)),
            (b"rXYZ", column(red)),
            (b"gXYZ", column([0.3851, 0.7169, 0.0971])),
            (b"bXYZ", column([0.1431, 0.0606, 0.7141])),
            (b"rTRC", curve.clone()),
            (b"gTRC", curve.clone()),
            (b"bTRC", curve.clone()),
        ])
    };
    let srgb_red = [0.4361, 0.2225, 0.0139];
    let chunk = |profile: Vec<u8>| (b"iCCP", profile_chunk(&profile));
    let chromaticities =
        |numbers: [u32; 8]| (b"cHRM", numbers.into_iter().flat_map(u32::to_be_bytes).collect::<Vec<u8>>());
    let rec_709 = [31_270, 32_900, 64_000, 33_000, 30_000, 60_000, 15_000, 6000];
    let p3 = [31_270, 32_900, 68_000, 32_000, 26_500, 69_000, 15_000, 6000];
    let gamma_chunk = |value: u32| (b"gAMA", value.to_be_bytes().to_vec());
    type Chunk = (&'static [u8; 4], Vec<u8>);
    let coloured = |chunks: &[Chunk]| {
        let pixels: [Chunk; 1] = [(b"IDAT", vec![0, 1, 2, 3])];
        png_of([1, 1], [8, 2, 0], &[chunks, &pixels].concat())
    };
    let colour = |chunks: &[Chunk]| bitmap(&coloured(chunks)).map_err(|error| error.to_string());
    let grey = |chunks: &[Chunk]| {
        let pixels: [Chunk; 1] = [(b"IDAT", vec![0, 1, 2])];
        let png = png_of([1, 1], [16, 0, 0], &[chunks, &pixels].concat());
        // Heights have no colour.
        assert!(HeightMap::decode(&png).is_ok());
        bitmap(&png).map_err(|error| error.to_string())
    };
    let right: [(&str, Vec<Chunk>); 7] = [
        ("nothing", vec![]),
        ("sRGB", vec![(b"sRGB", vec![0]), gamma_chunk(100_000)]),
        ("gamma and primaries", vec![gamma_chunk(45_455), chromaticities(rec_709)]),
        ("sRGB in a profile", vec![chunk(colours("sRGB", srgb_red, &srgb_curve))]),
        ("2.2 in a profile", vec![chunk(colours("sRGB", srgb_red, &gamma(2.2)))]),
        ("cICP", vec![(b"cICP", vec![1, 13, 0, 1]), chromaticities(p3)]),
        ("a profile before sRGB", vec![chunk(colours("sRGB", srgb_red, &srgb_curve)), gamma_chunk(100_000)]),
    ];
    for (what, chunks) in right {
        assert!(colour(&chunks).is_ok(), "{what}");
        assert!(grey(&chunks).is_ok(), "{what}");
    }
    let wrong: [(Vec<Chunk>, &str); 6] = [
        (vec![gamma_chunk(100_000)], "a gamma (gAMA) of 1, must be sRGB"),
        (vec![gamma_chunk(55_556)], "a gamma (gAMA) of 0.55556"),
        (vec![chromaticities(p3)], "the primaries (cHRM) [0.3127, 0.329, 0.68"),
        (vec![(b"cICP", vec![9, 16, 0, 1])], "(cICP) of primaries 9 and transfer 16"),
        (
            vec![chunk(colours("Display P3", [0.5151, 0.2412, -0.0011], &srgb_curve))],
            "the colour profile \"Display P3\"",
        ),
        (vec![chunk(colours("Linear", srgb_red, &gamma(1.0)))], "the colour profile \"Linear\", must be sRGB"),
    ];
    for (chunks, fragment) in wrong {
        let in_gltf = Bitmap::decode_in_gltf(&coloured(&chunks), Encoding::Colour);
        assert!(in_gltf.is_ok(), "glTF demands sRGB: {fragment}");
        let message = colour(&chunks).unwrap_err();
        assert!(message.contains(fragment), "no {fragment:?} in: {message}");
    }
    // Of grey, the primaries do not matter, and the brightness does.
    assert!(grey(&[chromaticities(p3)]).is_ok());
    assert!(grey(&[chunk(profile(&[(b"desc", name("Gray Gamma 2.2")), (b"kTRC", gamma(2.2))]))]).is_ok());
    let message = grey(&[chunk(profile(&[(b"desc", name("Gray Gamma 1.0")), (b"kTRC", gamma(1.0))]))]).unwrap_err();
    assert!(message.contains("Gray Gamma 1.0"), "{message}");
}

/// A grey picture with a profile of zeros, about as many as there are in these rows, compressed.
fn with_zeros_for_a_profile(rows: u32) -> Vec<u8> {
    let zeros = encode_png(image::DynamicImage::new_luma8(1 << 12, rows));
    let mut profile = b"zeros\0\0".to_vec();
    let mut place = 8;
    while let Some(length) = number(&zeros, place) {
        let content = place + 8..place + 8 + length as usize;
        if zeros[place + 4..place + 8] == *b"IDAT" {
            profile.extend(&zeros[content.clone()]);
        }
        place = content.end + 4;
    }
    png_of([1, 1], [16, 0, 0], &[(b"iCCP", profile), (b"IDAT", vec![0, 1, 2])])
}

#[test]
fn a_colour_profile_that_grows_without_bound_is_refused_and_counted_as_what_is_read_of_it() {
    let refused = |png: &[u8]| bitmap(png).unwrap_err().to_string();
    let large = with_zeros_for_a_profile(1 << 11);
    assert!(large.len() < 1 << 16);
    check_both_refused(&large, &["a PNG file with a colour profile (iCCP) that is larger than 4 MiB", "must be sRGB"]);
    let size = picture_size(&large).unwrap();
    assert_eq!(size.pixels, 1);
    assert!(size.decoded_bytes < 32 << 20, "{size:?}");
    // Some megabytes are read.
    assert!(refused(&with_zeros_for_a_profile(1 << 9)).contains("the colour profile \"without a name\""));
    // One that is damaged counts for nothing.
    let chunk = profile_chunk(&[7; 100]);
    let damaged = png_of([1, 1], [16, 0, 0], &[(b"iCCP", chunk[..50].to_vec()), (b"IDAT", vec![0, 1, 2])]);
    assert!(bitmap(&damaged).is_ok());
}

#[test]
fn the_header_of_a_png_file_says_how_much_its_pixels_take() {
    let kinds = [
        ([16, 0, 0], false, 2),
        ([16, 0, 0], true, 4),
        ([1, 0, 0], false, 1),
        ([16, 2, 0], false, 6),
        ([8, 2, 0], true, 4),
        ([4, 3, 0], false, 3),
        ([4, 3, 0], true, 4),
        ([8, 4, 0], false, 2),
        ([16, 6, 1], false, 8),
    ];
    for (kind, is_transparent, pixel_bytes) in kinds {
        let mut chunks: Vec<(&[u8; 4], Vec<u8>)> = vec![(b"tRNS", vec![0, 1]), (b"IDAT", vec![])];
        if !is_transparent {
            chunks.remove(0);
        }
        let size = picture_size(&png_of([300, 200], kind, &chunks)).unwrap();
        assert_eq!(size.pixels, 60_000);
        let pixel_bytes = pixel_bytes * size.pixels;
        assert!((pixel_bytes..pixel_bytes + 1000).contains(&size.decoded_bytes), "{kind:?} {size:?}");
    }
}

#[test]
fn other_formats_are_named_with_the_way_out() {
    let cases: [(&[u8], &str); 5] = [
        (b"MM\0*", ": it looks like a TIFF picture; save it"),
        (b"\0\0\0\x0cJXL \r\n\x87\n", ": it looks like a JPEG XL picture; save it as PNG (heights with 16 bits)"),
        (b"#?RADIANCE\n", ": it looks like a Radiance HDR picture; save it"),
        (b"", ": it is an empty file"),
        (b"glTF", ": it looks like a glTF binary (GLB); pictures are PNG or OpenEXR files"),
    ];
    for (bytes, fragment) in cases {
        check_both_refused(bytes, &["is no PNG, JPEG, WebP or OpenEXR file", fragment]);
    }
}
