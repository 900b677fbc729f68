//! Starts, free runs and errors: the way in which a fitted twin follows its records.

use super::climb::{Fitted, fit};
use super::outcome::{FittedStart, OutputErrors};
use super::problem::Problem;
use crate::fit::budget::BUDGET;
use crate::fit::budget::ITERATIONS;
use crate::likelihood::Level;
use crate::likelihood::kalman::{FilterError, Filtered, Gaussian, recoverable};
use crate::math::deviation;
use crate::record::Signal;
use crate::twin::{StepsTaken, begun};

/// The way in which a fitted twin follows its records.
pub(super) struct FollowedRecords {
    pub starts: Vec<FittedStart>,
    /// Noise-free run beside each record; none where it diverges.
    pub free_runs: Vec<Option<Signal>>,
    pub errors: Vec<OutputErrors>,
    /// Innovations of each record in their own units.
    pub residuals: Vec<Signal>,
}

impl FollowedRecords {
    /// At the full θ.
    pub fn new(problem: &Problem, theta: &[f64]) -> Result<Self, FilterError> {
        let first = problem.first_states(theta)?;
        let free_runs = free_runs(problem, theta, &first)?;
        let filtered = problem.filtered(theta)?;
        Ok(Self {
            starts: starts(problem, &first),
            errors: errors(problem, &filtered, &free_runs),
            free_runs,
            residuals: (filtered.into_iter()).map(|f| f.standardised).collect(),
        })
    }
}

