//! The command that starts a program, and one running copy of it, asked line by line, with numbers behind a line.

use super::running::{Running, locked};
use crate::storage::files::with_remedy;
use crate::storage::untrusted::{excerpt, one_line};
use crate::study::StudyError;
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Bytes of standard error that are kept for messages.
const KEPT: usize = 2048;
/// Bytes that are read at once, and how many such pieces may wait to be looked at.
const PIECE: usize = 1 << 16;
const PIECES: usize = 4;
/// Longest end of standard error that a message quotes, in characters.
const LAST_WORDS: usize = 400;
/// Time that an ending program gets for its status and last words.
const LAST_BREATH: Duration = Duration::from_millis(300);

/// A program and its arguments. No shell is run: `*`, `|`, `$` and the like mean themselves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ProgramCommand {
    program: String,
    arguments: Vec<String>,
}

impl ProgramCommand {
    /// The program and its arguments, each as it is.
    pub fn new<S: Into<String>>(program: &str, arguments: impl IntoIterator<Item = S>) -> Self {
        Self {
            program: program.into(),
            arguments: arguments.into_iter().map(Into::into).collect(),
        }
    }

    pub(super) fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        command.args(&self.arguments);
        // Ctrl-C is for us: we end the program.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command
    }

    /// Creates the error of a program that the system cannot start.
    pub(super) fn not_started(&self, error: &std::io::Error) -> StudyError {
        StudyError::Simulator(format!(
            "the program `{self}` cannot be started: {}",
            match Path::new(&self.program).is_dir() {
                true => "it is a folder; name the program in it".into(),
                false => with_remedy(error),
            }
        ))
    }

    /// Creates the error of a program that does not describe itself.
    pub(super) fn not_described(&self, problem: &str) -> StudyError {
        StudyError::Simulator(format!(
            "the program `{self}` {problem}; asked to describe itself, it must answer one line of JSON with name, parameters, outputs and record, within the time-out"
        ))
    }
}

/// The words as they would be typed; those with spaces or quotes stand in quotes.
impl std::fmt::Display for ProgramCommand {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let plain = |c: char| c.is_alphanumeric() || "_-./=:,+@%".contains(c);
        let word = |word: &str| match !word.is_empty() && word.chars().all(plain) {
            true => word.to_owned(),
            false => format!("'{}'", word.replace('\'', r"'\''")),
        };
        f.write_str(&word(&self.program))?;
        (self.arguments.iter()).try_for_each(|argument| write!(f, " {}", word(argument)))
    }
}

/// Words for a copy that is late, by which the command line knows it.
pub(crate) const LATE: &str = "gave no answer within";
/// Remedies of what a copy did, behind the words for that.
const IF_LATE: &str = "; flush each answer, or allow more time for one";
const IF_ENDED: &str = "; it must answer each request until its standard input ends";

/// Why a worker gave no answer.
#[derive(Debug)]
pub(super) enum Trouble {
    /// It ended or took too long; another copy may do.
    Gone(LostCopy),
    /// It said what no other copy will say better.
    Nonsense(String),
}

impl Trouble {
    /// Returns the problem in words that follow the program's name; whoever asks has a remedy for a copy that is gone.
    pub fn text(self) -> String {
        match self {
            Self::Gone(LostCopy { did, words, .. }) => did + &words,
            Self::Nonsense(text) => text,
        }
    }
}

/// A copy that gives no answer any more.
#[derive(Debug)]
pub(super) struct LostCopy {
    did: String,
    remedy: &'static str,
    /// The end of its standard error, as that of a message.
    words: String,
}

impl LostCopy {
    /// A copy that the system did not start.
    pub fn not_started(error: &io::Error) -> Self {
        Self {
            did: format!("did not start again: {}", with_remedy(error)),
            remedy: "",
            words: String::new(),
        }
    }

    /// Returns what the last of so many copies did, and the remedy, in words that follow the program's name.
    pub fn text(&self, attempts: usize) -> String {
        let Self { did, remedy, words } = self;
        match attempts {
            1 => format!("{did}{remedy}{words}"),
            _ => format!("{did} (attempt {attempts}){remedy}{words}"),
        }
    }
}

/// A child process whose standard output and standard error are always being read, so that it never waits for us.
///
/// Reading, writing and draining have a thread each: pipes know no time-outs, and a program that neither reads nor writes
/// must not hold up more than its own request. The threads end with the pipes.
pub(super) struct Worker {
    child: Running,
    /// Dropped, it closes the program's standard input.
    requests: Option<Sender<Vec<u8>>>,
    pieces: Receiver<Vec<u8>>,
    /// Read, and not yet part of an answer.
    waiting: Vec<u8>,
    words: Arc<Mutex<Vec<u8>>>,
    drain: JoinHandle<()>,
}

