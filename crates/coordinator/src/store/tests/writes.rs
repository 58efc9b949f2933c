//! Writes that share a transaction: their effects on each other, and their order.

use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use clerestory_api::WorkerActivity;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use uuid::Uuid;

use crate::model::FilmLease;
use crate::store::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::source::Source;
use crate::store::engine::sql::query;
use crate::store::engine::writer::Turn;
use crate::store::tests::Farm;
use crate::store::tests::farm::{TTL_MS, terms};

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

/// A write may have read what is rolled back with its transaction.
pub(super) async fn the_error_of_a_write_is_not_reported_when_its_transaction_fails(farm: Farm) {
    let write = farm.store.write::<(), StoreError, _>(|connection| {
        Box::pin(async {
            connection.batch("rollback").await?;
            Err(StoreError::Closed)
        })
    });
    let told = write.await.unwrap_err();
    assert!(!matches!(told, StoreError::Closed), "{told}");
    let order = Arc::default();
    let [later] = notes(&farm, ["later"], &order).await;
    later.await.unwrap().unwrap();
}

/// Each transaction runs one patient write, however many wait, and patient writes wait for one transaction each.
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

/// A claim that comes last waits for no more than one other write for each claim before it, and they for as many
/// claims.
pub(super) async fn claims_take_turns_with_other_writes(farm: Farm) {
    for (before, after) in [("other", "claim"), ("claim", "other")] {
        let held = Held::hold(&farm).await;
        let order = Arc::default();
        // More than one transaction holds.
        let many = notes(&farm, [before; 70], &order).await;
        let few = notes(&farm, [after; 5], &order).await;
        held.let_go().await;
        for write in many.into_iter().chain(few) {
            write.await.unwrap().unwrap();
        }
        let order = order.lock().unwrap();
        let last = order.iter().rposition(|kind| *kind == after).unwrap();
        assert!(order.len() == 75 && last < 10, "those that came last wait for all others: {order:?}");
    }
}

pub(super) async fn heartbeats_renewals_and_film_leases_are_written_before_waiting_writes(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    tokio::time::sleep(LONG).await;
    let held = Held::hold(&farm).await;
    let store = farm.store.clone();
    let look = tokio::spawn(async move {
        let write = store.write::<_, StoreError, _>(|connection| {
            Box::pin(async move {
                let row = query("select seen_ms, (select until_ms from film_leases) as until_ms from workers");
                let row = row.fetch_one(connection).await?;
                Ok((row.optional_integer("until_ms")?, row.integer("seen_ms")?))
            })
        });
        write.await
    });
    farm.until_waiting(1).await;
    let store = farm.store.clone();
    let alive = tokio::spawn(async move { store.touch_worker(worker, 7, WorkerActivity::default()).await });
    let store = farm.store.clone();
    let kept = tokio::spawn(async move { store.acquire_film_lease(job, Uuid::now_v7(), 0, 9).await });
    farm.until_waiting(3).await;
    held.let_go().await;
    alive.await.unwrap().unwrap();
    assert_eq!(kept.await.unwrap().unwrap(), FilmLease::Held);
    assert_eq!(look.await.unwrap().unwrap(), (Some(9), 7), "it has waited for longer");
}

pub(super) async fn a_lease_lasts_from_when_it_is_granted(farm: Farm) {
    farm.job(1).await;
    let worker = farm.worker().await;
    let held = Held::hold(&farm).await;
    let now_ms = Arc::new(AtomicI64::new(0));
    let (store, shown_ms) = (farm.store.clone(), Arc::clone(&now_ms));
    let claim = tokio::spawn(async move { store.claim(move || terms(worker, shown_ms.load(Ordering::SeqCst))).await });
    farm.until_waiting(1).await;
    now_ms.store(50_000, Ordering::SeqCst);
    held.let_go().await;
    assert_eq!(claim.await.unwrap().unwrap().unwrap().lease.deadline_ms, 50_000 + TTL_MS);
}

/// The lease of a claim whose caller has disconnected would not be worked off.
pub(super) async fn the_claim_of_a_disconnected_worker_takes_nothing(farm: Farm) {
    farm.job(1).await;
    let [gone, here] = [farm.worker().await, farm.worker().await];
    let held = Held::hold(&farm).await;
    let store = farm.store.clone();
    let claim = tokio::spawn(async move { store.claim(move || terms(gone, 0)).await });
    farm.until_waiting(1).await;
    claim.abort();
    assert!(claim.await.unwrap_err().is_cancelled(), "it waits for its turn");
    held.let_go().await;
    assert_eq!(farm.claim(here, 100, 0).await.unwrap().nodes.len(), 15);
}

