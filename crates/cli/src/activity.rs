//! What a command does before there is progress to show. The user sees it when it takes longer than a moment.

use std::io::{self, IsTerminal, Write};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::SceneError;
use indicatif::{ProgressBar, ProgressStyle};

use crate::local_scene;
use crate::progress::{LINE_PERIOD, bar_target};
use crate::text::duration_text;

/// Time before anything is shown.
const QUIET: Duration = Duration::from_secs(1);

/// Time between two pictures of the spinner.
const SPINNER_PERIOD: Duration = Duration::from_millis(120);

/// Steps of a bar.
const BAR_LENGTH: u64 = 1000;

/// Work that a spinner shows on a terminal, and lines elsewhere, when it takes longer than a moment.
pub(crate) struct Activity {
    /// Dropped when the work ends.
    steps: Option<Sender<Step>>,
    /// The thread that shows the steps; absent where the system has no thread for it.
    shown: Option<JoinHandle<()>>,
}

/// A message to the thread that shows the work.
enum Step {
    /// The next step begins. Of a step of many parts, this part is done.
    Begun(String, Option<f64>),
    /// The work is done.
    Done(&'static str),
}

impl Activity {
    /// Begins with a step, such as `Reading the scene`.
    pub(crate) fn begin(step: &str) -> Self {
        let is_terminal = io::stderr().is_terminal();
        Self::shown_on(Output { quiet: QUIET, is_terminal, note: Box::new(note) }, step)
    }

    fn shown_on(output: Output, step: &str) -> Self {
        let (steps, next) = mpsc::channel();
        let display = Display { step: step.to_owned(), done: None, start: Instant::now(), stage: Stage::Quiet, output };
        let shown = thread::Builder::new().name("activity".to_owned()).spawn(move || display.run(&next)).ok();
        Self { steps: Some(steps), shown }
    }

    /// Goes on with another step.
    pub(crate) fn step(&self, step: String) {
        self.send(Step::Begun(step, None));
    }

    /// Builds a scene, with a step for each of its parts.
    pub(crate) fn build(&self, bundle: &SceneBundle) -> Result<PreparedScene, SceneError> {
        local_scene::build(bundle, &mut |step| self.send(Step::Begun(step.to_string(), step.done())))
    }

    /// Ends the work. If the work was shown, a line says how long it took.
    pub(crate) fn done(self, what: &'static str) {
        self.send(Step::Done(what));
    }

    fn send(&self, step: Step) {
        // A thread that has ended shows nothing, which does not stop the work.
        let _ = self.steps.as_ref().map(|steps| steps.send(step));
    }
}

impl Drop for Activity {
    /// Waits until the thread has ended, so that the next output has the terminal to itself.
    fn drop(&mut self) {
        self.steps = None;
        // A thread that panicked shows nothing.
        let _ = self.shown.take().map(JoinHandle::join);
    }
}

/// How the work is shown.
enum Stage {
    /// Nothing is shown yet.
    Quiet,
    Spinner(ProgressBar),
    /// In lines; the last one was written at this time.
    Lines(Instant),
}

/// Where the work is shown.
struct Output {
    /// How long nothing is shown.
    quiet: Duration,
    is_terminal: bool,
    /// Writes a line.
    note: Box<dyn Fn(&str) + Send>,
}

struct Display {
    step: String,
    /// Which part of the step is done, where that is known.
    done: Option<f64>,
    start: Instant,
    stage: Stage,
    output: Output,
}

impl Display {
    fn run(mut self, steps: &Receiver<Step>) {
        loop {
            match steps.recv_timeout(self.pause()) {
                Ok(Step::Begun(step, done)) => {
                    (self.step, self.done) = (step, done);
                    if let Stage::Spinner(bar) = &self.stage {
                        self.set(bar);
                    }
                }
                Ok(Step::Done(what)) => return self.end(Some(what)),
                Err(RecvTimeoutError::Timeout) => self.show(),
                Err(RecvTimeoutError::Disconnected) => return self.end(None),
            }
        }
    }

