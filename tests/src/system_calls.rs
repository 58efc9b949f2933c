//! What a server did with its files and its connections, call by call as `strace` saw it, and whether what it
//! acknowledged was on disk.
//!
//! A file is on disk when a sync of it has succeeded that began after the last write to it had ended. A name is on disk
//! when its folder was synced after the name was made. Everything in the server's folder must be on disk when it begins
//! to answer a call that changes something. Before a blob is removed, everything that makes it superfluous must be on
//! disk.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

/// What is traced: all ways to change files, to sync them, and to read and write connections.
const TRACED: &str = "openat,open,creat,mkdir,mkdirat,rename,renameat,renameat2,link,linkat,unlink,unlinkat,\
     write,writev,pwrite64,pwritev,pwritev2,ftruncate,fallocate,copy_file_range,sendfile,\
     fsync,fdatasync,read,readv,recvfrom,recvmsg,sendto,sendmsg";

/// The command under `strace`, which writes what it and its threads do to a file. Arguments can be added as to the
/// command itself.
pub fn traced(command: &Command, trace: &Path) -> Command {
    let mut traced = Command::new("strace");
    traced.args(["-f", "-qq", "-y", "-s", "96", "-e", "signal=none", "-e"]).arg(format!("trace={TRACED}"));
    traced.arg("-o").arg(trace).arg("--").arg(command.get_program()).args(command.get_args());
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => traced.env(name, value),
            None => traced.env_remove(name),
        };
    }
    traced
}

/// What a server's files are, by their paths.
#[derive(Clone, Copy)]
pub struct Roles {
    /// What need not be on disk.
    pub is_ignored: fn(&str) -> bool,
    /// The log of the database: a transaction is on disk when what it has written there is.
    pub is_log: fn(&str) -> bool,
    /// Files that are written once, and that rows of the database name.
    pub is_blob: fn(&str) -> bool,
}

/// An answer to a call that changes something.
#[derive(Clone, Debug)]
pub struct Acknowledgement {
    /// Method and path of the call.
    pub call: String,
    /// On which line of the trace the call had come; the first is 0.
    pub received: usize,
    /// Files and folders that were not on disk when the answer began to be sent.
    pub unsynced: BTreeSet<String>,
}

/// A blob that is removed.
#[derive(Clone, Debug)]
pub struct Removal {
    /// The blob.
    pub path: String,
    /// Other files and folders that were not on disk when it began to be removed.
    pub unsynced: BTreeSet<String>,
    /// Other blobs that no row on disk could name then: nothing that had been written to the log since they were there
    /// had been synced.
    pub unnamed: BTreeSet<String>,
}

/// What relied on the disk.
#[derive(Clone, Debug, Default)]
pub struct Replay {
    /// All successful answers to calls that change something, in the order in which they were sent.
    pub acknowledgements: Vec<Acknowledgement>,
    /// All removals of blobs, in their order.
    pub removals: Vec<Removal>,
}

