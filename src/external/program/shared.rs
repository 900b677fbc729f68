//! Exchanges that passes share: while the program computes, others ask, and what has come together is its next request.
//!
//! Nobody waits for anybody who might not come: whoever asks while no exchange is under way begins one. The numbers of a pass do not depend
//! on who shares an exchange with it, since each point is computed by itself; that is tried out before the first shared one.

use super::asking::{Asker, Unanswered};
use super::frame::{self, LONGEST_LINE, PointTable};
use super::inside::ServedMethod;
use super::pool::ProgramRequest;
use super::running::locked;
use crate::twin::SimulationError;
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, OnceLock, PoisonError};
use std::thread;

/// Points of the trial of whether each is computed by itself, at least: wider than the blocks in which processors and libraries take numbers.
const TRIED: usize = 96;

/// A method at the points of one caller.
pub(super) struct PointsAsked {
    pub method: ServedMethod,
    /// Numbers of a point's answer.
    pub rows: usize,
    pub table: PointTable,
    /// θ of the caller, of several passes of the first.
    pub theta: Vec<f64>,
}

/// Rows of numbers, one a point.
type Numbers = Result<Vec<f64>, SimulationError>;

/// Callers of one program, and the exchanges that are under way.
pub(super) struct Exchanges {
    asker: Arc<Asker>,
    queue: Mutex<Queue>,
    /// `true` where each point is computed by itself, whatever stands beside it.
    is_by_point: OnceLock<bool>,
}

#[derive(Default)]
struct Queue {
    waiting: VecDeque<Ticket>,
    /// Exchanges under way.
    busy: usize,
}

/// A question and where its caller waits.
struct Ticket {
    question: Arc<PointsAsked>,
    seat: Arc<Seat>,
}

/// Where a caller waits for what comes next.
#[derive(Default)]
struct Seat {
    turn: Mutex<Option<Turn>>,
    called: Condvar,
}

enum Turn {
    Answered(Numbers),
    /// The next exchange is this caller's to make.
    Leads(Ticket),
}

impl Seat {
    fn call(&self, turn: Turn) {
        *locked(&self.turn) = Some(turn);
        self.called.notify_one();
    }

    fn wait(&self) -> Turn {
        let mut turn = locked(&self.turn);
        loop {
            match turn.take() {
                Some(turn) => return turn,
                None => turn = (self.called.wait(turn)).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }
}

/// An exchange under way: whatever becomes of it, nobody is left waiting.
struct Lead<'e> {
    exchanges: &'e Exchanges,
    /// Those that wait for their part of it.
    others: Vec<Arc<Seat>>,
}

impl Drop for Lead<'_> {
    fn drop(&mut self) {
        for seat in self.others.drain(..) {
            let error = SimulationError::fatal("the exchange with the program was given up");
            seat.call(Turn::Answered(Err(error)));
        }
        let mut queue = locked(&self.exchanges.queue);
        match queue.waiting.pop_front() {
            Some(next) => {
                let seat = next.seat.clone();
                seat.call(Turn::Leads(next));
            }
            None => queue.busy -= 1,
        }
    }
}

impl Exchanges {
    pub fn new(asker: Arc<Asker>) -> Self {
        Self {
            asker,
            queue: Mutex::default(),
            is_by_point: OnceLock::new(),
        }
    }

    /// Asks a question, together with those of other threads that wait.
    pub fn ask(&self, question: &Arc<PointsAsked>) -> Numbers {
        let seat = Arc::new(Seat::default());
        let ticket = Ticket {
            question: question.clone(),
            seat: seat.clone(),
        };
        let mut queue = locked(&self.queue);
        let first = if queue.busy < self.asker.pool.most() {
            queue.busy += 1;
            drop(queue);
            ticket
        } else {
            queue.waiting.push_back(ticket);
            drop(queue);
            match seat.wait() {
                Turn::Answered(answer) => return answer,
                Turn::Leads(ticket) => ticket,
            }
        };
        self.lead(&first.question)
    }

