//! How much a coordinator takes: the loads of docs/results/farm.md, one after the other, on SQLite and on a PostgreSQL that is started for it.
//! They print figures and judge none.
//!
//! ```text
//! cargo run --release -p clerestory-tests --bin load
//! ```

use std::process::ExitCode;

use clerestory_test_servers::Postgres;
use clerestory_tests::farm::clerestory;

/// What is asked of `clerestory bench farm`: numbers of workers, and what else.
const ON_SQLITE: &[&str] =
    &["10,100,1000", "1000 --rate 1000", "1000 --rate 2000", "5000 --rate 1500", "10,100 --tile 64", "10 --watch"];

const ON_POSTGRES: &[&str] = &["10,100", "1000 --rate 1000", "1000 --rate 1500", "5000 --rate 1000"];

fn main() -> ExitCode {
    let postgres = match Postgres::start().and_then(|postgres| postgres.settle().map(|()| postgres)) {
        Ok(postgres) => postgres,
        Err(error) => {
            eprintln!("PostgreSQL is not ready: {error}");
            return ExitCode::FAILURE;
        }
    };
    let on_sqlite = ON_SQLITE.iter().map(|load| (load, None));
    let on_postgres = ON_POSTGRES.iter().map(|load| (load, Some(postgres.new_database())));
    let mut failed = false;
    for (load, database) in on_sqlite.chain(on_postgres) {
        println!("\n== {load}{}", if database.is_some() { ", PostgreSQL" } else { "" });
        let mut command = clerestory();
        command.args(["bench", "farm", "--seconds", "8", "--workers"]).args(load.split(' '));
        command.args(database.iter().flat_map(|database| ["--database", database]));
        failed |= !command.status().is_ok_and(|status| status.success());
    }
    if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
