//! Share of the gap closed on held-out data.

use super::free_run::{Runner, closed, interval, root};
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::search::Found;
use crate::diagnose::model::{Model, keys};
use crate::diagnose::outcome::Shrinkage;
use crate::fit::climb::climb;
use crate::fit::first_part::first_part;
use crate::fit::posterior::posterior;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::record::Record;
use crate::twin::Noise;
use rayon::prelude::*;

/// Samples of the shortest record whose last third is held out.
pub const SHORTEST_SPLIT: usize = 300;
/// Iterations of a refit without the held-out part.
const REFIT: usize = 10;
/// Posterior draws whose free runs make the interval.
const DRAWS: usize = 100;

/// The first sample that is held out of a record without another to validate.
pub(crate) fn held_out_from(samples: usize) -> usize {
    2 * samples / 3
}

/// A model on held-out data: θ that has not seen them.
struct HeldOut<'r> {
    /// The record that it runs beside.
    record: &'r Record,
    /// Record whose start it begins with.
    begins: &'r [Record],
    /// First sample that counts.
    from: usize,
    what: &'static str,
}

impl HeldOut<'_> {
    /// θ of a model without what is held out; `None` where it cannot be fitted.
    fn theta(&self, model: &Model<'_>) -> Result<Option<Vec<f64>>, FilterError> {
        if self.from == 0 {
            return Ok(Some(model.theta()));
        }
        let problem = on(model, self.begins);
        let fitted = climb(&problem, &problem.full(&model.theta()), REFIT)?;
        Ok(fitted.map(|fitted| problem.of_record(0, &fitted.theta)))
    }

    fn runner(&self, model: &Model<'_>, theta: &[f64]) -> Result<Option<Runner>, DiagnoseError> {
        let problem = on(model, self.begins);
        Runner::new(&problem, &problem.full(theta))
    }
}

/// A model's problem on other records.
fn on<'r>(model: &Model<'_>, records: &'r [Record]) -> Problem<'r> {
    let mut problem = model.problem.on(records);
    problem.families.clone_from(&model.problem.families);
    problem
}

/// Measures how far the accepted effects close the gap on held-out data; `others` are the listed effects that were fitted.
pub(in crate::diagnose) fn shrinkage(
    base: &Model<'_>,
    accepted: Option<&Model<'_>>,
    others: &[Found<'_>],
    validation: Option<&[Record]>,
    initial: Option<&[f64]>,
    noise: Noise,
) -> Result<Option<Shrinkage>, DiagnoseError> {
    let whole = &base.problem.records[0];
    let short: Vec<Record>;
    let held_out = match validation {
        Some(records) => HeldOut {
            record: &records[0],
            begins: records,
            from: 0,
            what: "validation record",
        },
        None if whole.samples() >= SHORTEST_SPLIT => {
            let split = held_out_from(whole.samples());
            let Some(part) = first_part(whole, split) else {
                return Ok(None);
            };
            short = vec![part];
            HeldOut {
                record: whole,
                begins: &short,
                from: split,
                what: "last third of the record",
            }
        }
        None => return Ok(None),
    };
    let (record, from) = (held_out.record, held_out.from);
    let Some(theta) = held_out.theta(base)? else {
        return Ok(None);
    };
    let Some(runner) = held_out.runner(base, &theta)? else {
        return Ok(None);
    };
    let Some(before) = runner
        .errors(record, from)
        .filter(|errors| !errors.is_empty())
    else {
        return Ok(None);
    };
    let mut unfitted = base.problem.of_record(0, &base.problem.centre());
    for (value, initial) in unfitted.iter_mut().zip(initial.into_iter().flatten()) {
        *value = *initial;
    }
    let unfitted = held_out
        .runner(base, &unfitted)?
        .and_then(|runner| runner.errors(record, from));
    let mut result = Shrinkage {
        metric: Shrinkage::FREE_RUN,
        before: root(&before),
        after: None,
        floor: None,
        closed: None,
        interval: None,
        held_out: held_out.what,
        unfitted: unfitted.map(|e| root(&e)),
        placebo: None,
    };
    let Some(accepted) = accepted else {
        result.floor = runner.floor(record, from, noise.child("floor"));
        return Ok(Some(result));
    };
    let Some(grown) = held_out.theta(accepted)? else {
        return Ok(Some(result));
    };
    if accepted.terms.iter().all(|term| term.is_noise()) {
        // No free run moves: the density of what was held out does.
        let records = std::slice::from_ref(record);
        let score = |model: &Model<'_>, theta: &[f64]| -> Result<Option<f64>, FilterError> {
            let problem = on(model, records);
            let all = recoverable(problem.filtered(&problem.full(theta)))?;
            Ok(all.map(|all| {
                let d = &all[0].log_densities[from..];
                d.iter().sum::<f64>() / d.len() as f64
            }))
        };
        let Some(before) = score(base, &theta)? else {
            return Ok(None);
        };
        result.metric = Shrinkage::LOG_SCORE;
        result.before = before;
        result.after = score(accepted, &grown)?;
        (result.unfitted, result.placebo) = (None, None);
        return Ok(Some(result));
    }
    let Some(runner) = held_out.runner(accepted, &grown)? else {
        return Ok(Some(result));
    };
    let after = runner.errors(record, from);
    result.after = after.as_deref().map(root);
    result.floor = runner.floor(record, from, noise.child("floor"));
    if let (Some(after), Some(floor)) = (&after, result.floor) {
        (result.closed, result.interval) = closed(&before, after, floor, noise.child("bootstrap"));
    }
    if let (Some(closed), Some(floor)) = (result.closed, result.floor) {
        let draws = posterior(
            &accepted.problem,
            &accepted.fitted,
            noise.child("posterior"),
        )?;
        let afters: Vec<f64> = (draws.into_par_iter().take(DRAWS))
            .map(|theta| {
                Ok(held_out
                    .runner(accepted, &theta)?
                    .and_then(|r| r.errors(record, from)))
            })
            .collect::<Result<Vec<_>, DiagnoseError>>()?
            .into_iter()
            .flatten()
            .map(|errors| root(&errors))
            .collect();
        result.interval = interval(result.before, closed, floor, &afters).or(result.interval);
    }
    // The fitted effect that explains least, of those that move free runs.
    let used = keys(&accepted.terms);
    let placebo = (others.iter().rev()).find_map(|found| {
        let model = found.model.as_ref()?;
        let is_free = !found.last().is_noise() && !used.contains(&found.last().key());
        is_free.then_some(model)
    });
    if let Some(model) = placebo
        && let Some(theta) = held_out.theta(model)?
        && let Some(runner) = held_out.runner(model, &theta)?
    {
        result.placebo = runner.errors(record, from).map(|e| root(&e));
    }
    Ok(Some(result))
}
