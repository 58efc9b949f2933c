//! A comparison that can be measured.

use std::path::PathBuf;

use crate::error::ExperimentError;
use crate::files;
use crate::page::Heading;
use crate::report::Report;
use crate::session::Session;

/// A comparison that can be measured.
#[derive(Debug)]
pub struct Experiment {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, in a line.
    pub title: &'static str,
    /// What is measured, and how the paper measured it.
    pub(crate) question: &'static str,
    /// Its settings where the user gives none.
    pub defaults: Defaults,
    /// Measures it.
    pub(crate) run: fn(&mut Session) -> Result<Report, ExperimentError>,
}

/// Default settings of an experiment; a setting that the experiment does not have is `None`.
#[derive(Clone, Copy, Debug)]
pub struct Defaults {
    /// Render times, seconds.
    pub times: Option<&'static [f64]>,
    /// Independent renders of each variant.
    pub seeds: Option<u32>,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Samples in each pixel of the references.
    pub reference_samples: Option<u32>,
    /// Whether it renders images, which a farm can do.
    pub renders: bool,
    /// The folder of the references of [`pairs`](crate::pairs), if it compares with these.
    pub references: Option<&'static str>,
}

impl Experiment {
    /// Measures it and writes the report. Returns the page and the JSON file.
    ///
    /// # Errors
    ///
    /// When a render fails, when a file cannot be written, or when the user interrupts. Once the report is written,
    /// when a claim of the experiment is not met.
    pub fn run(&self, session: &mut Session) -> Result<[PathBuf; 2], ExperimentError> {
        let report = (self.run)(session)?;
        let heading = Heading { name: self.name, title: self.title, question: self.question };
        let written = files::write(&report, &heading, session)?;
        let missed = report.claims.iter().filter(|is_met| !**is_met).count();
        if missed > 0 {
            let [page, _] = written;
            return Err(ExperimentError::Claims { missed, all: report.claims.len(), page });
        }
        Ok(written)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;
    use std::sync::{Arc, Mutex};

    use clerestory_local_render::Control;
    use clerestory_render_core::integrator::PreparedScene;
    use rayon::ThreadPoolBuilder;

    use super::*;
    use crate::error::HostError;
    use crate::host::{Farm, FarmOrder, FarmRender, FarmView, Host};
    use crate::session::{Settings, Surroundings};
    use crate::{selection, table1};

    /// Files by their names.
    type Files = Arc<Mutex<BTreeMap<PathBuf, Vec<u8>>>>;

    /// A host that keeps files in memory, perhaps with a farm whose jobs the user interrupts.
    struct MemoryHost {
        files: Files,
        has_farm: bool,
    }

    impl Host for MemoryHost {
        fn show(&mut self, _fraction: f64, _activity: &str) {}

        fn note(&self, _line: &str) {}

        fn write(&self, file: &Path, content: &[u8]) -> Result<(), HostError> {
            if file.extension().is_some_and(|extension| extension == "html") {
                return Err("no room for the page".into());
            }
            self.files.lock().unwrap().insert(file.to_owned(), content.to_vec());
            Ok(())
        }

        fn farm(&mut self) -> Option<&mut dyn Farm> {
            if self.has_farm { Some(self) } else { None }
        }
    }

    impl Farm for MemoryHost {
        fn render(&mut self, _order: &FarmOrder<'_>) -> Result<Option<FarmRender>, HostError> {
            Ok(None)
        }

        fn view(&self) -> Result<FarmView, HostError> {
            Ok(FarmView::default())
        }
    }

    fn run(experiment: &Experiment, has_farm: bool) -> (ExperimentError, Files) {
        let threads = std::num::NonZeroUsize::MIN;
        let settings = Settings { times: vec![0.01], seeds: 1, size: [4, 4], reference_samples: 16, threads };
        let files = Files::default();
        let surroundings = Surroundings {
            folder: PathBuf::from("experiment"),
            references: PathBuf::from("references"),
            pool: ThreadPoolBuilder::new().num_threads(1).build().unwrap(),
            control: Arc::new(Control::default()),
            build_scene: PreparedScene::build,
            build: "test",
            host: Box::new(MemoryHost { files: Arc::clone(&files), has_farm }),
        };
        (experiment.run(&mut Session::new(settings, surroundings)).unwrap_err(), files)
    }

    #[test]
    fn a_report_goes_to_the_host_and_a_failure_of_the_host_is_that_of_the_experiment() {
        let (error, files) = run(&table1::EXPERIMENT, false);
        assert!(matches!(&error, ExperimentError::Host(_)), "{error:?}");
        assert_eq!(error.to_string(), "no room for the page");
        let files = files.lock().unwrap();
        let json: serde_json::Value = serde_json::from_slice(&files[Path::new("experiment/table1.json")]).unwrap();
        assert_eq!((&json["experiment"], &json["machine"]["build"]), (&"table1".into(), &"test".into()));
        assert!(json.get("farm").is_none() && files.keys().any(|file| file.extension().unwrap() == "csv"));
    }

    #[test]
    fn a_job_that_the_user_interrupts_ends_the_experiment() {
        let (error, files) = run(&selection::EXPERIMENT, true);
        assert!(error.to_string().starts_with("interrupted; references that were complete are kept"), "{error}");
        assert!(files.lock().unwrap().is_empty());
    }
}
