//! The demo on a terminal, where people start it.

use std::fs::File;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::OpenOptionsExt;
use std::process::{Child, ExitStatus};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use nix::fcntl::OFlag;
use nix::pty::{grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::support::Folder;

/// Longest time that a demo may take for anything before it counts as stuck.
const TIMEOUT: Duration = Duration::from_secs(120);

/// A demo whose standard input, output and error are a terminal; killed with the value.
struct Demo {
    process: Child,
    pieces: Receiver<Vec<u8>>,
    /// What it has written so far.
    text: String,
}

impl Demo {
    fn start(folder: &Folder, options: &[&str]) -> Self {
        // Neither end is handed on to the processes of other tests, which would keep the terminal open.
        let mut master = posix_openpt(OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let slave = || {
            let mut file = File::options();
            file.read(true).write(true).custom_flags(OFlag::O_NOCTTY.bits()).open(ptsname_r(&master).unwrap()).unwrap()
        };
        let words = ["demo", "--scene", "scene.json", "--size", "12x8", "--spp", "4"];
        let mut command = folder.command(&[&words[..], options].concat());
        command.env("TERM", "xterm").stdin(slave()).stdout(slave()).stderr(slave());
        let process = command.spawn().unwrap();
        // It holds the terminal's other end open.
        drop(command);
        let (sender, pieces) = mpsc::channel();
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            // Reading fails when the last process has let go of the terminal.
            while let Ok(bytes @ 1..) = master.read(&mut buffer) {
                if sender.send(buffer[..bytes].to_vec()).is_err() {
                    return;
                }
            }
        });
        Self { process, pieces, text: String::new() }
    }

    /// Takes in what it writes; false when it has let go of the terminal.
    #[track_caller]
    fn reads_more(&mut self, deadline: Instant) -> bool {
        match self.pieces.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            Ok(piece) => self.text.push_str(&String::from_utf8_lossy(&piece)),
            Err(RecvTimeoutError::Disconnected) => return false,
            Err(RecvTimeoutError::Timeout) => panic!("nothing more comes: {}", self.text),
        }
        true
    }

    /// Waits for a line with this text; returns the word that follows it.
    #[track_caller]
    fn word_after(&mut self, text: &str) -> String {
        let deadline = Instant::now() + TIMEOUT;
        loop {
            if let Some((_, rest)) = self.text.split_once(text)
                && let Some((line, _)) = rest.split_once('\n')
            {
                return line.split_whitespace().next().unwrap().to_owned();
            }
            assert!(self.reads_more(deadline), "it ended without {text:?}: {}", self.text);
        }
    }

    /// Waits for its end; returns how it ended and all that it wrote.
    #[track_caller]
    fn end(mut self) -> (ExitStatus, String) {
        let deadline = Instant::now() + TIMEOUT;
        while self.reads_more(deadline) {}
        (self.process.wait().unwrap(), std::mem::take(&mut self.text))
    }
}

impl Drop for Demo {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The first line of what a server answers when it is asked for its page.
fn answer(address: &str) -> String {
    let host = address.strip_prefix("http://").unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    stream.set_read_timeout(Some(TIMEOUT)).unwrap();
    write!(stream, "GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut text = Vec::new();
    stream.read_to_end(&mut text).unwrap();
    String::from_utf8_lossy(&text).lines().next().unwrap_or_default().to_owned()
}

#[test]
fn on_a_terminal_the_page_of_the_demo_stays_open_until_it_is_interrupted() {
    let folder = Folder::new();
    let mut demo = Demo::start(&folder, &[]);
    let address = demo.word_after("The farm's page: ");
    let page = demo.word_after("The page stays open until Ctrl-C: ");
    assert!(page.starts_with(&address), "{page}");
    assert!(folder.path("demo-output/demo.exr").is_file(), "the job has ended: {}", demo.text);
    assert_eq!(answer(&address), "HTTP/1.1 200 OK");
    assert!(demo.process.try_wait().unwrap().is_none(), "{}", demo.text);
    kill(Pid::from_raw(i32::try_from(demo.process.id()).unwrap()), Signal::SIGINT).unwrap();
    let (status, text) = demo.end();
    assert_eq!(status.code(), Some(0), "{text}");
    let goodbye = text.split_once("stays open").unwrap().1;
    assert!(goodbye.contains("For a farm that stays run `clerestory farm`"), "{text}");
}

#[test]
fn on_a_terminal_a_demo_that_is_told_to_exit_ends_with_its_job() {
    let folder = Folder::new();
    let (status, text) = Demo::start(&folder, &["--exit"]).end();
    assert_eq!(status.code(), Some(0), "{text}");
    assert!(text.contains("The farm's page: ") && !text.contains("stays open"), "{text}");
    assert!(folder.path("demo-output/demo.exr").is_file(), "{text}");
}
