//! Several effects together.
//!
//! Effects are added one by one, each the best beside those before it; partners are exchanged, so that two are found of which
//! neither helps much alone; and each is left out once more, so that none stays that only mended a poor fit of another.

use crate::diagnose::context::Context;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::{
    Explanation, ITERATIONS, base_validation, explanations, probabilities, scored,
};
use crate::diagnose::explain::step::{Accepted, Step, grown, improves};
use crate::diagnose::fitting::climb::fit;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::statistics::Statistics;
use crate::diagnose::thresholds::Thresholds;
use crate::progress::Stage;
use crate::record::Record;
use crate::twin::Noise;

/// Whether the scan beside a step's effects promises another one.
pub(in crate::diagnose) fn promises(step: &Step<'_>, look: &Statistics) -> bool {
    let price = 0.5 * (step.bench.problem.samples() as f64).ln();
    let candidates = &step.bench.dictionary.candidates;
    (candidates.iter().zip(&look.gains))
        .filter(|(candidate, _)| candidate.is_listed())
        .any(|(_, root)| 0.5 * root * root > price + Thresholds::PROMISE)
}

/// The best two of the `listed` explanations, or three: `None` where no second effect adds more than `margin` to the
/// `first`, whose records look like `look`.
pub(in crate::diagnose) fn several<'a>(
    context: &Context<'a>,
    bench: &FittedTwin<'a>,
    listed: &[&Explanation],
    (first, look): (&Step<'a>, &Statistics),
    margin: f64,
    noise: Noise,
    stage: &Stage,
) -> Result<Option<Step<'a>>, DiagnoseError> {
    let pair = best_pair(context, bench, listed, (first, look), stage)?;
    let Some(mut step) = pair.filter(|pair| pair.score > first.score + margin) else {
        return Ok(None);
    };
    // One that only helped another one out of a poor fit.
    for left_out in 0..step.accepted.len() {
        if let Some(alone) = without(context, bench, &step, left_out)?
            && alone.score > step.score - margin
        {
            return Ok((alone.accepted[0].key() != first.accepted[0].key()
                || alone.score > first.score + Thresholds::WORTH_ANOTHER)
                .then_some(alone));
        }
    }
    // Beside a noise, two effects follow nearly anything.
    while step.accepted.len() < Thresholds::MOST_EFFECTS
        && !step.accepted.iter().any(Accepted::is_noise)
    {
        let Some(look) = step.bench.own_look()? else {
            break;
        };
        if !promises(&step, &look) {
            break;
        }
        let next = beside(context, &step, &look, stage)?.best;
        let worth = |next: &Step<'_>| {
            next.score > step.score + Thresholds::WORTH_A_THIRD
                && !next.accepted.iter().any(Accepted::is_noise)
        };
        let Some(next) = next.filter(worth) else {
            break;
        };
        // Where the free run is to follow, likelihoods of thousands of nats are no measure.
        if context.follows && !improves(context, (&step.bench, &step.accepted), &next, noise)? {
            break;
        }
        step = next;
    }
    Ok(Some(step))
}

/// The best pair: the best beside each of the first few, then the best beside the partner that was found, and so on. Neither of
/// two effects need be much by itself.
fn best_pair<'a>(
    context: &Context<'a>,
    bench: &FittedTwin<'a>,
    listed: &[&Explanation],
    (first, look): (&Step<'a>, &Statistics),
    stage: &Stage,
) -> Result<Option<Step<'a>>, DiagnoseError> {
    let key = |e: &Explanation| bench.dictionary.candidates[e.candidate].key();
    let chances = probabilities(&listed.iter().map(|e| (*e).clone()).collect::<Vec<_>>());
    let mut tried = vec![first.accepted[0].key()];
    let mut best = beside(context, first, look, stage)?.best;
    let better = |best: &mut Option<Step<'a>>, pair: Option<Step<'a>>| {
        let gains =
            (pair.as_ref()).is_some_and(|p| best.as_ref().is_none_or(|b| p.score > b.score));
        if gains {
            *best = pair;
        }
        gains
    };
    let mut take = |index: usize| -> Result<Option<Beside<'a>>, DiagnoseError> {
        let name = key(listed[index]);
        if tried.contains(&name) {
            return Ok(None);
        }
        tried.push(name);
        let Some(step) = grown(context, bench, &[], listed[index], chances[index])? else {
            return Ok(None);
        };
        match step.bench.own_look()? {
            Some(look) => beside(context, &step, &look, stage).map(Some),
            None => Ok(None),
        }
    };
    for index in 1..listed.len().min(Thresholds::FIRSTS) {
        let pair = take(index)?.and_then(|found| found.best);
        better(&mut best, pair);
    }
    for _ in 0..Thresholds::EXCHANGES {
        let Some(pair) = &mut best else { break };
        let partner = pair.accepted[1].key();
        let Some(index) = listed.iter().position(|e| key(e) == partner) else {
            break;
        };
        let Some(found) = take(index)? else { break };
        // How probable the first one is beside the second.
        let first = pair.accepted[0].key();
        if let Some((_, chance)) = found.chances.iter().find(|(key, _)| *key == first) {
            pair.accepted[0].probability = *chance;
        }
        if !better(&mut best, found.best) {
            break;
        }
    }
    Ok(best)
}

