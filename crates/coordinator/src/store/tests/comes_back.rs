//! A PostgreSQL database that was away, or took no writes, and comes back: sessions that are left from before are not
//! used again.

use std::collections::BTreeSet;
use std::time::Duration;

use clerestory_test_servers::postgres;

use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::source::Source;
use crate::store::engine::sql::query;
use crate::store::engine::timeouts::Timeouts;
use crate::store::tests::Farm;

/// Runs statements on the connection that writes, in a transaction, or fails with them.
async fn write(farm: &Farm, statements: &'static str) -> Result<(), StoreError> {
    let write = farm.store.write::<(), StoreError, _>(move |connection| {
        Box::pin(async move { query(statements).execute(connection).await.map(drop) })
    });
    write.await
}

/// A statement that only a session can run that takes writes.
const WRITES: &str = "insert into sequences (name, value) values ('test', 1) on conflict (name) do update set value \
                      = sequences.value + 1";

/// Ends all sessions of the farm's database but this one, as a server does that another replaces.
const END_OTHERS: &str = "select pg_terminate_backend(pid) from pg_stat_activity where datname = current_database() \
                          and pid <> pg_backend_pid()";

/// Name of a farm's database.
async fn name(farm: &Farm) -> String {
    let name = query("select cast(current_database() as text) as name");
    name.fetch_one(&farm.store.readers).await.unwrap().text("name").unwrap()
}

async fn administer(administrator: &Farm, statement: String) {
    // Some statements wait for the disk.
    let timeouts = Timeouts { read: Duration::from_secs(120), ..Timeouts::default() };
    let readers = administrator.source.clone().with_timeouts(timeouts).readers().unwrap();
    query(statement).execute(&readers).await.unwrap();
    readers.close().await;
}

#[tokio::test]
async fn sessions_that_are_read_only_are_not_used_when_the_database_takes_writes_again() {
    let (farm, administrator) = (Farm::in_postgres().await, Farm::in_postgres().await);
    let name = name(&farm).await;
    write(&farm, WRITES).await.unwrap();
    administer(&administrator, format!("alter database {name} set default_transaction_read_only = on")).await;
    query(END_OTHERS).execute(&farm.store.readers).await.unwrap();
    for _ in 0..2 {
        let refused = write(&farm, WRITES).await.unwrap_err();
        assert!(matches!(refused, StoreError::ReadOnly(_)), "{refused}");
        assert!(farm.store.try_to_write().await.is_err(), "it knows that nothing can be written");
    }
    assert!(farm.store.open_jobs().await.is_ok(), "what can be read is read");
    administer(&administrator, format!("alter database {name} reset default_transaction_read_only")).await;
    write(&farm, WRITES).await.unwrap();
    farm.store.try_to_write().await.unwrap();
}

#[tokio::test]
async fn a_session_that_has_become_read_only_takes_all_others_with_it() {
    let farm = Farm::in_postgres().await;
    let processes = async || {
        let mut processes = BTreeSet::new();
        for _ in 0..8 {
            let process = query("select pg_backend_pid() as process").fetch_one(&farm.store.readers).await.unwrap();
            processes.insert(process.integer("process").unwrap());
        }
        processes
    };
    let before = processes().await;
    let mut listener = farm.store.listener().await.unwrap().unwrap();
    write(&farm, "set session characteristics as transaction read only").await.unwrap();
    let refused = write(&farm, WRITES).await.unwrap_err();
    assert!(matches!(refused, StoreError::ReadOnly(_)), "{refused}");
    write(&farm, WRITES).await.unwrap();
    assert!(before.is_disjoint(&processes().await), "one may be of a server that another has replaced");
    assert!(listener.next().await.is_err(), "and so may this one");
    let mut listener = farm.store.listener().await.unwrap().unwrap();
    farm.store.notify("glass".to_owned()).await.unwrap();
    assert_eq!(listener.next().await.unwrap(), "glass");
}

#[tokio::test]
async fn a_session_that_has_lost_its_prepared_statements_fails_once() {
    let farm = Farm::in_postgres().await;
    write(&farm, WRITES).await.unwrap();
    // As a pooler does that puts another server behind a session.
    write(&farm, "deallocate all").await.unwrap();
    write(&farm, WRITES).await.unwrap_err();
    write(&farm, WRITES).await.unwrap();
}

#[tokio::test]
async fn an_error_of_a_statement_leaves_its_session_in_use() {
    let farm = Farm::in_postgres().await;
    let process = async || {
        let write = farm.store.write::<i64, StoreError, _>(|connection| {
            let process = query("select pg_backend_pid() as process");
            Box::pin(async move { process.fetch_one(connection).await?.integer("process") })
        });
        write.await.unwrap()
    };
    let before = process().await;
    write(&farm, "insert into farm (single, id) values (2, 'two'), (2, 'two')").await.unwrap_err();
    write(&farm, "select 1 / 0").await.unwrap_err();
    assert_eq!(process().await, before);
}

#[tokio::test]
async fn a_database_that_is_gone_is_used_again_when_it_has_been_restored() {
    let (farm, administrator) = (Farm::in_postgres().await, Farm::in_postgres().await);
    let (identity, name) = (farm.store.identity().await.unwrap(), name(&farm).await);
    administer(
        &administrator,
        format!("select pg_terminate_backend(pid) from pg_stat_activity where datname = '{name}'"),
    )
    .await;
    administer(&administrator, format!("alter database {name} rename to {name}_backup")).await;
    write(&farm, WRITES).await.unwrap_err();
    administer(&administrator, format!("alter database {name}_backup rename to {name}")).await;
    assert_eq!(farm.store.identity().await.unwrap(), identity);
    assert_eq!(farm.store.open_jobs().await.unwrap(), []);
}

#[tokio::test]
async fn a_listener_whose_connection_is_ended_says_so() {
    let farm = Farm::in_postgres().await;
    let mut listener = farm.store.listener().await.unwrap().unwrap();
    let ended = tokio::time::timeout(Duration::from_secs(60), async {
        query(END_OTHERS).execute(&farm.store.readers).await.unwrap();
        listener.next().await
    });
    assert!(ended.await.unwrap().is_err());
    assert!(farm.store.listener().await.unwrap().is_some());
}

#[tokio::test]
async fn a_database_that_takes_no_writes_at_the_start_is_refused_with_the_reason() {
    let (farm, administrator) = (Farm::in_postgres().await, Farm::in_postgres().await);
    let name = name(&farm).await;
    administer(&administrator, format!("alter database {name} set default_transaction_read_only = on")).await;
    let source =
        Source::postgres(&format!("postgres://postgres@127.0.0.1:{}/{name}", postgres().port()).parse().unwrap());
    let error = Store::open(source.unwrap()).await.unwrap_err();
    let reason = std::error::Error::source(&error).unwrap().to_string();
    assert!(reason.contains("default_transaction_read_only"), "{reason}");
}
