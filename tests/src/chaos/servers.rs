//! The servers behind several coordinators, and the network between them.

use std::net::SocketAddr;

use clerestory_test_servers::{Postgres, S3Server};

use crate::proxy::{Protocol, Proxy};

/// PostgreSQL and an object server, each behind a proxy.
pub(super) struct Servers {
    pub(super) database: Postgres,
    pub(super) objects: S3Server,
    /// The proxies in front of the database and of the object server.
    pub(super) network: [Proxy; 2],
}

impl Servers {
    /// Starts them.
    ///
    /// # Panics
    ///
    /// When they do not start.
    pub(super) fn start(seed: u64) -> Self {
        let database = Postgres::start_with_faults().expect("PostgreSQL starts");
        let objects = S3Server::start_with_faults().expect("the S3 server starts");
        let network = [database.port(), objects.port()].map(|port| {
            let server = SocketAddr::from(([127, 0, 0, 1], port));
            Proxy::start(Protocol::Other, vec![server], seed, 1.0).expect("a free port")
        });
        Self { database, objects, network }
    }

    /// The environment of coordinators.
    pub(super) fn environment(&self) -> Vec<(String, String)> {
        self.objects.environment_through(self.network[1].address().port()).into()
    }

    /// The options of a coordinator with a new farm, which reaches them over the network.
    pub(super) fn options(&self) -> [String; 4] {
        let address = self.database.new_database();
        let there = |port: u16| format!(":{port}/");
        let through = address.replacen(&there(self.database.port()), &there(self.network[0].address().port()), 1);
        let bucket = format!("s3://{}/farm", self.objects.new_bucket());
        ["--database".to_owned(), through, "--object-store".to_owned(), bucket]
    }
}
