//! Starts and free runs: the way in which a fitted twin follows its records.

use super::outcome::FittedStart;
use super::problem::Problem;
use crate::likelihood::kalman::{FilterError, States};
use crate::record::Signal;
use crate::twin::begun;

/// States at the first sample of each record, given the whole record.
pub(crate) fn starts(problem: &Problem, smoothed: &[States]) -> Vec<FittedStart> {
    let states = problem.outline().states;
    (smoothed.iter().enumerate())
        .flat_map(|(r, smoothed)| {
            let deviations = smoothed.standard_deviations();
            (states.iter().enumerate())
                .filter(|(_, state)| !crate::twin::is_memory(&state.name))
                .map(|(i, state)| FittedStart {
                    record: r + 1,
                    name: state.name.clone(),
                    unit: state.unit.clone(),
                    value: smoothed.means[[0, i]],
                    std_error: deviations[[0, i]],
                })
                .collect::<Vec<_>>()
        })
        .collect()
}

/// Noise-free runs from the start given the record; none where a run diverges.
///
/// # Errors
///
/// A start that the twin cannot have, a simulator that does not work.
pub(crate) fn free_runs(
    problem: &Problem,
    theta: &[f64],
    smoothed: &[States],
) -> Result<Vec<Option<Signal>>, FilterError> {
    (problem.records.iter().enumerate())
        .map(|(r, record)| {
            let own = problem.of_record(r, theta);
            let twin = match smoothed.get(r).map(States::first) {
                Some(first) if first.iter().any(|x| !x.is_finite()) => return Ok(None),
                Some(first) => begun(&problem.twin, &first, record.drive().dt())?,
                None => problem.twin.clone(),
            };
            match twin.free_run(&own, record.drive()) {
                Ok(run) => Ok(run.iter().all(|v| v.is_finite()).then_some(run)),
                Err(error) if error.costs_one_run() => Ok(None),
                Err(error) => Err(error.into()),
            }
        })
        .collect()
}
