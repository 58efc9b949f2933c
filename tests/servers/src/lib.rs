//! Real servers for tests, each as a process of its own that ends with the test's process, and the faults that befall them.

mod balancer;
mod faults;
mod postgres;
mod s3;

pub use balancer::Balancer;
pub use faults::Faults;
pub use postgres::{Postgres, postgres};
pub use s3::{S3Server, s3};
