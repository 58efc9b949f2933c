//! Digests of pixels, and tables in which they are recorded.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use clerestory_film::{DecodeBudget, FrameImage, ImageLayers};

/// A picture in short.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PixelDigest {
    /// BLAKE3 of the bits of all layers but `caustic`, 32 hexadecimal digits of it.
    digest: String,
    /// Mean of all channels of the picture, for people who want to know how much a change changed.
    mean: String,
}

impl PixelDigest {
    /// The digest of the layers of an image. It does not depend on how files hold them. The layer `caustic` is left
    /// out, so that digests which were recorded without it stay.
    pub fn of(layers: &ImageLayers) -> Self {
        let mut hasher = blake3::Hasher::new();
        let mut add = |name: &str, bits: Option<Vec<u32>>| {
            if let Some(bits) = bits {
                hasher.update(name.as_bytes());
                hasher.update(&(bits.len() as u64).to_le_bytes());
                bits.iter().for_each(|bits| _ = hasher.update(&bits.to_le_bytes()));
            }
        };
        let triples = |layer: &Vec<[f32; 3]>| layer.as_flattened().iter().map(|value| value.to_bits()).collect();
        add("mean", Some(triples(&layers.mean)));
        add("stderr", layers.standard_error.as_ref().map(triples));
        add("samples", layers.samples.clone());
        add("albedo", layers.albedo.as_ref().map(triples));
        add("normal", layers.normal.as_ref().map(triples));
        add("depth", layers.depth.as_ref().map(|layer| layer.iter().map(|value| value.to_bits()).collect()));
        let values = layers.mean.as_flattened();
        let mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len().max(1) as f64;
        Self { digest: hasher.finalize().to_hex()[..32].to_owned(), mean: format!("{mean:.5e}") }
    }

    /// The digest of an image in a file.
    ///
    /// # Panics
    ///
    /// When it is no image of ours.
    pub fn of_image(file: &[u8]) -> Self {
        let image = FrameImage::decode(file, DecodeBudget { pixel_bytes: 1 << 24 });
        Self::of(image.expect("an image").layers())
    }

    /// Whether there is no light in the picture.
    pub fn is_black(&self) -> bool {
        self.mean.parse() == Ok(0.0)
    }
}

/// Digests by what was rendered: the scene, and how. A text file with a line for each, and comments in lines that begin
/// with `#`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DigestTable {
    cases: BTreeMap<(String, String), PixelDigest>,
}

impl DigestTable {
    /// Reads a table.
    ///
    /// # Panics
    ///
    /// When the file is not there, or a line is not as [`Self::write`] writes it.
    pub fn read(file: &Path) -> Self {
        let text = std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let mut table = Self::default();
        for line in text.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
            let columns: Vec<&str> = line.split('\t').collect();
            let [scene, settings, mean, digest] = columns[..] else {
                panic!("{}: `{line}` has {} columns, expected 4", file.display(), columns.len())
            };
            table.add(scene, settings, PixelDigest { digest: digest.to_owned(), mean: mean.to_owned() });
        }
        table
    }

    /// Writes the table below some lines of comment.
    ///
    /// # Panics
    ///
    /// When the file cannot be written.
    pub fn write(&self, file: &Path, comment: &str) {
        let mut text: String = comment.lines().map(|line| format!("# {line}\n")).collect();
        for ((scene, settings), PixelDigest { digest, mean }) in &self.cases {
            writeln!(text, "{scene}\t{settings}\t{mean}\t{digest}").expect("text can be written to memory");
        }
        std::fs::write(file, text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    }

    /// Adds a case.
    ///
    /// # Panics
    ///
    /// When it is there already.
    pub fn add(&mut self, scene: &str, settings: &str, digest: PixelDigest) {
        let before = self.cases.insert((scene.to_owned(), settings.to_owned()), digest);
        assert_eq!(before, None, "{scene}, {settings} is there twice");
    }

    /// The cases: scene, settings, digest.
    pub fn cases(&self) -> impl Iterator<Item = (&str, &str, &PixelDigest)> {
        self.cases.iter().map(|((scene, settings), digest)| (scene.as_str(), settings.as_str(), digest))
    }

    /// What is different in another table, in a line for each case: recorded here and other there, or in one table
    /// alone.
    pub fn differences(&self, now: &Self) -> Vec<String> {
        let mut all: Vec<_> = self.cases.keys().chain(now.cases.keys()).collect();
        all.sort();
        all.dedup();
        let difference = |case: &(String, String)| {
            let (recorded, now) = (self.cases.get(case), now.cases.get(case));
            let words = match (recorded, now) {
                (Some(recorded), Some(now)) if recorded == now => return None,
                (Some(recorded), Some(now)) => {
                    format!("other pixels; the mean was {}, and is {}", recorded.mean, now.mean)
                }
                (Some(_), None) => "is recorded, and is not rendered any more".to_owned(),
                (None, Some(_)) => "is rendered, and is not recorded".to_owned(),
                (None, None) => return None,
            };
            Some(format!("{}, {}: {words}", case.0, case.1))
        };
        all.into_iter().filter_map(difference).collect()
    }
}
