//! Fits of the explanations together with θ, and their order.

use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::frequency::peaks;
use crate::diagnose::hypotheses::candidate::{Addition, Candidate, Kind};
use crate::diagnose::hypotheses::dictionary::{Dictionary, Point};
use crate::diagnose::hypotheses::variant::Variant;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::statistics::Statistics;
use crate::diagnose::thresholds::Thresholds;
use crate::fit::climb::{Fitted, climb, fit};
use crate::fit::problem::Problem;
use crate::fit::reference::{Gain, Reference};
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::progress::Stage;
use crate::record::Record;
use crate::twin::Noise;
use rayon::prelude::*;

/// Iterations of a fit.
pub(super) const ITERATIONS: usize = 15;

/// A fitted explanation.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Explanation {
    /// Index among the fitted twin's candidates.
    pub candidate: usize,
    pub variant: usize,
    pub fitted: Fitted,
    /// Nats over the fitted twin's own twin, on the record.
    pub gain: f64,
    /// gain − ½·k·log N, and what a mark on the outputs is worth.
    pub penalised: f64,
    /// Nats over the fitted twin's own twin on the validation record, unknown starts refitted there.
    pub validation: Option<f64>,
    /// log-likelihood of the validation record.
    pub validation_likelihood: Option<f64>,
}

impl Explanation {
    /// Score by which explanations are ordered.
    pub fn score(&self) -> f64 {
        self.penalised + self.validation.unwrap_or(0.0)
    }
}

/// The likelihood of records at a θ fitted elsewhere, unknown starts refitted; `None` where the filter does not work.
pub(in crate::diagnose) fn elsewhere(
    problem: &Problem<'_>,
    theta: &[f64],
) -> Result<Option<f64>, FilterError> {
    let full = problem.full(theta);
    match problem.starts_only() {
        Some(starts) => Ok(climb(&starts, &full, ITERATIONS)?.map(|f| f.log_likelihood)),
        None => recoverable(problem.log_likelihood(&full)),
    }
}

/// Fits every candidate from its best points; best first.
pub(in crate::diagnose) fn explanations(
    model: &FittedTwin<'_>,
    statistics: &Statistics,
    validation: Option<&[Record]>,
    only: Option<&[usize]>,
    stage: &Stage,
) -> Result<Vec<Explanation>, DiagnoseError> {
    let base_validation = base_validation(model, validation)?;
    let reference = Reference::new(&model.problem, &model.fitted.theta)?;
    let tasks: Vec<usize> = match only {
        Some(list) => list.to_vec(),
        None => (0..model.dictionary.candidates.len()).collect(),
    };
    let mut explanations: Vec<Explanation> = tasks
        .into_par_iter()
        .map(|candidate| {
            let mut starts = match &reference {
                Some(reference) => peaks(model, reference, candidate)?,
                None => vec![],
            };
            starts.extend(best_points(&model.dictionary, statistics, candidate));
            let explained = explain(model, &starts, candidate, validation, base_validation)?;
            stage.tick()?;
            Ok(explained)
        })
        .collect::<Result<Vec<_>, DiagnoseError>>()?
        .into_iter()
        .flatten()
        .collect();
    let order = |explanations: &mut Vec<Explanation>| {
        explanations.sort_by(|a, b| b.score().total_cmp(&a.score()));
    };
    order(&mut explanations);
    // Once more from where the best ended: a poor θ leads to poor fits.
    if only.is_none() {
        let (round, draws) = if model.problem.is_simulated() {
            (
                Thresholds::SECOND_ROUND_SIMULATED,
                Thresholds::SECOND_DRAWS_SIMULATED,
            )
        } else {
            (Thresholds::SECOND_ROUND, Thresholds::SECOND_DRAWS)
        };
        let space = model.problem.twin.parameters();
        let d = space.len();
        let anywhere = Noise::new(0, "second round", 0);
        let thetas: Vec<Vec<f64>> = (explanations.iter().take(Thresholds::SECOND_STARTS))
            .map(|e| model.explained(e).of_record(0, &e.fitted.theta)[..d].to_vec())
            .chain((0..draws).map(|i| space.draw_prior(anywhere.sample(i))))
            .collect();
        let again: Vec<usize> = (0..explanations.len())
            .filter(|&i| {
                model.dictionary.candidates[explanations[i].candidate].is_listed() || i < 3
            })
            .take(round)
            .collect();
        let better: Vec<Option<Fitted>> = again
            .par_iter()
            .map(|&i| {
                let e = &explanations[i];
                let variant = &model.dictionary.variants[e.variant];
                let problem = variant.problem(&model.problem);
                let own = problem.of_record(0, &e.fitted.theta);
                let starts: Vec<Vec<f64>> = (thetas.iter())
                    .filter(|theta| theta[..] != own[..d])
                    .map(|theta| problem.full(&variant.theta(theta, &own[d..])))
                    .collect();
                let fitted = fit(&problem, &starts, ITERATIONS)?;
                Ok(fitted.filter(|f| f.objective > e.fitted.objective + 0.1))
            })
            .collect::<Result<_, DiagnoseError>>()?;
        for (i, fitted) in again.into_iter().zip(better) {
            if let Some(fitted) = fitted {
                let (candidate, variant) = (explanations[i].candidate, explanations[i].variant);
                explanations[i] = scored(
                    model,
                    candidate,
                    variant,
                    fitted,
                    validation,
                    base_validation,
                )?;
            }
        }
        order(&mut explanations);
    }
    Ok(explanations)
}

