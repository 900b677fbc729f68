//! Unknown functions, disturbances and waves beside a model: the rivals of listed effects.

use super::breadth::Breadth;
use super::explanation::Explanation;
use super::fits::{Effort, fit_function, fit_promise};
use super::model::Model;
use super::screen::{functions, scan_from};
use super::traces::screened;
use super::{beside, merged, ways};
use crate::fit::reference::Reference;
use crate::hypothesis::limits::SEARCH;
use crate::hypothesis::term::{Nature, Term};
use crate::likelihood::kalman::FilterError;
use crate::math::{descending, log_mean, median};
use crate::parallel::try_each;
use std::sync::Arc;

/// A hypothesis before it is weighed against others: its terms, its nats, and its fit where it was worth one.
type Weighed = (Vec<Arc<Term>>, f64, Option<Model>);

/// Unknown functions beside a model; best first.
pub(crate) fn unknown(
    model: &Model,
    terms: &[Arc<Term>],
    breadth: Breadth,
) -> Result<Vec<Explanation>, FilterError> {
    let of = |nature: Nature| -> Vec<Arc<Term>> {
        let own = terms.iter().filter(|term| term.nature == nature);
        own.cloned().collect()
    };
    let half = breadth.functions.div_ceil(2);
    // Lags and plays of one variable at one place explain nearly the same; what a screen lets pass costs a gradient.
    let few = breadth.functions.div_ceil(6);
    let with = |functions: usize| Breadth {
        functions,
        ..breadth
    };
    let reference = model.reference()?;
    let pasts = screened(model, reference.as_ref(), of(Nature::Past), with(few + 1))?;
    let mut all = vec![
        weighed(model, &of(Nature::Function), 0.0, breadth)?,
        weighed(model, &of(Nature::Reading), 0.0, with(half))?,
        weighed(
            model,
            &of(Nature::Periodic),
            SEARCH.price_of_frequency,
            with(half),
        )?,
    ];
    let mut own = weighed(model, &pasts.kept, 0.0, with(few))?;
    let others = pasts.others.iter();
    own.extend(others.map(|(term, gain)| (beside(model, term), *gain, None)));
    all.push(own);
    if let Some(reference) = &reference {
        all.push(disturbances(
            model,
            reference,
            &of(Nature::Time),
            with(half),
        )?);
    }
    let explained = (all.into_iter()).flat_map(|all| explained(model, all, breadth.least));
    let mut ways = ways(terms);
    ways.extend(pasts.ways);
    Ok(merged(explained.collect(), &ways))
}

/// Functions beside a model, so many of the best of them refitted; `price` is taken off what they promise.
fn weighed(
    model: &Model,
    terms: &[Arc<Term>],
    price: f64,
    breadth: Breadth,
) -> Result<Vec<Weighed>, FilterError> {
    let linear = functions(model, terms)?;
    try_each(linear.into_iter().enumerate(), |(i, linear)| {
        let (terms, gain) = (linear.extended.terms.clone(), linear.gain - price);
        let iterations = if gain > 10.0 { 6 } else { 4 };
        let fitted = match i < breadth.functions && linear.gain > breadth.least {
            true => fit_function(model, linear, iterations)?,
            false => None,
        };
        Ok((terms, gain, fitted))
    })
}

/// Disturbances beside a model, so many of the best of them refitted.
fn disturbances(
    model: &Model,
    reference: &Reference,
    terms: &[Arc<Term>],
    breadth: Breadth,
) -> Result<Vec<Weighed>, FilterError> {
    let promises = scan_from(model, reference, terms)?;
    // The starts of a disturbance are sizes from its prior: their mean likelihood is the evidence, but for what θ answers.
    let rough: Vec<f64> = (promises.iter())
        .map(|p| log_mean(&p.starts.iter().map(|start| start.nats).collect::<Vec<_>>()))
        .collect();
    let mut order: Vec<usize> = (0..rough.len()).collect();
    descending(&mut order, |&i| rough[i]);
    try_each(order.into_iter().enumerate(), |(n, i)| {
        let is_worth = rough[i] > 0.0 || promises[i].nats() > breadth.least;
        let effort = Effort {
            starts: 0..SEARCH.first_starts,
            iterations: 6,
        };
        let fitted = match n < breadth.functions && is_worth {
            true => fit_promise(model, &promises[i], &[], effort)?,
            false => None,
        };
        Ok((beside(model, &promises[i].term), rough[i], fitted))
    })
}

/// The explanations that hypotheses of one kind are: those that were not refitted count as the refits tell.
fn explained(model: &Model, all: Vec<Weighed>, least: f64) -> Vec<Explanation> {
    let added = |fitted: &Model| fitted.log_evidence - model.log_evidence;
    let refits: Vec<(f64, Option<f64>)> = (all.iter())
        .map(|(_, gain, fitted)| (*gain, fitted.as_ref().map(added)))
        .collect();
    let estimates = of_promises(&refits, least).into_iter();
    (all.into_iter().zip(estimates))
        .map(|((terms, _, fitted), gain)| Explanation {
            log_z: model.log_evidence + gain,
            terms,
            model: fitted,
        })
        .collect()
}

/// Nats of hypotheses that promise nats and of which the best were refitted: of the others the share of their promise that the refits kept,
/// by the median, and no more than the best refit. A promise counts what a step far beyond the quadratic's reach would gain.
fn of_promises(all: &[(f64, Option<f64>)], least: f64) -> Vec<f64> {
    let refits = || {
        all.iter()
            .filter_map(|(gain, refit)| Some((*gain, (*refit)?)))
    };
    let shares: Vec<f64> = refits()
        .filter(|(gain, _)| *gain > 0.0)
        .map(|(gain, refit)| refit / gain)
        .collect();
    let share = median(&shares).unwrap_or(1.0).clamp(0.0, 1.0);
    let best = refits().map(|(_, refit)| refit).fold(least, f64::max);
    (all.iter())
        .map(|(gain, refit)| {
            refit.unwrap_or((gain * if *gain > 0.0 { share } else { 1.0 }).min(best))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three refits kept a half, so the fourth is worth half its promise; what promises a loss keeps it.
    #[test]
    fn what_is_not_refitted_is_no_better_than_the_refits_tell() {
        let all = [
            (40.0, Some(20.0)),
            (30.0, Some(18.0)),
            (20.0, Some(8.0)),
            (16.0, None),
            (-1.0, None),
        ];
        assert_eq!(of_promises(&all, 2.5), [20.0, 18.0, 8.0, 8.0, -1.0]);
        assert_eq!(of_promises(&[(5.0, None)], 2.5), [2.5]);
    }
}
