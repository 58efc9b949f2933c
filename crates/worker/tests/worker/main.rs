//! A worker against a coordinator that misbehaves in every way that a real one does.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

mod fake_coordinator;
mod leases;
mod running_worker;
mod scenes;
mod uploads;