/// The best points of a candidate: (variant, magnitudes as the secant says), best first.
fn best_points(
    dictionary: &Dictionary,
    statistics: &Statistics,
    candidate: usize,
) -> Vec<(usize, Vec<f64>)> {
    let mut points: Vec<(&Point, Gain)> = (dictionary.points.iter())
        .zip(statistics.points.iter().copied())
        .filter(|(p, _)| dictionary.variants[p.variant].candidate == candidate)
        .collect();
    points.sort_by(|a, b| b.1.nats.total_cmp(&a.1.nats));
    let threshold = points.first().is_some_and(|(p, _)| {
        dictionary.variants[p.variant].free[0]
            .off
            .is_some_and(f64::is_infinite)
    });
    let most = if threshold {
        Thresholds::THRESHOLD_STARTS
    } else {
        Thresholds::STARTS
    };
    (points.into_iter().take(most))
        .map(|(point, gain)| {
            let axis = &dictionary.variants[point.variant].axes[0];
            let mut m = point.m.clone();
            if point.linear && gain.alpha != 0.0 {
                // A noise's square is what adds up.
                m[0] *= if axis.bounds.low() > 0.0 {
                    gain.alpha.clamp(0.01, 100.0).sqrt()
                } else {
                    gain.alpha
                };
            }
            (point.variant, m)
        })
        .collect()
}

fn explain(
    model: &FittedTwin<'_>,
    points: &[(usize, Vec<f64>)],
    candidate: usize,
    validation: Option<&[Record]>,
    base_validation: Option<f64>,
) -> Result<Option<Explanation>, DiagnoseError> {
    let dictionary = &model.dictionary;
    let mut best: Option<(f64, usize, Fitted)> = None;
    let price = 0.5 * (model.problem.samples() as f64).ln();
    for (n, (v, m)) in points.iter().enumerate() {
        let variant = &dictionary.variants[*v];
        let problem = variant.problem(&model.problem);
        let start = |theta: &[f64], m: &[f64]| -> Vec<f64> {
            problem.clamp(&variant.at(&model.problem, theta, m).1)
        };
        let mut starts = vec![start(&model.fitted.theta, m)];
        if n == 0 {
            starts.push(start(&model.problem.centre(), m));
        }
        let Some(mut fitted) = fit(&problem, &starts, ITERATIONS)? else {
            continue;
        };
        if !variant.jumps.is_empty() {
            fitted = jump(&problem, variant, fitted)?;
        }
        let value = fitted.objective - price * variant.free.len() as f64;
        if best.as_ref().is_none_or(|(b, ..)| value > *b) {
            best = Some((value, *v, fitted));
        }
    }
    let Some((_, v, fitted)) = best else {
        return Ok(None);
    };
    Ok(Some(scored(
        model,
        candidate,
        v,
        fitted,
        validation,
        base_validation,
    )?))
}

