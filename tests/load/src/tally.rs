//! The counters that the workers of a load share, and their measured times.
//!
//! The time of a claim is measured only if there was unleased work all the while. A claim that met the moment without
//! work waited for work and not for the coordinator.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use clerestory_api::{JobId, NodeAddress, NodeVerdict, PartialAnswer};
use tokio::time::Instant;

use crate::merging::{MergeTimes, OpenRounds};

/// The counts so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Leases granted.
    pub(crate) leases: u64,
    /// Nodes in them.
    pub(crate) leased: u64,
    /// Partials answered.
    pub(crate) partials: u64,
    /// Bytes of these.
    pub(crate) bytes: u64,
    /// Nodes accepted.
    pub(crate) accepted: u64,
    /// Passes of a tile in these; a node has at least one.
    pub(crate) accepted_passes: u64,
    /// Nodes that were accepted before.
    pub(crate) duplicate: u64,
    /// Nodes that the coordinator refused.
    pub(crate) refused: u64,
    /// Nodes whose lease had ended before their answer.
    pub(crate) late: u64,
    /// Calls that were repeated after a transient failure.
    pub(crate) repeated: u64,
    /// Previews that failed.
    pub(crate) failed_previews: u64,
}

/// The state at the start of a claim, if its time is measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Asked(Option<u64>);

/// Whether the time of an upload is measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sent(bool);

/// The counters that all workers of a load share.
#[derive(Debug)]
pub(crate) struct Tally {
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    counts: Counts,
    /// Passes of tiles in all jobs that were submitted, less those that are leased or done.
    free_passes: u64,
    /// How often the last free pass was leased.
    droughts: u64,
    is_measuring: bool,
    times: Times,
    /// For each job, the times of answered partials, and the nodes accepted by then.
    arrivals: BTreeMap<JobId, Vec<(Instant, u64)>>,
    rounds: OpenRounds,
    /// The shown preview: its job, and the nodes of it that had been accepted when the preview was begun.
    shown: Option<(JobId, u64)>,
    failure: Option<String>,
}

/// Measured times.
#[derive(Clone, Debug, Default)]
pub(crate) struct Times {
    /// From the request for a lease to the lease.
    pub(crate) claims: Vec<Duration>,
    /// From the first byte of a partial to its answer.
    pub(crate) uploads: Vec<Duration>,
    /// Encoding of a partial.
    pub(crate) encodings: Vec<Duration>,
    /// From the request for a preview to its last byte.
    pub(crate) previews: Vec<Duration>,
    /// From the answer that acknowledged the first node which a preview lacks until the preview came.
    pub(crate) ages: Vec<Duration>,
    /// The same until a preview with more of the job replaced it.
    pub(crate) replaced_ages: Vec<Duration>,
}

