//! Smoothed starts and free runs: the way in which a fitted twin follows its records.

use super::outcome::FittedStart;
use super::problem::Problem;
use crate::likelihood::kalman::{FilterError, FilterSettings, Kalman, Smoothed};
use crate::record::Signal;
use crate::twin::{Adaptation, StartLevel, Twin, adapt};

/// States of each record given all of it; empty for a black box.
pub(crate) fn smoothed(problem: &Problem<'_>, theta: &[f64]) -> Result<Vec<Smoothed>, FilterError> {
    let Some(equations) = problem.twin.equations() else {
        return Ok(vec![]);
    };
    let settings = FilterSettings::default();
    (problem.records.iter().enumerate())
        .map(|(r, record)| {
            Kalman::new(equations, record, &settings)?.smooth(&problem.of_record(r, theta))
        })
        .collect()
}

/// States at the first sample of each record, given the whole record.
pub(crate) fn starts(problem: &Problem<'_>, smoothed: &[Smoothed]) -> Vec<FittedStart> {
    let states = problem.outline().states;
    (smoothed.iter().enumerate())
        .flat_map(|(r, smoothed)| {
            let deviations = smoothed.states.standard_deviations();
            (states.iter().enumerate())
                .filter(|(_, state)| !crate::twin::is_memory(&state.name))
                .map(|(i, state)| FittedStart {
                    record: r + 1,
                    name: state.name.clone(),
                    unit: state.unit.clone(),
                    value: smoothed.states.means[[0, i]],
                    std_error: deviations[[0, i]],
                })
                .collect::<Vec<_>>()
        })
        .collect()
}

/// Noise-free runs from the start given the record; none where a run diverges.
pub(crate) fn free_runs(
    problem: &Problem<'_>,
    theta: &[f64],
    smoothed: &[Smoothed],
) -> Vec<Option<Signal>> {
    (problem.records.iter().enumerate())
        .map(|(r, record)| {
            let own = problem.of_record(r, theta);
            let twin = match smoothed.get(r) {
                Some(smoothed) => begun(&problem.twin, smoothed, record.drive().dt())?,
                None => problem.twin.clone(),
            };
            let run = twin.free_run(&own, record.drive()).ok()?;
            run.iter().all(|v| v.is_finite()).then_some(run)
        })
        .collect()
}

/// The twin with the start that a record shows.
pub(crate) fn begun(twin: &Twin, smoothed: &Smoothed, step: f64) -> Option<Twin> {
    let outline = twin.outline()?;
    let limits = twin.equations()?.limits();
    let start = (outline.states.iter().zip(limits).enumerate())
        .filter(|(_, (state, _))| !crate::twin::is_memory(&state.name))
        .map(|(i, (state, limit))| {
            let mean = limit.clamp(smoothed.states.means[[0, i]]);
            (state.name.clone(), StartLevel::Declared { mean, std: 0.0 })
        })
        .collect();
    let adaptation = Adaptation {
        start,
        ..Adaptation::default()
    };
    adapt(twin.clone(), &adaptation, step).ok()
}