/// The likelihood of the validation record under the fitted twin's own twin.
pub(super) fn base_validation(
    model: &FittedTwin<'_>,
    validation: Option<&[Record]>,
) -> Result<Option<f64>, FilterError> {
    let Some(records) = validation else {
        return Ok(None);
    };
    let theta = model.theta();
    elsewhere(&model.problem.on(records), &theta)
}

/// A fit with its scores.
pub(super) fn scored(
    model: &FittedTwin<'_>,
    candidate: usize,
    v: usize,
    fitted: Fitted,
    validation: Option<&[Record]>,
    base_validation: Option<f64>,
) -> Result<Explanation, DiagnoseError> {
    let dictionary = &model.dictionary;
    let variant = &dictionary.variants[v];
    let numbers = if dictionary.candidates[candidate].is_listed() {
        variant.free.len() as f64
    } else {
        Thresholds::DISTURBANCE_NUMBERS
    };
    let gain = fitted.value() - model.fitted.value();
    let samples = model.problem.samples() as f64;
    let mut explanation = Explanation {
        candidate,
        variant: v,
        gain,
        penalised: gain - 0.5 * numbers * samples.ln() + variant.mark,
        validation: None,
        validation_likelihood: None,
        fitted,
    };
    if let (Some(records), Some(base)) = (validation, base_validation) {
        let problem = variant.problem(&model.problem.on(records));
        let theta = variant
            .problem(&model.problem)
            .of_record(0, &explanation.fitted.theta);
        let there = elsewhere(&problem, &theta)?;
        explanation.validation_likelihood = there;
        // A fit that does not even filter the validation record is no explanation.
        explanation.validation = Some(there.map_or(-1e3, |there| there - base));
    }
    Ok(explanation)
}

/// Moves a magnitude without a derivative by halved steps, the rest refitted.
fn jump(problem: &Problem<'_>, variant: &Variant, mut best: Fitted) -> Result<Fitted, FilterError> {
    let base = problem.twin.parameters().len() - variant.free.len();
    for &i in &variant.jumps {
        let at = base + i;
        let bounds = problem.axes[at].bounds;
        let mut step = bounds.width() / 18.0;
        let least = problem.records[0].drive().dt();
        while step > least {
            for side in [-1.0, 1.0] {
                let mut start = best.theta.clone();
                start[at] = bounds.clamp(start[at] + side * step);
                if let Some(trial) = climb(problem, &start, 4)?
                    && trial.objective > best.objective
                {
                    best = trial;
                    break;
                }
            }
            step *= 0.5;
        }
    }
    Ok(best)
}

/// Probabilities over explanations, by softmax of score/temperature; what is missing to one is an imitated law's.
pub(in crate::diagnose) fn probabilities(explanations: &[Explanation]) -> Vec<f64> {
    let top = explanations
        .iter()
        .map(Explanation::score)
        .fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = (explanations.iter())
        .map(|e| ((e.score() - top) / Thresholds::TEMPERATURE).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    weights
        .iter()
        .map(|w| (1.0 - Thresholds::IMITATED) * w / sum)
        .collect()
}

impl FittedTwin<'_> {
    /// The candidate of an explanation.
    pub fn candidate(&self, explanation: &Explanation) -> &Candidate {
        &self.dictionary.candidates[explanation.candidate]
    }

    /// The effect of an explanation as an addition to the twin.
    pub fn addition(&self, explanation: &Explanation) -> Option<Addition> {
        let candidate = &self.dictionary.candidates[explanation.candidate];
        match &candidate.kind {
            Kind::Listed(effect) => Some(Addition {
                effect: effect.clone(),
                held: self.dictionary.variants[explanation.variant].held.clone(),
                kept: self.dictionary.variants[explanation.variant].kept,
            }),
            Kind::CatchAll(..) => None,
        }
    }

    /// The problem that an explanation was fitted in.
    pub fn explained(&self, explanation: &Explanation) -> Problem<'_> {
        self.dictionary.variants[explanation.variant].problem(&self.problem)
    }
}
