//! The report of a run, for people and programs.

use std::fs;
use std::num::NonZeroU32;
use std::path::Path;

use serde::Serialize;

use crate::ceilings::Ceilings;
use crate::error::LoadError;
use crate::machine::Machine;
use crate::settings::{CHECKED_FRACTION, Settings};
use crate::statistics::Latency;

/// Characters of the names and of the numbers of the table.
const WIDTHS: [usize; 2] = [46, 11];

/// The measurements of a run.
#[derive(Debug, Serialize)]
pub struct Report {
    machine: Machine,
    /// `sqlite` or `postgres`.
    state: &'static str,
    /// `folder` or `bucket`.
    blobs: &'static str,
    /// File system of the coordinator's folder.
    file_system: String,
    /// Fraction of the nodes that a second worker checks.
    checked_fraction: f64,
    /// Whether previews were fetched.
    is_watched: bool,
    ceilings: Ceilings,
    lines: Vec<Line>,
}

/// The figures of one number of workers. Rates are those of the measured time unless stated otherwise. A megabyte is
/// 10^6 bytes.
#[derive(Debug, Serialize)]
pub(crate) struct Line {
    /// Connected workers.
    pub(crate) workers: u32,
    /// Edge of a tile in pixels.
    pub(crate) tile_size: u32,
    /// Nodes in a lease.
    pub(crate) nodes_per_lease: u32,
    /// The rate that the workers offered together; absent where workers ask again at once.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) offered_nodes_per_second: Option<NonZeroU32>,
    /// Jobs that were submitted.
    pub(crate) jobs: u64,
    /// The measured time.
    pub(crate) load_seconds: f64,
    /// From the end of the measured time until all work is merged and the coordinator rests.
    pub(crate) drain_seconds: f64,
    /// Until all workers were registered, 100 at a time.
    pub(crate) registration_seconds: f64,
    /// Leases granted, over the measured time, as all rates below but one.
    pub(crate) leases_per_second: f64,
    /// Nodes leased.
    pub(crate) leased_per_second: f64,
    /// Nodes accepted.
    pub(crate) uploaded_per_second: f64,
    /// Nodes whose round was recorded.
    pub(crate) merged_per_second: f64,
    /// All nodes, over the time from the first claim until the coordinator was at rest.
    pub(crate) sustained_per_second: f64,
    /// Partials answered.
    pub(crate) partials_per_second: f64,
    /// Their bytes.
    pub(crate) partial_megabytes_per_second: f64,
    /// Exchanges with a bare server over as many connections, 1000 at most, with bodies as large.
    pub(crate) exchanges_per_second: f64,
    /// Bytes of a partial with all nodes of a lease.
    pub(crate) partial_bytes: u64,
    /// From the request for a lease to the lease, while there was work.
    pub(crate) claim: Latency,
    /// From the start of an upload to its answer.
    pub(crate) upload: Latency,
    /// From the answer that acknowledged the last node of a round until the coordinator showed the round as recorded.
    pub(crate) round_merge: Latency,
    /// The same from every answer that acknowledged nodes of a round, with the wait for other nodes of the round.
    pub(crate) upload_merge: Latency,
    /// Encoding of a partial by the generator.
    pub(crate) encoding: Latency,
    /// From the answer that acknowledged the first node which a preview lacked until the preview came. Empty without
    /// previews.
    pub(crate) preview_age: Latency,
    /// The same until a preview with more of the same job replaced it.
    pub(crate) preview_replaced_age: Latency,
    /// From the request for a preview to its last byte.
    pub(crate) preview: Latency,
    /// Previews that were asked for and did not come.
    pub(crate) failed_previews: u64,
    /// Leases granted, from the first claim to the end, as all counts below.
    pub(crate) leases: u64,
    /// Nodes in them.
    pub(crate) leased_nodes: u64,
    /// Nodes accepted.
    pub(crate) uploaded_nodes: u64,
    /// Nodes in recorded rounds at the end.
    pub(crate) merged_nodes: u64,
    /// Nodes that were accepted before.
    pub(crate) duplicate_nodes: u64,
    /// Nodes that the coordinator refused.
    pub(crate) refused_nodes: u64,
    /// Nodes whose lease had run out, or which another worker had uploaded. At the end, idle workers take over leased
    /// nodes.
    pub(crate) late_nodes: u64,
    /// The same until the end of the measured time, while there was work for all.
    pub(crate) late_nodes_under_load: u64,
    /// Nodes that were accepted and are in no recorded round at the end.
    pub(crate) lost_nodes: u64,
    /// Calls that were repeated after a transient failure.
    pub(crate) repeated_calls: u64,
    /// Camera samples that the accepted nodes stand for.
    pub(crate) samples: u64,
    /// Most memory of the coordinator.
    pub(crate) coordinator_peak_megabytes: f64,
    /// Its memory at the end of the measured time.
    pub(crate) coordinator_megabytes_under_load: f64,
    /// Its sockets at that time.
    pub(crate) coordinator_sockets: u64,
    /// Its processor time, from the first claim to the end.
    pub(crate) coordinator_processor_seconds: f64,
    /// Processor time of the generator in the same time.
    pub(crate) generator_processor_seconds: f64,
    /// Bytes that the coordinator made the system write, for each byte of a partial. Writes of a database server are
    /// not in it.
    pub(crate) write_amplification: f64,
    /// Bytes that a PostgreSQL server wrote to its log (WAL), for all of its databases, for each byte of a partial.
    /// Absent where no server reports it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) database_log_amplification: Option<f64>,
    /// Growth of the state and of the blobs that are not in a bucket, for each camera sample.
    pub(crate) stored_bytes_per_sample: f64,
}

