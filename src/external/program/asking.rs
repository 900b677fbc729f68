//! Requests to a program, asked again where a copy of it fails.

use super::description::Description;
use super::health::Health;
use super::pool::{Pool, ProgramRequest};
use super::worker::Trouble;
use crate::progress::is_hastened;
use crate::twin::SimulationError;
use std::sync::atomic::{AtomicU64, Ordering};

/// Copies of a program, what it says it is, and how well it answers.
pub(super) struct Asker {
    pub pool: Pool,
    pub description: Description,
    pub health: Health,
    retries: usize,
    /// Number of the next request; the first is 1.
    requests: AtomicU64,
}

/// Why there is no answer.
pub(super) enum Unanswered {
    /// Nothing will be answered any more.
    Broken(SimulationError),
    /// Each copy that was asked ended or was late.
    Gone(String),
}

/// The first line of an answer.
pub(super) enum Reply<T> {
    /// An answer, and the number of bytes behind the line.
    Good(T, usize),
    /// The program says that it cannot go on.
    Error(String),
}

impl Asker {
    pub fn new(pool: Pool, description: Description, retries: usize) -> Self {
        Self {
            pool,
            description,
            health: Health::default(),
            retries,
            requests: AtomicU64::new(1),
        }
    }

    /// Returns the number of the next request.
    pub fn next_id(&self) -> u64 {
        self.requests.fetch_add(1, Ordering::Relaxed)
    }

    /// Returns a problem behind the name of the program.
    pub fn named(&self, problem: &str) -> String {
        format!("`{}` {problem}", self.pool.command())
    }

    /// One request at θ, asked of fresh copies until one answers or the attempts are used up; also the bytes behind the answer.
    pub fn ask<T>(
        &self,
        theta: &[f64],
        request: &ProgramRequest,
        read: impl Fn(&str) -> Result<Reply<T>, String>,
    ) -> Result<(T, Vec<u8>), SimulationError> {
        self.ask_up_to(self.attempts(), request, read)
            .map_err(|problem| self.lost(theta, problem))
    }

    /// Number of copies that are asked, one after the other.
    pub fn attempts(&self) -> usize {
        self.retries + 1
    }

    /// Counts a run at θ as failed; returns what that costs.
    pub fn lost(&self, theta: &[f64], problem: Unanswered) -> SimulationError {
        match problem {
            Unanswered::Broken(error) => error,
            Unanswered::Gone(problem) => self.health.failed(theta, problem),
        }
    }

    /// As [`ask`](Self::ask), so many times at most; a run that is lost is not yet counted as failed.
    pub fn ask_up_to<T>(
        &self,
        attempts: usize,
        request: &ProgramRequest,
        read: impl Fn(&str) -> Result<Reply<T>, String>,
    ) -> Result<(T, Vec<u8>), Unanswered> {
        let broken = |problem| Unanswered::Broken(self.health.broken(problem));
        let read = |line: &str| {
            read(line).map(|reply| match reply {
                Reply::Good(answer, bytes) => (Ok(answer), bytes),
                Reply::Error(text) => (Err(text), 0),
            })
        };
        let mut attempt = 0;
        loop {
            // A copy that was ended as the work is to stop is no failure.
            if is_hastened() {
                return Err(Unanswered::Broken(SimulationError::stopped()));
            }
            attempt += 1;
            let fresh = attempt > 1;
            match (self.pool).ask(request, fresh, &self.description, read) {
                Ok((Ok(answer), bytes)) => return Ok((answer, bytes)),
                Ok((Err(text), _)) => {
                    return Err(broken(self.named(&format!("says: {text}"))));
                }
                Err(Trouble::Nonsense(problem)) => return Err(broken(self.named(&problem))),
                Err(Trouble::Gone(_)) if attempt < attempts => {
                    self.health.check().map_err(Unanswered::Broken)?;
                }
                Err(Trouble::Gone(_)) if is_hastened() => {}
                Err(Trouble::Gone(copy)) => {
                    return Err(Unanswered::Gone(self.named(&copy.text(attempt))));
                }
            }
        }
    }
}