    /// Time until the next output.
    fn pause(&self) -> Duration {
        match &self.stage {
            Stage::Quiet => self.output.quiet.saturating_sub(self.start.elapsed()),
            Stage::Spinner(_) => SPINNER_PERIOD,
            Stage::Lines(last) => LINE_PERIOD.saturating_sub(last.elapsed()),
        }
    }

    /// Shows the step, with a bar where it is known which part of it is done.
    fn set(&self, bar: &ProgressBar) {
        let template =
            if self.done.is_some() { "{spinner} {bar:24} {msg} ({elapsed})" } else { "{spinner} {msg} ({elapsed})" };
        bar.set_style(ProgressStyle::with_template(template).expect("the template is well formed"));
        bar.set_position((self.done.unwrap_or(0.0) * BAR_LENGTH as f64) as u64);
        bar.set_message(self.step.clone());
    }

    fn show(&mut self) {
        match &mut self.stage {
            Stage::Quiet if self.output.is_terminal => {
                let bar = ProgressBar::with_draw_target(Some(BAR_LENGTH), bar_target());
                let bar = bar.with_elapsed(self.start.elapsed());
                self.set(&bar);
                bar.tick();
                self.stage = Stage::Spinner(bar);
            }
            Stage::Spinner(bar) => bar.tick(),
            Stage::Quiet | Stage::Lines(_) => {
                self.stage = Stage::Lines(Instant::now());
                (self.output.note)(&format!("{} ({})", self.step, duration_text(self.start.elapsed())));
            }
        }
    }

    fn end(self, done: Option<&str>) {
        if let Stage::Spinner(bar) = &self.stage {
            bar.finish_and_clear();
        }
        if let (Stage::Spinner(_) | Stage::Lines(_), Some(done)) = (&self.stage, done) {
            (self.output.note)(&format!("{done} after {}", duration_text(self.start.elapsed())));
        }
    }
}

fn note(line: &str) {
    // Without standard error, the work goes on.
    let _ = writeln!(io::stderr().lock(), "{line}");
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    /// An output, and the lines that it has received.
    fn lines(quiet: Duration) -> (Output, Arc<Mutex<Vec<String>>>) {
        let lines = Arc::new(Mutex::new(Vec::new()));
        let written = lines.clone();
        let note = move |line: &str| written.lock().unwrap().push(line.to_owned());
        (Output { quiet, is_terminal: false, note: Box::new(note) }, lines)
    }

    #[test]
    fn work_that_takes_long_is_shown_with_its_end() {
        let (output, lines) = lines(Duration::ZERO);
        let activity = Activity::shown_on(output, "Reading the scene");
        let deadline = Instant::now() + Duration::from_secs(60);
        while lines.lock().unwrap().is_empty() {
            assert!(Instant::now() < deadline, "nothing is shown");
            thread::yield_now();
        }
        activity.step("Building the panes".to_owned());
        activity.done("The scene is ready");
        let lines = lines.lock().unwrap();
        assert!(lines[0].starts_with("Reading the scene ("), "{lines:?}");
        assert!(lines.last().unwrap().starts_with("The scene is ready after "), "{lines:?}");
    }

    #[test]
    fn work_that_is_soon_done_or_fails_says_nothing_of_its_end() {
        let (output, quiet) = lines(Duration::from_secs(3600));
        let activity = Activity::shown_on(output, "Reading the scene");
        activity.step("Building the panes".to_owned());
        activity.done("The scene is ready");
        assert!(quiet.lock().unwrap().is_empty(), "{quiet:?}");
        let (output, failed) = lines(Duration::ZERO);
        drop(Activity::shown_on(output, "Reading the scene"));
        assert!(failed.lock().unwrap().iter().all(|line| line.starts_with("Reading the scene (")), "{failed:?}");
    }
}