impl Worker {
    /// Starts the program.
    pub fn start(command: &ProgramCommand) -> io::Result<Self> {
        let mut command = command.command();
        let child = Running::start(
            (command.stdin(Stdio::piped()))
                .stdout(Stdio::piped())
                .stderr(Stdio::piped()),
        )?;
        let missing = || io::Error::other("the system gave no pipe");
        let pipes =
            |child: &mut Child| (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(stdin), Some(stdout), Some(stderr)) = child.with(pipes) else {
            return Err(missing());
        };
        let (requests, to_write) = channel::<Vec<u8>>();
        let (read, pieces) = sync_channel(PIECES);
        let words = Arc::new(Mutex::new(Vec::new()));
        let kept = words.clone();
        thread::spawn(move || write_all(stdin, &to_write));
        thread::spawn(move || read_all(stdout, &read));
        let drain = thread::spawn(move || drain(stderr, &kept));
        Ok(Self {
            child,
            requests: Some(requests),
            pieces,
            waiting: Vec::new(),
            words,
            drain,
        })
    }

    /// Sends a request and waits for a line: at most `time`, at most `longest` bytes.
    pub fn ask(
        &mut self,
        request: Vec<u8>,
        longest: usize,
        time: Duration,
    ) -> Result<String, Trouble> {
        let deadline = Instant::now() + time;
        let sent = self.requests.as_ref().map(|to| to.send(request));
        if !matches!(sent, Some(Ok(()))) {
            return Err(self.ended());
        }
        let mut seen = 0;
        loop {
            // What was looked at before holds no end of line.
            if let Some(end) = self.waiting[seen..].iter().position(|b| *b == b'\n') {
                let rest = self.waiting.split_off(seen + end + 1);
                let line = std::mem::replace(&mut self.waiting, rest);
                if line.len() > longest {
                    return Err(too_long(longest, &line));
                }
                seen = 0;
                let text = String::from_utf8(line).map_err(|_| {
                    Trouble::Nonsense("answered with bytes that are no UTF-8; write answers alone to standard output, in UTF-8".into())
                })?;
                // Blank lines say nothing.
                if text.trim().is_empty() {
                    continue;
                }
                return Ok(text);
            }
            seen = self.waiting.len();
            if seen > longest {
                return Err(too_long(longest, &self.waiting));
            }
            self.receive(deadline, time)?;
        }
    }

    /// Waits for the bytes behind a line: so many, at most `time`.
    pub fn bytes(&mut self, count: usize, time: Duration) -> Result<Vec<u8>, Trouble> {
        let deadline = Instant::now() + time;
        while self.waiting.len() < count {
            self.receive(deadline, time)?;
        }
        let rest = self.waiting.split_off(count);
        Ok(std::mem::replace(&mut self.waiting, rest))
    }

    /// Waits for a piece of what the program writes.
    fn receive(&mut self, deadline: Instant, time: Duration) -> Result<(), Trouble> {
        let left = deadline.saturating_duration_since(Instant::now());
        match self.pieces.recv_timeout(left) {
            Ok(piece) => self.waiting.extend(piece),
            Err(RecvTimeoutError::Disconnected) => return Err(self.ended()),
            Err(RecvTimeoutError::Timeout) => return Err(self.late(time)),
        }
        // Blank lines without end are no answer either.
        if Instant::now() > deadline {
            return Err(self.late(time));
        }
        Ok(())
    }

    /// The trouble of a program that took longer than `time`.
    fn late(&self, time: Duration) -> Trouble {
        Trouble::Gone(LostCopy {
            did: format!("{LATE} {} s", time.as_secs_f64()),
            remedy: IF_LATE,
            words: self.last_words(),
        })
    }

    /// Returns whether the process still runs.
    pub fn lives(&mut self) -> bool {
        matches!(self.child.ended(), Ok(None))
    }

    /// Returns the last lines of standard error, as the end of a message; empty if there are none.
    pub fn last_words(&self) -> String {
        let words = locked(&self.words);
        match last_words(&words) {
            text if text.is_empty() => text,
            text => format!("; its standard error ends: {text}"),
        }
    }

