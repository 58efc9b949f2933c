//! Progress on standard error: a bar on a terminal, lines elsewhere.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use clerestory_api::ConvergencePoint;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::text::{duration_text, printable, printable_lines, with_prefix};

/// Steps of a full progress bar.
const BAR_STEPS: u64 = 1000;

/// Time between lines of progress where there is no terminal to draw a bar on.
pub(crate) const LINE_PERIOD: Duration = Duration::from_secs(5);

/// Why relMSE can rise although the image gets better.
pub(crate) const REL_MSE_NOTE: &str = "weighs dark pixels most: it rises when a bright sample arrives";

/// How far a render is.
#[derive(Clone, Debug, Default)]
pub(crate) struct Advance {
    /// Fraction that is done, 0 to 1.
    pub(crate) fraction: f64,
    /// The activity, where it is not one render alone.
    pub(crate) activity: Option<String>,
    /// Samples in a pixel, as text.
    pub(crate) samples: Option<String>,
    /// Camera samples a second.
    pub(crate) samples_per_second: Option<f64>,
    /// Estimated time left.
    pub(crate) remaining: Option<Duration>,
}

/// Progress on standard error: a bar on a terminal, a line now and then elsewhere.
pub(crate) struct Progress {
    bar: ProgressBar,
    is_drawn: bool,
    last_line: Option<Instant>,
    columns: Option<Columns>,
    last_rel_mse: Option<f64>,
    has_explained_rise: bool,
}

/// Optional columns of the table of rounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Columns {
    /// Whether there is a reference to measure the error against.
    has_error: bool,
    /// Whether the noise of the reference is known, which corrects the error.
    has_corrected_error: bool,
}

impl Progress {
    pub(crate) fn new() -> Self {
        let is_drawn = io::stderr().is_terminal();
        let style =
            ProgressStyle::with_template("{bar:32} {percent:>3} %  {msg}").expect("the template is well formed");
        let bar = ProgressBar::with_draw_target(Some(BAR_STEPS), bar_target()).with_style(style);
        Self { bar, is_drawn, last_line: None, columns: None, last_rel_mse: None, has_explained_rise: false }
    }

    /// Whether a terminal shows it.
    pub(crate) fn is_drawn(&self) -> bool {
        self.is_drawn
    }

    /// Shows how far it is.
    pub(crate) fn show(&mut self, advance: &Advance) {
        let text = printable(&advance_text(advance)).into_owned();
        if self.is_drawn {
            self.bar.set_position((advance.fraction * BAR_STEPS as f64) as u64);
            self.bar.set_message(text);
        } else if !text.is_empty() && self.last_line.is_none_or(|last| last.elapsed() >= LINE_PERIOD) {
            self.last_line = Some(Instant::now());
            self.note(&format!("{:3.0} %  {text}", advance.fraction * 100.0));
        }
    }

    /// Writes a line that stays.
    pub(crate) fn note(&self, line: &str) {
        // Without standard error, the work goes on.
        self.bar.suspend(|| {
            let _ = writeln!(io::stderr().lock(), "{}", printable_lines(line));
        });
    }

    /// Lists what was assumed for a file of another program.
    pub(crate) fn assumptions(&self, assumptions: &[String]) {
        self.list("Assumed, because the file does not say:", assumptions);
    }

    /// Lists what is in imported files and not in the scene, or differs.
    pub(crate) fn import_notes(&self, notes: &[String]) {
        self.list("Of the imported files:", notes);
    }

    /// Lists which method `auto` has chosen for which light.
    pub(crate) fn chosen_methods(&self, chosen: &[String]) {
        self.list("Methods that auto has chosen:", chosen);
    }

    /// Lists the light that the image lacks, and the light that is left to chance.
    pub(crate) fn missing_light(&self, missing: &[String], left_to_chance: &[String]) {
        self.list("Light that this image lacks:", missing);
        self.list("Light that is left to chance, and comes as rare bright samples:", left_to_chance);
    }

    /// Writes lines under a heading, or nothing without lines.
    fn list(&self, heading: &str, lines: &[String]) {
        if !lines.is_empty() {
            self.note(heading);
        }
        lines.iter().for_each(|line| self.note(&format!("  - {}", printable(line))));
    }

