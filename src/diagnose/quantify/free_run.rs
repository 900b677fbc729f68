//! Free-run errors, and the share of a gap that effects close.

use crate::diagnose::outcome::FreeRuns;
use crate::diagnose::thresholds::THRESHOLDS;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::math::median;
use crate::parallel::each;
use crate::record::{Record, Signal};
use crate::study::StudyError;
use crate::twin::{Noise, Twin, begun};
use ndarray::Array1;

/// A model that runs beside a record: free, or with its own noise.
pub(in crate::diagnose) struct Runner {
    twin: Twin,
    theta: Vec<f64>,
}

impl Runner {
    /// The twin of a problem at θ, begun as a record shows; `None` where its first state cannot be told.
    pub fn new(problem: &Problem, theta: &[f64]) -> Result<Option<Self>, StudyError> {
        let twin = match recoverable(problem.first_states(theta))? {
            None => return Ok(None),
            Some(first) => match first.first().map(|first| &first.mean) {
                Some(first) if first.iter().any(|x| !x.is_finite()) => return Ok(None),
                Some(first) => begun(&problem.twin, first, problem.records[0].drive().dt())
                    .map_err(FilterError::from)?,
                None => problem.twin.clone(),
            },
        };
        let theta = problem.of_record(0, theta);
        Ok(Some(Self { twin, theta }))
    }

    /// Squared errors of the free run over the variance of y, mean over channels, by sample from `from` on. Missing outputs, and
    /// samples without any, are left out.
    pub fn errors(&self, record: &Record, from: usize) -> Option<Vec<f64>> {
        let outputs = self.outputs(record)?;
        Some(squares(record.outputs(), &outputs, from))
    }

    /// The free run beside the record.
    pub fn outputs(&self, record: &Record) -> Option<Signal> {
        let run = self.twin.free_run(&self.theta, record.drive()).ok()?;
        run.iter().all(|v| v.is_finite()).then_some(run)
    }

    /// Outputs that the twin simulates beside the record, with its noise.
    pub fn simulated(&self, record: &Record, noise: Noise) -> Option<Signal> {
        let run = self
            .twin
            .simulate(&self.theta, record.drive(), noise)
            .ok()?;
        run.iter().all(|v| v.is_finite()).then_some(run)
    }

    /// Median error of records simulated at θ against their own free run.
    pub fn floor(&self, record: &Record, from: usize, noise: Noise) -> Option<f64> {
        let free = self.outputs(record)?;
        let scale = variances(record.outputs());
        let errors = each(0..THRESHOLDS.floor_records, |i| {
            let run = self.simulated(record, noise.sample(i))?;
            // In units of the measured record, as the other errors are.
            let errors = record.with_gaps_in(run - &free);
            Some(root(&scaled(&errors, &scale, from)))
        });
        median(&errors.into_iter().flatten().collect::<Vec<_>>()).ok()
    }
}

/// Free runs beside a record.
pub(in crate::diagnose) fn free_runs(
    record: &Record,
    base: Option<&Runner>,
    grown: Option<&Runner>,
) -> FreeRuns {
    FreeRuns {
        times: record.drive().times(),
        measured: record.outputs().clone(),
        before: base.and_then(|base| base.outputs(record)),
        after: grown.and_then(|grown| grown.outputs(record)),
    }
}

pub(in crate::diagnose) fn variances(y: &Signal) -> Vec<f64> {
    (y.columns().into_iter())
        .map(|y| {
            let there: Array1<f64> = y.iter().copied().filter(|v| !v.is_nan()).collect();
            there.var(0.0).max(1e-300)
        })
        .collect()
}

pub(super) fn scaled(difference: &Signal, variances: &[f64], from: usize) -> Vec<f64> {
    (difference.rows().into_iter().skip(from))
        .filter_map(|row| {
            let there = || row.iter().zip(variances).filter(|(d, _)| !d.is_nan());
            let squares = there().map(|(d, v)| d * d / v);
            let count = there().count();
            (count > 0).then(|| squares.sum::<f64>() / count as f64)
        })
        .collect()
}

fn squares(y: &Signal, free: &Signal, from: usize) -> Vec<f64> {
    scaled(&(y - free), &variances(y), from)
}

/// √(mean).
pub(in crate::diagnose) fn root(squares: &[f64]) -> f64 {
    mean(squares).sqrt()
}

/// Mean; 0 of nothing.
pub(in crate::diagnose) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
