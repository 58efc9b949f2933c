//! What a file is by how it begins, for messages about files that are not what was expected.

use std::fmt;

/// A kind of file, with an article: "a PNG picture".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileFormat {
    name: &'static str,
    content: Content,
}

/// What a file holds, which decides what to do with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Content {
    Nothing,
    Scene,
    /// Of the format of this name, if a scene can name it unconverted.
    Mesh(Option<&'static str>),
    Picture,
    Archive,
    Json,
    Utf16,
    Other,
}

impl fmt::Display for FileFormat {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name)
    }
}

impl FileFormat {
    /// The format of a file that begins with these bytes, or is these bytes; `None` when it is none that is known.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let known = |(name, content)| Self { name, content };
        of_signature(bytes).or_else(|| of_structure(bytes)).or_else(|| of_text(bytes)).map(known)
    }

    /// Whether it is JSON of no known kind, which may be a scene.
    pub fn is_json(self) -> bool {
        self.content == Content::Json
    }

    /// Whether it is the format of meshes of this name.
    pub fn is_mesh(self, name: &'static str) -> bool {
        self.content == Content::Mesh(Some(name))
    }

    /// What to tell someone who gives this file as a scene.
    pub fn instead_of_scene(self) -> String {
        let scene = "a scene is a JSON file, see docs/scene-format.md";
        let way_out = match self.content {
            Content::Nothing => return format!("this is {self}; {scene}"),
            Content::Scene => "export its meshes as OBJ or PLY and name them in a scene file",
            Content::Mesh(None) => "convert it to OBJ or PLY and name it in a scene file",
            Content::Mesh(_) => "name it in a scene file, as the source of a mesh",
            Content::Picture => "a scene file names pictures as textures and height maps",
            Content::Archive => "unpack it",
            Content::Utf16 => "save it as UTF-8",
            Content::Json | Content::Other => "give the scene file",
        };
        format!("this looks like {self}; {scene}: {way_out}")
    }

    /// What to tell someone who gives this file as a mesh.
    pub fn instead_of_mesh(self) -> String {
        let way_out = match self.content {
            Content::Nothing => return format!("it is {self}"),
            Content::Mesh(Some(name)) => {
                return format!("it looks like {self}; name it as the source \"{}\"", name.to_lowercase());
            }
            Content::Archive => "unpack it",
            Content::Utf16 => "save it as ASCII or UTF-8",
            _ => "meshes are OBJ or PLY files: export it as one of them, for instance from Blender",
        };
        format!("it looks like {self}; {way_out}")
    }

    /// What to tell someone who gives this file as a rendered image.
    pub fn instead_of_image(self) -> String {
        let way_out = match self.content {
            Content::Nothing => return format!("it is {self}"),
            Content::Picture => "rendered images are OpenEXR files, in linear light",
            Content::Archive => "unpack it",
            _ => "rendered images are OpenEXR files",
        };
        format!("it looks like {self}; {way_out}")
    }

    /// What to tell someone who gives this file as a picture.
    pub fn instead_of_picture(self) -> String {
        let way_out = match self.content {
            Content::Nothing => return format!("it is {self}"),
            Content::Picture => "save it as PNG (heights with 16 bits) or OpenEXR",
            Content::Archive => "unpack it",
            _ => "pictures are PNG or OpenEXR files",
        };
        format!("it looks like {self}; {way_out}")
    }
}

const OBJ: (&str, Content) = ("an OBJ mesh", Content::Mesh(Some("OBJ")));
const STL: (&str, Content) = ("an STL mesh", Content::Mesh(None));
const FBX: (&str, Content) = ("an FBX file", Content::Scene);
const GLTF: (&str, Content) = ("a glTF file", Content::Scene);
const TIFF: (&str, Content) = ("a TIFF picture", Content::Picture);
const JPEG_2000: (&str, Content) = ("a JPEG 2000 picture", Content::Picture);
const JPEG_XL: (&str, Content) = ("a JPEG XL picture", Content::Picture);
const HDR: (&str, Content) = ("a Radiance HDR picture", Content::Picture);
const UTF_16: (&str, Content) = ("UTF-16 text", Content::Utf16);