/// Goes through a trace, and notes what of a server's `folder` was on disk whenever something relied on it.
///
/// # Panics
///
/// When the trace is not one.
pub fn replayed(trace: &str, folder: &Path, roles: Roles) -> Replay {
    let folder = folder.to_str().expect("a path that is text");
    let mut disk = Disk::default();
    let mut calls: BTreeMap<String, (String, usize)> = BTreeMap::new();
    // Those that are there, each with how often the log had been changed when it got its name.
    let mut blobs: BTreeMap<String, u64> = BTreeMap::new();
    let mut replay = Replay::default();
    for event in events(trace) {
        let path = event.path().filter(|path| path.starts_with(folder) && !(roles.is_ignored)(path));
        match (event.name, path) {
            ("write" | "writev" | "pwrite64" | "pwritev" | "pwritev2" | "ftruncate" | "fallocate", Some(path)) => {
                disk.changes(path);
            }
            ("fsync" | "fdatasync", Some(path)) => disk.syncs(&event, path),
            ("openat" | "open" | "creat", _) if event.ended == Some(true) && event.text.contains("O_CREAT") => {
                if let Some(path) = event.result_path()
                    && path.starts_with(folder)
                    && !(roles.is_ignored)(path)
                {
                    disk.has(path);
                }
            }
            ("mkdir" | "mkdirat", _) if event.ended == Some(true) => {
                for path in event.quoted().into_iter().filter(|path| path.starts_with(folder)) {
                    disk.has(path);
                }
            }
            ("rename" | "renameat" | "renameat2" | "link" | "linkat", _) if event.ended == Some(true) => {
                if let [from, to] = event.quoted()[..]
                    && to.starts_with(folder)
                {
                    disk.moves(from, to);
                    if (roles.is_blob)(to) {
                        let [changes, _] = disk.changes_of(roles.is_log);
                        blobs.insert(to.to_owned(), changes);
                    }
                }
            }
            ("unlink" | "unlinkat", _) => {
                for path in event.quoted() {
                    if event.begins && path.starts_with(folder) && (roles.is_blob)(path) {
                        replay.removals.push(removal(path, &disk, &blobs, roles));
                    }
                    if event.ended == Some(true) {
                        disk.forgets(path);
                        blobs.remove(path);
                    }
                }
            }
            ("read" | "readv" | "recvfrom" | "recvmsg", None) if event.ended.is_some() => {
                if let (Some(connection), Some(call)) = (event.path(), event.call()) {
                    calls.insert(connection.to_owned(), (call.to_owned(), event.line));
                }
            }
            ("write" | "writev" | "sendto" | "sendmsg", None)
                if event.begins && event.text.contains("\"HTTP/1.1 2") =>
            {
                let known = event.path().and_then(|connection| calls.remove(connection));
                let (call, received) = known.unwrap_or_default();
                if !call.starts_with("GET ") && !call.starts_with("HEAD ") {
                    replay.acknowledgements.push(Acknowledgement { call, received, unsynced: disk.unsynced() });
                }
            }
            _ => {}
        }
    }
    replay
}

/// A removal that begins now.
fn removal(path: &str, disk: &Disk, blobs: &BTreeMap<String, u64>, roles: Roles) -> Removal {
    let mut unsynced = disk.unsynced();
    unsynced.remove(path);
    let [_, on_disk] = disk.changes_of(roles.is_log);
    let unnamed = blobs.iter().filter(|(blob, changes)| blob.as_str() != path && on_disk <= **changes);
    Removal { path: path.to_owned(), unsynced, unnamed: unnamed.map(|(blob, _)| blob.clone()).collect() }
}

/// The trace of a server that omits some of the calls of this one, from a line on. `missing` chooses them by the name
/// of the call and the file of its first argument.
pub fn without(trace: &str, from: usize, missing: impl Fn(&str, &str) -> bool) -> String {
    let is_missing = |line: &str| {
        let call = line.split_once(' ').map_or("", |(_, call)| call.trim_start());
        let name = call.split_once('(').map_or("", |(name, _)| name);
        open_on(call).is_some_and(|path| missing(name, path))
    };
    // What is left of a call that another thread has interrupted has no beginning, and counts for nothing.
    let made = trace.lines().enumerate().filter(|(number, line)| *number < from || !is_missing(line));
    made.map(|(_, line)| line).collect::<Vec<_>>().join("\n")
}

/// Whether a call of this name syncs.
pub fn is_sync(name: &str) -> bool {
    matches!(name, "fsync" | "fdatasync")
}

/// The beginning of a system call, its end, or both.
#[derive(Clone, Debug)]
struct Event<'a> {
    line: usize,
    thread: &'a str,
    name: &'a str,
    begins: bool,
    /// With whether it succeeded.
    ended: Option<bool>,
    /// The call with its arguments and, at the end, its result, as far as the line has them.
    text: String,
}

impl Event<'_> {
    /// What the first argument, a descriptor, is open on.
    fn path(&self) -> Option<&str> {
        open_on(&self.text)
    }

    /// What the descriptor that is its result is open on.
    fn result_path(&self) -> Option<&str> {
        self.text.rsplit_once(" = ")?.1.split_once('<')?.1.strip_suffix('>')
    }

    /// All arguments that are texts.
    fn quoted(&self) -> Vec<&str> {
        self.text.split('"').skip(1).step_by(2).collect()
    }

    /// Method and path, if what was read begins as a call does.
    fn call(&self) -> Option<&str> {
        let read = self.text.split_once('"')?.1;
        let is_call =
            ["GET /", "HEAD /", "POST /", "PUT /", "DELETE /", "PATCH /"].iter().any(|start| read.starts_with(start));
        let end = read.match_indices([' ', '"', '?', '\\']).nth(1).filter(|_| is_call)?.0;
        read.get(..end)
    }
}

