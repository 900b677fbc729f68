//! A fit on a record that it has not seen.

use super::axis::Axis;
use super::follow::{errors, free_runs};
use super::outcome::{Fit, OutputErrors};
use super::problem::Problem;
use super::run::Subject;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::likelihood::{measured, share_name, with_share};
use crate::record::{Record, Signal};
use crate::twin::Role;

/// Predictions of a fitted twin on another record.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct FitScore {
    /// Mean log density of a row given those before it, in nats; the first row, which only the start predicts, is left out.
    pub log_score: f64,
    /// Errors of each output that the record has.
    pub errors: Vec<OutputErrors>,
    /// Free run beside the record; none where it diverges.
    pub free_run: Option<Signal>,
}

/// Scores a fit; `None` where the twin cannot be filtered there.
pub(crate) fn score(
    subject: &Subject<'_>,
    fit: &Fit,
    record: &Record,
) -> Result<Option<FitScore>, FilterError> {
    let records = std::slice::from_ref(record);
    let measured = measured(subject.twin, records, subject.beliefs)?;
    let problem = with_shares(Problem::of_measured(&measured, records), fit);
    let centre = problem.centre();
    let theta: Vec<f64> = (problem.twin.parameters().iter().zip(centre))
        .map(|(p, centre)| {
            let found = match p.role {
                Role::Noise => {
                    let level = fit.noise.iter().find(|level| level.name == p.target());
                    // A level that follows the states is told by what is typical of its records.
                    let here = measured.levels.iter().find(|l| l.parameter.name == p.name);
                    let here = here.and_then(|level| level.declared);
                    level.map(|level| match level.declared.zip(here) {
                        Some((there, here)) => level.value * (here / there),
                        None => level.value,
                    })
                }
                // A start belongs to its record.
                Role::Start => None,
                _ => {
                    let fitted = fit.parameters.iter().find(|fitted| fitted.name == p.name);
                    fitted.map(|fitted| fitted.value)
                }
            };
            found.map_or(centre, |value| p.bounds.clamp(value))
        })
        .collect();
    let Some(filtered) = recoverable(problem.filtered(&theta))? else {
        return Ok(None);
    };
    let first = problem.first_states(&theta)?;
    let mut runs = free_runs(&problem, &theta, &first)?;
    let densities = &filtered[0].log_densities[1..];
    Ok(Some(FitScore {
        log_score: densities.iter().sum::<f64>() / densities.len().max(1) as f64,
        errors: errors(&problem, &filtered, &runs),
        free_run: runs.swap_remove(0),
    }))
}

/// The problem with the noise that grows with the signal of a fit.
fn with_shares(problem: Problem, fit: &Fit) -> Problem {
    let outputs = problem.twin.signals().outputs;
    let has_share = |name: &str| fit.noise.iter().any(|level| level.name == share_name(name));
    let all = (outputs.iter().enumerate()).filter(|(_, output)| has_share(&output.name));
    all.fold(problem, |problem, (j, _)| {
        let twin = with_share(&problem.twin, j);
        let space = twin.parameters();
        let own = space.len() - 1;
        let axes = problem.axes[..own].iter().cloned();
        let axes = axes.chain([Axis::of(&space[own])]).collect();
        problem.with_twin(twin, axes)
    })
}
