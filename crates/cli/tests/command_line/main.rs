//! The binary as scripts see it: exit codes, standard output, error messages, files.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

mod convert;
#[cfg(target_os = "linux")]
mod demo;
mod experiments;
mod export;
mod failures;
mod imports;
mod jobs;
mod render;
mod scene;
mod services;
mod sun;
mod support;