/// What stands beside accepted effects.
struct Beside<'a> {
    /// The best listed effect, if it beats a catch-all there.
    best: Option<Step<'a>>,
    /// Probabilities of all that was tried.
    chances: Vec<(String, f64)>,
}

/// The best effect beside those of a step.
fn beside<'a>(
    context: &Context<'a>,
    step: &Step<'a>,
    look: &Statistics,
    stage: &Stage,
) -> Result<Beside<'a>, DiagnoseError> {
    let bench = &step.bench;
    let candidates = &bench.dictionary.candidates;
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|&a, &b| look.gains[b].total_cmp(&look.gains[a]));
    let mut tried: Vec<usize> = (order.iter().copied())
        .filter(|&c| candidates[c].is_listed())
        .take(Thresholds::SECONDS)
        .collect();
    // And the catch-all that promises most.
    tried.extend(order.iter().copied().find(|&c| !candidates[c].is_listed()));
    let found = explanations(bench, look, context.validation, Some(&tried), stage)?;
    let chances = probabilities(&found);
    let best = match found.first() {
        Some(best) if candidates[best.candidate].is_listed() => {
            let next = grown(context, bench, &step.accepted, best, chances[0])?;
            next.map(|mut next| {
                next.score += step.score;
                next
            })
        }
        _ => None,
    };
    let keys = found.iter().map(|e| candidates[e.candidate].key());
    Ok(Beside {
        best,
        chances: keys.zip(chances).collect(),
    })
}

/// An accepted effect alone, fitted from a θ of the twin and its own magnitudes; `None` where it cannot be.
fn refitted(
    bench: &FittedTwin<'_>,
    accepted: &Accepted,
    own: &[f64],
    validation: Option<&[Record]>,
) -> Result<Option<Explanation>, DiagnoseError> {
    let dictionary = &bench.dictionary;
    let (key, addition) = (accepted.key(), &accepted.addition);
    let found = dictionary.variants.iter().position(|v| {
        dictionary.candidates[v.candidate].key() == key
            && v.held == addition.held
            && v.kept == addition.kept
    });
    let Some(index) = found else { return Ok(None) };
    let variant = &dictionary.variants[index];
    let free: Vec<f64> = (accepted.magnitudes.iter())
        .filter(|(name, _)| !variant.held.contains_key(name))
        .map(|(_, value)| *value)
        .collect();
    let problem = variant.problem(&bench.problem);
    let start = problem.clamp(&problem.full(&variant.theta(own, &free)));
    let Some(fitted) = fit(&problem, &[start], ITERATIONS)? else {
        return Ok(None);
    };
    let base = base_validation(bench, validation)?;
    scored(bench, variant.candidate, index, fitted, validation, base).map(Some)
}

/// A pair without one of its effects, the other one fitted alone from where it stands beside it.
fn without<'a>(
    context: &Context<'a>,
    bench: &FittedTwin<'a>,
    pair: &Step<'a>,
    left_out: usize,
) -> Result<Option<Step<'a>>, DiagnoseError> {
    let kept: Vec<&Accepted> = (pair.accepted.iter().enumerate())
        .filter(|(i, _)| *i != left_out)
        .map(|(_, accepted)| accepted)
        .collect();
    let [kept] = kept[..] else { return Ok(None) };
    let theta = pair.bench.problem.of_record(0, &pair.bench.fitted.theta);
    let own = &theta[..bench.problem.twin.parameters().len()];
    let explanation = refitted(bench, kept, own, context.validation)?;
    match explanation {
        Some(explanation) => grown(context, bench, &[], &explanation, kept.probability),
        None => Ok(None),
    }
}