    /// The trouble of a program that closed its pipes, once it is gone.
    fn ended(&mut self) -> Trouble {
        let by = Instant::now() + LAST_BREATH;
        while self.lives() && Instant::now() < by {
            thread::sleep(Duration::from_millis(2));
        }
        let how = match self.child.ended() {
            Ok(Some(status)) => format!("ended ({status})"),
            _ => "closed its standard output".to_owned(),
        };
        self.stop(Instant::now());
        while !self.drain.is_finished() && Instant::now() < by {
            thread::sleep(Duration::from_millis(2));
        }
        Trouble::Gone(LostCopy {
            did: format!("{how} without an answer"),
            remedy: IF_ENDED,
            words: self.last_words(),
        })
    }

    /// Closes the program's standard input: a hint to end.
    pub fn dismiss(&mut self) {
        self.requests = None;
    }

    /// Waits for the end until `by`, then enforces it. Nothing of the process is left.
    pub fn stop(&mut self, by: Instant) {
        self.dismiss();
        while self.lives() && Instant::now() < by {
            thread::sleep(Duration::from_millis(1));
        }
        self.child.end();
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.stop(Instant::now());
    }
}

fn too_long(longest: usize, line: &[u8]) -> Trouble {
    let start = excerpt(&String::from_utf8_lossy(&line[..line.len().min(PIECE)]));
    Trouble::Nonsense(format!(
        "answered with a line of more than {longest} bytes: \"{start}\"; write an answer a line, and errors in few words"
    ))
}

/// Writes requests until there are no more, or nobody reads them.
fn write_all(mut to: impl Write, requests: &Receiver<Vec<u8>>) {
    for request in requests {
        if to.write_all(&request).and_then(|()| to.flush()).is_err() {
            return;
        }
    }
}

/// Hands on what is read, in pieces.
fn read_all(mut from: impl Read, to: &SyncSender<Vec<u8>>) {
    let mut piece = vec![0; PIECE];
    while let Some(length) = read(&mut from, &mut piece) {
        if to.send(piece[..length].to_vec()).is_err() {
            return;
        }
    }
}

/// Reads to the end and keeps the last bytes.
fn drain(mut from: impl Read, kept: &Mutex<Vec<u8>>) {
    let mut piece = vec![0; PIECE];
    while let Some(length) = read(&mut from, &mut piece) {
        let mut kept = locked(kept);
        kept.extend_from_slice(&piece[length.saturating_sub(KEPT)..length]);
        let surplus = kept.len().saturating_sub(KEPT);
        kept.drain(..surplus);
    }
}

/// Bytes read; `None` at the end.
fn read(from: &mut impl Read, piece: &mut [u8]) -> Option<usize> {
    loop {
        match from.read(piece) {
            Ok(0) => return None,
            Ok(length) => return Some(length),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return None,
        }
    }
}

/// The end of what a program wrote to standard error, in one line; its lines are parted by ` | `.
pub(super) fn last_words(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let lines: Vec<String> = (text.lines().map(|line| one_line(line, usize::MAX)))
        .filter(|line| !line.is_empty())
        .collect();
    let joined = lines.join(" | ");
    let surplus = joined.chars().count().saturating_sub(LAST_WORDS);
    match joined.char_indices().nth(surplus) {
        Some((from, _)) if surplus > 0 => format!("… {}", &joined[from..]),
        _ => joined,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_lost_copy_did_comes_with_a_remedy() {
        let ended = || LostCopy {
            did: "ended (exit status: 0) without an answer".into(),
            remedy: IF_ENDED,
            words: "; its standard error ends: no".into(),
        };
        assert_eq!(
            ended().text(3),
            "ended (exit status: 0) without an answer (attempt 3); it must answer each request until its standard input ends; its standard error ends: no"
        );
        assert!(!ended().text(1).contains("attempt"));
        // Asked to describe itself, it is told what to describe.
        let described = Trouble::Gone(ended()).text();
        assert!(!described.contains(IF_ENDED), "{described}");
        let long = too_long(9, b"Loading the model").text();
        assert!(
            long.ends_with("; write an answer a line, and errors in few words"),
            "{long}"
        );
    }

    #[test]
    fn pieces_are_short_and_in_one_line() {
        assert_eq!(
            last_words(b"Traceback:\n  File x\n\nValueError: no\n"),
            "Traceback: | File x | ValueError: no"
        );
        let long = last_words(format!("{}end", "ö".repeat(999)).as_bytes());
        assert!(long.starts_with("… ö") && long.ends_with("end"), "{long}");
        assert_eq!(last_words(&[0xff, 0xfe]), "\u{fffd}\u{fffd}");
    }
}
