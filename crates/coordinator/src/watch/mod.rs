//! TODO

pub(crate) mod events;
pub(crate) mod notifications;
pub(crate) mod rates;
pub(crate) mod readiness;
pub(crate) mod views;
