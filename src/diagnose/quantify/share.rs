//! Share of the gap closed on held-out data.

use super::free_run::{Runner, root};
use super::horizon::{HeldOutRows, Predictor, compare};
use crate::diagnose::outcome::Shrinkage;
use crate::diagnose::thresholds::Thresholds;
use crate::fit::climb::{Fitted, climb};
use crate::fit::posterior::posterior;
use crate::fit::problem::Problem;
use crate::hypothesis::model::{Model, keys};
use crate::likelihood::kalman::FilterError;
use crate::record::Record;
use crate::study::StudyError;
use crate::twin::Noise;
use std::sync::Arc;

/// Samples of the shortest record whose last third is held out.
pub const SHORTEST_SPLIT: usize = 300;
/// Iterations of a refit without the held-out part.
const REFIT: usize = 10;

/// The first sample that is held out of a record without another to validate.
pub(crate) fn held_out_from(samples: usize) -> usize {
    2 * samples / 3
}

/// A model on held-out data: θ that has not seen them.
struct HeldOut<'r> {
    /// The record that it runs beside.
    record: &'r Record,
    /// Record whose start it begins with.
    begins: Arc<[Record]>,
    /// First sample that counts.
    from: usize,
    what: &'static str,
}

impl HeldOut<'_> {
    /// The problem of a model without what is held out, and its fit; `None` where it cannot be fitted.
    fn refit(&self, model: &Model) -> Result<Option<Refit>, FilterError> {
        if self.from == 0 {
            let problem = model.problem.clone();
            let fitted = model.fitted.clone();
            return Ok(Some(Refit { problem, fitted }));
        }
        let problem = model.problem.on(self.begins.clone());
        let fitted = climb(&problem, &problem.full(&model.theta()), REFIT)?;
        Ok(fitted.map(|fitted| Refit { problem, fitted }))
    }

    /// The model at θ, begun as the held-out data show; `None` where that cannot be told.
    fn predictor(&self, model: &Model, theta: Vec<f64>) -> Result<Option<Predictor>, StudyError> {
        let problem = model.problem.on(self.begins.clone());
        let runner = Runner::new(&problem, &problem.full(&theta))?;
        Ok(runner.map(|runner| Predictor {
            problem,
            theta,
            runner,
        }))
    }

    /// The model refitted without what is held out.
    fn refitted(&self, model: &Model) -> Result<Option<Predictor>, StudyError> {
        match self.refit(model)? {
            Some(refit) => self.predictor(model, refit.theta()),
            None => Ok(None),
        }
    }

    /// The model at draws of its posterior without what is held out.
    fn draws(
        &self,
        model: &Model,
        refit: &Refit,
        noise: Noise,
    ) -> Result<Vec<Predictor>, StudyError> {
        let fitted = std::slice::from_ref(&refit.fitted);
        let drawn = posterior(&refit.problem, fitted, None, noise)?;
        let mut all = vec![];
        for theta in drawn.thetas.iter().take(Thresholds::SHARE_RECORDS as usize) {
            all.extend(self.predictor(model, refit.problem.of_record(0, theta))?);
        }
        if all.is_empty() {
            // Without a posterior, θ is taken as known.
            all.extend(self.predictor(model, refit.theta())?);
        }
        Ok(all)
    }

    fn rows(&self) -> HeldOutRows<'_> {
        HeldOutRows {
            record: self.record,
            from: self.from,
        }
    }
}

/// A fit that has not seen the held-out data.
struct Refit {
    problem: Problem,
    fitted: Fitted,
}

impl Refit {
    /// θ of the first record.
    fn theta(&self) -> Vec<f64> {
        self.problem.of_record(0, &self.fitted.theta)
    }
}

/// Means to measure the share of a gap.
pub(in crate::diagnose) struct Measures<'m> {
    /// The twin alone.
    pub base: &'m Model,
    /// The same with the accepted effects, if any were accepted.
    pub accepted: Option<&'m Model>,
    /// The listed effects that were fitted, best first.
    pub others: &'m [&'m Model],
    /// Rivals of the accepted effects, as `id@target`.
    pub class: &'m [String],
    /// A record that nothing before has seen.
    pub validation: Option<&'m [Record]>,
    /// θ before any fit.
    pub initial: Option<&'m [f64]>,
}

