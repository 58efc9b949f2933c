//! A database that is gone without a word: the network swallows what is said to it, and nothing says so.

use std::io;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use clerestory_test_servers::postgres;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};

use super::{Source, Store, StoreError};
use crate::store::patience::Patience;
use crate::store::sql::query;

/// A network on which all connections of the moment can fall silent for good.
struct Network {
    address: SocketAddr,
    /// Of the connections that are made now.
    is_silent: Arc<Mutex<Arc<AtomicBool>>>,
}

impl Network {
    /// A network between here and a server.
    async fn before(server: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let is_silent = Arc::new(Mutex::new(Arc::new(AtomicBool::new(false))));
        let current = Arc::clone(&is_silent);
        tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let is_silent = Arc::clone(&current.lock().unwrap());
                let server = TcpStream::connect(server).await.unwrap();
                let ((from_client, to_client), (from_server, to_server)) = (client.into_split(), server.into_split());
                tokio::spawn(carry(from_client, to_server, Arc::clone(&is_silent)));
                tokio::spawn(carry(from_server, to_client, is_silent));
            }
        });
        Self { address, is_silent }
    }

    /// Nothing is heard any more on the connections that there are.
    fn fall_silent(&self) {
        let mut current = self.is_silent.lock().unwrap();
        current.store(true, Ordering::SeqCst);
        *current = Arc::new(AtomicBool::new(false));
    }
}

/// Carries bytes one way, or swallows them.
async fn carry(
    mut from: impl AsyncReadExt + Unpin,
    mut to: impl AsyncWriteExt + Unpin,
    is_silent: Arc<AtomicBool>,
) -> io::Result<()> {
    let mut buffer = [0; 4096];
    loop {
        let length = from.read(&mut buffer).await?;
        if is_silent.load(Ordering::SeqCst) {
            // Neither side learns that the other has gone.
            std::future::pending::<()>().await;
        }
        if length == 0 {
            return to.shutdown().await;
        }
        to.write_all(&buffer[..length]).await?;
    }
}

/// Long enough for whoever answers, and short enough for a test.
const PATIENCE: Patience = Patience {
    connection: Duration::from_secs(2),
    turn: Duration::from_secs(2),
    transaction: Duration::from_secs(2),
    read: Duration::from_secs(2),
    silence: Duration::from_millis(200),
};

#[tokio::test]
async fn a_database_that_falls_silent_is_given_up_and_called_again() {
    let address: url::Url = postgres().new_database().parse().unwrap();
    let network = Arc::new(Network::before(address.socket_addrs(|| None).unwrap()[0]).await);
    let mut through = address.clone();
    through.set_port(Some(network.address.port())).unwrap();
    let source = Source::postgres(&through.as_str().parse().unwrap()).unwrap().with_patience(PATIENCE);
    let store = Store::open(source).await.unwrap();
    let farm = store.identity().await.unwrap().farm;
    store.open_jobs().await.unwrap();
    let mut listener = store.listener().await.unwrap().unwrap();

    network.fall_silent();
    assert!(store.open_jobs().await.is_err(), "a read must not wait for ever");
    assert!(listener.next().await.is_err(), "a listener must notice that nobody can be heard");
    assert_eq!(store.identity().await.unwrap().farm, farm, "a write that has not begun finds another connection");

    let there = Arc::clone(&network);
    let written = store.write::<_, StoreError, _>(move |connection| {
        there.fall_silent();
        Box::pin(async move { query("select 1").execute(connection).await })
    });
    assert!(written.await.is_err(), "a transaction must not wait for ever");

    assert_eq!(store.identity().await.unwrap().farm, farm);
    assert_eq!(store.open_jobs().await.unwrap(), []);
    let mut listener = store.listener().await.unwrap().unwrap();
    store.notify("glass".to_owned()).await.unwrap();
    assert_eq!(listener.next().await.unwrap(), "glass");
    store.close().await;
}
