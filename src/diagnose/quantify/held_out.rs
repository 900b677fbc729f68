//! Share of the gap closed on held-out data.

use crate::diagnose::context::Context;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::Explanation;
use crate::diagnose::explain::decide::Conclusion;
use crate::diagnose::explain::extended::{Accepted, ExtendedTwin, additions};
use crate::diagnose::outcome::Shrinkage;
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::free_run::{Runner, closed, interval, root};
use crate::fit::climb::{Fitted, fit};
use crate::fit::first_part::first_part;
use crate::fit::posterior::posterior;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::record::Record;
use crate::twin::{Noise, Role};
use rayon::prelude::*;

/// Samples of the shortest record whose last third is held out.
pub const SHORTEST_SPLIT: usize = 300;

/// The first sample that is held out of a record without another to validate.
pub(crate) fn held_out_from(samples: usize) -> usize {
    2 * samples / 3
}

/// Measures how far the accepted effects close the gap on held-out data.
pub(in crate::diagnose) fn shrinkage(
    context: &Context<'_>,
    model: &FittedTwin<'_>,
    extended: Option<&ExtendedTwin<'_>>,
    conclusion: &Conclusion,
    explanations: Option<&[Explanation]>,
    settings: &DiagnoseSettings,
    noise: Noise,
) -> Result<Option<Shrinkage>, DiagnoseError> {
    let twin = context.twin;
    let additions = additions(&conclusion.accepted);
    let whole = &model.problem.records[0];
    // The held-out record, its first sample that counts, and θ fitted without it.
    let short: Vec<Record>;
    let (record, from, base, grown, held_out) = match context.validation {
        Some(records) => {
            let base = model.theta();
            let grown = extended.map(|s| s.model.theta());
            (&records[0], 0, Some(base), grown, "validation record")
        }
        None if whole.samples() >= SHORTEST_SPLIT => {
            let split = held_out_from(whole.samples());
            let Some(part) = first_part(whole, split) else {
                return Ok(None);
            };
            short = vec![part];
            let refit = |problem: &Problem<'_>, theta: &[f64]| -> Result<_, FilterError> {
                let problem = problem.on(&short);
                Ok(fit(&problem, &[problem.full(theta)], 10)?.map(|f| f.theta))
            };
            let base = model.theta();
            let base = refit(&model.problem, &base)?;
            let grown = match extended {
                Some(s) => refit(&s.model.problem, &s.model.theta())?,
                None => None,
            };
            (whole, split, base, grown, "last third of the record")
        }
        None => return Ok(None),
    };
    let Some(base) = base else { return Ok(None) };
    let runner = Runner::new(twin, &[], base.clone())?;
    let before = runner.errors(record, from);
    let Some(before) = before.filter(|errors| !errors.is_empty()) else {
        return Ok(None);
    };
    let unfitted = settings
        .initial
        .clone()
        .unwrap_or_else(|| twin.parameters().centre());
    let unfitted = Runner::new(twin, &[], unfitted)?.errors(record, from);
    let noisy =
        !conclusion.accepted.is_empty() && conclusion.accepted.iter().all(Accepted::is_noise);
    let mut result = Shrinkage {
        metric: Shrinkage::FREE_RUN,
        before: root(&before),
        after: None,
        floor: None,
        closed: None,
        interval: None,
        held_out,
        unfitted: unfitted.map(|e| root(&e)),
        placebo: None,
    };
    let Some(grown) = grown.filter(|_| !additions.is_empty()) else {
        result.floor = runner.floor(record, from, noise.child("floor"));
        return Ok(Some(result));
    };
    if noisy && let Some(extended) = extended {
        // No free run moves: the density of what was held out does.
        result.metric = Shrinkage::LOG_SCORE;
        let records = std::slice::from_ref(record);
        let score = |problem: &Problem<'_>, theta: &[f64]| -> Result<Option<f64>, FilterError> {
            let problem = problem.on(records);
            let all = recoverable(problem.filtered(&problem.full(theta)))?;
            Ok(all.map(|all| {
                let d = &all[0].log_densities[from..];
                d.iter().sum::<f64>() / d.len() as f64
            }))
        };
        let Some(before) = score(&model.problem, &base)? else {
            return Ok(None);
        };
        result.before = before;
        result.after = score(&extended.model.problem, &grown)?;
        (result.unfitted, result.placebo) = (None, None);
        return Ok(Some(result));
    }
    let accepted = Runner::new(twin, &additions, grown)?;
    let after = accepted.errors(record, from);
    // Noise levels are those of the twin alone, so that a wider noise is no smaller gap.
    let space = twin.parameters();
    let mut quiet = accepted.theta.clone();
    for (j, p) in space.iter().enumerate() {
        // That of a simulator without noise is all that it misses.
        if p.role == Role::Noise && !context.silent {
            quiet[j] = base[j];
        }
    }
    let floor = Runner {
        twin: accepted.twin.clone(),
        theta: quiet,
    }
    .floor(record, from, noise.child("floor"));
    result.after = after.as_deref().map(root);
    result.floor = floor;
    if let (Some(after), Some(floor)) = (&after, floor) {
        (result.closed, result.interval) = closed(&before, after, floor, noise.child("bootstrap"));
    }
    if let (Some(closed), Some(floor), Some(extended)) = (result.closed, floor, extended) {
        let all = all_data(context, extended)?;
        let (problem, fitted) = match &all {
            Some((problem, fitted)) => (problem, fitted),
            None => (&extended.model.problem, &extended.model.fitted),
        };
        let draws = posterior(problem, fitted, noise.child("posterior"))?;
        let afters: Vec<f64> = (draws.into_par_iter())
            .map(|theta| Ok(Runner::new(twin, &additions, theta)?.errors(record, from)))
            .collect::<Result<Vec<_>, DiagnoseError>>()?
            .into_iter()
            .flatten()
            .map(|errors| root(&errors))
            .collect();
        result.interval = interval(result.before, closed, floor, &afters).or(result.interval);
    }
    result.placebo = placebo(context, model, explanations, conclusion, record, from)?;
    Ok(Some(result))
}

/// The accepted twin fitted to the records and the validation record together; `None` where there is none.
fn all_data<'a>(
    context: &Context<'a>,
    extended: &ExtendedTwin<'_>,
) -> Result<Option<(Problem<'a>, Fitted)>, DiagnoseError> {
    let Some(records) = context.together else {
        return Ok(None);
    };
    let (problem, start) = extended.model.on(records);
    Ok(fit(&problem, &[start], 10)?.map(|fitted| (problem, fitted)))
}

/// The error with the listed effect that explains least, fitted as the accepted one was.
fn placebo(
    context: &Context<'_>,
    model: &FittedTwin<'_>,
    explanations: Option<&[Explanation]>,
    conclusion: &Conclusion,
    record: &Record,
    from: usize,
) -> Result<Option<f64>, DiagnoseError> {
    let candidates = &model.dictionary.candidates;
    let last = explanations.and_then(|list| {
        list.iter().rev().find(|e| {
            let candidate = &candidates[e.candidate];
            candidate.is_listed()
                && !candidate.is_noise()
                && !conclusion.class.contains(&candidate.key())
        })
    });
    let Some(last) = last else { return Ok(None) };
    let Some(addition) = model.addition(last) else {
        return Ok(None);
    };
    let theta = model.explained(last).of_record(0, &last.fitted.theta);
    let runner = Runner::new(context.twin, &[addition], theta)?;
    Ok(runner.errors(record, from).map(|e| root(&e)))
}
