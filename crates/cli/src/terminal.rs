//! What people and scripts see: results on standard output, progress on standard error.

use std::borrow::Cow;
use std::error::Error;
use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use clerestory_api::{ClientError, ConvergencePoint, is_printable};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use crate::failure::{Failure, report};

/// Steps of a full progress bar.
const BAR_STEPS: u64 = 1000;

/// Time between lines of progress where there is no terminal to draw a bar on.
pub(crate) const LINE_PERIOD: Duration = Duration::from_secs(5);

/// Why relMSE can rise although the image gets better.
pub(crate) const REL_MSE_NOTE: &str = "weighs dark pixels most: it rises when a bright sample arrives";

/// A text of others as a part of a line: what would steer the terminal or begin another line is written as an escape.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, is_printable)
}

/// A text of several lines in which nothing steers the terminal.
fn printable_lines(text: &str) -> Cow<'_, str> {
    escaped(text, |character| matches!(character, '\n' | '\t') || is_printable(character))
}

fn escaped(text: &str, is_kept: impl Fn(char) -> bool) -> Cow<'_, str> {
    if text.chars().all(&is_kept) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        if is_kept(character) { escaped.push(character) } else { escaped.extend(character.escape_unicode()) }
    }
    Cow::Owned(escaped)
}

/// Writes a line to standard output.
pub(crate) fn print_line(line: &str) -> Result<(), Failure> {
    write_line(&printable_lines(line))
}

/// Writes a value to standard output as one line of JSON.
pub(crate) fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    let json = serde_json::to_string(value).expect("what commands print has a form in JSON");
    write_line(&printable_json(&json))
}

/// One line of JSON in which nothing steers the terminal. Such characters are in its texts alone, where an escape says the same.
fn printable_json(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    for character in json.chars() {
        match is_printable(character) {
            true => text.push(character),
            false => text.push_str(&format!("\\u{:04x}", u32::from(character))),
        }
    }
    text
}

fn write_line(line: &str) -> Result<(), Failure> {
    writeln!(io::stdout().lock(), "{line}").map_err(Failure::Output)
}

/// The message of an error, as it is shown.
pub(crate) fn cause_text(cause: &(dyn Error + 'static)) -> String {
    match cause.downcast_ref::<ClientError>() {
        // It repeats what a server says.
        Some(answer) => printable(&answer.to_string()).into_owned(),
        None => printable_lines(&cause.to_string()).into_owned(),
    }
}

/// Writes a failure, its causes and what can be done to standard error.
pub(crate) fn print_failure(failure: &Failure) {
    // With standard error gone, nobody is left to be told.
    let _ = writeln!(io::stderr().lock(), "error: {}", report(failure));
    if let Some(advice) = failure.advice() {
        let _ = writeln!(io::stderr().lock(), "{}", printable_lines(&advice));
    }
}

/// How far a render is.
#[derive(Clone, Debug, Default)]
pub(crate) struct Advance {
    /// Fraction that is done, 0 to 1.
    pub(crate) fraction: f64,
    /// What is being done, where it is not one render alone.
    pub(crate) activity: Option<String>,
    /// Samples in a pixel, in words.
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

/// Columns of the table of rounds that not every render fills.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Columns {
    /// Whether there is a reference to measure the error against.
    has_error: bool,
    /// Whether the noise of the reference is known, which is taken off the error.
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

    /// Whether it is drawn for somebody who looks at it.
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
        // Progress is a courtesy: a standard error that is gone does not stop the work.
        self.bar.suspend(|| {
            let _ = writeln!(io::stderr().lock(), "{}", printable_lines(line));
        });
    }

    /// Says what light the image lacks, and what comes by chance.
    pub(crate) fn missing_light(&self, missing: &[String], left_to_chance: &[String]) {
        self.list("Light that this image lacks:", missing);
        self.list("Light that is left to chance, and comes as rare bright samples:", left_to_chance);
    }

    /// Writes lines under a heading; nothing where there are none.
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

/// Where bars are drawn: on standard error, and nowhere when that is no terminal.
pub(crate) fn bar_target() -> ProgressDrawTarget {
    if io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() }
}

/// A bar for an upload of so many bytes.
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
    /// Those that a round fills.
    fn of(point: &ConvergencePoint) -> Self {
        Self { has_error: point.mse.is_some(), has_corrected_error: point.corrected_mse.is_some() }
    }

    /// These, and those that are shown already.
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
        // Without a reference, the image's own estimate of its error is all there is.
        if let Some(estimate) = point.estimated_mse.filter(|_| point.mse.is_none()) {
            row.push_str(&format!("  (estimated MSE {estimate:.2e})"));
        }
        row
    }
}

/// A duration in the largest fitting units: `0.4 s`, `3 min 20 s`, `2 h 05 min`.
pub(crate) fn duration_text(duration: Duration) -> String {
    let seconds = duration.as_secs();
    match seconds {
        0..60 => format!("{:.1} s", duration.as_secs_f64()),
        60..3600 => format!("{} min {:02} s", seconds / 60, seconds % 60),
        _ => format!("{} h {:02} min", seconds / 3600, seconds / 60 % 60),
    }
}

/// A number of things, in the right one of two words.
pub(crate) fn counted(count: u64, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// A number with a decimal prefix: `12.3 k`, `4.56 M`.
fn with_prefix(value: f64) -> String {
    let prefixes = [(1e9, " G"), (1e6, " M"), (1e3, " k")];
    match prefixes.into_iter().find(|(factor, _)| value >= *factor) {
        Some((factor, prefix)) => format!("{:.2}{prefix}", value / factor),
        None => format!("{value:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_and_rates_are_written_for_people() {
        let text = |seconds| duration_text(Duration::from_secs_f64(seconds));
        assert_eq!((text(0.44), text(200.0), text(7500.0)), ("0.4 s".into(), "3 min 20 s".into(), "2 h 05 min".into()));
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
    fn what_would_steer_a_terminal_is_escaped_and_all_scripts_are_shown() {
        assert_eq!(
            printable("rose \u{1b}[31m\r\n\u{9b}2J\u{202e}txt"),
            "rose \\u{1b}[31m\\u{d}\\u{a}\\u{9b}2J\\u{202e}txt"
        );
        assert_eq!(printable_lines("first\n\tsecond\u{7f}"), "first\n\tsecond\\u{7f}");
        let name = "rose \u{1b}\u{9b}2J\u{202e}txt\u{2028}";
        let json = printable_json(&serde_json::to_string(name).unwrap());
        assert_eq!(json, r#""rose \u001b\u009b2J\u202etxt\u2028""#);
        assert_eq!(serde_json::from_str::<String>(&json).unwrap(), name);
        for name in ["Rosenfenster, süd", "حافظ", "窓 🪟"] {
            assert!(matches!(printable(name), Cow::Borrowed(shown) if shown == name));
        }
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
