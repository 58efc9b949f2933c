//! Databases that cannot be the state of a farm.

use clerestory_test_servers::postgres;

use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::schema::SchemaError;
use crate::store::engine::source::Source;
use crate::store::engine::sql::query;
use crate::store::tests::Farm;

/// Why a database is refused.
async fn refusal(source: Source) -> String {
    let error = Store::open(source).await.unwrap_err();
    assert!(matches!(error, SchemaError::Unsuitable { .. }), "{error}");
    error.to_string()
}

pub(super) async fn a_database_of_another_program_is_refused_and_left_as_it_is(farm: Farm) {
    async fn change(farm: &Farm, statements: &'static [&'static str]) {
        let write = farm.store.write::<(), StoreError, _>(move |connection| {
            Box::pin(async move {
                for statement in statements {
                    query(*statement).execute(&mut *connection).await?;
                }
                Ok(())
            })
        });
        write.await.unwrap();
    }
    // One with migrations of its own.
    change(&farm, &["update _sqlx_migrations set description = 'orders' where version = 1"]).await;
    let words = refusal(farm.source.clone()).await;
    assert!(words.contains("another program's"), "{words}");
    // One with tables, and none.
    change(&farm, &["alter table _sqlx_migrations rename to zz_orders"]).await;
    let words = refusal(farm.source.clone()).await;
    assert!(words.contains("not empty and not of a farm"), "{words}");
    change(
        &farm,
        &[
            "alter table zz_orders rename to _sqlx_migrations",
            "update _sqlx_migrations set description = 'first' where version = 1",
        ],
    )
    .await;
    farm.reopened().await;
}

#[tokio::test]
async fn a_database_that_does_not_hold_every_name_is_refused() {
    for encoding in ["LATIN1", "SQL_ASCII"] {
        let database = postgres().new_database_in(encoding);
        let words = refusal(Source::postgres(&database.parse().unwrap()).unwrap()).await;
        assert!(words.contains(encoding) && words.contains("expected UTF8"), "{words}");
    }
}

#[tokio::test]
async fn a_role_that_may_not_create_tables_gets_an_error_with_the_missing_grant_and_needs_it_once() {
    let database = postgres().new_database();
    let owner = async |statement: &str| {
        let source = Source::postgres(&database.parse().unwrap()).unwrap();
        query(statement.to_owned()).execute(&source.readers().unwrap()).await.unwrap();
    };
    // Roles are the server's, and other tests use it too.
    owner("create role glazier login").await;
    let restricted = database.replace("postgres@", "glazier@");
    let source = || Source::postgres(&restricted.parse().unwrap()).unwrap();
    let words = refusal(source()).await;
    assert!(words.contains("grant create on schema public to glazier"), "{words}");
    owner("grant create on schema public to glazier").await;
    Store::open(source()).await.unwrap().close().await;
    owner("revoke create on schema public from glazier").await;
    Store::open(source()).await.unwrap().close().await;
}
