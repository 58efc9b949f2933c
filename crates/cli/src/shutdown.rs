//! When to stop: at an interrupt or termination signal, or, for children of a farm, at the end of standard input.

use std::io::{Read, stdin};
use std::process;

use tokio_util::sync::CancellationToken;

use crate::failure::INTERRUPTED;
use crate::output_file::remove_unfinished;

/// What besides signals stops a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Parent {
    /// Nothing.
    None,
    /// The end of standard input. The parent holds the other end, so the process ends with its parent.
    HoldsStdin,
}

/// Returns a token that is cancelled when the process should stop. A second signal ends the process at once.
pub(crate) fn token(parent: Parent) -> CancellationToken {
    let stop = CancellationToken::new();
    let first = stop.clone();
    tokio::spawn(async move {
        signal().await;
        first.cancel();
        signal().await;
        remove_unfinished();
        process::exit(INTERRUPTED.into());
    });
    if parent == Parent::HoldsStdin {
        let first = stop.clone();
        std::thread::spawn(move || {
            let mut buffer = [0; 64];
            while matches!(stdin().read(&mut buffer), Ok(bytes) if bytes > 0) {}
            first.cancel();
        });
    }
    stop
}

/// Completes when SIGINT or SIGTERM arrives. If the system refuses to listen, it never completes.
#[cfg(unix)]
async fn signal() {
    use tokio::signal::unix::{SignalKind, signal};

    let (Ok(mut interrupt), Ok(mut terminate)) = (signal(SignalKind::interrupt()), signal(SignalKind::terminate()))
    else {
        return std::future::pending().await;
    };
    tokio::select! {
        _ = interrupt.recv() => {}
        _ = terminate.recv() => {}
    }
}

/// Completes when the user interrupts. If the system refuses to listen, it never completes.
#[cfg(not(unix))]
async fn signal() {
    if tokio::signal::ctrl_c().await.is_err() {
        std::future::pending().await
    }
}