impl Tally {
    /// No counts yet. Every job has `tiles` tiles.
    pub(crate) fn new(tiles: u32) -> Self {
        Self { state: Mutex::new(State { rounds: OpenRounds::new(tiles), ..State::default() }) }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What has been counted so far.
    pub(crate) fn counts(&self) -> Counts {
        self.state().counts
    }

    /// Begins or ends the measurement of times.
    pub(crate) fn measure(&self, is_measuring: bool) {
        self.state().is_measuring = is_measuring;
    }

    /// Whether times are measured.
    pub(crate) fn is_measuring(&self) -> bool {
        self.state().is_measuring
    }

    /// The measured times.
    pub(crate) fn times(&self) -> Times {
        self.state().times.clone()
    }

    /// The measured times until rounds were recorded.
    pub(crate) fn merge_times(&self) -> MergeTimes {
        self.state().rounds.times().clone()
    }

    /// Passes of tiles that no worker has leased.
    pub(crate) fn free_passes(&self) -> u64 {
        self.state().free_passes
    }

    /// Notes a submitted job.
    pub(crate) fn supply(&self, passes: u64) {
        self.state().free_passes += passes;
    }

    /// Notes the start of a claim.
    pub(crate) fn asks(&self) -> Asked {
        let state = self.state();
        Asked((state.is_measuring && state.free_passes > 0).then_some(state.droughts))
    }

    /// Notes that a claim was granted after `time`.
    pub(crate) fn granted(&self, asked: Asked, time: Duration, nodes: &[NodeAddress]) {
        let mut state = self.state();
        state.counts.leases += 1;
        state.counts.leased += nodes.len() as u64;
        if asked.0 == Some(state.droughts) {
            state.times.claims.push(time);
        }
        state.free_passes = state.free_passes.saturating_sub(passes(nodes.iter()));
        if state.free_passes == 0 {
            state.droughts += 1;
        }
    }

    /// Notes that a claim was answered without work after `time`.
    pub(crate) fn claim_without_work(&self, asked: Asked, time: Duration) {
        let mut state = self.state();
        if asked.0 == Some(state.droughts) {
            state.times.claims.push(time);
        }
    }

    /// Notes the start of an upload, after the time of its encoding.
    pub(crate) fn sends(&self, encoding: Duration) -> Sent {
        let mut state = self.state();
        if state.is_measuring {
            state.times.encodings.push(encoding);
        }
        Sent(state.is_measuring)
    }

    /// Notes the answer to an upload of a job after `time`.
    pub(crate) fn answered(&self, sent: Sent, job: JobId, time: Duration, bytes: u64, answer: &PartialAnswer) {
        let with = |verdict| answer.nodes.iter().filter(move |node| node.verdict == verdict).map(|node| &node.node);
        let mut state = self.state();
        if sent.0 {
            state.times.uploads.push(time);
        }
        let counts = &mut state.counts;
        counts.partials += 1;
        counts.bytes += bytes;
        let accepted = with(NodeVerdict::Accepted).count() as u64;
        counts.accepted += accepted;
        counts.accepted_passes += passes(with(NodeVerdict::Accepted));
        counts.duplicate += with(NodeVerdict::Duplicate).count() as u64;
        counts.refused += with(NodeVerdict::Refused).count() as u64;
        state.free_passes += passes(with(NodeVerdict::Refused));
        let now = Instant::now();
        state.arrives(job, accepted, now);
        state.rounds.acknowledged(job, with(NodeVerdict::Accepted), sent.0, now);
    }

    /// Jobs with complete rounds that are not known to be recorded, and since when.
    pub(crate) fn due(&self) -> Vec<(JobId, Instant)> {
        self.state().rounds.due()
    }

    /// Notes that the coordinator shows the rounds of a job up to `complete_passes` passes as recorded.
    pub(crate) fn recorded(&self, job: JobId, complete_passes: u32) {
        let now = Instant::now();
        self.state().rounds.recorded(job, complete_passes, now);
    }

    /// Notes a preview of a job, requested at `asked`, with `accepted_nodes` nodes.
    pub(crate) fn seen(&self, job: JobId, accepted_nodes: u64, asked: Instant) {
        let now = Instant::now();
        self.state().sees(job, accepted_nodes, asked, now);
    }

    /// Notes a preview that failed.
    pub(crate) fn preview_failed(&self) {
        self.state().counts.failed_previews += 1;
    }

    /// Notes nodes that are back in the queue, because their lease had ended before their answer.
    pub(crate) fn note_late(&self, nodes: &[NodeAddress]) {
        let mut state = self.state();
        state.counts.late += nodes.len() as u64;
        state.free_passes += passes(nodes.iter());
    }

    /// Notes a repeated call.
    pub(crate) fn repeats(&self) {
        self.state().counts.repeated += 1;
    }

    /// Notes the failure of a worker. The first failure is kept.
    pub(crate) fn fails(&self, reason: String) {
        self.state().failure.get_or_insert(reason);
    }

    /// The first failure of a worker.
    pub(crate) fn failure(&self) -> Option<String> {
        self.state().failure.clone()
    }
}

impl State {
    /// Notes `accepted` acknowledged nodes of a job.
    fn arrives(&mut self, job: JobId, accepted: u64, now: Instant) {
        let arrivals = self.arrivals.entry(job).or_default();
        let before = arrivals.last().map_or(0, |(_, nodes)| *nodes);
        arrivals.push((now, before + accepted));
    }

    fn sees(&mut self, job: JobId, accepted_nodes: u64, asked: Instant, now: Instant) {
        // An equal preview replaces nothing, and a preview of another job begins anew.
        if let Some((shown_job, shown_nodes)) = self.shown.replace((job, accepted_nodes))
            && shown_job == job
            && shown_nodes != accepted_nodes
        {
            let age = self.age(job, shown_nodes, now);
            self.times.replaced_ages.push(age);
        }
        let age = self.age(job, accepted_nodes, now);
        self.times.ages.push(age);
        self.times.previews.push(now - asked);
    }

