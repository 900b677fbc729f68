//! Several effects together.
//!
//! Effects are added one by one, each the best beside those before it; partners are exchanged, so that two are explanations of which
//! neither helps much alone; and each is left out once more, so that none stays that only mended a poor fit of another.

use crate::diagnose::context::Context;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::{
    Explanation, ITERATIONS, base_validation, explanations, probabilities, scored,
};
use crate::diagnose::explain::extended::{Accepted, ExtendedTwin, extend, improves};
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::statistics::Statistics;
use crate::diagnose::thresholds::Thresholds;
use crate::fit::climb::fit;
use crate::progress::Stage;
use crate::record::Record;
use crate::twin::Noise;

/// Returns true where the scan beside the effects of `extended` promises another one.
pub(in crate::diagnose) fn promises(extended: &ExtendedTwin<'_>, statistics: &Statistics) -> bool {
    let price = 0.5 * (extended.model.problem.samples() as f64).ln();
    let candidates = &extended.model.dictionary.candidates;
    (candidates.iter().zip(&statistics.gains))
        .filter(|(candidate, _)| candidate.is_listed())
        .any(|(_, root)| 0.5 * root * root > price + Thresholds::PROMISE)
}

/// The best two of the `listed` explanations, or three: `None` where no second effect adds more than `margin` to the
/// `first`, whose records look like `look`.
pub(in crate::diagnose) fn several<'a>(
    context: &Context<'a>,
    model: &FittedTwin<'a>,
    listed: &[&Explanation],
    (first, statistics): (&ExtendedTwin<'a>, &Statistics),
    margin: f64,
    noise: Noise,
    stage: &Stage,
) -> Result<Option<ExtendedTwin<'a>>, DiagnoseError> {
    let pair = best_pair(context, model, listed, (first, statistics), stage)?;
    let Some(mut extended) = pair.filter(|pair| pair.score > first.score + margin) else {
        return Ok(None);
    };
    // One that only helped another one out of a poor fit.
    for left_out in 0..extended.accepted.len() {
        if let Some(alone) = without(context, model, &extended, left_out)?
            && alone.score > extended.score - margin
        {
            return Ok((alone.accepted[0].key() != first.accepted[0].key()
                || alone.score > first.score + Thresholds::WORTH_ANOTHER)
                .then_some(alone));
        }
    }
    // Beside a noise, two effects follow nearly anything.
    while extended.accepted.len() < Thresholds::MOST_EFFECTS
        && !extended.accepted.iter().any(Accepted::is_noise)
    {
        let Some(statistics) = extended.model.own_statistics()? else {
            break;
        };
        if !promises(&extended, &statistics) {
            break;
        }
        let next = beside(context, &extended, &statistics, stage)?.best;
        let worth = |next: &ExtendedTwin<'_>| {
            next.score > extended.score + Thresholds::WORTH_A_THIRD
                && !next.accepted.iter().any(Accepted::is_noise)
        };
        let Some(next) = next.filter(worth) else {
            break;
        };
        // Where the free run is to follow, likelihoods of thousands of nats are no measure.
        if context.follows
            && !improves(context, (&extended.model, &extended.accepted), &next, noise)?
        {
            break;
        }
        extended = next;
    }
    Ok(Some(extended))
}

/// The best pair: the best beside each of the first few, then the best beside the partner that was explanations, and so on. Neither of
/// two effects need be much by itself.
fn best_pair<'a>(
    context: &Context<'a>,
    model: &FittedTwin<'a>,
    listed: &[&Explanation],
    (first, statistics): (&ExtendedTwin<'a>, &Statistics),
    stage: &Stage,
) -> Result<Option<ExtendedTwin<'a>>, DiagnoseError> {
    let key = |e: &Explanation| model.candidate(e).key();
    let chances = probabilities(&listed.iter().map(|e| (*e).clone()).collect::<Vec<_>>());
    let mut tried = vec![first.accepted[0].key()];
    let mut best = beside(context, first, statistics, stage)?.best;
    let better = |best: &mut Option<ExtendedTwin<'a>>, pair: Option<ExtendedTwin<'a>>| {
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
        let Some(extended) = extend(context, model, &[], listed[index], chances[index])? else {
            return Ok(None);
        };
        match extended.model.own_statistics()? {
            Some(statistics) => beside(context, &extended, &statistics, stage).map(Some),
            None => Ok(None),
        }
    };
    for index in 1..listed.len().min(Thresholds::FIRSTS) {
        let pair = take(index)?.and_then(|partners| partners.best);
        better(&mut best, pair);
    }
    for _ in 0..Thresholds::EXCHANGES {
        let Some(pair) = &mut best else { break };
        let partner = pair.accepted[1].key();
        let Some(index) = listed.iter().position(|e| key(e) == partner) else {
            break;
        };
        let Some(partners) = take(index)? else { break };
        // How probable the first one is beside the second.
        let first = pair.accepted[0].key();
        if let Some((_, chance)) = partners.chances.iter().find(|(key, _)| *key == first) {
            pair.accepted[0].probability = *chance;
        }
        if !better(&mut best, partners.best) {
            break;
        }
    }
    Ok(best)
}

