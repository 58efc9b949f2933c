//! Leases: granted, renewed, returned, failed and expired.

pub(in crate::store) mod attempts;
pub(in crate::store) mod ended_workers;
pub(in crate::store) mod expiry;
pub(in crate::store) mod failures;
pub(in crate::store) mod grant;
pub(in crate::store) mod renewals;
pub(in crate::store) mod table;