    /// The time since the first node was acknowledged that a preview with `accepted_nodes` nodes lacks. Zero when it
    /// lacks none.
    fn age(&self, job: JobId, accepted_nodes: u64, now: Instant) -> Duration {
        let arrivals = self.arrivals.get(&job).map(Vec::as_slice).unwrap_or_default();
        let first_lacking = arrivals.partition_point(|(_, nodes)| *nodes <= accepted_nodes);
        arrivals.get(first_lacking).map_or(Duration::ZERO, |(time, _)| now - *time)
    }
}

fn passes<'a>(nodes: impl Iterator<Item = &'a NodeAddress>) -> u64 {
    nodes.map(|node| 1_u64.checked_shl(node.level).unwrap_or(0)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nodes(count: u32) -> Vec<NodeAddress> {
        (0..count).map(|index| NodeAddress { frame: 0, tile: 0, level: 0, index }).collect()
    }

    #[test]
    fn only_claims_for_which_there_was_work_all_the_while_are_measured() {
        let tally = Tally::new(1);
        let time = Duration::from_millis(5);
        let measured = || tally.times().claims.len();
        tally.supply(4);
        let before = tally.asks();
        tally.measure(true);
        tally.granted(before, time, &nodes(1));
        assert_eq!(measured(), 0, "sent before the measurement");
        let (first, second, third) = (tally.asks(), tally.asks(), tally.asks());
        tally.granted(first, time, &nodes(1));
        tally.granted(second, time, &nodes(2));
        assert_eq!((measured(), tally.free_passes()), (2, 0));
        let idle = tally.asks();
        tally.supply(4);
        tally.granted(third, time, &nodes(1));
        tally.granted(idle, time, &nodes(1));
        assert_eq!(measured(), 2, "waited for work");
        tally.granted(tally.asks(), time, &nodes(1));
        assert_eq!((measured(), tally.counts().leased, tally.counts().leases), (3, 7, 6));
        tally.claim_without_work(tally.asks(), time);
        assert_eq!((measured(), tally.counts().leases), (4, 6));
        tally.claim_without_work(idle, time);
        assert_eq!(measured(), 4, "there was none");
    }

    fn job(number: u8) -> JobId {
        format!("00000000-0000-0000-0000-0000000000{number:02}").parse().unwrap()
    }

    #[test]
    fn the_age_of_a_preview_is_that_of_the_first_node_that_it_lacks() {
        let mut state = State::default();
        let start = Instant::now();
        let after = |seconds| start + Duration::from_secs(seconds);
        state.arrives(job(1), 2, after(0));
        state.arrives(job(2), 2, after(1));
        state.arrives(job(1), 2, after(2));
        for accepted_nodes in [0, 1, 2, 3, 3, 4, 9] {
            state.sees(job(1), accepted_nodes, after(4), after(7));
        }
        state.sees(job(3), 0, after(4), after(7));
        let Times { ages, replaced_ages, previews, .. } = state.times;
        assert_eq!(ages.iter().map(Duration::as_secs).collect::<Vec<_>>(), [7, 7, 5, 5, 5, 0, 0, 0]);
        assert_eq!(replaced_ages.iter().map(Duration::as_secs).collect::<Vec<_>>(), [7, 7, 5, 5, 0]);
        assert_eq!(previews, [Duration::from_secs(3); 8]);
    }

    #[test]
    fn nodes_are_counted_by_verdict_and_those_that_are_not_taken_are_free_again() {
        let tally = Tally::new(1);
        let answer = |verdict, level| clerestory_api::NodeAnswer {
            node: NodeAddress { frame: 0, tile: 0, level, index: 0 },
            verdict,
            reason: None,
        };
        let verdicts = [(NodeVerdict::Accepted, 2), (NodeVerdict::Duplicate, 0), (NodeVerdict::Refused, 3)];
        let nodes = verdicts.map(|(verdict, level)| answer(verdict, level)).to_vec();
        let sent = tally.sends(Duration::ZERO);
        tally.answered(sent, job(1), Duration::ZERO, 100, &PartialAnswer { nodes, outstanding: 0 });
        let expected = Counts {
            partials: 1,
            bytes: 100,
            accepted: 1,
            accepted_passes: 4,
            duplicate: 1,
            refused: 1,
            ..Counts::default()
        };
        assert_eq!((tally.counts(), tally.free_passes()), (expected, 8));
        assert!(tally.times().uploads.is_empty());
    }
}
