//! A whole coordinator, over HTTP.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

mod adaptive;
mod backups;
mod bad_requests;
mod farm;
mod frames;
mod integrators;
mod live;
mod lost;
mod memory;
mod pieces;
mod scene_reports;
mod support;
mod targets;
mod trouble;
