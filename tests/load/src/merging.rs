//! Merging: the time from the last upload of a round until the coordinator shows the round as recorded.
//!
//! All nodes come from this process, so it knows which answer acknowledges the last node of a round. From then on, it
//! requests the job until the job shows the round. The event stream is no alternative. It batches events for up to 200
//! ms, and a subscriber makes the coordinator build a view of every worker.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::time::Duration;

use clerestory_api::{Client, JobId, NodeAddress};
use clerestory_film::Rounds;
use tokio::time::Instant;

use crate::supply::PASSES;
use crate::tally::Tally;

/// Shortest and longest pause between two requests for a job.
const PAUSES: [Duration; 2] = [Duration::from_millis(5), Duration::from_millis(50)];

/// Between these limits, the pause is this fraction of the time waited so far.
const PART: u32 = 20;

/// Rounds of jobs, from their first node until they are complete and recorded.
#[derive(Debug, Default)]
pub(crate) struct OpenRounds {
    /// Tiles of every job.
    tiles: u32,
    /// By job, and by the passes that every tile has after them.
    rounds: BTreeMap<(JobId, u32), Round>,
    times: MergeTimes,
}

/// Measured times until rounds were recorded.
#[derive(Clone, Debug, Default)]
pub(crate) struct MergeTimes {
    /// From the answer that acknowledged the last node of a round.
    pub(crate) rounds: Vec<Duration>,
    /// From every answer that acknowledged nodes of a round.
    pub(crate) uploads: Vec<Duration>,
}

#[derive(Debug, Default)]
struct Round {
    /// Passes of tiles that have been acknowledged.
    passes: u64,
    /// When they were acknowledged, where the time is measured.
    acknowledged: Vec<Instant>,
    /// When the last of them was acknowledged, and whether that time is measured.
    complete: Option<(Instant, bool)>,
    /// When the coordinator first showed the round as recorded. That can be before the last answer arrives here.
    recorded: Option<Instant>,
}

impl OpenRounds {
    /// Rounds of jobs of `tiles` tiles.
    pub(crate) fn new(tiles: u32) -> Self {
        Self { tiles, ..Self::default() }
    }

    /// Notes nodes of a job that one answer acknowledges.
    pub(crate) fn acknowledged<'a>(
        &mut self,
        job: JobId,
        nodes: impl Iterator<Item = &'a NodeAddress>,
        is_measured: bool,
        now: Instant,
    ) {
        let mut passes: BTreeMap<[u32; 2], u64> = BTreeMap::new();
        for node in nodes {
            if let Some(round) = round_of(node) {
                *passes.entry(round).or_default() += 1_u64.checked_shl(node.level).unwrap_or(0);
            }
        }
        for ([first, end], passes) in passes {
            let round = self.rounds.entry((job, end)).or_default();
            round.passes += passes;
            if is_measured {
                round.acknowledged.push(now);
            }
            if round.passes == u64::from(self.tiles) * u64::from(end - first) {
                round.complete = Some((now, is_measured));
            }
            self.close((job, end));
        }
    }

    /// Notes that the coordinator shows the rounds of a job up to `complete_passes` passes as recorded.
    pub(crate) fn recorded(&mut self, job: JobId, complete_passes: u32, now: Instant) {
        let keys: Vec<(JobId, u32)> =
            self.rounds.range((job, 0)..=(job, complete_passes)).map(|(key, _)| *key).collect();
        for key in keys {
            if let Some(round) = self.rounds.get_mut(&key) {
                round.recorded.get_or_insert(now);
            }
            self.close(key);
        }
    }

    /// Takes the times of a round that is both complete and recorded.
    fn close(&mut self, key: (JobId, u32)) {
        let Entry::Occupied(entry) = self.rounds.entry(key) else { return };
        let (Some((complete, is_measured)), Some(recorded)) = (entry.get().complete, entry.get().recorded) else {
            return;
        };
        let acknowledged = entry.remove().acknowledged;
        let since = |time: Instant| recorded.saturating_duration_since(time);
        self.times.uploads.extend(acknowledged.into_iter().map(since));
        if is_measured {
            self.times.rounds.push(since(complete));
        }
    }

    /// Jobs with complete rounds that are not known to be recorded, and when the first of these was complete.
    pub(crate) fn due(&self) -> Vec<(JobId, Instant)> {
        let mut due: Vec<(JobId, Instant)> = Vec::new();
        for ((job, _), round) in &self.rounds {
            if let Some((complete, _)) = round.complete
                && due.last().is_none_or(|(last, _)| last != job)
            {
                due.push((*job, complete));
            }
        }
        due
    }

    /// The measured times.
    pub(crate) fn times(&self) -> &MergeTimes {
        &self.times
    }
}

