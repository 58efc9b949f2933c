//! Statements and their answers, for both engines.

use std::borrow::Cow;
use std::future::Future;

use crate::store::engine::error::StoreError;
use crate::store::engine::row::Row;
use crate::store::engine::value::Value;

/// Prepared statements that a connection caches: more than there are.
pub(in crate::store) const PREPARED: usize = 256;

/// A statement with its parameters.
#[derive(Clone, Debug)]
pub(in crate::store) struct Query {
    pub(in crate::store) statement: Cow<'static, str>,
    pub(in crate::store) values: Vec<Value>,
}

/// What a statement has come to.
#[derive(Clone, Debug, Default)]
pub(in crate::store) struct Answer {
    /// Its rows.
    pub(in crate::store) rows: Vec<Row>,
    /// Rows that it has changed.
    pub(in crate::store) affected: u64,
}

/// What statements run on.
pub(in crate::store) trait Runner {
    /// Runs one statement.
    fn run(self, query: Query) -> impl Future<Output = Result<Answer, StoreError>> + Send;
}

/// A statement with numbered parameters, `$1` and so on.
pub(in crate::store) fn query(statement: impl Into<Cow<'static, str>>) -> Query {
    Query { statement: statement.into(), values: Vec::new() }
}

impl Query {
    /// Binds the next parameter.
    pub(in crate::store) fn bind(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// All its rows.
    pub(in crate::store) async fn fetch_all(self, runner: impl Runner + Send) -> Result<Vec<Row>, StoreError> {
        Ok(runner.run(self).await?.rows)
    }

    /// Its first row, if there is any.
    pub(in crate::store) async fn fetch_optional(self, runner: impl Runner + Send) -> Result<Option<Row>, StoreError> {
        Ok(runner.run(self).await?.rows.into_iter().next())
    }

    /// Its first row.
    pub(in crate::store) async fn fetch_one(self, runner: impl Runner + Send) -> Result<Row, StoreError> {
        let statement = self.statement.clone();
        let row = self.fetch_optional(runner).await?;
        row.ok_or_else(|| StoreError::Database(format!("no row comes of `{statement}`")))
    }

    /// Runs it, and answers the number of changed rows.
    pub(in crate::store) async fn execute(self, runner: impl Runner + Send) -> Result<u64, StoreError> {
        Ok(runner.run(self).await?.affected)
    }
}
