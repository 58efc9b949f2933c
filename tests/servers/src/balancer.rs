//! A load balancer in front of several servers: connections go to each in turn, and past those that do not answer.

use std::io;
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::thread;

/// A balancer on a free port of the loopback interface. It serves until the process ends.
#[derive(Debug)]
pub struct Balancer {
    address: SocketAddr,
}

impl Balancer {
    /// Starts a balancer in front of some servers.
    ///
    /// # Errors
    ///
    /// When no port is free.
    pub fn start(servers: Vec<SocketAddr>) -> io::Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let address = listener.local_addr()?;
        thread::spawn(move || {
            for (first, client) in listener.incoming().flatten().enumerate() {
                let in_turn = (0..servers.len()).map(|k| servers[(first + k) % servers.len()]);
                // A client that finds no server is cut off, and tries again.
                if let Some(server) = in_turn.map(TcpStream::connect).find_map(Result::ok) {
                    // A connection that cannot be doubled is cut off as well.
                    let _ = join(client, server);
                }
            }
        });
        Ok(Self { address })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

/// Carries bytes both ways until either side ends.
fn join(client: TcpStream, server: TcpStream) -> io::Result<()> {
    for (mut from, mut to) in [(client.try_clone()?, server.try_clone()?), (server, client)] {
        thread::spawn(move || {
            // However it ends, both are told.
            let _ = io::copy(&mut from, &mut to);
            let _ = to.shutdown(Shutdown::Both);
            let _ = from.shutdown(Shutdown::Both);
        });
    }
    Ok(())
}