impl Report {
    /// The report of a run.
    pub(crate) fn new(
        settings: &Settings,
        machine: Machine,
        file_system: String,
        ceilings: Ceilings,
        lines: Vec<Line>,
    ) -> Self {
        let state = if settings.database.is_some() { "postgres" } else { "sqlite" };
        let blobs = if settings.object_store.is_some() { "bucket" } else { "folder" };
        Self {
            machine,
            state,
            blobs,
            file_system,
            checked_fraction: CHECKED_FRACTION,
            is_watched: settings.watch,
            ceilings,
            lines,
        }
    }

    /// Writes the report as JSON.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn write(&self, file: &Path) -> Result<(), LoadError> {
        let json = serde_json::to_vec_pretty(self).expect("a report has a form in JSON");
        fs::write(file, json).map_err(|source| LoadError::Write { file: file.to_owned(), source })
    }

    /// The report as a table: a column for each number of workers, and below it the speed of the bare machine.
    pub fn table(&self) -> String {
        let mut table = String::new();
        let Some(first) = self.lines.first() else { return table };
        let Line { tile_size, nodes_per_lease, partial_bytes, .. } = first;
        let offered = first.offered_nodes_per_second.map_or_else(
            || "as many nodes as the coordinator takes".to_owned(),
            |rate| format!("{rate} nodes/s offered"),
        );
        let Self { state, blobs, file_system, checked_fraction, .. } = self;
        table.push_str(&format!(
            "state: {state}, blobs: {blobs}, on {file_system}; tiles of {tile_size} x {tile_size} pixels, \
             {nodes_per_lease} nodes in a lease, partials of \
             {partial_bytes} bytes, {offered}; fraction of nodes that are checked: {checked_fraction}\n"
        ));
        let [names, numbers] = WIDTHS;
        let is_logged = self.lines.iter().any(|line| line.database_log_amplification.is_some());
        let logged = LOGGED_ROWS.iter().filter(|_| is_logged);
        let watched = WATCHED_ROWS.iter().filter(|_| self.is_watched);
        for &(name, digits, value) in ROWS.iter().chain(logged).chain(watched) {
            table.push_str(&format!("{name:<names$}"));
            table.extend(self.lines.iter().map(|line| format!("{:>numbers$.digits$}", value(line))));
            table.push('\n');
        }
        table.push_str("the bare machine:\n");
        for (name, value) in self.ceilings.lines() {
            let indented = format!("  {name}");
            table.push_str(&format!("{indented:<names$}{value:>numbers$.0}\n"));
        }
        table.truncate(table.trim_end().len());
        table
    }
}