/// Where bytes of a format stand, and which.
const SIGNATURES: &[(usize, &[u8], (&str, Content))] = &[
    (0, b"glTF", ("a glTF binary (GLB)", Content::Scene)),
    (0, b"BLENDER", ("a Blender file", Content::Scene)),
    (0, b"Kaydara FBX Binary", FBX),
    (0, b"; FBX", FBX),
    (0, b"PXR-USDC", ("a USD file", Content::Scene)),
    (0, b"#usda", ("a USD file", Content::Scene)),
    (0, b"Ogawa", ("an Alembic file", Content::Scene)),
    (0, b"#VRML", ("a VRML file", Content::Scene)),
    (0, b"solid", STL),
    (0, b"ply\n", ("a PLY mesh", Content::Mesh(Some("PLY")))),
    (0, b"ply\r", ("a PLY mesh", Content::Mesh(Some("PLY")))),
    (0, b"OFF\n", ("an OFF mesh", Content::Mesh(None))),
    (0, b"OFF\r", ("an OFF mesh", Content::Mesh(None))),
    (0, b"\x89PNG", ("a PNG picture", Content::Picture)),
    (0, b"\x76\x2f\x31\x01", ("an OpenEXR picture", Content::Picture)),
    (0, b"\xff\xd8\xff", ("a JPEG picture", Content::Picture)),
    (0, b"\0\0\0\x0cjP  ", JPEG_2000),
    (0, b"\xff\x4f\xff\x51", JPEG_2000),
    (0, b"\0\0\0\x0cJXL ", JPEG_XL),
    (0, b"\xff\x0a", JPEG_XL),
    (0, b"II*\0", TIFF),
    (0, b"MM\0*", TIFF),
    (0, b"II+\0", TIFF),
    (0, b"GIF8", ("a GIF picture", Content::Picture)),
    (8, b"WEBP", ("a WebP picture", Content::Picture)),
    (4, b"ftypavif", ("an AVIF picture", Content::Picture)),
    (4, b"ftyphei", ("a HEIF picture", Content::Picture)),
    (4, b"ftypmif1", ("a HEIF picture", Content::Picture)),
    (0, b"#?RADIANCE", HDR),
    (0, b"#?RGBE", HDR),
    (6, b"\0\0\0\0\x36\0\0\0", ("a BMP picture", Content::Picture)),
    (6, b"\0\0\0\0\x8a\0\0\0", ("a BMP picture", Content::Picture)),
    (0, b"8BPS", ("a Photoshop picture", Content::Picture)),
    (0, b"DDS ", ("a DDS picture", Content::Picture)),
    (0, b"\xabKTX", ("a KTX picture", Content::Picture)),
    (0, b"qoif", ("a QOI picture", Content::Picture)),
    (0, b"PK\x03\x04", ("a ZIP archive", Content::Archive)),
    (0, b"PK\x05\x06", ("a ZIP archive", Content::Archive)),
    (0, b"\x1f\x8b", ("a gzip archive", Content::Archive)),
    (0, b"\x28\xb5\x2f\xfd", ("a Zstandard archive, or a compressed Blender file", Content::Archive)),
    (0, b"BZh", ("a bzip2 archive", Content::Archive)),
    (0, b"\xfd7zXZ\0", ("an xz archive", Content::Archive)),
    (0, b"7z\xbc\xaf\x27\x1c", ("a 7-Zip archive", Content::Archive)),
    (0, b"Rar!", ("a RAR archive", Content::Archive)),
    (257, b"ustar", ("a tar archive", Content::Archive)),
    (0, b"%PDF", ("a PDF document", Content::Other)),
    (0, b"\x7fELF", ("a program", Content::Other)),
    (0, b"SQLite format 3\0", ("an SQLite database", Content::Other)),
    (0, b"version https://git-lfs", ("a pointer of Git LFS (\"git lfs pull\" gets the file)", Content::Other)),
    (0, b"\xff\xfe", UTF_16),
    (0, b"\xfe\xff", UTF_16),
];

fn of_signature(bytes: &[u8]) -> Option<(&'static str, Content)> {
    let begins = |(offset, magic, _): &&(usize, &[u8], _)| bytes.get(*offset..).is_some_and(|at| at.starts_with(magic));
    SIGNATURES.iter().find(begins).map(|(_, _, format)| *format)
}

/// Formats without a signature that the arrangement of their bytes gives away.
fn of_structure(bytes: &[u8]) -> Option<(&'static str, Content)> {
    if bytes.iter().all(|byte| *byte == 0) {
        let name = if bytes.is_empty() { "an empty file" } else { "a file of nothing but zeros" };
        return Some((name, Content::Nothing));
    }
    match bytes {
        [b'P', b'1'..=b'7' | b'f' | b'F', b' ' | b'\n' | b'\r' | b'\t', ..] => {
            return Some(("a PNM picture", Content::Picture));
        }
        [0, high, 0, low, ..] | [high, 0, low, 0, ..] if high.is_ascii_graphic() && low.is_ascii() => {
            return Some(UTF_16);
        }
        _ => {}
    }
    // A binary STL file: a comment, the number of triangles, and 50 bytes for each.
    let count = bytes.get(80..84).and_then(|count| count.try_into().ok()).map(u32::from_le_bytes)?;
    (bytes.len() as u64 == 84 + 50 * u64::from(count)).then_some(STL)
}

/// First words of the statements of a pbrt scene.
const PBRT: [&str; 16] = [
    "LookAt",
    "Camera",
    "Sampler",
    "Integrator",
    "SurfaceIntegrator",
    "Film",
    "PixelFilter",
    "WorldBegin",
    "AttributeBegin",
    "Scale",
    "Rotate",
    "Translate",
    "Transform",
    "ConcatTransform",
    "Include",
    "ColorSpace",
];

