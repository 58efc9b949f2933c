//! Writes that come together: what one does to the others, and in which order they are carried out.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::task::JoinHandle;

use super::Farm;
use super::farm::terms;
use crate::store::StoreError;
use crate::store::sql::query;
use crate::store::writer::Turn;

pub(super) async fn a_failed_write_takes_nothing_else_with_it(farm: Farm) {
    let write = async |name: &'static str, then_fail: bool| {
        let write = farm.store.write::<(), StoreError, _>(move |connection| {
            Box::pin(async move {
                query("insert into sequences (name, value) values ($1, 1)").bind(name).execute(connection).await?;
                if then_fail { Err(StoreError::Closed) } else { Ok(()) }
            })
        });
        write.await
    };
    let (first, second, again) = tokio::join!(write("a", false), write("b", true), write("a", false));
    let third = write("c", false).await;
    assert!(first.is_ok() && second.is_err() && again.is_err() && third.is_ok());
    let rows = query("select name from sequences where length(name) = 1 order by name");
    let rows = rows.fetch_all(&farm.store.readers).await.unwrap();
    let names: Vec<String> = rows.iter().map(|row| row.text("name").unwrap()).collect();
    assert_eq!(names, ["a", "c"]);
}

/// However many patient writes wait, others wait for one of them in each transaction, and they for one transaction each.
pub(super) async fn a_transaction_ends_with_one_patient_write(farm: Farm) {
    let held = Held::hold(&farm).await;
    let order = Arc::default();
    let patient = notes(&farm, ["patient"; 5], &order).await;
    // More than one transaction holds.
    let others = notes(&farm, ["other"; 70], &order).await;
    held.let_go().await;
    for write in patient.into_iter().chain(others) {
        write.await.unwrap().unwrap();
    }
    let order = order.lock().unwrap();
    let last = order.iter().rposition(|kind| *kind == "other").unwrap();
    let mixed = &order[..last];
    assert_eq!((order[0], order.len()), ("other", 75));
    assert!(mixed.contains(&"patient"), "they wait for all others: {order:?}");
    assert!(!mixed.windows(2).any(|pair| pair == ["patient"; 2]), "others wait for several: {order:?}");
}

pub(super) async fn what_keeps_leases_alive_is_written_first_and_holds_nothing_else_up(farm: Farm) {
    let held = Held::hold(&farm).await;
    let order = Arc::default();
    let others = notes(&farm, ["other"; 3], &order).await;
    // Together they take longer than a transaction lets others begin.
    let first = notes(&farm, ["slow first"; 2], &order).await;
    held.let_go().await;
    for write in first.into_iter().chain(others) {
        write.await.unwrap().unwrap();
    }
    assert_eq!(*order.lock().unwrap(), ["slow first", "slow first", "other", "other", "other"]);
}

/// What is written of a claim whose caller has hung up would be a lease that nobody works off.
pub(super) async fn a_claim_of_a_worker_that_has_gone_away_takes_nothing(farm: Farm) {
    farm.job(1).await;
    let [gone, here] = [farm.worker().await, farm.worker().await];
    let held = Held::hold(&farm).await;
    let store = farm.store.clone();
    let claim = tokio::spawn(async move { store.claim(terms(gone, 0)).await });
    tokio::time::sleep(SETTLED).await;
    claim.abort();
    assert!(claim.await.unwrap_err().is_cancelled(), "it waits for its turn");
    held.let_go().await;
    assert_eq!(farm.claim(here, 100, 0).await.unwrap().nodes.len(), 15);
}

pub(super) async fn what_waits_is_written_before_the_store_is_closed(farm: Farm) {
    let held = Held::hold(&farm).await;
    let order = Arc::default();
    let writes = notes(&farm, ["patient", "other", "patient", "patient", "first"], &order).await;
    let store = farm.store.clone();
    let closed = tokio::spawn(async move { store.close().await });
    tokio::time::sleep(SETTLED).await;
    held.let_go().await;
    for write in writes {
        write.await.unwrap().unwrap();
    }
    closed.await.unwrap();
    assert_eq!(*order.lock().unwrap(), ["first", "other", "patient", "patient", "patient"]);
    for kind in ["patient", "other", "first"] {
        let [late] = notes(&farm, [kind], &order).await;
        assert!(matches!(late.await.unwrap(), Err(StoreError::Closed)), "{kind}");
    }
}

/// After this time, a write that was asked for waits for its turn.
const SETTLED: Duration = Duration::from_millis(100);

/// Longer than a transaction takes more writes.
const LONG: Duration = Duration::from_millis(20);

/// A write that goes on until it is let go.
struct Held {
    go_on: oneshot::Sender<()>,
    write: JoinHandle<Result<(), StoreError>>,
}

impl Held {
    async fn hold(farm: &Farm) -> Self {
        let (go_on, gone_on) = oneshot::channel();
        let (begins, begun) = oneshot::channel();
        let store = farm.store.clone();
        let write = tokio::spawn(async move {
            let write = store.write(move |_| {
                Box::pin(async move {
                    begins.send(()).unwrap();
                    gone_on.await.map_err(|_| StoreError::Closed)
                })
            });
            write.await
        });
        begun.await.unwrap();
        Self { go_on, write }
    }

    async fn let_go(self) {
        self.go_on.send(()).unwrap();
        self.write.await.unwrap().unwrap();
    }
}

/// Asks for writes that note of which kind they are when they are carried out.
async fn notes<const N: usize>(
    farm: &Farm,
    kinds: [&'static str; N],
    order: &Arc<Mutex<Vec<&'static str>>>,
) -> [JoinHandle<Result<(), StoreError>>; N] {
    let writes = kinds.map(|kind| {
        let (store, order) = (farm.store.clone(), Arc::clone(order));
        let noted = move || {
            order.lock().unwrap().push(kind);
            Ok(())
        };
        let turn = match kind {
            "patient" => Turn::Patient,
            "first" | "slow first" => Turn::First,
            _ => Turn::Usual,
        };
        tokio::spawn(async move {
            let write = store.write_in(turn, move |_| {
                Box::pin(async move {
                    if kind == "slow first" {
                        tokio::time::sleep(LONG).await;
                    }
                    noted()
                })
            });
            write.await
        })
    });
    tokio::time::sleep(SETTLED).await;
    writes
}