    /// Writes a row of the table of rounds, with a header above the first and wherever a column is new.
    pub(crate) fn round(&mut self, point: &ConvergencePoint) {
        let columns = Columns::of(point).with(self.columns);
        if self.columns != Some(columns) {
            self.columns = Some(columns);
            self.note(&columns.header());
        }
        self.note(&columns.row(point));
        let rises = self.last_rel_mse.zip(point.rel_mse).is_some_and(|(last, now)| now > last);
        if rises && !std::mem::replace(&mut self.has_explained_rise, true) {
            self.note(&format!("  (relMSE {REL_MSE_NOTE}, and falls again with more samples)"));
        }
        self.last_rel_mse = point.rel_mse;
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// The target of progress bars: standard error if it is a terminal.
pub(crate) fn bar_target() -> ProgressDrawTarget {
    if io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() }
}

/// A bar for an upload of `bytes` bytes.
pub(crate) fn upload_bar(bytes: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("Uploading {bar:20} {bytes} of {total_bytes}, {bytes_per_sec}")
        .expect("the template is well formed");
    ProgressBar::with_draw_target(Some(bytes), bar_target()).with_style(style)
}

fn advance_text(advance: &Advance) -> String {
    let rate = advance.samples_per_second.map(|rate| format!("{} samples/s", with_prefix(rate)));
    let left = advance.remaining.map(|left| format!("{} left", duration_text(left)));
    [advance.activity.clone(), advance.samples.clone(), rate, left].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

impl Columns {
    /// The columns that a round fills.
    fn of(point: &ConvergencePoint) -> Self {
        Self { has_error: point.mse.is_some(), has_corrected_error: point.corrected_mse.is_some() }
    }

    /// These columns and those that are shown already.
    fn with(self, shown: Option<Self>) -> Self {
        let Some(shown) = shown else { return self };
        Self {
            has_error: self.has_error || shown.has_error,
            has_corrected_error: self.has_corrected_error || shown.has_corrected_error,
        }
    }

    fn header(self) -> String {
        let mut header = "  round     spp       time".to_owned();
        if self.has_error {
            header.push_str("          MSE");
        }
        if self.has_corrected_error {
            header.push_str("    corrected");
        }
        if self.has_error {
            header.push_str("       relMSE        PSNR     FLIP");
        }
        header
    }

    fn row(self, point: &ConvergencePoint) -> String {
        let number =
            |value: Option<f64>| value.map_or_else(|| format!(" {:>12}", "-"), |value| format!(" {value:12.4e}"));
        let time = duration_text(Duration::from_millis(u64::try_from(point.wall_ms).unwrap_or(0)));
        let mut row = format!("{:>7} {:>7} {time:>10}", point.round + 1, point.samples_per_pixel);
        if self.has_error {
            row.push_str(&number(point.mse));
        }
        if self.has_corrected_error {
            row.push_str(&number(point.corrected_mse));
        }
        if self.has_error {
            row.push_str(&number(point.rel_mse));
            let psnr = point.psnr.map_or_else(|| format!(" {:>8}   ", "-"), |psnr| format!(" {psnr:8.2} dB"));
            row.push_str(&psnr);
            row.push_str(&point.flip.map_or_else(|| format!(" {:>8}", "-"), |flip| format!(" {flip:8.4}")));
        }
        // Without a reference, only the image's own estimate of its error is known.
        if let Some(estimate) = point.estimated_mse.filter(|_| point.mse.is_none()) {
            row.push_str(&format!("  (estimated MSE {estimate:.2e})"));
        }
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_beside_the_bar_has_samples_rate_and_time_left() {
        let advance = Advance {
            fraction: 0.5,
            activity: None,
            samples: Some("128 of 256 samples a pixel".to_owned()),
            samples_per_second: Some(1_234_567.0),
            remaining: Some(Duration::from_secs(61)),
        };
        assert_eq!(advance_text(&advance), "128 of 256 samples a pixel, 1.23 M samples/s, 1 min 01 s left");
        assert_eq!(advance_text(&Advance::default()), "");
    }

    #[test]
    fn a_round_shows_the_columns_that_it_fills() {
        let own = ConvergencePoint {
            samples_per_pixel: 64,
            wall_ms: 1500,
            estimated_mse: Some(1.25e-3),
            ..ConvergencePoint::default()
        };
        let columns = Columns::of(&own);
        assert_eq!(columns.header(), "  round     spp       time");
        assert_eq!(columns.row(&own), "      1      64      1.5 s  (estimated MSE 1.25e-3)");
        let early = ConvergencePoint { estimated_mse: None, ..own.clone() };
        assert_eq!(columns.row(&early), "      1      64      1.5 s", "nothing is known of it yet");

        let measured = ConvergencePoint {
            mse: Some(0.5),
            rel_mse: Some(0.25),
            psnr: Some(20.0),
            flip: Some(0.125),
            ..own.clone()
        };
        let columns = Columns::of(&measured);
        assert_eq!(columns.header(), "  round     spp       time          MSE       relMSE        PSNR     FLIP");
        assert_eq!(columns.row(&measured), "      1      64      1.5 s    5.0000e-1    2.5000e-1    20.00 dB   0.1250");
        let corrected = ConvergencePoint { corrected_mse: Some(0.375), psnr: None, ..measured.clone() };
        let columns = Columns::of(&corrected).with(Some(columns));
        let [header, row, first] = [columns.header(), columns.row(&corrected), columns.row(&measured)];
        assert_eq!(header, "  round     spp       time          MSE    corrected       relMSE        PSNR     FLIP");
        assert_eq!(row, "      1      64      1.5 s    5.0000e-1    3.7500e-1    2.5000e-1        -      0.1250");
        assert_eq!((row.len(), first.len()), (header.len(), header.len()));
    }
}
