//! Materials of Wavefront MTL files, as plain data.

use std::collections::BTreeMap;

use super::file_name::file_beside;
use crate::scene::text::{Lines, Words, decimal, expected_number, is_not_finite, name, quoted};
use crate::settings::AssetProblem;
use clerestory_film::file_format::{FileFormat, without_byte_order_mark};

/// The materials of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MtlFile {
    /// In the order of the file.
    pub(crate) materials: Vec<MtlMaterial>,
    /// Statements that are left out, and how often they stand there.
    pub(crate) left_out: BTreeMap<String, usize>,
}

/// A material; members that the file does not say are `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MtlMaterial {
    /// Its name, by which OBJ files choose it.
    pub(crate) name: String,
    /// `Kd`: diffuse reflectance.
    pub(crate) diffuse: Option<[f64; 3]>,
    /// `Ks`: specular reflectance.
    pub(crate) specular: Option<[f64; 3]>,
    /// `Ke`: emitted light.
    pub(crate) emission: Option<[f64; 3]>,
    /// `Tf`: the part of light that goes through.
    pub(crate) transmission: Option<[f64; 3]>,
    /// `Ns`: the exponent of Phong's highlight, 0 to 1000.
    pub(crate) shininess: Option<f64>,
    /// `Ni`: the index of refraction.
    pub(crate) ior: Option<f64>,
    /// `d`, or 1 - `Tr`: opacity.
    pub(crate) opacity: Option<f64>,
    /// `Pr`: roughness of the metallic-roughness model.
    pub(crate) roughness: Option<f64>,
    /// `Pm`: metallic of the metallic-roughness model.
    pub(crate) metallic: Option<f64>,
    /// `illum`: the number of the illumination model.
    pub(crate) illumination: Option<u32>,
    /// `map_Kd`
    pub(crate) diffuse_map: Option<MtlMap>,
    /// `map_Ke`
    pub(crate) emission_map: Option<MtlMap>,
    /// `map_d`
    pub(crate) opacity_map: Option<MtlMap>,
    /// `map_Bump` or `bump`: heights.
    pub(crate) bump_map: Option<MtlMap>,
    /// `norm`: normals in tangent space.
    pub(crate) normal_map: Option<MtlMap>,
    /// `map_Pr`
    pub(crate) roughness_map: Option<MtlMap>,
    /// `map_Pm`
    pub(crate) metallic_map: Option<MtlMap>,
    /// Statements of pictures that name no file beside the library, in lower case.
    pub(crate) unnamed: Vec<String>,
}

/// A picture with its options.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MtlMap {
    /// Its file, relative to the MTL file.
    pub(crate) file: String,
    /// `-o`: added to the texture coordinates.
    pub(crate) offset: [f64; 2],
    /// `-s`: factors of the texture coordinates.
    pub(crate) scale: [f64; 2],
    /// `-bm`: the factor of a bump map.
    pub(crate) multiplier: f64,
    /// `-clamp on`: the picture is not repeated.
    pub(crate) is_clamped: bool,
}

impl MtlFile {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// When a number of a known statement is none.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, AssetProblem> {
        let mut file = Self::default();
        let mut lines = Lines::new(without_byte_order_mark(bytes), 1);
        while let Some(text) = lines.next() {
            let mut words = Words(text);
            let Some(keyword) = words.next().filter(|keyword| !keyword.starts_with(b"#")) else { continue };
            let line = Line { number: lines.number(), text, rest: words.0 };
            file.read_line(&keyword.to_ascii_lowercase(), keyword, line)?;
        }
        match FileFormat::of(bytes) {
            Some(format) if file.materials.is_empty() && !bytes.trim_ascii().is_empty() => {
                Err(AssetProblem::malformed(format_args!("is not a readable MTL file: it looks like {format}")))
            }
            _ => Ok(file),
        }
    }

    /// The first material of a name.
    pub(crate) fn material(&self, name: &str) -> Option<&MtlMaterial> {
        self.materials.iter().find(|material| material.name == name)
    }

    fn read_line(&mut self, keyword: &[u8], written: &[u8], line: Line<'_>) -> Result<(), AssetProblem> {
        if keyword == b"newmtl" {
            self.materials.push(MtlMaterial { name: name(line.rest), ..MtlMaterial::default() });
            return Ok(());
        }
        let is_known = match self.materials.last_mut() {
            Some(material) => material.read(keyword, line)?,
            None => false,
        };
        // Ambient light is what a path tracer computes.
        if !is_known && !matches!(keyword, b"ka" | b"map_ka") {
            *self.left_out.entry(quoted(written).into_owned()).or_default() += 1;
        }
        Ok(())
    }
}

