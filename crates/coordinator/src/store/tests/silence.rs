//! A database that is gone without a word: the network swallows what is said to it, and nothing says so.

use std::io;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use clerestory_test_servers::postgres;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};

use crate::store::engine::sql::query;
use crate::store::engine::timeouts::Timeouts;
use crate::store::tests::{Source, Store, StoreError};

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

    /// Open connections fall silent.
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

/// For longer than any test.
const LONG: Duration = Duration::from_secs(3600);

/// Long enough for every answer, and short enough for a test. The server is not asked what it works on.
const SHORT_TIMEOUTS: Timeouts = Timeouts {
    connection: Duration::from_secs(2),
    idle: Duration::from_millis(200),
    turn: Duration::from_secs(2),
    transaction: Duration::from_secs(2),
    doubt: LONG,
    read: Duration::from_secs(2),
    silence: Duration::from_millis(200),
};

/// The server is waited for while it works.
const DOUBT: Timeouts = Timeouts { turn: LONG, transaction: LONG, doubt: Duration::from_millis(200), ..SHORT_TIMEOUTS };

#[tokio::test]
async fn a_database_that_falls_silent_is_given_up_and_called_again() {
    falls_silent(SHORT_TIMEOUTS).await;
}

#[tokio::test]
async fn what_is_lost_of_a_transaction_is_not_waited_for() {
    tokio::time::timeout(Duration::from_secs(60), falls_silent(DOUBT)).await.expect("it is not waited for");
}

#[tokio::test]
async fn a_server_that_takes_long_is_waited_for() {
    let source = Source::postgres(&postgres().new_database().parse().unwrap()).unwrap().with_timeouts(DOUBT);
    let [store, other] = [Store::open(source.clone()).await.unwrap(), Store::open(source).await.unwrap()];
    // It takes its time, as does this process, and the other waits for its turn meanwhile.
    let (begun, has_begun) = tokio::sync::oneshot::channel();
    let slow = store.write::<_, StoreError, _>(|connection| {
        Box::pin(async move {
            begun.send(()).unwrap();
            query("select pg_sleep(1)").execute(&mut *connection).await?;
            tokio::time::sleep(Duration::from_secs(1)).await;
            query("select 1").execute(connection).await
        })
    });
    let waits = async {
        has_begun.await.unwrap();
        let write = other.write::<_, StoreError, _>(|connection| {
            Box::pin(async move { query("select 1").execute(connection).await })
        });
        write.await
    };
    let (slow, waits) = tokio::join!(slow, waits);
    assert!(slow.is_ok() && waits.is_ok(), "{slow:?}, {waits:?}");
    store.close().await;
    other.close().await;
}

async fn falls_silent(timeouts: Timeouts) {
    let address: url::Url = postgres().new_database().parse().unwrap();
    let network = Arc::new(Network::before(address.socket_addrs(|| None).unwrap()[0]).await);
    let mut through = address.clone();
    through.set_port(Some(network.address.port())).unwrap();
    let source = Source::postgres(&through.as_str().parse().unwrap()).unwrap().with_timeouts(timeouts);
    let store = Store::open(source).await.unwrap();
    let farm = store.identity().await.unwrap().farm;
    store.open_jobs().await.unwrap();
    let mut listener = store.listener().await.unwrap().unwrap();

    network.fall_silent();
    let read = async { while store.open_jobs().await.is_err() {} };
    tokio::time::timeout(Duration::from_secs(60), read)
        .await
        .expect("a read finds another connection than an idle one");
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

    assert_eq!(store.open_jobs().await.unwrap(), []);
    // The pool asks on the connection that was given back, and hears nothing.
    network.fall_silent();
    tokio::task::yield_now().await;
    tokio::time::timeout(Duration::from_secs(60), store.close()).await.expect("no silent connection is waited for");
}
