//! A network that loses connections: a small proxy in front of servers, which delays, cuts and drops what it carries,
//! and sends requests twice.
//!
//! What happens is drawn from a seed and the number of the connection. A proxy for HTTP knows where a request ends, so
//! that each request on a connection has a fate of its own. Data of other protocols is passed on as it comes, and each
//! piece has a fate.

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::{Builder, Runtime};

use crate::random::Random;
use crate::requests::read_request;

/// What the servers speak.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// HTTP/1.1, one request after the other.
    Http,
    /// Anything.
    Other,
}

/// What happens to a request, or to a piece of what another protocol says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fate {
    /// It arrives later.
    Delayed,
    /// The connection ends before anything of it arrives.
    Dropped,
    /// The connection ends in the middle of it.
    Cut,
    /// It arrives, and the connection ends before the answer has come back.
    Unanswered,
    /// It arrives, and once more on another connection, whose answer is discarded.
    Duplicated,
    /// Neither it nor anything after it arrives on its connection, and neither side notices.
    Swallowed,
}

/// The fates of requests, each with its probability.
const OF_REQUESTS: [(Fate, f64); 5] = [
    (Fate::Delayed, 0.04),
    (Fate::Dropped, 0.02),
    (Fate::Cut, 0.02),
    (Fate::Unanswered, 0.03),
    (Fate::Duplicated, 0.04),
];

/// The fates of pieces of other protocols, each with its probability.
const OF_PIECES: [(Fate, f64); 3] = [(Fate::Delayed, 0.01), (Fate::Cut, 0.001), (Fate::Swallowed, 0.0001)];

/// Longest delay, seconds.
const LONGEST_DELAY: f64 = 0.5;

/// Most bytes of an answer that still come back before its connection ends.
const REMNANT: f64 = 400.0;

/// Longest wait for the answer to a duplicate.
const TIMEOUT: Duration = Duration::from_secs(5);

/// A proxy on a free port of the loopback interface. It ends with the value.
#[derive(Debug)]
pub struct Proxy {
    address: SocketAddr,
    network: Arc<Network>,
    /// What carries the bytes; taken when the proxy ends.
    runtime: Option<Runtime>,
}

#[derive(Debug)]
struct Network {
    protocol: Protocol,
    servers: Vec<SocketAddr>,
    seed: u64,
    roughness: f64,
    is_calm: AtomicBool,
    fates: Mutex<BTreeMap<Fate, u32>>,
}