/// Result of a search beside accepted effects.
struct Beside<'a> {
    /// The best listed effect, if it beats a catch-all there.
    best: Option<ExtendedTwin<'a>>,
    /// Probabilities of all that was tried.
    chances: Vec<(String, f64)>,
}

/// The best effect beside those of a extended.
fn beside<'a>(
    context: &Context<'a>,
    extended: &ExtendedTwin<'a>,
    statistics: &Statistics,
    stage: &Stage,
) -> Result<Beside<'a>, DiagnoseError> {
    let model = &extended.model;
    let candidates = &model.dictionary.candidates;
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|&a, &b| statistics.gains[b].total_cmp(&statistics.gains[a]));
    let mut tried: Vec<usize> = (order.iter().copied())
        .filter(|&c| candidates[c].is_listed())
        .take(Thresholds::SECONDS)
        .collect();
    // And the catch-all that promises most.
    tried.extend(order.iter().copied().find(|&c| !candidates[c].is_listed()));
    let explanations = explanations(model, statistics, context.validation, Some(&tried), stage)?;
    let chances = probabilities(&explanations);
    let best = match explanations.first() {
        Some(best) if candidates[best.candidate].is_listed() => {
            let next = extend(context, model, &extended.accepted, best, chances[0])?;
            next.map(|mut next| {
                next.score += extended.score;
                next
            })
        }
        _ => None,
    };
    let keys = explanations.iter().map(|e| candidates[e.candidate].key());
    Ok(Beside {
        best,
        chances: keys.zip(chances).collect(),
    })
}

/// An accepted effect alone, fitted from a θ of the twin and its own magnitudes; `None` where it cannot be.
fn refitted(
    model: &FittedTwin<'_>,
    accepted: &Accepted,
    own: &[f64],
    validation: Option<&[Record]>,
) -> Result<Option<Explanation>, DiagnoseError> {
    let dictionary = &model.dictionary;
    let (key, addition) = (accepted.key(), &accepted.addition);
    let position = dictionary.variants.iter().position(|v| {
        dictionary.candidates[v.candidate].key() == key
            && v.held == addition.held
            && v.kept == addition.kept
    });
    let Some(index) = position else {
        return Ok(None);
    };
    let variant = &dictionary.variants[index];
    let free: Vec<f64> = (accepted.magnitudes.iter())
        .filter(|(name, _)| !variant.held.contains_key(name))
        .map(|(_, value)| *value)
        .collect();
    let problem = variant.problem(&model.problem);
    let start = problem.clamp(&problem.full(&variant.theta(own, &free)));
    let Some(fitted) = fit(&problem, &[start], ITERATIONS)? else {
        return Ok(None);
    };
    let base = base_validation(model, validation)?;
    scored(model, variant.candidate, index, fitted, validation, base).map(Some)
}

/// A pair without one of its effects, the other one fitted alone from where it stands beside it.
fn without<'a>(
    context: &Context<'a>,
    model: &FittedTwin<'a>,
    pair: &ExtendedTwin<'a>,
    left_out: usize,
) -> Result<Option<ExtendedTwin<'a>>, DiagnoseError> {
    let kept: Vec<&Accepted> = (pair.accepted.iter().enumerate())
        .filter(|(i, _)| *i != left_out)
        .map(|(_, accepted)| accepted)
        .collect();
    let [kept] = kept[..] else { return Ok(None) };
    let theta = pair.model.theta();
    let own = &theta[..model.problem.twin.parameters().len()];
    let explanation = refitted(model, kept, own, context.validation)?;
    match explanation {
        Some(explanation) => extend(context, model, &[], &explanation, kept.probability),
        None => Ok(None),
    }
}
