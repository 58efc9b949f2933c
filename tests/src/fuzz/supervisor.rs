//! Runs cases in processes of their own: one that panics, hangs or takes too much memory ends its process alone.
//!
//! A process prints the number of each case before it begins with it. So the last number says which case it was.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use super::corpus::Corpus;
use super::{Case, reading};

/// Cases for one process.
const BATCH: u64 = 500;

/// What becomes of the supervisor's own test: a fault that is planted in the third case of each process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Plant {
    /// It panics.
    Panic,
    /// It does not end.
    Hang,
    /// It takes memory without end.
    Memory,
}

/// What to run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Seed of all cases.
    pub seed: u64,
    /// How long.
    pub time: Duration,
    /// Time for one case.
    pub case_time: Duration,
    /// Address space of a process, bytes.
    pub memory: u64,
    /// Where the files of cases with a fault go.
    pub found: PathBuf,
    /// A fault to be noticed.
    pub plant: Option<Plant>,
}

/// A case with a fault.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Its number.
    pub case: u64,
    /// How its process ended.
    pub what: String,
    /// The folder with its files.
    pub files: PathBuf,
}

/// What was run.
#[derive(Debug, Default)]
pub struct Tally {
    /// Cases.
    pub cases: u64,
    /// Those that were refused.
    pub refused: u64,
    /// Those with a fault.
    pub findings: Vec<Finding>,
}

/// The work of one process: cases from `first` on, each announced on standard output. Refused ones end in `r`.
///
/// # Panics
///
/// When a case does, and when standard output is closed.
pub fn work(seed: u64, first: u64, plant: Option<Plant>) {
    let (corpus, folder) = (Corpus::kept(), tempfile::tempdir().expect("a folder"));
    let mut output = std::io::stdout().lock();
    for number in first..first + BATCH {
        writeln!(output, "{number}").and_then(|()| output.flush()).expect("a reader");
        if number == first + 2 {
            plant.into_iter().for_each(fault);
        }
        if reading::read(&Case::new(&corpus, seed, number), folder.path()).is_err() {
            writeln!(output, "r").expect("a reader");
        }
    }
}

/// Does what no case may do.
fn fault(plant: Plant) {
    match plant {
        Plant::Panic => panic!("a planted panic"),
        Plant::Hang => std::thread::sleep(Duration::from_secs(3600)),
        Plant::Memory => {
            let mut taken = Vec::new();
            loop {
                taken.push(vec![1_u8; 1 << 24]);
            }
        }
    }
}

/// Runs cases until the time is over. `program` starts a process for a seed and the number of the first case.
///
/// # Panics
///
/// When no process can be started, or the files of a case cannot be written.
pub fn run(plan: &Plan, program: &dyn Fn(u64) -> Vec<String>, tell: &mut dyn FnMut(&Tally)) -> Tally {
    let (corpus, start, mut tally, mut first) = (Corpus::kept(), Instant::now(), Tally::default(), 0);
    while start.elapsed() < plan.time && (plan.plant.is_none() || tally.findings.is_empty()) {
        let (mut process, lines) = started(&program(first), plan.memory);
        let (mut last, mut refused) = (None, 0);
        let ended = loop {
            match lines.recv_timeout(plan.case_time) {
                Ok(line) if line == "r" => refused += 1,
                Ok(line) => last = line.parse::<u64>().ok().or(last),
                Err(RecvTimeoutError::Disconnected) => break None,
                Err(RecvTimeoutError::Timeout) => break Some(format!("takes more than {:?}", plan.case_time)),
            }
        };
        // It may have ended by itself.
        let _ = process.kill();
        let (what, next) = (ended.or_else(|| failure(&mut process)), last.map_or(first, |last| last + 1));
        let _ = process.wait();
        tally.cases += next - first;
        tally.refused += refused;
        if let Some(what) = what {
            // A process that fails before its first case fails for all.
            let case = last.unwrap_or_else(|| panic!("no case began: {what}"));
            let files = kept(&plan.found, case, &Case::new(&corpus, plan.seed, case));
            tally.findings.push(Finding { case, what, files });
        }
        first = next;
        tell(&tally);
    }
    tally
}

/// Starts a process with a limit on its memory, and the lines that it prints.
fn started(words: &[String], memory: u64) -> (Child, Receiver<String>) {
    let limited = "ulimit -v \"$1\" && shift && exec \"$@\"";
    let mut command = Command::new("sh");
    command.args(["-c", limited, "sh", &(memory >> 10).to_string()]).args(words);
    let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("a shell");
    let output = BufReader::new(process.stdout.take().expect("it is piped"));
    let (sender, lines) = mpsc::channel();
    std::thread::spawn(move || output.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
    (process, lines)
}

/// How a process that ended by itself failed, in words.
fn failure(process: &mut Child) -> Option<String> {
    let status = process.wait().expect("a process of ours");
    let mut said = String::new();
    // What it said is a help alone.
    let _ = process.stderr.take().map(|mut errors| errors.read_to_string(&mut said));
    let said: Vec<&str> = said.lines().filter(|line| !line.is_empty()).take(3).collect();
    (!status.success()).then(|| format!("{status}: {}", said.join(" ")))
}

/// Writes the files of a case, and answers where they are.
fn kept(found: &Path, number: u64, case: &Case) -> PathBuf {
    let folder = found.join(format!("case-{number}"));
    fs::create_dir_all(&folder).expect("a folder that can be written");
    for (name, bytes) in &case.files {
        fs::write(folder.join(name), bytes).expect("a folder that can be written");
    }
    folder
}
