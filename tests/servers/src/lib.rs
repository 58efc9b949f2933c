//! Real servers for tests, each as a process of its own that ends with the test's process, and the faults that befall
//! them.

use std::io;
use std::net::TcpListener;

mod balancer;
mod faults;
mod garage;
mod postgres;
mod s3;
mod watched;

pub use balancer::Balancer;
pub use faults::Faults;
pub use postgres::{Postgres, postgres};
pub use s3::{S3Server, s3};

/// A port of the loopback interface without a listener.
fn free_port() -> io::Result<u16> {
    Ok(TcpListener::bind("127.0.0.1:0")?.local_addr()?.port())
}
