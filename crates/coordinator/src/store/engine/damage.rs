//! What an error of PostgreSQL says about the session on which it came.
//!
//! A session that outlives a failover may stay read-only, and a session without its prepared statements fails every
//! call. So a session is used again only after errors that a statement or its values caused. When the server is to
//! blame, no session to it is used again: a reader may be connected to a server that was replaced.

/// The state of sessions after an error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::store) enum Damage {
    /// The session is as it was.
    #[default]
    None,
    /// The session is not used again.
    Session,
    /// No session to the server is used again.
    Server,
}

impl Damage {
    /// What an error leaves.
    pub(in crate::store) fn of(error: &sqlx::Error) -> Self {
        match error {
            sqlx::Error::Database(error) => error.code().map_or(Self::Session, |code| Self::of_code(&code)),
            sqlx::Error::RowNotFound
            | sqlx::Error::ColumnIndexOutOfBounds { .. }
            | sqlx::Error::ColumnNotFound(_)
            | sqlx::Error::ColumnDecode { .. }
            | sqlx::Error::Encode(_)
            | sqlx::Error::Decode(_) => Self::None,
            _ => Self::Server,
        }
    }

    fn of_code(code: &str) -> Self {
        match code {
            // Values, constraints, conflicts of transactions, locks, and calls in a transaction that has failed.
            "25P02" | "57014" => Self::None,
            _ if ["22", "23", "40", "55"].iter().any(|class| code.starts_with(class)) => Self::None,
            READ_ONLY => Self::Server,
            // The connection is lost; the server stops or starts.
            _ if ["08", "57"].iter().any(|class| code.starts_with(class)) => Self::Server,
            _ => Self::Session,
        }
    }
}

/// Error code of a write in a read-only session.
const READ_ONLY: &str = "25006";

/// Whether a statement was refused because its session is read-only.
pub(in crate::store) fn is_read_only(error: &sqlx::Error) -> bool {
    matches!(error, sqlx::Error::Database(error) if error.code().as_deref() == Some(READ_ONLY))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_a_statement_has_caused_leaves_its_session_in_use() {
        for (code, expected) in [
            ("23505", Damage::None),    // unique_violation
            ("40001", Damage::None),    // serialization_failure
            ("22P02", Damage::None),    // invalid_text_representation
            ("25P02", Damage::None),    // in_failed_sql_transaction
            ("57014", Damage::None),    // query_canceled
            ("26000", Damage::Session), // a prepared statement does not exist
            ("0A000", Damage::Session), // a cached plan must not change its result type
            ("42P05", Damage::Session), // a prepared statement exists twice, behind a pooler
            ("42P01", Damage::Session), // a table is missing: the database is being restored
            ("53100", Damage::Session), // disk_full
            ("53300", Damage::Session), // too_many_connections
            ("25P03", Damage::Session), // idle_in_transaction_session_timeout
            ("XX000", Damage::Session), // internal_error
            ("25006", Damage::Server),  // read_only_sql_transaction
            ("57P01", Damage::Server),  // admin_shutdown
            ("57P02", Damage::Server),  // crash_shutdown
            ("57P04", Damage::Server),  // database_dropped
            ("57P05", Damage::Server),  // idle_session_timeout
            ("08006", Damage::Server),  // connection_failure
        ] {
            assert_eq!(Damage::of_code(code), expected, "{code}");
        }
        assert_eq!(Damage::of(&sqlx::Error::Protocol("cut off".to_owned())), Damage::Server);
        assert_eq!(Damage::of(&sqlx::Error::RowNotFound), Damage::None);
        assert!(Damage::None < Damage::Session && Damage::Session < Damage::Server, "the worst of several counts");
    }
}