impl Proxy {
    /// Starts a proxy in front of some servers: connections go to each in turn, and past those that do not answer. All
    /// fates are `roughness` times as probable as usual.
    ///
    /// # Errors
    ///
    /// When no port is free, or no thread can be had.
    pub fn start(protocol: Protocol, servers: Vec<SocketAddr>, seed: u64, roughness: f64) -> io::Result<Self> {
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        let listener = runtime.block_on(TcpListener::bind("127.0.0.1:0"))?;
        let address = listener.local_addr()?;
        let is_calm = AtomicBool::new(false);
        let network = Arc::new(Network { protocol, servers, seed, roughness, is_calm, fates: Mutex::default() });
        runtime.spawn(serve(listener, Arc::clone(&network)));
        Ok(Self { address, network, runtime: Some(runtime) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Whether everything arrives, once and at once.
    pub fn calm(&self, is_calm: bool) {
        self.network.is_calm.store(is_calm, Ordering::Relaxed);
    }

    /// What has happened so far, and how often.
    pub fn fates(&self) -> BTreeMap<Fate, u32> {
        self.network.fates.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

impl Network {
    /// Draws a fate.
    fn fate(&self, random: &mut Random) -> Option<Fate> {
        let fates: &[(Fate, f64)] = if self.protocol == Protocol::Http { &OF_REQUESTS } else { &OF_PIECES };
        let mut drawn = random.uniform();
        let mut fates = fates.iter();
        let fate = fates.find(|(_, probability)| {
            drawn -= probability * self.roughness;
            drawn < 0.0
        });
        let (fate, _) = fate.filter(|_| !self.is_calm.load(Ordering::Relaxed))?;
        *self.fates.lock().unwrap_or_else(PoisonError::into_inner).entry(*fate).or_default() += 1;
        Some(*fate)
    }

    /// A connection to the servers in turn; an error when none answers.
    async fn connect(&self, number: u64) -> io::Result<TcpStream> {
        let mut last = io::Error::other("there are no servers");
        for k in 0..self.servers.len() {
            let server = (number as usize).wrapping_add(k) % self.servers.len();
            match TcpStream::connect(self.servers[server]).await {
                Ok(stream) => return Ok(stream),
                Err(error) => last = error,
            }
        }
        Err(last)
    }
}

impl fmt::Display for Fate {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Delayed => "delayed",
            Self::Dropped => "dropped",
            Self::Cut => "cut",
            Self::Unanswered => "cut off from their answers",
            Self::Duplicated => "duplicated",
            Self::Swallowed => "swallowed",
        })
    }
}

async fn serve(listener: TcpListener, network: Arc<Network>) {
    for number in 0.. {
        let Ok((client, _)) = listener.accept().await else { continue };
        let network = Arc::clone(&network);
        tokio::spawn(async move {
            // However a connection ends, both sides see it end.
            let _ = carry(client, &network, number).await;
        });
    }
}

/// Carries what is said on a connection until either side or fate ends it.
async fn carry(client: TcpStream, network: &Arc<Network>, number: u64) -> io::Result<()> {
    let server = network.connect(number).await?;
    client.set_nodelay(true)?;
    server.set_nodelay(true)?;
    let (from_client, to_client) = client.into_split();
    let (from_server, to_server) = server.into_split();
    let [there, back] = [0, 1].map(|way| Random::new(network.seed, 2 * number + way));
    match network.protocol {
        Protocol::Http => {
            let remnant = AtomicUsize::new(usize::MAX);
            tokio::select! {
                ended = requests(from_client, to_server, network, number, there, &remnant) => ended,
                ended = answers(from_server, to_client, &remnant) => ended,
            }
        }
        Protocol::Other => {
            let is_silent = AtomicBool::new(false);
            tokio::select! {
                ended = pieces(from_client, to_server, network, there, &is_silent) => ended,
                ended = pieces(from_server, to_client, network, back, &is_silent) => ended,
            }
        }
    }
}

/// Carries requests. `remnant` is how many bytes may still come back.
async fn requests(
    mut client: OwnedReadHalf,
    mut server: OwnedWriteHalf,
    network: &Arc<Network>,
    number: u64,
    mut random: Random,
    remnant: &AtomicUsize,
) -> io::Result<()> {
    let mut waiting = Vec::new();
    while let Some(request) = read_request(&mut client, &mut waiting).await? {
        let fate = network.fate(&mut random);
        let part = random.uniform();
        match fate {
            None => server.write_all(&request).await?,
            Some(Fate::Delayed) => {
                delay(part).await;
                server.write_all(&request).await?;
            }
            Some(Fate::Dropped) => return Ok(()),
            Some(Fate::Cut) => return server.write_all(&request[..(part * request.len() as f64) as usize]).await,
            Some(Fate::Unanswered) => {
                remnant.store((part * REMNANT) as usize, Ordering::SeqCst);
                server.write_all(&request).await?;
            }
            Some(Fate::Swallowed) => std::future::pending().await,
            Some(Fate::Duplicated) => {
                server.write_all(&request).await?;
                tokio::spawn(repeat(request, Arc::clone(network), number + 1, part));
            }
        }
    }
    Ok(())
}

/// Carries answers, as far as they may come back.
async fn answers(mut server: OwnedReadHalf, mut client: OwnedWriteHalf, remnant: &AtomicUsize) -> io::Result<()> {
    let mut buffer = vec![0; 1 << 16];
    loop {
        let length = server.read(&mut buffer).await?;
        let left = remnant.load(Ordering::SeqCst);
        client.write_all(&buffer[..length.min(left)]).await?;
        if length == 0 || length > left {
            return Ok(());
        }
        if left != usize::MAX {
            remnant.store(left - length, Ordering::SeqCst);
        }
    }
}

/// Sends a request once more, some time later, and listens to its answer for a while.
async fn repeat(request: Vec<u8>, network: Arc<Network>, number: u64, part: f64) {
    delay(part).await;
    let Ok(mut server) = network.connect(number).await else { return };
    if server.write_all(&request).await.is_ok() {
        // Nobody wants to know what it says.
        let _ = tokio::time::timeout(TIMEOUT, tokio::io::copy(&mut server, &mut tokio::io::sink())).await;
    }
}

/// Carries pieces of what is said one way.
async fn pieces(
    mut from: OwnedReadHalf,
    mut to: OwnedWriteHalf,
    network: &Network,
    mut random: Random,
    is_silent: &AtomicBool,
) -> io::Result<()> {
    let mut buffer = vec![0; 1 << 16];
    loop {
        let length = from.read(&mut buffer).await?;
        if is_silent.load(Ordering::Relaxed) {
            std::future::pending::<()>().await;
        }
        if length == 0 {
            return Ok(());
        }
        let fate = network.fate(&mut random);
        let part = random.uniform();
        match fate {
            Some(Fate::Cut) => return to.write_all(&buffer[..(part * length as f64) as usize]).await,
            Some(Fate::Delayed) => delay(part).await,
            Some(Fate::Swallowed) => {
                is_silent.store(true, Ordering::Relaxed);
                std::future::pending::<()>().await;
            }
            _ => {}
        }
        to.write_all(&buffer[..length]).await?;
    }
}

async fn delay(part: f64) {
    tokio::time::sleep(Duration::from_secs_f64(part * LONGEST_DELAY)).await;
}
