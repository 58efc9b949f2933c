//! What a server did with its files and its connections, call by call as `strace` saw it, and whether what it acknowledged was on disk.
//!
//! A file is on disk when a sync of it has succeeded that began after the last write to it had ended; a name when the same is so of its
//! folder since the name was made. At the moment when an answer to a call that changes something begins to be sent, everything in the
//! server's folder should be.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

/// What is traced: all ways to change files, to sync them, and to read and write connections.
const TRACED: &str = "openat,open,creat,mkdir,mkdirat,rename,renameat,renameat2,link,linkat,unlink,unlinkat,\
     write,writev,pwrite64,pwritev,pwritev2,ftruncate,fallocate,copy_file_range,sendfile,\
     fsync,fdatasync,read,readv,recvfrom,recvmsg,sendto,sendmsg";

/// The command under `strace`, which writes what it and its threads do to a file. Arguments can be added as to the command itself.
pub fn traced(command: &Command, trace: &Path) -> Command {
    let mut traced = Command::new("strace");
    traced.args(["-f", "-qq", "-y", "-s", "48", "-e", "signal=none", "-e"]).arg(format!("trace={TRACED}"));
    traced.arg("-o").arg(trace).arg("--").arg(command.get_program()).args(command.get_args());
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => traced.env(name, value),
            None => traced.env_remove(name),
        };
    }
    traced
}

/// An answer to a call that changes something.
#[derive(Clone, Debug)]
pub struct Acknowledgement {
    /// Method and path of the call.
    pub call: String,
    /// Files and folders that were not on disk when the answer began to be sent.
    pub unsynced: BTreeSet<String>,
}

/// All successful answers to calls that change something, in the order in which they were sent. Of what lies in `folder`, files that `ignored`
/// names need not be on disk, and only syncs of what `counted` names count.
///
/// # Panics
///
/// When the trace is not one.
pub fn acknowledgements(
    trace: &str,
    folder: &Path,
    ignored: impl Fn(&str) -> bool,
    counted: impl Fn(&str) -> bool,
) -> Vec<Acknowledgement> {
    let folder = folder.to_str().expect("a path that is text");
    let mut disk = Disk::default();
    let mut calls: BTreeMap<String, String> = BTreeMap::new();
    let mut acknowledgements = Vec::new();
    for event in events(trace) {
        let path = event.path().filter(|path| path.starts_with(folder) && !ignored(path));
        match (event.name, path) {
            ("write" | "writev" | "pwrite64" | "pwritev" | "pwritev2" | "ftruncate" | "fallocate", Some(path)) => {
                disk.changes(path);
            }
            ("fsync" | "fdatasync", Some(path)) if counted(path) => disk.syncs(&event, path),
            ("openat" | "open" | "creat", _) if event.ended == Some(true) && event.text.contains("O_CREAT") => {
                if let Some(path) = event.result_path().filter(|path| path.starts_with(folder) && !ignored(path)) {
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
                }
            }
            ("unlink" | "unlinkat", _) if event.ended == Some(true) => {
                event.quoted().into_iter().for_each(|path| disk.forgets(path));
            }
            ("read" | "readv" | "recvfrom" | "recvmsg", None) if event.ended.is_some() => {
                if let (Some(connection), Some(call)) = (event.path(), event.call()) {
                    calls.insert(connection.to_owned(), call.to_owned());
                }
            }
            ("write" | "writev" | "sendto" | "sendmsg", None)
                if event.begins && event.text.contains("\"HTTP/1.1 2") =>
            {
                let call = event.path().and_then(|connection| calls.remove(connection)).unwrap_or_default();
                if !call.starts_with("GET ") && !call.starts_with("HEAD ") {
                    acknowledgements.push(Acknowledgement { call, unsynced: disk.unsynced() });
                }
            }
            _ => {}
        }
    }
    acknowledgements
}

/// The beginning of a system call, its end, or both.
#[derive(Clone, Debug)]
struct Event<'a> {
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
        let (descriptor, rest) = self.text.split_once('(')?.1.split_once('<')?;
        descriptor.bytes().all(|byte| byte.is_ascii_digit()).then(|| rest.split_once('>').map(|(path, _)| path))?
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

/// The lines of a trace, those of calls that other threads interrupted put together.
fn events(trace: &str) -> Vec<Event<'_>> {
    let mut begun: BTreeMap<&str, String> = BTreeMap::new();
    let mut events = Vec::new();
    for line in trace.lines() {
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
            events.push(Event { thread, name, begins, ended: None, text: unfinished.to_owned() });
        } else {
            let succeeded = text.rsplit_once(" = ").is_some_and(|(_, result)| !result.starts_with('-'));
            events.push(Event { thread, name, begins, ended: Some(succeeded), text });
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

    fn unsynced(&self) -> BTreeSet<String> {
        self.paths.iter().filter(|(_, [changes, on_disk])| on_disk < changes).map(|(path, _)| path.clone()).collect()
    }
}

fn parent(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(parent, _)| parent)
}