/// The passes of a node's round: the first, and the one after the last. `None` where the jobs of a load have no such
/// pass.
fn round_of(node: &NodeAddress) -> Option<[u32; 2]> {
    let pass = u64::from(node.index).checked_shl(node.level)?;
    let rounds = Rounds::new(PASSES);
    let mut first = 0;
    for end in (0..).map_while(|round| rounds.end(round)) {
        if pass < u64::from(end) {
            return Some([first, end]);
        }
        first = end;
    }
    None
}

/// Requests jobs with complete rounds until these are recorded, for as long as it is polled.
pub(crate) async fn follow(client: &Client, tally: &Tally) {
    let [shortest, longest] = PAUSES;
    loop {
        let due = tally.due();
        for (job, _) in &due {
            match client.job(*job).await {
                Ok(view) => tally.recorded(*job, view.complete_passes),
                // The next request follows soon.
                Err(_) => tally.repeats(),
            }
        }
        let waited = due.iter().map(|(_, complete)| complete.elapsed()).min().unwrap_or_default();
        tokio::time::sleep((waited / PART).clamp(shortest, longest)).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(number: u8) -> JobId {
        format!("00000000-0000-0000-0000-0000000000{number:02}").parse().unwrap()
    }

    fn node(tile: u32, level: u32, index: u32) -> NodeAddress {
        NodeAddress { frame: 0, tile, level, index }
    }

    fn seconds(times: &[Duration]) -> Vec<u64> {
        times.iter().map(Duration::as_secs).collect()
    }

    #[test]
    fn nodes_belong_to_the_rounds_of_a_job() {
        let rounds = [(0, 0), (0, 1), (0, 2), (1, 1), (0, 7), (2, 1), (3, 1), (0, 15)].map(|(level, index)| {
            let [first, end] = round_of(&node(0, level, index)).unwrap();
            (first, end)
        });
        assert_eq!(rounds, [(0, 1), (1, 2), (2, 4), (2, 4), (4, 8), (4, 8), (8, 16), (8, 16)]);
        assert_eq!(round_of(&node(0, 0, PASSES)), None);
    }

    #[test]
    fn a_round_is_due_from_its_last_node_until_it_is_recorded_and_times_run_until_then() {
        let mut rounds = OpenRounds::new(2);
        let start = Instant::now();
        let after = |seconds| start + Duration::from_secs(seconds);
        rounds.acknowledged(job(1), [node(0, 0, 0)].iter(), true, after(0));
        assert!(rounds.due().is_empty());
        // The last node of the first round comes with a node of the next.
        rounds.acknowledged(job(1), [node(1, 0, 0), node(0, 0, 1)].iter(), true, after(1));
        rounds.acknowledged(job(2), [node(0, 0, 0), node(1, 0, 0)].iter(), true, after(2));
        assert_eq!(rounds.due(), [(job(1), after(1)), (job(2), after(2))]);
        rounds.recorded(job(1), 1, after(4));
        assert_eq!(rounds.due(), [(job(2), after(2))]);
        assert_eq!((seconds(&rounds.times().rounds), seconds(&rounds.times().uploads)), (vec![3], vec![4, 3]));
        rounds.recorded(job(2), 1, after(9));
        assert!(rounds.due().is_empty());
        assert_eq!((seconds(&rounds.times().rounds), seconds(&rounds.times().uploads)), (vec![3, 7], vec![4, 3, 7]));
    }

    #[test]
    fn a_round_that_is_recorded_before_its_last_answer_came_was_merged_at_once() {
        let mut rounds = OpenRounds::new(2);
        let start = Instant::now();
        let after = |seconds| start + Duration::from_secs(seconds);
        rounds.acknowledged(job(1), [node(0, 0, 0)].iter(), true, after(0));
        rounds.recorded(job(1), 1, after(2));
        rounds.recorded(job(1), 1, after(3));
        rounds.acknowledged(job(1), [node(1, 0, 0)].iter(), true, after(4));
        assert_eq!((seconds(&rounds.times().rounds), seconds(&rounds.times().uploads)), (vec![0], vec![2, 0]));
    }

    #[test]
    fn times_of_answers_outside_the_measurement_do_not_count() {
        let mut rounds = OpenRounds::new(2);
        let start = Instant::now();
        let after = |seconds| start + Duration::from_secs(seconds);
        rounds.acknowledged(job(1), [node(0, 0, 0)].iter(), true, after(0));
        rounds.acknowledged(job(1), [node(1, 0, 0)].iter(), false, after(1));
        assert_eq!(rounds.due(), [(job(1), after(1))]);
        rounds.recorded(job(1), 16, after(2));
        assert_eq!((seconds(&rounds.times().rounds), seconds(&rounds.times().uploads)), (vec![], vec![2]));
    }
}
