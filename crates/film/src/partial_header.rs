//! What a part of a partial says of its node: the JSON in its attribute `clerestory`.

use serde::{Deserialize, Serialize};

use super::address::{NodeAddress, Tile};
use super::partial_error::PartialError;
use super::partial_format::{Expectation, FORMAT_VERSION, PartialHeader, Rendered};
use super::sampling::Sampling;
use super::store;
use crate::counters::Counters;

/// Most of anything that a worker may count for each camera sample, in the mean over a node. At a hundred million a
/// second that is ten minutes a sample: who claims more has not counted.
const MOST_PER_SAMPLE: u64 = 1 << 36;

/// The attribute of a part.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NodeHeader {
    version: u64,
    job: String,
    scene_hash: String,
    build: String,
    frame: u32,
    tile: u32,
    level: u32,
    index: u32,
    first_pass: u64,
    passes: u64,
    samples: u64,
    sampling: Sampling,
    #[serde(with = "StrictCounters")]
    pub(super) counters: Counters,
    pub(super) hash: String,
}

/// The counters, without unknown members. Images and the rows of a farm may have some of another build.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Counters", deny_unknown_fields)]
struct StrictCounters {
    height_evaluations: u64,
    solver_calls: u64,
    converged: u64,
    unique_solutions: u64,
    trials: u64,
    truncated: u64,
    rays: u64,
    samples: u64,
}

/// Only the version, which is read first.
#[derive(Deserialize)]
struct HeaderVersion {
    version: u64,
}

impl NodeHeader {
    /// The header of a node.
    pub(super) fn new(rendered: &Rendered, header: &PartialHeader) -> Self {
        let node = &rendered.node;
        let NodeAddress { frame, tile, level, index } = node.address();
        Self {
            version: FORMAT_VERSION.into(),
            job: header.job.clone(),
            scene_hash: header.scene_hash.clone(),
            build: header.build.clone(),
            frame,
            tile,
            level,
            index,
            first_pass: node.passes().first.into(),
            passes: node.passes().count.into(),
            samples: node.samples(),
            sampling: node.sampling(),
            counters: rendered.counters,
            hash: hash(rendered),
        }
    }

    /// The header of part `index`, compared with what is expected; and the tile of its node.
    pub(super) fn read(index: usize, json: Option<&str>, expected: &Expectation) -> Result<(Self, Tile), PartialError> {
        let bad_header = |message: String| PartialError::BadHeader { part: index, message };
        let json = json.ok_or_else(|| bad_header("it is missing".to_owned()))?;
        let version = read_json::<HeaderVersion>(json).map_err(bad_header)?.version;
        if version != u64::from(FORMAT_VERSION) {
            return Err(PartialError::WrongVersion { part: index, found: version });
        }
        let header: Self = read_json(json).map_err(bad_header)?;
        if header.job != expected.job {
            return Err(PartialError::WrongJob { found: header.job, expected: expected.job.clone() });
        }
        if header.scene_hash != expected.scene_hash {
            return Err(PartialError::WrongScene { found: header.scene_hash, expected: expected.scene_hash.clone() });
        }
        let address = header.address();
        let tile = expected.grid.tile(address.tile).filter(|_| address.exists() && expected.allowed.contains(&address));
        let tile = tile.ok_or(PartialError::UnexpectedNode { address })?;
        if header.sampling != expected.sampling {
            let found = header.sampling;
            return Err(PartialError::WrongSampling { address, found, expected: expected.sampling });
        }
        let samples = u64::from(address.passes().count) * u64::from(expected.sampling.samples_per_pass());
        for (field, found, expected) in [
            ("first_pass", header.first_pass, u64::from(address.passes().first)),
            ("passes", header.passes, u64::from(address.passes().count)),
            ("samples", header.samples, samples),
        ] {
            if found != expected {
                return Err(PartialError::WrongCount { address, field, found, expected });
            }
        }
        Ok((header, tile))
    }

    /// The node.
    pub(super) fn address(&self) -> NodeAddress {
        NodeAddress { frame: self.frame, tile: self.tile, level: self.level, index: self.index }
    }

    /// Compares the counters with what can have been counted in the pixels of the tile.
    pub(super) fn check_counters(&self, tile: Tile) -> Result<(), PartialError> {
        let (address, found) = (self.address(), self.counters.samples);
        let camera_samples = self.samples.saturating_mul(tile.pixels() as u64);
        if found != camera_samples {
            let field = "counters.samples";
            return Err(PartialError::WrongCount { address, field, found, expected: camera_samples });
        }
        let most = camera_samples.saturating_mul(MOST_PER_SAMPLE);
        match named(&self.counters).into_iter().find(|(_, found)| *found > most) {
            Some((counter, found)) => Err(PartialError::AbsurdCounter { address, counter, found, most }),
            None => Ok(()),
        }
    }
}

/// The counters with their names.
fn named(counters: &Counters) -> [(&'static str, u64); 8] {
    let Counters { height_evaluations, solver_calls, converged, unique_solutions, trials, truncated, rays, samples } =
        *counters;
    [
        ("height_evaluations", height_evaluations),
        ("solver_calls", solver_calls),
        ("converged", converged),
        ("unique_solutions", unique_solutions),
        ("trials", trials),
        ("truncated", truncated),
        ("rays", rays),
        ("samples", samples),
    ]
}

/// Hash of a node's stored form and of its counters, in hexadecimal.
pub(super) fn hash(rendered: &Rendered) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&store::hash(&rendered.node));
    for (_, count) in named(&rendered.counters) {
        hasher.update(&count.to_le_bytes());
    }
    hasher.finalize().to_string()
}

/// Reads JSON; an error begins with the member that is wrong, unless it is the whole.
fn read_json<'a, T: Deserialize<'a>>(json: &'a str) -> Result<T, String> {
    let mut reader = serde_json::Deserializer::from_str(json);
    let value =
        serde_path_to_error::deserialize(&mut reader).map_err(|error| match error.path().to_string().as_str() {
            path if path != "." && error.inner().is_data() => format!("{path}: {}", error.inner()),
            _ => error.inner().to_string(),
        })?;
    reader.end().map_err(|error| error.to_string())?;
    Ok(value)
}
