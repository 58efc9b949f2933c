//! Real servers for tests, each as a process of its own that ends with the test's process.

mod postgres;

pub use postgres::{Postgres, postgres};
