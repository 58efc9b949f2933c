//! What is seen of the farm while it works: views, event streams, notifications between tasks and coordinators,
//! liveness and readiness.

pub(crate) mod events;
pub(crate) mod liveness;
pub(crate) mod notifications;
pub(crate) mod peers;
pub(crate) mod rates;
pub(crate) mod readiness;
pub(crate) mod views;