/// The same where it has been taken from the queue, and waits for the transaction to come to it.
pub(super) async fn the_claim_of_a_worker_that_disconnects_during_another_write_takes_nothing(farm: Farm) {
    farm.job(1).await;
    let [gone, here] = [farm.worker().await, farm.worker().await];
    let held = Held::hold(&farm).await;
    // Its turn comes first, then that of a usual write, and only then that of a second claim.
    let order = Arc::default();
    let [before] = notes(&farm, ["claim"], &order).await;
    let (begun, next) = Held::ask(&farm);
    let store = farm.store.clone();
    let claim = tokio::spawn(async move { store.claim(move || terms(gone, 0)).await });
    farm.until_waiting(3).await;
    held.let_go().await;
    begun.await.unwrap();
    claim.abort();
    assert!(claim.await.unwrap_err().is_cancelled(), "it waits for its turn");
    next.let_go().await;
    before.await.unwrap().unwrap();
    assert_eq!(farm.claim(here, 100, 0).await.unwrap().nodes.len(), 15);
}

pub(super) async fn other_writes_are_carried_out_after_their_caller_has_disconnected(farm: Farm) {
    let held = Held::hold(&farm).await;
    let order = Arc::default();
    let [gone] = notes(&farm, ["other"], &order).await;
    gone.abort();
    assert!(gone.await.unwrap_err().is_cancelled(), "it waits for its turn");
    held.let_go().await;
    let [later] = notes(&farm, ["later"], &order).await;
    later.await.unwrap().unwrap();
    assert_eq!(*order.lock().unwrap(), ["other", "later"]);
}

pub(super) async fn waiting_writes_are_carried_out_before_the_store_closes(farm: Farm) {
    tokio::time::sleep(LONG).await;
    let held = Held::hold(&farm).await;
    let order = Arc::default();
    let writes = notes(&farm, ["patient", "other", "patient", "claim", "patient", "first"], &order).await;
    let store = farm.store.clone();
    let closed = tokio::spawn(async move { store.close().await });
    farm.until_waiting(7).await;
    held.let_go().await;
    for write in writes {
        write.await.unwrap().unwrap();
    }
    closed.await.unwrap();
    assert_eq!(*order.lock().unwrap(), ["first", "claim", "other", "patient", "patient", "patient"]);
    for kind in ["patient", "other", "claim", "first"] {
        let [late] = notes(&farm, [kind], &order).await;
        assert!(matches!(late.await.unwrap(), Err(StoreError::Closed)), "{kind}");
    }
}

/// Longer than such writes wait behind others.
const LONG: Duration = Duration::from_millis(150);

impl Farm {
    /// Waits until as many writes wait for the next transaction.
    async fn until_waiting(&self, writes: usize) {
        until(|| self.store.writer.waiting() == writes).await;
    }
}

async fn until(condition: impl Fn() -> bool) {
    let met = async {
        while !condition() {
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(Duration::from_secs(60), met).await.expect("the condition is met");
}

/// A write that runs until it is released.
struct Held {
    go_on: oneshot::Sender<()>,
    write: JoinHandle<Result<(), StoreError>>,
}

impl Held {
    async fn hold(farm: &Farm) -> Self {
        let (begun, held) = Self::ask(farm);
        begun.await.unwrap();
        held
    }

    /// One that may have to wait for its turn, and what tells when that has come.
    fn ask(farm: &Farm) -> (oneshot::Receiver<()>, Self) {
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
        (begun, Self { go_on, write })
    }

    async fn let_go(self) {
        self.go_on.send(()).unwrap();
        self.write.await.unwrap().unwrap();
    }
}

/// Asks for writes that note of which kind they are when they are carried out. They wait for their turn or have ended
/// when this returns.
async fn notes<const N: usize>(
    farm: &Farm,
    kinds: [&'static str; N],
    order: &Arc<Mutex<Vec<&'static str>>>,
) -> [JoinHandle<Result<(), StoreError>>; N] {
    let before = farm.store.writer.waiting();
    let writes = kinds.map(|kind| {
        let (store, order) = (farm.store.clone(), Arc::clone(order));
        let noted = move || {
            order.lock().unwrap().push(kind);
            Ok(())
        };
        let turn = match kind {
            "patient" => Turn::Patient,
            "first" => Turn::First,
            "claim" => Turn::Claim,
            _ => Turn::Usual,
        };
        tokio::spawn(async move {
            let write = store.write_in(turn, move |_| Box::pin(async move { noted() }));
            write.await
        })
    });
    let arrived = || {
        let open = writes.iter().filter(|write| !write.is_finished()).count();
        open <= farm.store.writer.waiting().saturating_sub(before)
    };
    until(arrived).await;
    writes
}

#[tokio::test]
async fn a_database_that_is_closed_is_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(Source::file(&folder.path().join("farm.sqlite"))).await.unwrap();
    store.try_to_write().await.unwrap();
    store.open_jobs().await.unwrap();
    store.close().await;
    let names = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
    assert_eq!(names.collect::<Vec<_>>(), ["farm.sqlite"]);
}
