//! When failures of single runs mean that nothing works.

use super::running::locked;
use crate::twin::SimulationError;
use std::sync::{Mutex, MutexGuard};

/// Failed runs after which a program that has never answered counts as broken.
const NEVER: usize = 5;
/// Failed runs in a row, each at another θ, after which any program does. Repeated runs at one bad θ count once.
const IN_A_ROW: usize = 30;

/// Counts of successful and failed runs.
#[derive(Default)]
pub(super) struct Health(Mutex<State>);

#[derive(Default)]
struct State {
    worked: bool,
    failed: usize,
    in_a_row: usize,
    /// Where the last failure was.
    theta: Vec<f64>,
    /// Why nothing is tried any more.
    broken: Option<String>,
}

impl Health {
    pub fn check(&self) -> Result<(), SimulationError> {
        match &self.lock().broken {
            Some(reason) => Err(SimulationError::fatal(reason.clone())),
            None => Ok(()),
        }
    }

    /// A run was answered.
    pub fn worked(&self) {
        let mut state = self.lock();
        state.worked = true;
        state.in_a_row = 0;
    }

    /// A run at `theta` was given up; the error says whether that costs this run or all of them.
    pub fn failed(&self, theta: &[f64], reason: String) -> SimulationError {
        let mut state = self.lock();
        state.failed += 1;
        if state.in_a_row == 0 || state.theta != theta {
            state.in_a_row += 1;
            state.theta = theta.to_vec();
        }
        let (failed, in_a_row) = (state.failed, state.in_a_row);
        let hopeless = match state.worked {
            false if failed >= NEVER => format!("none of {failed} simulations worked"),
            true if in_a_row >= IN_A_ROW => format!("{in_a_row} simulations in a row failed"),
            _ => return SimulationError::Failed(reason.into()),
        };
        drop(state);
        self.broken(format!("{hopeless}: {reason}"))
    }

    /// Nothing will work from now on.
    pub fn broken(&self, reason: String) -> SimulationError {
        let reason = self.lock().broken.get_or_insert(reason).clone();
        SimulationError::fatal(reason)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        locked(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lost(health: &Health, theta: f64) -> bool {
        health.failed(&[theta], "it ended".into()).costs_one_run()
    }

    #[test]
    fn a_program_that_never_answered_is_broken_after_a_few_runs() {
        let health = Health::default();
        assert!((1..NEVER).all(|_| lost(&health, 1.0)));
        let error = health.failed(&[1.0], "it ended".into());
        assert!(
            error
                .to_string()
                .contains("none of 5 simulations worked: it ended"),
            "{error}"
        );
        assert!(
            !health.check().unwrap_err().costs_one_run(),
            "nothing is tried again"
        );
    }

    #[test]
    fn many_runs_at_one_bad_point_count_once() {
        let health = Health::default();
        health.worked();
        assert!((0..500).all(|_| lost(&health, 2.0)));
        assert!((2..IN_A_ROW).all(|i| lost(&health, i as f64 + 1.0)));
        health.worked();
        assert!((1..IN_A_ROW).all(|i| lost(&health, i as f64)));
        assert!(!lost(&health, 0.0));
    }
}