/// A row of the table: its name, digits after the point, and where the number comes from.
type Row = (&'static str, usize, fn(&Line) -> f64);

const ROWS: &[Row] = &[
    ("workers", 0, |line| line.workers.into()),
    ("leases, /s", 0, |line| line.leases_per_second),
    ("nodes leased, /s", 0, |line| line.leased_per_second),
    ("nodes uploaded, /s", 0, |line| line.uploaded_per_second),
    ("nodes merged, /s", 0, |line| line.merged_per_second),
    ("nodes sustained (load and drain), /s", 0, |line| line.sustained_per_second),
    ("partials, /s", 0, |line| line.partials_per_second),
    ("  bare HTTP exchanges of that size, /s", 0, |line| line.exchanges_per_second),
    ("partials, MB/s", 1, |line| line.partial_megabytes_per_second),
    ("claim until lease, p50, ms", 1, |line| line.claim.p50_ms),
    ("  p99, ms", 1, |line| line.claim.p99_ms),
    ("  max, ms", 1, |line| line.claim.max_ms),
    ("upload until answer, p50, ms", 1, |line| line.upload.p50_ms),
    ("  p99, ms", 1, |line| line.upload.p99_ms),
    ("  max, ms", 1, |line| line.upload.max_ms),
    ("last upload of a round until merged, p50, ms", 1, |line| line.round_merge.p50_ms),
    ("  p99, ms", 1, |line| line.round_merge.p99_ms),
    ("  max, ms", 1, |line| line.round_merge.max_ms),
    ("  rounds", 0, |line| line.round_merge.count as f64),
    ("any upload until merged, p50, ms", 1, |line| line.upload_merge.p50_ms),
    ("  p99, ms", 1, |line| line.upload_merge.p99_ms),
    ("  max, ms", 1, |line| line.upload_merge.max_ms),
    ("measured, s", 1, |line| line.load_seconds),
    ("drain until all is merged, s", 1, |line| line.drain_seconds),
    ("registration of all workers, s", 1, |line| line.registration_seconds),
    ("nodes lost, refused, late or there already", 0, |line| {
        (line.lost_nodes + line.refused_nodes + line.late_nodes + line.duplicate_nodes) as f64
    }),
    ("calls repeated", 0, |line| line.repeated_calls as f64),
    ("coordinator, most memory, MB", 0, |line| line.coordinator_peak_megabytes),
    ("coordinator, sockets", 0, |line| line.coordinator_sockets as f64),
    ("coordinator, processor ms for each node", 3, |line| processor_ms(line, line.coordinator_processor_seconds)),
    ("generator, processor ms for each node", 3, |line| processor_ms(line, line.generator_processor_seconds)),
    ("  of which encoding, p50, ms", 3, |line| line.encoding.p50_ms / f64::from(line.nodes_per_lease)),
    ("stored for each camera sample, bytes", 3, |line| line.stored_bytes_per_sample),
    ("written for each byte of partials, bytes", 2, |line| line.write_amplification),
];

/// Rows for servers that report their log.
const LOGGED_ROWS: &[Row] =
    &[("  and by PostgreSQL to its log, bytes", 2, |line| line.database_log_amplification.unwrap_or(0.0))];

/// Rows for loads with previews.
const WATCHED_ROWS: &[Row] = &[
    ("previews", 0, |line| line.preview.count as f64),
    ("previews that failed", 0, |line| line.failed_previews as f64),
    ("preview, age when it comes, p50, ms", 1, |line| line.preview_age.p50_ms),
    ("  p99, ms", 1, |line| line.preview_age.p99_ms),
    ("  max, ms", 1, |line| line.preview_age.max_ms),
    ("preview, age when it is replaced, p50, ms", 1, |line| line.preview_replaced_age.p50_ms),
    ("  p99, ms", 1, |line| line.preview_replaced_age.p99_ms),
    ("  max, ms", 1, |line| line.preview_replaced_age.max_ms),
    ("preview until it comes, p50, ms", 1, |line| line.preview.p50_ms),
    ("  p99, ms", 1, |line| line.preview.p99_ms),
    ("  max, ms", 1, |line| line.preview.max_ms),
];

fn processor_ms(line: &Line, seconds: f64) -> f64 {
    seconds * 1000.0 / line.uploaded_nodes.max(1) as f64
}