/// How much of a text is looked at.
const TEXT_BYTES: usize = 4096;

fn of_text(bytes: &[u8]) -> Option<(&'static str, Content)> {
    let bytes = without_byte_order_mark(bytes);
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(TEXT_BYTES)]);
    let text = text.trim_ascii_start();
    let has = |part: &str| text.contains(part);
    if text.is_empty() && bytes.len() <= TEXT_BYTES {
        return Some(("an empty file", Content::Nothing));
    }
    if text.starts_with('<') {
        return Some(match () {
            () if has("<scene") => ("a Mitsuba scene", Content::Scene),
            () if has("<COLLADA") => ("a COLLADA file", Content::Scene),
            () if has("<X3D") => ("an X3D file", Content::Scene),
            () if has("<svg") => ("an SVG picture", Content::Picture),
            () if has("<html") || has("<HTML") || has("<!DOCTYPE html") => ("a web page", Content::Other),
            () => ("an XML file", Content::Other),
        });
    }
    if text.starts_with('{') {
        let is_gltf = has("\"asset\"") && ["\"buffers\"", "\"scenes\"", "\"accessors\""].into_iter().any(has);
        return Some(if is_gltf { GLTF } else { ("a JSON file", Content::Json) });
    }
    let statement = text.lines().map(str::trim_ascii).find(|line| !line.is_empty() && !line.starts_with('#'))?;
    let (word, rest) = statement.split_once([' ', '\t']).unwrap_or((statement, ""));
    match word {
        "v" | "vn" | "vt" | "f" if rest.trim_ascii().starts_with(|first: char| "+-.0123456789".contains(first)) => {
            Some(OBJ)
        }
        "mtllib" | "usemtl" | "o" | "g" if !rest.is_empty() => Some(OBJ),
        "newmtl" => Some(("a file of OBJ materials (MTL)", Content::Other)),
        word if PBRT.contains(&word) => Some(("a pbrt scene", Content::Scene)),
        _ => None,
    }
}

/// A text without the byte-order mark of UTF-8, which some editors put first.
pub fn without_byte_order_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_known_by_how_they_begin() {
        let utf_16 = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
        let stl = [&[b' '; 80][..], &1_u32.to_le_bytes(), &[7; 50]].concat();
        let cases: [(&[u8], &str); 29] = [
            (b"", "an empty file"),
            (b" \n\t\r\n", "an empty file"),
            (b"\xef\xbb\xbf\n", "an empty file"),
            (&[0; 100], "a file of nothing but zeros"),
            (b"glTF\x02\0\0\0", "a glTF binary (GLB)"),
            (b"{\"asset\": {\"version\": \"2.0\"}, \"scenes\": []}", "a glTF file"),
            (b"\n{\"name\": 1}", "a JSON file"),
            (b"BLENDER-v405", "a Blender file"),
            (b"#usda 1.0", "a USD file"),
            (b"ply\r\nformat", "a PLY mesh"),
            (b"# Blender 4.5\nmtllib a.mtl\n", "an OBJ mesh"),
            (b"\xef\xbb\xbf  v -1. 0 0\n", "an OBJ mesh"),
            (b"newmtl wood\n", "a file of OBJ materials (MTL)"),
            (b"solid ball\nfacet normal", "an STL mesh"),
            (&stl, "an STL mesh"),
            (b"\xff\xd8\xff\xe0", "a JPEG picture"),
            (b"RIFF\x10\0\0\0WEBPVP8 ", "a WebP picture"),
            (b"#?RADIANCE\n", "a Radiance HDR picture"),
            (b"MM\0*", "a TIFF picture"),
            (b"P6 2 2 255\n", "a PNM picture"),
            (b"PK\x03\x04", "a ZIP archive"),
            (b"\x1f\x8b\x08", "a gzip archive"),
            (b"%PDF-1.7", "a PDF document"),
            (b"<?xml version='1.0'?>\n<scene version=\"3.0.0\">", "a Mitsuba scene"),
            (b"<?xml version='1.0'?><COLLADA>", "a COLLADA file"),
            (b"# a scene\nLookAt 0 0 0  1 0 0  0 0 1\n", "a pbrt scene"),
            (b"\xff\xfe{\0", "UTF-16 text"),
            (&utf_16("{\"version\": 1}"), "UTF-16 text"),
            (b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS (\"git lfs pull\" gets the file)"),
        ];
        for (bytes, name) in cases {
            assert_eq!(FileFormat::of(bytes).map(|format| format.name), Some(name), "{}", bytes.escape_ascii());
        }
    }

    #[test]
    fn other_text_is_of_no_known_format() {
        for text in ["v for vendetta", "plywood", "Rotated scenes", "fox", "\u{e9}t\u{e9}", "[1, 2]", "version 1", "P6"]
        {
            assert_eq!(FileFormat::of(text.as_bytes()), None, "{text}");
        }
    }
}
