//! What handlers work with: each takes the parts that it needs.

use std::sync::Arc;

use axum::extract::FromRef;

use super::receiving::ReceivingMemory;
use crate::config::Token;
use crate::films::acceptance::Acceptance;
use crate::films::assets::Assets;
use crate::films::images::Images;
use crate::films::live::LiveErrors;
use crate::films::previews::Previews;
use crate::jobs::claims::Claims;
use crate::jobs::lifecycle::Jobs;
use crate::jobs::submission::Submissions;
use crate::jobs::workers::Workers;
use crate::store::Store;
use crate::watch::events::EventFeed;
use crate::watch::readiness::Readiness;
use crate::watch::views::Views;

/// Largest bodies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyLimits {
    /// Of an asset or a reference, in bytes.
    pub(crate) asset: u64,
    /// Of a partial, in bytes.
    pub(crate) partial: u64,
}

/// The farm's token, if callers need one.
#[derive(Clone, Debug)]
pub(crate) struct Access(pub(crate) Option<Token>);

/// Declares the state of the router. Handlers extract each part of it by its type.
macro_rules! api_state {
    ($($(#[$doc:meta])* $name:ident: $part:ty,)*) => {
        /// The parts that the API is made of.
        #[derive(Clone, Debug)]
        pub(crate) struct ApiState {
            $($(#[$doc])* pub(crate) $name: $part,)*
        }

        $(impl FromRef<ApiState> for $part {
            fn from_ref(state: &ApiState) -> Self {
                state.$name.clone()
            }
        })*
    };
}

api_state! {
    /// Who may call.
    access: Access,
    /// Largest bodies.
    limits: BodyLimits,
    /// Memory for partials that are received.
    receiving: Arc<ReceivingMemory>,
    /// The database, for plain reads.
    store: Store,
    /// Jobs and workers as the API shows them.
    views: Arc<Views>,
    /// Event streams.
    feed: Arc<EventFeed>,
    /// Readiness of the coordinator.
    readiness: Arc<Readiness>,
    /// Jobs.
    jobs: Arc<Jobs>,
    /// New jobs.
    submissions: Arc<Submissions>,
    /// Leases.
    claims: Arc<Claims>,
    /// Partials.
    acceptance: Arc<Acceptance>,
    /// Workers.
    workers: Arc<Workers>,
    /// Assets.
    assets: Arc<Assets>,
    /// Images.
    images: Arc<Images>,
    /// Previews.
    previews: Arc<Previews>,
    /// Errors between rounds.
    live_errors: Arc<LiveErrors>,
}
