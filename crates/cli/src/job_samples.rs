//! How far a job is, in samples.

use std::time::Duration;

use clerestory_api::{JobView, StopReason};

use crate::text::duration_text;

/// Samples in a pixel so far, mean over both planes, with a unit behind the number, and the end of the job.
pub(crate) fn samples_text(job: &JobView, unit: &str) -> String {
    let planes = 1 + u64::from(job.light_plane);
    let pixels = u64::from(job.width) * u64::from(job.height) * u64::from(job.frames) * planes;
    let samples = match job.stopped_by {
        // Samples beyond the last round are not in the image.
        Some(StopReason::Mse | StopReason::EstimatedMse) => {
            f64::from(job.complete_passes) * f64::from(job.samples_per_pass)
        }
        _ => job.samples as f64 / pixels.max(1) as f64,
    };
    let ends = Ends {
        samples: job.total_samples as f64 / pixels.max(1) as f64,
        mse: job.target_mse,
        estimated_mse: job.target_estimated_mse,
        time: job.time_limit_ms.and_then(|limit| u64::try_from(limit).ok()).map(Duration::from_millis),
    };
    ends.words(samples, unit)
}

/// The ends of a job; the first that is reached ends it.
#[derive(Clone, Copy, Debug, Default)]
struct Ends {
    samples: f64,
    mse: Option<f64>,
    estimated_mse: Option<f64>,
    time: Option<Duration>,
}

impl Ends {
    fn words(&self, samples: f64, unit: &str) -> String {
        let number = |samples: f64| if samples.fract() == 0.0 { format!("{samples}") } else { format!("{samples:.1}") };
        let ends = [
            self.mse.map(|target| format!("to MSE {target:e}")),
            self.estimated_mse.map(|target| format!("to MSE ~{target:e}")),
            self.time.map(|limit| format!("within {}", duration_text(limit))),
        ];
        let ends: Vec<String> = ends.into_iter().flatten().collect();
        if ends.is_empty() {
            return format!("{} of {}{unit}", number(samples), number(self.samples));
        }
        format!("{}{unit} {}", number(samples), ends.join(" or "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_have_their_unit_before_a_limit_and_behind_the_total() {
        let total = Ends { samples: 256.0, ..Ends::default() };
        let limited = Ends { time: Some(Duration::from_secs(150)), ..total };
        let unit = " samples a pixel";
        assert_eq!(limited.words(76.5, unit), "76.5 samples a pixel within 2 min 30 s");
        assert_eq!(total.words(128.0, unit), "128 of 256 samples a pixel");
        assert_eq!(total.words(128.0, ""), "128 of 256");
        let shared_out = Ends { samples: 612.25, ..Ends::default() };
        assert_eq!(shared_out.words(88.5, ""), "88.5 of 612.2");
        let targets = Ends { mse: Some(1e-3), estimated_mse: Some(2.5e-4), ..limited };
        assert_eq!(targets.words(16.0, ""), "16 to MSE 1e-3 or to MSE ~2.5e-4 or within 2 min 30 s");
    }
}
