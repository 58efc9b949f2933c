//! Records: what rows of the database become, and the rules that depend on nothing else.

mod check;
mod cut;
mod delivery;
mod event;
mod identity;
mod job;
mod lease;
mod measured_rate;
mod name;
mod node;
mod round;
mod scene_report;
mod sharing;
mod targets;
mod worker;

pub(crate) use check::{CheckKey, CheckOutcome, is_selected};
pub(crate) use cut::cut;
pub(crate) use delivery::{DeliveredNode, Delivery, WorkFailure};
pub(crate) use event::{StoredEvent, StoredKind};
pub(crate) use identity::Identity;
pub(crate) use job::{Ending, JobRecord, NewJob, is_read_by_first, is_same_by_first};
pub(crate) use lease::{ClaimTerms, Grant, LeaseRecord, LeaseState, MOST_NODES, Renewal};
pub(crate) use measured_rate::{MeasuredRate, SHORTEST_LINGER_SECONDS};
pub(crate) use name::{UnprintableName, check_name};
pub(crate) use node::{BlobRange, Merge, NodeRow, Removed, StoredNode, Work, wire_address};
pub(crate) use round::{CompleteRound, FilmLease, RecordedRound};
pub(crate) use scene_report::{SceneChange, SceneRefusal, SceneReport};
pub(crate) use sharing::TilePasses;
pub(crate) use targets::{round_error, stop_reason};
pub(crate) use worker::Heartbeat;
