//! `clerestory compare`: measures how far an image is from a reference.

use std::path::PathBuf;

use clap::Args;

use crate::failure::Failure;
use crate::image_file::read;
use crate::measures::Measures;
use crate::output::{print_json, print_line};
use crate::progress::{Progress, REL_MSE_NOTE};
use crate::standard_error::reference_gaps;

/// Options of `clerestory compare`.
#[derive(Debug, Args)]
pub(crate) struct CompareArguments {
    /// The image.
    image: PathBuf,
    /// The reference, of the same size. With a standard error in it, the corrected MSE has a value.
    reference: PathBuf,
    /// Write the measures as JSON; a measure that does not exist, such as the PSNR of identical images, is null.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &CompareArguments) -> Result<(), Failure> {
    let (image, reference) = (read(&arguments.image)?, read(&arguments.reference)?);
    let measures = Measures::of(&image, &reference)?;
    if let Some(gaps) = reference_gaps(&reference) {
        Progress::new().note(&gaps);
    }
    if arguments.json { print_json(&measures) } else { rows(&measures).iter().try_for_each(|row| print_line(row)) }
}

fn rows(Measures { metrics, flip }: &Measures) -> Vec<String> {
    let row = |name: &str, value: Option<f64>| {
        format!("{name:<16} {}", value.map_or_else(|| "-".to_owned(), |value| format!("{value:.5e}")))
    };
    vec![
        row("MSE", Some(metrics.mse)),
        row("corrected MSE", metrics.corrected_mse),
        row("relMSE", metrics.rel_mse) + &metrics.rel_mse.map(|_| format!("  ({REL_MSE_NOTE})")).unwrap_or_default(),
        format!("{:<16} {}", "PSNR (dB)", metrics.psnr.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"))),
        format!("{:<16} {flip:.4}", "FLIP"),
        row("mean ratio", metrics.mean_ratio),
        row("max difference", Some(metrics.max_abs_diff)),
        format!("{:<16} {}", "bit-identical", if metrics.bit_identical { "yes" } else { "no" }),
    ]
}
