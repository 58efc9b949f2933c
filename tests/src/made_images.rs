//! Images that one process or a farm made of a scene, and whether they are the same.

use std::path::{Path, PathBuf};

use clerestory_api::JobState;
use clerestory_film::{DecodeBudget, FrameImage, ImageMetadata};

use crate::exr_files::same_samples;
use crate::farm::{Farm, clerestory, succeeded};

/// The image that one process makes of a scene, in a folder.
///
/// # Panics
///
/// When it makes none.
pub fn rendered_alone(scene: &Path, folder: &Path, name: &str, options: &[&str]) -> PathBuf {
    let image = folder.join(name);
    succeeded(clerestory().arg("render").arg(scene).args(options).arg("-o").arg(&image));
    image
}

/// The image of the farm's newest job, once it is done, in a folder.
///
/// # Panics
///
/// When it fails or is cancelled, or does not end within minutes.
pub fn rendered_by(farm: &Farm, folder: &Path) -> PathBuf {
    let job = farm.wait_until("done", |job| !matches!(job.state, JobState::Queued | JobState::Running));
    assert_eq!(job.state, JobState::Done, "{:?}", job.failure);
    let image = folder.join(format!("{}.exr", job.id));
    std::fs::write(&image, farm.image(job.id)).expect("a writable folder");
    image
}

/// The same bits in all that was rendered.
///
/// # Panics
///
/// When they are not.
#[track_caller]
pub fn assert_same_bits(first: &Path, second: &Path) {
    let output = succeeded(clerestory().arg("compare").arg(first).arg(second).arg("--json"));
    let comparison: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(comparison["bit_identical"], true, "{comparison}");
    let [first, second] = [first, second].map(|file| std::fs::read(file).expect("the image is there"));
    assert_eq!(same_samples(&first, &second), Ok(()));
}

/// How an image says that it was made.
///
/// # Panics
///
/// When the file is no image of ours.
pub fn metadata(file: &Path) -> ImageMetadata {
    let image = FrameImage::decode(&std::fs::read(file).expect("a file"), DecodeBudget { pixel_bytes: 1 << 28 });
    image.expect("an image").metadata().expect("an image of ours").clone()
}

/// The same bits, made with the same work by the same build.
///
/// # Panics
///
/// When they are not.
#[track_caller]
pub fn assert_made_alike(first: &Path, second: &Path) {
    assert_same_bits(first, second);
    let [first, second] = [first, second].map(metadata);
    assert!(first.counters.rays > 0 && first.counters.height_evaluations > 0, "{:?}", first.counters);
    assert_eq!(first.counters, second.counters);
    assert_eq!((&first.build, &first.worker_builds), (&second.build, &second.worker_builds));
    let lists = |image: ImageMetadata| {
        [image.missing_light, image.left_to_chance, image.chosen_methods, image.import_notes, image.assumptions]
    };
    assert_eq!(lists(first), lists(second));
}