/// Measures how far the accepted effects close the gap on held-out data.
pub(in crate::diagnose) fn shrinkage(
    measures: &Measures<'_>,
    noise: Noise,
) -> Result<Option<Shrinkage>, StudyError> {
    let base = measures.base;
    let whole = &base.problem.records[0];
    let held_out = match measures.validation {
        Some(records) => HeldOut {
            record: &records[0],
            begins: records.into(),
            from: 0,
            what: "validation record",
        },
        None if whole.samples() >= SHORTEST_SPLIT => {
            let split = held_out_from(whole.samples());
            let Some(part) = whole.first_part(split) else {
                return Ok(None);
            };
            HeldOut {
                record: whole,
                begins: Arc::from([part]),
                from: split,
                what: "last third of the record",
            }
        }
        None => return Ok(None),
    };
    let (record, from, rows) = (held_out.record, held_out.from, held_out.rows());
    let Some(before) = held_out.refitted(base)? else {
        return Ok(None);
    };
    let free_run = |p: Predictor| p.runner.errors(record, from).map(|e| root(&e));
    let Some(error) = (before.runner.errors(record, from)).filter(|errors| !errors.is_empty())
    else {
        return Ok(None);
    };
    let mut unfitted = base.problem.of_record(0, &base.problem.centre());
    for (value, initial) in unfitted
        .iter_mut()
        .zip(measures.initial.into_iter().flatten())
    {
        *value = *initial;
    }
    let unfitted = held_out.predictor(base, unfitted)?;
    let mut result = Shrinkage {
        metric: Shrinkage::FREE_RUN,
        before: root(&error),
        after: None,
        floor: None,
        closed: None,
        interval: None,
        held_out: held_out.what,
        horizon: None,
        horizons: vec![],
        log_score: None,
        unfitted: None,
        placebo: None,
        random: vec![],
    };
    let Some(accepted) = measures.accepted else {
        result.floor = before.runner.floor(record, from, noise.child("floor"));
        result.unfitted = unfitted.and_then(free_run);
        return Ok(Some(result));
    };
    let refit = held_out.refit(accepted)?;
    let after = refit
        .as_ref()
        .map(|refit| held_out.predictor(accepted, refit.theta()));
    let (Some(refit), Some(after)) = (&refit, after.transpose()?.flatten()) else {
        result.unfitted = unfitted.and_then(free_run);
        return Ok(Some(result));
    };
    let scores = (before.log_score(rows)?, after.log_score(rows)?);
    result.log_score = match scores {
        (Some(before), Some(after)) => Some([before, after]),
        _ => None,
    };
    if accepted.terms.iter().all(|term| term.is_noise()) {
        // No prediction moves: the density of what was held out does.
        let Some([before, after]) = result.log_score else {
            return Ok(None);
        };
        result.metric = Shrinkage::LOG_SCORE;
        (result.before, result.after) = (before, Some(after));
        return Ok(Some(result));
    }
    let draws = held_out.draws(accepted, refit, noise.child("posterior"))?;
    let compared = compare(&before, &after, &draws, rows, noise.child("floor"))?;
    result.horizons.clone_from(&compared.horizons);
    let shown = compared.headline.or(compared.horizons.len().checked_sub(1));
    if let Some(horizon) = shown.map(|at| &compared.horizons[at]) {
        result.metric = match horizon.samples {
            Some(_) => Shrinkage::PREDICTION,
            None => Shrinkage::FREE_RUN,
        };
        result.before = horizon.before;
        result.after = Some(horizon.after);
        result.floor = Some(horizon.floor);
        result.closed = horizon.closed;
        result.horizon = horizon.seconds;
    }
    result.interval = compared.interval(&before, &after, &draws, rows, noise.child("share"))?;
    let is_narrow = |[low, high]: [f64; 2]| high - low < Thresholds::WIDEST;
    result.closed = result
        .closed
        .filter(|_| result.interval.is_some_and(is_narrow));
    let error = |p: &Predictor| compared.error(shown, p, rows);
    result.unfitted = match &unfitted {
        Some(unfitted) => error(unfitted)?,
        None => None,
    };
    // Fitted effects outside the class: the best, and some at random.
    let used = keys(&accepted.terms);
    let outside: Vec<&Model> = (measures.others.iter().copied())
        .filter(|model| {
            let others = model.terms.iter().map(|term| (term.is_noise(), term.key()));
            let mut is_used = others.map(|(is_noise, key)| {
                is_noise || used.contains(&key) || measures.class.contains(&key)
            });
            !is_used.any(|is_used| is_used)
        })
        .collect();
    let of_wrong = |model: &Model| match held_out.refitted(model)? {
        Some(predictor) => error(&predictor),
        None => Ok(None),
    };
    if let Some(best) = outside.first() {
        result.placebo = of_wrong(best)?;
    }
    if !accepted.problem.is_simulated() {
        let (mut drawn, mut source) = (outside, noise.source("random effects"));
        for _ in 0..Thresholds::RANDOM_EFFECTS.min(drawn.len()) {
            let at = (source.uniform() * drawn.len() as f64) as usize;
            result
                .random
                .extend(of_wrong(drawn.swap_remove(at.min(drawn.len() - 1)))?);
        }
    }
    Ok(Some(result))
}