    /// Makes an exchange for a question and for all that wait; returns the answer to the first.
    fn lead(&self, first: &Arc<PointsAsked>) -> Numbers {
        let mut lead = Lead {
            exchanges: self,
            others: vec![],
        };
        // Those that were just answered come again, if they are let.
        thread::yield_now();
        let mut questions = vec![first.clone()];
        if self.may_share(first) {
            let mut queue = locked(&self.queue);
            let (own, others) = (queue.waiting.drain(..))
                .partition(|ticket| ticket.question.method == first.method);
            queue.waiting = others;
            let own: VecDeque<Ticket> = own;
            for ticket in own {
                questions.push(ticket.question);
                lead.others.push(ticket.seat);
            }
        }
        let mut answers = self.answers(&questions).into_iter();
        let own = answers.next();
        for (seat, answer) in lead.others.drain(..).zip(answers) {
            seat.call(Turn::Answered(answer));
        }
        own.unwrap_or_else(|| Err(SimulationError::fatal("an exchange without an answer")))
    }

    /// Answers to questions about one method, in one exchange where that works: a copy that ends or is late takes nobody along who did not
    /// ask for it.
    fn answers(&self, questions: &[Arc<PointsAsked>]) -> Vec<Numbers> {
        if let [one] = questions {
            return vec![self.alone(one)];
        }
        let tables: Vec<&PointTable> = questions.iter().map(|q| &q.table).collect();
        let (method, rows) = (questions[0].method, questions[0].rows);
        match self.exchange(1, method, rows, &tables) {
            Ok(numbers) => {
                let all = frame::parted(&numbers, &tables);
                all.into_iter().map(Ok).collect()
            }
            Err(_) => questions.iter().map(|one| self.alone(one)).collect(),
        }
    }

    fn alone(&self, question: &PointsAsked) -> Numbers {
        let PointsAsked { method, rows, .. } = *question;
        self.asker.health.check()?;
        (self.exchange(self.asker.attempts(), method, rows, &[&question.table]))
            .map_err(|problem| self.asker.lost(&question.theta, problem))
    }

    fn exchange(
        &self,
        attempts: usize,
        method: ServedMethod,
        rows: usize,
        tables: &[&PointTable],
    ) -> Result<Vec<f64>, Unanswered> {
        let id = self.asker.next_id();
        let request = ProgramRequest {
            bytes: frame::request(id, method, tables),
            longest: LONGEST_LINE,
        };
        let points = tables.iter().map(|table| table.points()).sum();
        let read = |line: &str| frame::reply(line, id, (rows, points));
        let ((), bytes) = self.asker.ask_up_to(attempts, &request, read)?;
        Ok(frame::numbers(&bytes))
    }

    /// Returns whether questions may share an exchange: whether this one's points get the same bits alone and many times side by side. A sum
    /// over points, or a product of matrices whose rounding depends on its size, fails that; then each caller has exchanges of its own.
    fn may_share(&self, question: &PointsAsked) -> bool {
        if let Some(known) = self.is_by_point.get() {
            return *known;
        }
        if locked(&self.queue).waiting.is_empty() {
            return false;
        }
        *self.is_by_point.get_or_init(|| {
            let points = question.table.points().max(1);
            let tables = vec![&question.table; TRIED.div_ceil(points) + 1];
            let ask =
                |tables: &[&PointTable]| self.exchange(1, question.method, question.rows, tables);
            let (Ok(alone), Ok(many)) = (ask(&tables[..1]), ask(&tables)) else {
                // The question itself will tell.
                return true;
            };
            let bits = |v: &f64| if v.is_nan() { u64::MAX } else { v.to_bits() };
            (frame::parted(&many, &tables).iter())
                .all(|own| own.iter().map(bits).eq(alone.iter().map(bits)))
        })
    }
}
