//! Reference images: a mean, two independent halves and a standard error, stored as OpenEXR.
//!
//! The channels `R`, `G`, `B` hold radiance, so that any viewer shows the picture. `half_a.*` and `half_b.*` hold the
//! means of the even and of the odd batches. `stderr.*` is the standard error of the mean from all batches. Stratified
//! batches make the errors of neighbouring pixels anticorrelated. So the error of a block of pixels comes from the
//! difference of the halves, not from the pixels' standard errors in quadrature.

use std::path::{Path, PathBuf};

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Layer, LayerAttributes, ReadChannels, ReadLayers, SmallVec,
    WritableImage,
};
use glam::DVec3;

/// A picture: linear RGB, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// `width * height` pixels.
    pub pixels: Vec<DVec3>,
}

impl Image {
    /// A black picture.
    pub fn black(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![DVec3::ZERO; width * height] }
    }

    /// The pixel-by-pixel mean of pictures of one size.
    ///
    /// # Panics
    ///
    /// Without any picture.
    pub fn mean<'a>(images: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut images = images.into_iter();
        let mut sum = images.next().expect("a picture").clone();
        let mut count = 1.0;
        for image in images {
            for (a, b) in sum.pixels.iter_mut().zip(&image.pixels) {
                *a += *b;
            }
            count += 1.0;
        }
        for pixel in &mut sum.pixels {
            *pixel /= count;
        }
        sum
    }

    /// The relative mean square error of either of two independent pictures of one scene, of their red light.
    pub fn relative_error(&self, other: &Self) -> f64 {
        let error = |(a, b): (&DVec3, &DVec3)| {
            let mean = 0.5 * (a.x + b.x);
            0.5 * (a.x - b.x) * (a.x - b.x) / (mean * mean)
        };
        self.pixels.iter().zip(&other.pixels).map(error).sum::<f64>() / self.pixels.len() as f64
    }

    /// The picture times `factor`.
    pub fn scaled(mut self, factor: f64) -> Self {
        for pixel in &mut self.pixels {
            *pixel *= factor;
        }
        self
    }
}

/// A reference image.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The best estimate.
    pub mean: Image,
    /// Two independent estimates whose mean is `mean`.
    pub halves: [Image; 2],
    /// Standard error of each pixel of `mean`.
    pub standard_error: Image,
}

/// Why a reference image cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// The file is no OpenEXR image, or cannot be written.
    #[error("cannot read or write {path}")]
    Exr {
        /// The file.
        path: PathBuf,
        /// Why.
        source: exr::error::Error,
    },
    /// The image has other channels than a reference.
    #[error("{path} has no 32-bit float channel `{channel}`, which a reference must have")]
    Channel {
        /// The file.
        path: PathBuf,
        /// What is missing.
        channel: String,
    },
}

const LAYERS: [&str; 4] = ["", "half_a.", "half_b.", "stderr."];
const CHANNELS: [&str; 3] = ["R", "G", "B"];

impl Reference {
    /// From independent, equally distributed batches, an even number of at least four.
    ///
    /// # Panics
    ///
    /// With another number of batches.
    pub fn from_batches(batches: &[Image]) -> Self {
        assert!(batches.len() >= 4 && batches.len().is_multiple_of(2), "an even number of batches");
        let mean = Image::mean(batches);
        let halves = [0, 1].map(|half| Image::mean(batches.iter().skip(half).step_by(2)));
        let count = batches.len() as f64;
        let mut standard_error = Image::black(mean.width, mean.height);
        for (i, pixel) in standard_error.pixels.iter_mut().enumerate() {
            let squares: DVec3 =
                batches.iter().map(|b| (b.pixels[i] - mean.pixels[i]) * (b.pixels[i] - mean.pixels[i])).sum();
            let variance = squares / (count * (count - 1.0));
            *pixel = DVec3::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt());
        }
        Self { mean, halves, standard_error }
    }

    /// The reference times `factor`.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            mean: self.mean.scaled(factor),
            halves: self.halves.map(|half| half.scaled(factor)),
            standard_error: self.standard_error.scaled(factor),
        }
    }

    /// Reads a reference image.
    ///
    /// # Errors
    ///
    /// A file that is no OpenEXR image with the channels of a reference.
    pub fn read(path: &Path) -> Result<Self, ReferenceError> {
        let file = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_file(path)
            .map_err(|source| ReferenceError::Exr { path: path.into(), source })?;
        let (width, height) = (file.layer_data.size.width(), file.layer_data.size.height());
        let image = |layer: &str| {
            let mut image = Image::black(width, height);
            for (c, name) in CHANNELS.iter().enumerate() {
                let name = format!("{layer}{name}");
                let channel = file.layer_data.channel_data.list.iter().find(|channel| channel.name.eq(name.as_str()));
                let Some(FlatSamples::F32(values)) = channel.map(|channel| &channel.sample_data) else {
                    return Err(ReferenceError::Channel { path: path.into(), channel: name });
                };
                for (pixel, value) in image.pixels.iter_mut().zip(values) {
                    pixel[c] = f64::from(*value);
                }
            }
            Ok(image)
        };
        let [mean, half_a, half_b, standard_error] =
            [image(LAYERS[0])?, image(LAYERS[1])?, image(LAYERS[2])?, image(LAYERS[3])?];
        Ok(Self { mean, halves: [half_a, half_b], standard_error })
    }

    /// Writes the reference image as 32-bit floats. Mantissas are rounded to 18 bits, those of the standard error to 9
    /// bits, far below the noise, so that the file is small.
    ///
    /// # Errors
    ///
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ReferenceError> {
        let images = [&self.mean, &self.halves[0], &self.halves[1], &self.standard_error];
        let mut channels = SmallVec::<[AnyChannel<FlatSamples>; 4]>::new();
        for (layer, image) in LAYERS.iter().zip(images) {
            let bits = if *layer == "stderr." { 9 } else { 18 };
            for (c, name) in CHANNELS.iter().enumerate() {
                let values = image.pixels.iter().map(|pixel| rounded(pixel[c] as f32, bits)).collect();
                channels.push(AnyChannel::new(format!("{layer}{name}").as_str(), FlatSamples::F32(values)));
            }
        }
        let layer = Layer::new(
            (self.mean.width, self.mean.height),
            LayerAttributes::default(),
            Encoding::SMALL_LOSSLESS,
            AnyChannels::sort(channels),
        );
        exr::prelude::Image::from_layer(layer)
            .write()
            .to_file(path)
            .map_err(|source| ReferenceError::Exr { path: path.into(), source })
    }
}

/// A float with its mantissa rounded to `bits` bits.
fn rounded(value: f32, bits: u32) -> f32 {
    let spare = 23 - bits;
    f32::from_bits((value.to_bits().wrapping_add(1 << (spare - 1)) >> spare) << spare)
}
