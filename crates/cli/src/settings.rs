//! Settings of the services, in layers: defaults, then a TOML file, then the environment, then options.
//!
//! The argument parser merges the environment and the options, except for the token. This module reads the file.

use std::fs;
use std::path::Path;

use serde::de::DeserializeOwned;

use crate::failure::Failure;

/// Where a coordinator keeps its data by default.
pub(crate) const DEFAULT_DATA: &str = "clerestory-data";

/// Reads a configuration file. Without one, every setting is absent. An unknown key is an error.
pub(crate) fn read<T: DeserializeOwned + Default>(file: Option<&Path>) -> Result<T, Failure> {
    let Some(file) = file else { return Ok(T::default()) };
    let text = fs::read_to_string(file).map_err(|source| Failure::Read { file: file.to_owned(), source })?;
    toml::from_str(&text).map_err(|source| Failure::Configuration { file: file.to_owned(), source: Box::new(source) })
}

#[cfg(test)]
mod tests {
    use std::process::ExitCode;

    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Default, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    struct Settings {
        threads: Option<u32>,
    }

    #[test]
    fn a_key_that_nobody_knows_is_named_in_the_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("worker.toml");
        fs::write(&file, "threads = 3\n").unwrap();
        assert_eq!(read::<Settings>(Some(&file)).unwrap(), Settings { threads: Some(3) });
        fs::write(&file, "treads = 3\n").unwrap();
        let failure = read::<Settings>(Some(&file)).unwrap_err();
        let text: Vec<String> = failure.causes().map(ToString::to_string).collect();
        assert!(
            text[0].contains("worker.toml") && text[1].contains("treads") && text[1].contains("threads"),
            "{text:?}"
        );
        assert_eq!(failure.exit_code(), ExitCode::from(2));
    }
}