/// States at the first sample of each record, given the whole record.
pub(crate) fn starts(problem: &Problem, first: &[Gaussian]) -> Vec<FittedStart> {
    let states = problem.outline().states;
    (first.iter().enumerate())
        .flat_map(|(r, first)| {
            (states.iter().enumerate())
                .filter(|(_, state)| !crate::twin::is_memory(&state.name))
                .map(|(i, state)| FittedStart {
                    record: r + 1,
                    name: state.name.clone(),
                    unit: state.unit.clone(),
                    value: first.mean[i],
                    std_error: first.deviation(i),
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
    first: &[Gaussian],
) -> Result<Vec<Option<Signal>>, FilterError> {
    (problem.records.iter().enumerate())
        .map(|(r, record)| {
            let own = problem.of_record(r, theta);
            let twin = match first.get(r) {
                Some(first) if first.mean.iter().any(|x| !x.is_finite()) => return Ok(None),
                // What effects remember of the time before the first row is in the twin's own run alone.
                Some(first)
                    if problem.twin.begins().is_some() && first.cov.iter().all(|c| *c == 0.0) =>
                {
                    problem.twin.clone()
                }
                Some(first) => begun(&problem.twin, &first.mean, record.drive().dt())?,
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

/// Adaptive substeps of all records; `None` for fixed ones, and where a run diverges.
pub(super) fn steps_taken(problem: &Problem, theta: &[f64]) -> Option<StepsTaken> {
    let mut records = problem.records.iter().enumerate();
    records.try_fold(StepsTaken::default(), |all, (r, record)| {
        let own = problem.of_record(r, theta);
        let taken = problem.twin.steps_taken(&own, record.drive())?;
        Some(all.and(taken))
    })
}

/// Errors of each output that the records have, from innovations and free runs.
pub(super) fn errors(
    problem: &Problem,
    filtered: &[Filtered],
    free_runs: &[Option<Signal>],
) -> Vec<OutputErrors> {
    let outputs = problem.outline().outputs;
    // A record may lack a sensor.
    let there = |j: &usize| problem.records.iter().any(|record| record.has_output(*j));
    (0..outputs.len())
        .filter(there)
        .map(|j| {
            let output = &outputs[j];
            let (mut one_step, mut free, mut all) = (Rms::default(), Rms::default(), vec![]);
            let mut correlation = LagOne::default();
            for (r, record) in problem.records.iter().enumerate() {
                correlation.begin();
                for k in 0..record.samples() {
                    let y = record.outputs()[[k, j]];
                    if !y.is_finite() {
                        continue;
                    }
                    all.push(y);
                    // The first row is predicted from the start, which a record is not to be judged by.
                    if k > 0 {
                        one_step.add(filtered[r].innovations[[k, j]]);
                        correlation.add(k, filtered[r].standardised[[k, j]]);
                    }
                    if let Some(run) = &free_runs[r] {
                        free.add(y - run[[k, j]]);
                    }
                }
            }
            OutputErrors {
                name: output.name.clone(),
                unit: output.unit.clone(),
                one_step: one_step.value(),
                correlation: correlation.value(),
                free_run: free_runs.iter().all(Option::is_some).then(|| free.value()),
                deviation: deviation(&all),
            }
        })
        .collect()
}

/// Root mean square of values; 0 of none.
#[derive(Default)]
struct Rms {
    squares: f64,
    count: usize,
}

impl Rms {
    fn add(&mut self, value: f64) {
        self.squares += value * value;
        self.count += 1;
    }

    fn value(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt()
    }
}

/// Correlation of values with those a row before, over the present ones.
#[derive(Default)]
struct LagOne {
    before: Option<(usize, f64)>,
    squares: f64,
    products: f64,
    pairs: usize,
}

impl LagOne {
    /// Begins a record.
    fn begin(&mut self) {
        self.before = None;
    }

    fn add(&mut self, k: usize, value: f64) {
        if let Some((_, before)) = self.before.filter(|(at, _)| at + 1 == k) {
            self.products += before * value;
            self.pairs += 1;
        }
        self.squares += value * value;
        self.before = Some((k, value));
    }

    /// Returns the correlation; none of fewer than three pairs.
    fn value(&self) -> Option<f64> {
        (self.pairs > 2 && self.squares > 0.0).then(|| self.products / self.squares)
    }
}

/// An output that the twin follows much better if it is fitted without process noise.
pub(super) struct Swallowed {
    pub name: String,
    /// Root mean square of the error of the free run.
    pub with: f64,
    /// The same of the twin fitted without process noise.
    pub without: f64,
}

/// Fits the twin without the process noise of which nothing is declared, where the free run says much less of the record than the one-step
/// predictions; returns the output that it follows better by most.
pub(super) fn swallowed(
    problem: &Problem,
    fitted: &Fitted,
    levels: &[Level],
    fitted_errors: &[OutputErrors],
) -> Result<Option<Swallowed>, FilterError> {
    let space = problem.twin.parameters();
    let is_free = |name: &str| {
        let level = levels.iter().find(|level| level.parameter.name == name);
        level.is_some_and(|level| level.is_process && level.declared.is_none())
    };
    let loses = |e: &OutputErrors| {
        let free = e.free_run.unwrap_or(f64::INFINITY);
        e.one_step.powi(2) < (1.0 - BUDGET.swallowed) * free.powi(2)
    };
    if !space.iter().any(|p| is_free(&p.name)) || !fitted_errors.iter().any(loses) {
        return Ok(None);
    }
    let mut axes = problem.axes[..space.len()].to_vec();
    for (axis, p) in axes.iter_mut().zip(space.iter()) {
        if is_free(&p.name) {
            let none = axis.bounds.low();
            (axis.centre, axis.begin, axis.held) = (none, Some(none), true);
        }
    }
    let quiet = problem.with_twin(problem.twin.clone(), axes);
    let starts = [&fitted.theta, &quiet.centre()].map(|theta| quiet.begin(theta));
    let Some(alone) = fit(&quiet, &starts, ITERATIONS)? else {
        return Ok(None);
    };
    let Some(alone) = recoverable(FollowedRecords::new(&quiet, &alone.theta))? else {
        return Ok(None);
    };
    let all = (fitted_errors.iter().zip(alone.errors)).filter_map(|(own, alone)| {
        let (with, without) = (own.free_run?, alone.free_run?);
        let is_better = without.powi(2) < (1.0 - BUDGET.swallowed) * with.powi(2);
        is_better.then(|| Swallowed {
            name: own.name.clone(),
            with,
            without,
        })
    });
    Ok(all.min_by(|a, b| (a.without / a.with).total_cmp(&(b.without / b.with))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Catalogue, augment, augment_late};
    use crate::equations::Equations;
    use crate::record::{Drive, Record};
    use crate::twin::{Twin, fix};

    const DECAY: &str = "[twin]\nname = 'decay'\n[parameters]\nc = { prior = [0.1, 1.0] }\n\
        [states]\nh = { rate = '-c*h', start = { value = 2.0, at = -1.5 } }\n\
        [outputs]\ny = { value = 'h', noise = 0.01 }\n";

    /// A sensor that lags, or is late, has seen what went on before the first row: the free run begins with what it remembers of that, as the filter does.
    #[test]
    fn effects_remember_the_time_before_the_first_row() {
        for (id, magnitude, value) in [("sensor-lag", "tau", 1.2), ("sensor-delay", "delay", 0.3)] {
            let effect = Catalogue::default().effect(id, "sensor").unwrap();
            let effect = effect.hold(magnitude, value);
            let base = Twin::new(Equations::parse(DECAY).unwrap());
            for augment in [augment, augment_late] {
                let twin = augment(base.clone(), vec![effect.clone()]).unwrap();
                let twin = fix(twin, &effect.given_by_parameter().collect()).unwrap();
                let drive = Drive::autonomous(0.25, 30).unwrap();
                let outputs = twin.free_run(&[0.6], &drive).unwrap();
                let record = Record::new(drive, outputs.clone()).unwrap();
                let problem = Problem::of_twin(&twin, vec![record]);
                let followed = FollowedRecords::new(&problem, &[0.6]).unwrap();
                let run = followed.free_runs[0].as_ref().unwrap();
                let off = (run - &outputs)
                    .iter()
                    .fold(0.0, |off: f64, d| off.max(d.abs()));
                assert!(off < 1e-9, "{id}: {off}");
                let step = followed.errors[0].one_step;
                assert!(step < 1e-6, "{id}: {step}");
            }
        }
    }
}
