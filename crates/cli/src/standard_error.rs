//! Notes on the standard error of an image: where it is not known, why, and what to change.

use clerestory_film::{FrameImage, ImageMetadata, Sampling};

use crate::text::counted;

/// Blocks of a suggested setting, so that the spread of their means is meaningful.
const SUGGESTED_BLOCKS: u32 = 4;

/// The note that an image with this many samples has no standard error; `None` when it has one.
pub(crate) fn absence(sampling: Sampling, samples: u32) -> Option<String> {
    let passes = samples.div_ceil(sampling.samples_per_pass());
    if sampling.complete_blocks(passes) >= 2 {
        return None;
    }
    let block = sampling.samples_per_block();
    let samples = passes.saturating_mul(sampling.samples_per_pass());
    Some(format!(
        "No standard error: {} in each pixel, which is less than two blocks of {block}. For one, render {}",
        counted(samples.into(), "sample", "samples"),
        ways_out(sampling, samples)
    ))
}

/// The note on tiles without a standard error; `None` when all have one.
pub(crate) fn gaps(metadata: &ImageMetadata) -> Option<String> {
    let (known, tiles) = (metadata.tiles_with_standard_error() as usize, metadata.tile_passes.len());
    if known == tiles {
        return None;
    }
    let block = metadata.sampling.samples_per_block();
    Some(if known == 0 {
        format!("no tile has a standard error: each has less than two blocks of {block} samples")
    } else {
        format!(
            "{known} of {tiles} tiles have a standard error: the others have less than two blocks of {block} \
             samples, and zeros \
             in its place"
        )
    })
}

/// [`gaps`], as a line of its own.
pub(crate) fn note_of_gaps(metadata: &ImageMetadata) -> Option<String> {
    gaps(metadata).map(|gaps| format!("Standard error: {gaps}"))
}

/// The note that the noise of a reference is known in some tiles only, so that the corrected error is too large.
pub(crate) fn reference_gaps(reference: &FrameImage) -> Option<String> {
    let metadata = reference.metadata().filter(|metadata| metadata.tiles_with_standard_error() > 0)?;
    gaps(metadata).map(|gaps| format!("Of the reference, {gaps}; the corrected MSE is too large by their noise"))
}

/// Settings that give a standard error.
fn ways_out(sampling: Sampling, samples: u32) -> String {
    let more = format!("--spp {} or more", sampling.samples_per_block().saturating_mul(2));
    let pass = sampling.samples_per_pass();
    match (samples / SUGGESTED_BLOCKS).checked_ilog2() {
        None => more,
        Some(_) if samples / SUGGESTED_BLOCKS >= pass => {
            let passes = 1 << (samples / SUGGESTED_BLOCKS / pass).ilog2();
            format!("{more}, or in smaller blocks with --samples-per-block {}", passes * pass)
        }
        Some(exponent) => {
            let block = 1 << exponent;
            format!(
                "{more}, or in smaller passes and blocks with --samples-per-pass {block} --samples-per-block {block}"
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use clerestory_film::ImageLayers;
    use clerestory_film::counters::Counters;

    use super::*;

    #[test]
    fn an_image_without_a_standard_error_says_what_to_set() {
        let absence = |pass, block, samples| absence(Sampling::new(pass, block).unwrap(), samples);
        let usual = absence(16, 256, 256).unwrap();
        assert!(
            usual.starts_with("No standard error: 256 samples in each pixel, which is less than two blocks of 256")
        );
        assert!(usual.ends_with("--spp 512 or more, or in smaller blocks with --samples-per-block 64"), "{usual}");
        // Whole passes are rendered.
        assert!(absence(16, 256, 1).unwrap().contains("16 samples"));
        assert!(absence(16, 256, 1).unwrap().ends_with("--samples-per-pass 4 --samples-per-block 4"));
        assert!(absence(1, 2, 3).unwrap().ends_with("--spp 4 or more"));
        assert_eq!((absence(16, 256, 512), absence(16, 64, 256), absence(16, 256, 497)), (None, None, None));
    }

    #[test]
    fn an_image_with_gaps_says_how_many_tiles_have_a_standard_error() {
        let image = |tile_passes: [u32; 4]| {
            let mut metadata = ImageMetadata {
                scene_hash: String::new(),
                frame: 0,
                seed: 0,
                integrator: serde_json::Value::Null,
                sampling: Sampling::new(4, 8).unwrap(),
                tile_size: 1,
                tile_passes: Vec::new(),
                standard_error_tiles: None,
                build: String::new(),
                worker_builds: Vec::new(),
                missing_light: Vec::new(),
                left_to_chance: Vec::new(),
                chosen_methods: Vec::new(),
                import_notes: Vec::new(),
                assumptions: Vec::new(),
                counters: Counters::default(),
                elapsed_seconds: None,
            };
            metadata.set_tile_passes(tile_passes.to_vec());
            let layers = ImageLayers { mean: vec![[0.0; 3]; 4], ..ImageLayers::default() };
            FrameImage::new(2, 2, layers, Some(metadata)).unwrap()
        };
        let gaps_of = |tile_passes| gaps(image(tile_passes).metadata().unwrap());
        assert_eq!(gaps_of([4, 5, 40, 4]), None);
        let some = gaps_of([4, 3, 4, 0]).unwrap();
        assert!(
            some.starts_with("2 of 4 tiles have a standard error: the others have less than two blocks of 8"),
            "{some}"
        );
        assert!(gaps_of([3; 4]).unwrap().starts_with("no tile has a standard error"));
        let reference = reference_gaps(&image([4, 3, 4, 0])).unwrap();
        assert!(reference.starts_with("Of the reference, 2 of 4 tiles have a standard error"), "{reference}");
        assert_eq!((reference_gaps(&image([3; 4])), reference_gaps(&image([4; 4]))), (None, None));
    }

    #[test]
    fn what_is_suggested_gives_a_standard_error() {
        for (pass, block, samples) in [(16, 256, 256), (16, 256, 100), (12, 48, 60), (16, 256, 16), (16, 16384, 20000)]
        {
            let sampling = Sampling::new(pass, block).unwrap();
            let text = absence(sampling, samples).unwrap();
            let value = |option: &str| {
                let (_, rest) = text.split_once(&format!("{option} "))?;
                rest.split(' ').next()?.trim_end_matches(',').parse::<u32>().ok()
            };
            let smaller = value("--samples-per-block").unwrap();
            let suggested = Sampling::new(value("--samples-per-pass").unwrap_or(pass), smaller).unwrap();
            assert_eq!(absence(suggested, samples), None, "{text}");
            assert_eq!(absence(sampling, value("--spp").unwrap()), None, "{text}");
        }
    }
}
