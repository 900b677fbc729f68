//! Share of the gap closed on held-out data.

use super::free_run::{Runner, root};
use super::horizon::{HeldOutRows, Predictor, compare};
use crate::diagnose::outcome::Shrinkage;
use crate::diagnose::thresholds::THRESHOLDS;
use crate::fit::climb::{Fitted, climb};
use crate::fit::posterior::{DrawsAsked, posterior};
use crate::fit::problem::Problem;
use crate::hypothesis::search::model::{Model, keys};
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

impl<'r> HeldOut<'r> {
    /// The validation record, or the last third of the first record; `None` where that is too short.
    fn of(measures: &Measures<'r>) -> Option<Self> {
        if let Some(records) = measures.validation {
            return Some(Self {
                record: &records[0],
                begins: records.into(),
                from: 0,
                what: "validation record",
            });
        }
        let record = &measures.base.problem.records[0];
        let from = held_out_from(record.samples());
        let part = (record.samples() >= SHORTEST_SPLIT).then(|| record.first_part(from));
        Some(Self {
            record,
            begins: Arc::from([part??]),
            from,
            what: "last third of the record",
        })
    }

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
        let drawn = posterior(&refit.problem, fitted, DrawsAsked::Usual, noise)?;
        let mut all = vec![];
        for theta in drawn.thetas.iter().take(THRESHOLDS.share_records as usize) {
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

/// Models and records from which the share of a gap is measured.
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

impl Measures<'_> {
    /// θ before any fit: the prior's centre, or what an estimator gave.
    fn unfitted(&self) -> Vec<f64> {
        let problem = &self.base.problem;
        let mut theta = problem.of_record(0, &problem.centre());
        let initial = self.initial.into_iter().flatten();
        theta
            .iter_mut()
            .zip(initial)
            .for_each(|(v, initial)| *v = *initial);
        theta
    }

    /// Fitted effects outside the class, best first.
    fn outside(&self, accepted: &Model) -> Vec<&Model> {
        let used = keys(&accepted.terms);
        let is_used = |key: String| used.contains(&key) || self.class.contains(&key);
        let is_outside = |model: &&&Model| {
            (model.terms.iter()).all(|term| !term.is_noise() && !is_used(term.key()))
        };
        self.others.iter().filter(is_outside).copied().collect()
    }
}

/// Measures how far the accepted effects close the gap on held-out data.
pub(in crate::diagnose) fn shrinkage(
    measures: &Measures<'_>,
    noise: Noise,
) -> Result<Option<Shrinkage>, StudyError> {
    let Some(held_out) = HeldOut::of(measures) else {
        return Ok(None);
    };
    let (record, from) = (held_out.record, held_out.from);
    let Some(before) = held_out.refitted(measures.base)? else {
        return Ok(None);
    };
    let errors = before.runner.errors(record, from);
    let Some(errors) = errors.filter(|errors| !errors.is_empty()) else {
        return Ok(None);
    };
    let unfitted = held_out.predictor(measures.base, measures.unfitted())?;
    let free_run = |p: &Predictor| p.runner.errors(record, from).map(|e| root(&e));
    let alone = Shrinkage {
        metric: Shrinkage::FREE_RUN,
        before: root(&errors),
        after: None,
        floor: None,
        closed: None,
        interval: None,
        held_out: held_out.what,
        horizon: None,
        horizons: vec![],
        log_score: None,
        unfitted: unfitted.as_ref().and_then(free_run),
        placebo: None,
        random: vec![],
    };
    let Some(accepted) = measures.accepted else {
        let floor = before.runner.floor(record, from, noise.child("floor"));
        return Ok(Some(Shrinkage { floor, ..alone }));
    };
    let Some(refit) = held_out.refit(accepted)? else {
        return Ok(Some(alone));
    };
    let Some(after) = held_out.predictor(accepted, refit.theta())? else {
        return Ok(Some(alone));
    };
    let rows = held_out.rows();
    let scores = before.log_score(rows)?.zip(after.log_score(rows)?);
    let log_score = scores.map(|(before, after)| [before, after]);
    if accepted.terms.iter().all(|term| term.is_noise()) {
        // No prediction moves: the density of what was held out does.
        return Ok(log_score.map(|[before, after]| Shrinkage {
            metric: Shrinkage::LOG_SCORE,
            before,
            after: Some(after),
            log_score,
            unfitted: None,
            ..alone
        }));
    }
    let draws = held_out.draws(accepted, &refit, noise.child("posterior"))?;
    let compared = compare(&before, &after, &draws, rows, noise.child("floor"))?;
    let shown = compared.headline.or(compared.horizons.len().checked_sub(1));
    let interval = compared.interval(&before, &after, &draws, rows, noise.child("share"))?;
    let mut closed = Shrinkage {
        interval,
        log_score,
        horizons: compared.horizons.clone(),
        ..alone
    };
    if let Some(horizon) = shown.map(|at| &compared.horizons[at]) {
        let is_narrow = |[low, high]: [f64; 2]| high - low < THRESHOLDS.widest;
        closed.metric = match horizon.samples {
            Some(_) => Shrinkage::PREDICTION,
            None => Shrinkage::FREE_RUN,
        };
        closed.before = horizon.before;
        closed.after = Some(horizon.after);
        closed.floor = Some(horizon.floor);
        closed.closed = horizon.closed.filter(|_| interval.is_some_and(is_narrow));
        closed.horizon = horizon.seconds;
    }
    let error = |p: &Predictor| compared.error(shown, p, rows);
    closed.unfitted = unfitted.as_ref().map(error).transpose()?.flatten();
    controls(&mut closed, measures.outside(accepted), noise, |model| {
        let wrong = held_out.refitted(model)?;
        Ok(wrong.as_ref().map(error).transpose()?.flatten())
    })?;
    Ok(Some(closed))
}

/// Adds errors of wrong effects, best first: those of the best, and where fits are cheap of some at random.
fn controls(
    shrinkage: &mut Shrinkage,
    mut wrong: Vec<&Model>,
    noise: Noise,
    error: impl Fn(&Model) -> Result<Option<f64>, StudyError>,
) -> Result<(), StudyError> {
    let Some(best) = wrong.first() else {
        return Ok(());
    };
    shrinkage.placebo = error(best)?;
    if best.problem.is_simulated() {
        return Ok(());
    }
    let mut source = noise.source("random effects");
    for _ in 0..THRESHOLDS.random_effects.min(wrong.len()) {
        let at = (source.uniform() * wrong.len() as f64) as usize;
        let drawn = wrong.swap_remove(at.min(wrong.len() - 1));
        shrinkage.random.extend(error(drawn)?);
    }
    Ok(())
}