/// What the first argument of a call, a descriptor, is open on.
fn open_on(call: &str) -> Option<&str> {
    let (descriptor, rest) = call.split_once('(')?.1.split_once('<')?;
    descriptor.bytes().all(|byte| byte.is_ascii_digit()).then(|| rest.split_once('>').map(|(path, _)| path))?
}

/// The lines of a trace, those of calls that other threads interrupted put together.
fn events(trace: &str) -> Vec<Event<'_>> {
    let mut begun: BTreeMap<&str, String> = BTreeMap::new();
    let mut events = Vec::new();
    for (number, line) in trace.lines().enumerate() {
        let (thread, rest) = line.split_once(' ').expect("a line begins with a thread");
        let rest = rest.trim_start();
        if rest.starts_with("+++") || rest.starts_with("---") {
            continue;
        }
        let (begins, text) = match rest.strip_prefix("<... ") {
            None => (true, rest.to_owned()),
            Some(resumed) => {
                let Some(before) = begun.remove(thread) else { continue };
                let (_, after) = resumed.split_once(" resumed>").expect("a call that goes on");
                (false, before + after)
            }
        };
        let name = match rest.strip_prefix("<... ") {
            None => rest.split_once('(').map_or("", |(name, _)| name),
            Some(resumed) => resumed.split_once(' ').map_or("", |(name, _)| name),
        };
        if let Some(unfinished) = text.strip_suffix(" <unfinished ...>") {
            begun.insert(thread, unfinished.to_owned());
            events.push(Event { line: number, thread, name, begins, ended: None, text: unfinished.to_owned() });
        } else {
            let succeeded = text.rsplit_once(" = ").is_some_and(|(_, result)| !result.starts_with('-'));
            events.push(Event { line: number, thread, name, begins, ended: Some(succeeded), text });
        }
    }
    events
}

/// What of a folder is on disk.
#[derive(Clone, Debug, Default)]
struct Disk {
    /// Changes of each file and folder, and how many of them are on disk.
    paths: BTreeMap<String, [u64; 2]>,
    /// How many changes there were when a sync began, by thread.
    begun: BTreeMap<String, u64>,
}

impl Disk {
    fn changes(&mut self, path: &str) {
        self.paths.entry(path.to_owned()).or_default()[0] += 1;
    }

    fn syncs(&mut self, event: &Event<'_>, path: &str) {
        let Some([changes, on_disk]) = self.paths.get_mut(path) else { return };
        if event.begins {
            self.begun.insert(event.thread.to_owned(), *changes);
        }
        if let Some(succeeded) = event.ended {
            let begun = self.begun.remove(event.thread);
            if let Some(begun) = begun.filter(|_| succeeded) {
                *on_disk = begun.max(*on_disk);
            }
        }
    }

    /// There is a file or folder of this name, which may be new.
    fn has(&mut self, path: &str) {
        if !self.paths.contains_key(path) {
            self.paths.insert(path.to_owned(), [0, 0]);
            self.changes(parent(path));
        }
    }

    fn moves(&mut self, from: &str, to: &str) {
        let state = self.paths.remove(from).unwrap_or_default();
        self.paths.insert(to.to_owned(), state);
        self.changes(parent(to));
    }

    fn forgets(&mut self, path: &str) {
        self.paths.remove(path);
    }

    /// Changes of all files of a kind, and how many of them are on disk.
    fn changes_of(&self, is_one: fn(&str) -> bool) -> [u64; 2] {
        let found = self.paths.iter().filter(|(path, _)| is_one(path));
        found.fold([0_u64; 2], |sums, (_, counts)| [sums[0] + counts[0], sums[1] + counts[1]])
    }

    fn unsynced(&self) -> BTreeSet<String> {
        self.paths.iter().filter(|(_, [changes, on_disk])| on_disk < changes).map(|(path, _)| path.clone()).collect()
    }
}

fn parent(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(parent, _)| parent)
}