impl MtlMaterial {
    /// Reads a statement; answers whether it is known.
    fn read(&mut self, keyword: &[u8], line: Line<'_>) -> Result<bool, AssetProblem> {
        if let Some(place) = self.colour(keyword) {
            let colour = line.colour()?;
            *place = colour.or(*place);
            return Ok(colour.is_some());
        }
        if let Some(place) = self.map(keyword) {
            match line.map()? {
                Some(map) => *place = Some(map),
                None => self.unnamed.push(name(keyword)),
            }
            return Ok(true);
        }
        if let Some(place) = self.number(keyword) {
            *place = Some(line.number()?);
            return Ok(true);
        }
        match keyword {
            b"d" => self.opacity = Some(line.number()?),
            // Some programs write the opacity as `Tr`, but none does so beside `d`.
            b"tr" => self.opacity = self.opacity.or(Some(1.0 - line.number()?)),
            b"illum" => self.illumination = Some(line.illumination()?),
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn colour(&mut self, keyword: &[u8]) -> Option<&mut Option<[f64; 3]>> {
        match keyword {
            b"kd" => Some(&mut self.diffuse),
            b"ks" => Some(&mut self.specular),
            b"ke" => Some(&mut self.emission),
            b"tf" => Some(&mut self.transmission),
            _ => None,
        }
    }

    fn number(&mut self, keyword: &[u8]) -> Option<&mut Option<f64>> {
        match keyword {
            b"ns" => Some(&mut self.shininess),
            b"ni" => Some(&mut self.ior),
            b"pr" => Some(&mut self.roughness),
            b"pm" => Some(&mut self.metallic),
            _ => None,
        }
    }

    fn map(&mut self, keyword: &[u8]) -> Option<&mut Option<MtlMap>> {
        match keyword {
            b"map_kd" => Some(&mut self.diffuse_map),
            b"map_ke" => Some(&mut self.emission_map),
            b"map_d" => Some(&mut self.opacity_map),
            b"map_bump" | b"bump" => Some(&mut self.bump_map),
            b"norm" => Some(&mut self.normal_map),
            b"map_pr" => Some(&mut self.roughness_map),
            b"map_pm" => Some(&mut self.metallic_map),
            _ => None,
        }
    }
}

/// A statement.
#[derive(Clone, Copy)]
struct Line<'a> {
    number: usize,
    text: &'a [u8],
    /// What follows its keyword.
    rest: &'a [u8],
}

impl Line<'_> {
    fn problem(&self, message: impl std::fmt::Display) -> AssetProblem {
        let (line, text) = (self.number, quoted(self.text));
        AssetProblem::malformed(format_args!("is not a readable MTL file: line {line}, \"{text}\": {message}"))
    }

