//! Copies of a program, lent to one thread at a time.

use super::super::lending::Lending;
use super::description::Description;
use super::protocol::{self, LONGEST_DESCRIPTION};
use super::worker::{LostCopy, ProgramCommand, Trouble, Worker};
use crate::storage::untrusted::excerpt;
use std::time::{Duration, Instant};

/// Time that a program gets to end once its standard input is closed.
const GRACE: Duration = Duration::from_millis(500);

/// A request, and the longest line that answers it, in bytes.
pub(super) struct ProgramRequest {
    pub bytes: Vec<u8>,
    pub longest: usize,
}

/// Starts workers when they are needed, keeps the idle ones, and ends all with itself.
pub(super) struct Pool {
    command: ProgramCommand,
    /// For one answer, the description included.
    timeout: Duration,
    workers: Lending<Worker>,
}

impl Pool {
    /// At most `most` workers.
    pub fn new(command: ProgramCommand, timeout: Duration, most: usize) -> Self {
        Self {
            command,
            timeout,
            workers: Lending::new(most),
        }
    }

    /// The command that starts a worker.
    pub fn command(&self) -> &ProgramCommand {
        &self.command
    }

    /// Number of workers, at most.
    pub fn most(&self) -> usize {
        self.workers.most()
    }

    /// Takes in a worker that was started elsewhere.
    pub fn adopt(&self, worker: Worker) {
        self.workers.adopt(worker);
    }

    /// Sends a request to a worker that has said to be `expected`, and reads the line of its answer with `read`, which says how many bytes
    /// are behind the line. A worker that gave no good answer is ended; `read`'s error is nonsense.
    pub fn ask<T>(
        &self,
        request: &ProgramRequest,
        fresh: bool,
        expected: &Description,
        read: impl FnOnce(&str) -> Result<(T, usize), String>,
    ) -> Result<(T, Vec<u8>), Trouble> {
        // Some programs end after an answer; that is no failure of the next one.
        let (idle, place) = self.workers.take(fresh, Worker::lives);
        let mut worker = match idle {
            Some(worker) => worker,
            None => {
                let (worker, found) = introduce(&self.command, self.timeout)
                    .map_err(|error| Trouble::Gone(LostCopy::not_started(&error)))??;
                if found != *expected {
                    let problem = "describes itself otherwise than when it was first started; give the same description each time";
                    return Err(Trouble::Nonsense(problem.into()));
                }
                worker
            }
        };
        let answer = worker.ask(request.bytes.clone(), request.longest, self.timeout)?;
        let (read, count) =
            read(&answer).map_err(|problem| nonsense(&answer, &problem, &worker))?;
        let bytes = match count {
            0 => vec![],
            count => worker.bytes(count, self.timeout)?,
        };
        place.give_back(worker);
        Ok((read, bytes))
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        let idle = self.workers.idle();
        idle.iter_mut().for_each(Worker::dismiss);
        let by = Instant::now() + GRACE;
        idle.iter_mut().for_each(|worker| worker.stop(by));
    }
}

/// Starts a worker and asks what it is; start and description together take at most `timeout`.
pub(super) fn introduce(
    command: &ProgramCommand,
    timeout: Duration,
) -> std::io::Result<Result<(Worker, Description), Trouble>> {
    let mut worker = Worker::start(command)?;
    let answer = worker.ask(
        protocol::describe().into_bytes(),
        LONGEST_DESCRIPTION,
        timeout,
    );
    Ok(answer.and_then(|line| match Description::parse(&line) {
        Ok(description) => Ok((worker, description)),
        Err(problem) => Err(nonsense(&line, &problem, &worker)),
    }))
}

fn nonsense(line: &str, problem: &str, worker: &Worker) -> Trouble {
    Trouble::Nonsense(format!(
        "answered \"{}\": {problem}{}",
        excerpt(line),
        worker.last_words()
    ))
}