    /// A word as a finite number.
    fn finite(&self, word: &[u8]) -> Result<f64, AssetProblem> {
        let number = decimal(word).filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| self.problem(format_args!("\"{}\" {}", quoted(word), expected_number(word))))
    }

    /// The words before a comment.
    fn words(&self) -> impl Iterator<Item = &[u8]> {
        Words(self.rest).take_while(|word| !word.starts_with(b"#"))
    }

    fn number(&self) -> Result<f64, AssetProblem> {
        let is_option = |word: &&[u8]| word.eq_ignore_ascii_case(b"-halo");
        match self.words().find(|word| !is_option(word)) {
            Some(word) => self.finite(word),
            None => Err(self.problem("must have a number")),
        }
    }

    /// One number is a grey. Spectra and CIE XYZ are left out.
    fn colour(&self) -> Result<Option<[f64; 3]>, AssetProblem> {
        let words: Vec<&[u8]> = self.words().take(3).collect();
        match words[..] {
            [kind, ..] if kind.eq_ignore_ascii_case(b"spectral") || kind.eq_ignore_ascii_case(b"xyz") => Ok(None),
            [grey] => Ok(Some([self.finite(grey)?; 3])),
            [red, green, blue] => Ok(Some([self.finite(red)?, self.finite(green)?, self.finite(blue)?])),
            _ => Err(self.problem(format_args!("has {} numbers, must have 1 or 3", words.len()))),
        }
    }

    fn illumination(&self) -> Result<u32, AssetProblem> {
        let number = self.number()?;
        let model = (0..=10).find(|model| f64::from(*model) == number);
        model.ok_or_else(|| self.problem("must be a whole number of 0 to 10"))
    }

    /// A picture behind its options. The name of its file may have blanks in it. `None` when it names no file beside
    /// the library: exporters write the statement for pictures that were never saved.
    fn map(&self) -> Result<Option<MtlMap>, AssetProblem> {
        let mut map =
            MtlMap { file: String::new(), offset: [0.0; 2], scale: [1.0; 2], multiplier: 1.0, is_clamped: false };
        let mut words = Words(self.rest);
        loop {
            let rest = words.0;
            let option = words.next().unwrap_or_default().to_ascii_lowercase();
            match &option[..] {
                b"-o" => self.numbers(&mut words, &mut map.offset)?,
                b"-s" => self.numbers(&mut words, &mut map.scale)?,
                b"-bm" => self.numbers(&mut words, std::slice::from_mut(&mut map.multiplier))?,
                b"-t" | b"-mm" | b"-boost" | b"-texres" => self.numbers(&mut words, &mut [])?,
                b"-clamp" => map.is_clamped = words.next().is_some_and(|word| word.eq_ignore_ascii_case(b"on")),
                b"-blendu" | b"-blendv" | b"-cc" | b"-imfchan" | b"-type" => _ = words.next(),
                _ => {
                    return Ok(file_beside(&name(rest)).map(|file| MtlMap { file, ..map }));
                }
            }
        }
    }

    /// The one to three numbers of an option, of which the first ones are kept.
    fn numbers(&self, words: &mut Words<'_>, kept: &mut [f64]) -> Result<(), AssetProblem> {
        for index in 0..3 {
            let rest = words.0;
            let word = words.next().unwrap_or_default();
            // The name of a file may follow, but not instead of the first number.
            if index > 0 && decimal::<f64>(word).is_none() && !is_not_finite(word) {
                words.0 = rest;
                break;
            }
            let number = self.finite(word)?;
            if let Some(place) = kept.get_mut(index) {
                *place = number;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> MtlFile {
        MtlFile::read(text.as_bytes()).unwrap()
    }

    fn map(file: &str) -> MtlMap {
        MtlMap { file: file.to_owned(), offset: [0.0; 2], scale: [1.0; 2], multiplier: 1.0, is_clamped: false }
    }

    #[test]
    fn all_members_are_read_whatever_the_case_of_their_names() {
        let text = "\u{feff}# Blender\r\nnewmtl stained glass\r\n\tKa 1 1 1\r\nKd 0.1 0.2 0.3 # red\r\nks 0.5\r\n\
                    Ke 1 2 3\r\nTf .9 .8 .7\r\nNs 96.078431\r\nNi 1.52\r\nd 0.25\r\nTr 0.1\r\nPr 0.4\r\nPm 1\r\n\
                    illum 3\r\nmap_Kd wood.png\r\nmap_Ke a.png\r\nmap_d b.png\r\nmap_Bump c.png\r\nnorm d.png\r\n\
                    map_Pr e.png\r\nmap_Pm f.png";
        let expected = MtlMaterial {
            name: "stained glass".to_owned(),
            diffuse: Some([0.1, 0.2, 0.3]),
            specular: Some([0.5; 3]),
            emission: Some([1.0, 2.0, 3.0]),
            transmission: Some([0.9, 0.8, 0.7]),
            shininess: Some(96.078431),
            ior: Some(1.52),
            opacity: Some(0.25),
            roughness: Some(0.4),
            metallic: Some(1.0),
            illumination: Some(3),
            diffuse_map: Some(map("wood.png")),
            emission_map: Some(map("a.png")),
            opacity_map: Some(map("b.png")),
            bump_map: Some(map("c.png")),
            normal_map: Some(map("d.png")),
            roughness_map: Some(map("e.png")),
            metallic_map: Some(map("f.png")),
            unnamed: Vec::new(),
        };
        let file = read(text);
        assert_eq!(file.material("stained glass"), Some(&expected));
        assert!(file.left_out.is_empty());
        let upper = read(&text.replace("map_Bump", "bump").replace("map_Kd", "MAP_KD"));
        assert_eq!(upper, file);
    }

    #[test]
    fn materials_follow_each_other_and_members_that_are_not_there_are_none() {
        let file = read("newmtl a\nTr 0.25\nnewmtl b\nd -halo 0.5\n\nnewmtl a\nKd 1 1 1\n");
        assert_eq!(file.materials.len(), 3);
        assert_eq!(file.material("a").unwrap().opacity, Some(0.75));
        assert_eq!(file.material("b").unwrap().opacity, Some(0.5));
        assert_eq!(file.material("b").unwrap().diffuse, None);
        assert_eq!(file.material("c"), None);
        assert_eq!(read(""), MtlFile::default());
        assert_eq!(read("# nothing\n"), MtlFile::default());
    }

    #[test]
    fn options_stand_before_the_name_of_a_picture() {
        let of = |line: &str| read(&format!("newmtl a\n{line}\n")).materials[0].bump_map.clone().unwrap();
        let expected = MtlMap {
            offset: [0.5, -0.5],
            scale: [2.0, 3.0],
            multiplier: 0.25,
            is_clamped: true,
            ..map("maps/wood grain.png")
        };
        let line = "bump -bm 0.25 -s 2 3 1 -o .5 -.5 -clamp on -blendu off -imfchan l -mm 0 1 maps\\wood grain.png";
        assert_eq!(of(line), expected);
        assert_eq!(of("map_Bump -s 4 2.png"), MtlMap { scale: [4.0, 1.0], ..map("2.png") });
        assert_eq!(of("map_Bump -texres 512 -boost 2 -t 1 C:\\maps\\a b.png").file, "a b.png");
    }

    #[test]
    fn pictures_without_a_name_are_left_out_and_listed() {
        let material = |lines: &str| read(&format!("newmtl a\n{lines}\n")).materials[0].clone();
        for line in ["map_Kd", "map_Kd \t", "map_Kd -s 1 1", "map_Kd .."] {
            let unnamed = MtlMaterial { name: "a".to_owned(), unnamed: vec!["map_kd".to_owned()], ..<_>::default() };
            assert_eq!(material(line), unnamed, "{line:?}");
        }
        assert_eq!(material("map_Kd a.png\nmap_Kd\n").diffuse_map, Some(map("a.png")));
    }

    #[test]
    fn what_is_left_out_is_counted() {
        let file = read("Kd 1 1 1\nnewmtl a\nmap_Ks x.png\nrefl -type sphere y.png\nmap_ks z.png\nKd spectral a.rfl\n");
        let left_out: Vec<(&str, usize)> = file.left_out.iter().map(|(name, count)| (name.as_str(), *count)).collect();
        assert_eq!(left_out, [("Kd", 2), ("map_Ks", 1), ("map_ks", 1), ("refl", 1)]);
    }

    #[test]
    fn names_of_other_encodings_are_read() {
        let file = MtlFile::read(b"newmtl gr\xfcn\nmap_Kd gr\xfcn.png\n").unwrap();
        assert_eq!(file.materials[0].name, "gr\u{fc}n");
        assert_eq!(file.materials[0].diffuse_map, Some(map("gr\u{fc}n.png")));
    }

    #[test]
    fn errors_name_the_line_the_text_and_what_would_be_right() {
        for (text, expected) in [
            ("Kd nan 0 0", "line 2, \"Kd nan 0 0\": \"nan\" must be a finite number"),
            ("Kd 1 1e999 0", "\"1e999\" must be a finite number"),
            ("Kd 0,5 0 0", "\"0,5\" must be a number with a point, not a comma"),
            ("Kd 1 2", "has 2 numbers, must have 1 or 3"),
            ("Kd", "has 0 numbers, must have 1 or 3"),
            ("Ns # none", "must have a number"),
            ("Ns inf", "\"inf\" must be a finite number"),
            ("illum 1.5", "must be a whole number of 0 to 10"),
            ("map_Kd -s wood.png", "\"wood.png\" must be a number such as"),
            ("map_Kd -bm nan wood.png", "\"nan\" must be a finite number"),
            ("map_Kd -s 1 inf wood.png", "\"inf\" must be a finite number"),
        ] {
            let error = MtlFile::read(format!("newmtl a\n{text}\n").as_bytes()).unwrap_err().to_string();
            assert!(error.starts_with("is not a readable MTL file: line 2, "), "{error}");
            assert!(error.contains(expected), "no {expected:?} in: {error}");
        }
        let error = MtlFile::read(b"\x89PNG\r\n\x1a\n").unwrap_err().to_string();
        assert_eq!(error, "is not a readable MTL file: it looks like a PNG picture");
    }
}
