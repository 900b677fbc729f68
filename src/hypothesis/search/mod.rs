//! Search for what a model lacks: all hypotheses are screened, the promising ones refitted.

pub(crate) mod asked;
mod breadth;
pub(crate) mod effects;
pub(crate) mod explanation;
mod fits;
mod fold;
pub(crate) mod frequencies;
pub(crate) mod model;
mod rivals;
pub(crate) mod screen;
mod traces;
mod valleys;

pub(crate) use crate::hypothesis::limits::SEARCH;
pub(crate) use breadth::Breadth;
pub(crate) use rivals::unknown;

use crate::fit::climb::climb;
use crate::hypothesis::set::TermSet;
use crate::hypothesis::term::{Term, marks};
use crate::likelihood::kalman::FilterError;
use crate::parallel::{try_each, try_found};
use explanation::{Explanation, sort};
use fits::{Effort, anneal, fit_afresh, fit_promise, fit_unfolded, loudly, release};
use model::Model;
use screen::{Promise, scan};
use std::collections::BTreeMap;
use std::sync::Arc;
use valleys::leave_valleys;

/// Nats that the ways to use a hypothesis cost it, by its key: they share its prior.
type Ways = BTreeMap<String, f64>;

/// The best of terms that are one hypothesis used in several ways.
fn merged(all: Vec<Explanation>, ways: &Ways) -> Vec<Explanation> {
    let mut best: BTreeMap<TermSet, Explanation> = BTreeMap::new();
    for found in all {
        let keys = found.set();
        match best.get(&keys) {
            Some(old) if old.log_z >= found.log_z => {}
            _ => {
                best.insert(keys, found);
            }
        }
    }
    let mut all: Vec<Explanation> = (best.into_values())
        .map(|mut found| {
            found.log_z -= ways.get(&found.last().key()).copied().unwrap_or(0.0);
            found
        })
        .collect();
    sort(&mut all);
    all
}

fn ways(terms: &[Arc<Term>]) -> Ways {
    let mut ways: BTreeMap<String, usize> = BTreeMap::new();
    for term in terms {
        *ways.entry(term.key()).or_insert(0) += 1;
    }
    let nats = |(key, count): (String, usize)| (key, (count as f64).ln());
    ways.into_iter().map(nats).collect()
}

/// Knowledge with which a search for listed effects begins.
#[derive(Default)]
pub(crate) struct Before {
    /// Further starts of the twin's own θ.
    pub thetas: Vec<Vec<f64>>,
    /// Fits of the same effects beside another fit of the same model: they go on from where they are.
    pub fits: Vec<Model>,
}

/// Listed effects beside a model, refitted; best first.
pub(crate) fn listed(
    model: &Model,
    terms: &[Arc<Term>],
    before: Before,
    breadth: Breadth,
) -> Result<Vec<Explanation>, FilterError> {
    if terms.is_empty() {
        return Ok(vec![]);
    }
    let promises = scan(model, terms)?;
    let found = |models: Vec<Model>| models.into_iter().map(Explanation::of);
    let first = first_fits(model, &promises, &before.thetas, breadth)?;
    let mut all: Vec<Explanation> = found(first).collect();
    let mut others = match breadth.afresh {
        true => fresh_fits(model, &promises)?,
        false => vec![],
    };
    if breadth.deep
        && let Some(loud) = loudly(model)?
    {
        others.extend(annealed_fits(model, &loud, terms, breadth)?);
    }
    let known: Vec<Explanation> = found(before.fits).collect();
    let is_known = |term: &Term| known.iter().any(|e| e.last().key() == term.key());
    let unfitted: Vec<&Promise> = (promises.iter())
        .filter(|promise| !is_known(&promise.term))
        .collect();
    for other in found(others) {
        let is_same = |own: &&mut Explanation| Arc::ptr_eq(own.last(), other.last());
        match all.iter_mut().find(is_same) {
            Some(own) if own.log_z >= other.log_z => {}
            Some(own) => *own = other,
            None => all.push(other),
        }
    }
    for old in known {
        let is_beaten = |new: &Explanation| new.set() == old.set() && new.log_z >= old.log_z;
        if !all.iter().any(is_beaten) {
            all.push(old);
        }
    }
    sort(&mut all);
    let floor = model.log_evidence;
    fit_on(model, &promises, breadth, &mut all)?;
    sort(&mut all);
    leave_valleys(model, &mut all, floor)?;
    // A filter sees rounding by its first two moments, and may be worse off with it than with louder noise; the values bear its mark
    // all the same.
    for found in &mut all {
        let mark = marks(&found.terms) - marks(&model.terms);
        if mark > 0.0 {
            found.log_z = found.log_z.max(floor + mark);
        }
    }
    // What was not refitted is no better than its promise.
    for promise in unfitted {
        if !all.iter().any(|f| Arc::ptr_eq(f.last(), &promise.term)) {
            all.push(Explanation {
                terms: beside(model, &promise.term),
                log_z: floor + (promise.nats() - SEARCH.averaged).min(-0.5),
                model: None,
            });
        }
    }
    Ok(merged(all, &ways(terms)))
}

/// Short fits of the terms that promise most.
fn first_fits(
    model: &Model,
    promises: &[Promise],
    thetas: &[Vec<f64>],
    breadth: Breadth,
) -> Result<Vec<Model>, FilterError> {
    let effort = Effort {
        starts: 0..SEARCH.first_starts,
        iterations: 6,
    };
    try_found(first_chosen(promises, breadth), |promise| {
        fit_promise(model, promise, thetas, effort.clone())
    })
}

/// Terms that promise most.
fn first_chosen(promises: &[Promise], breadth: Breadth) -> impl Iterator<Item = &Promise> {
    let best = promises.iter().take(breadth.listed);
    best.filter(move |promise| promise.nats() > breadth.least)
}

/// Fits of all terms from the prior's centre and from unfolded records: beside the twin where it is, the right one may promise nothing.
fn fresh_fits(model: &Model, promises: &[Promise]) -> Result<Vec<Model>, FilterError> {
    let fits = try_each(promises, |promise| {
        Ok::<_, FilterError>([fit_afresh(model, promise)?, fit_unfolded(model, promise)?])
    })?;
    Ok(fits.into_iter().flatten().flatten().collect())
}

/// The same from loud noise, of the terms that promise most there. Noise is let down to that of the model for those that are near the best by
/// then.
fn annealed_fits(
    model: &Model,
    loud: &Model,
    terms: &[Arc<Term>],
    breadth: Breadth,
) -> Result<Vec<Model>, FilterError> {
    let promises: Vec<Promise> = (scan(loud, terms)?.into_iter())
        .take(breadth.annealed)
        .filter(|promise| promise.nats() > breadth.least)
        .collect();
    let begun = try_each(&promises, |promise| anneal(model, loud, promise, 2))?;
    let best = (begun.iter().flatten())
        .map(|fitted| fitted.objective)
        .fold(f64::NEG_INFINITY, f64::max);
    try_found(promises.iter().zip(begun), |(promise, mut begun)| {
        begun.retain(|fitted| fitted.objective > best - SEARCH.lost);
        release(model, promise, &begun)
    })
}

/// Gives those near the best more starts, and carries them on.
fn fit_on(
    model: &Model,
    promises: &[Promise],
    breadth: Breadth,
    all: &mut [Explanation],
) -> Result<(), FilterError> {
    let has_begun = |promise: &Promise| {
        first_chosen(promises, breadth).any(|first| std::ptr::eq(first, promise))
    };
    let floor = model.log_evidence;
    let top = all.first().map_or(floor, |f| f.log_z);
    let is_near = |i: usize, log_z: f64| i < 5 || log_z > top - SEARCH.candidates;
    let is_worth = |i: usize, log_z: f64| i < 2 || log_z > floor + 1.0;
    let best: Vec<Vec<f64>> = all
        .iter()
        .take(2)
        .filter_map(Explanation::own_theta)
        .collect();
    let better = try_each(all.iter().enumerate(), |(i, found)| {
        if !is_near(i, found.log_z) || !is_worth(i, found.log_z) {
            return Ok(None);
        }
        let own = found.own_theta();
        let thetas: Vec<Vec<f64>> = (best.iter())
            .filter(|theta| own.as_ref() != Some(theta))
            .cloned()
            .collect();
        let most = match found.last().shape() {
            Some(_) => SEARCH.starts_of_shape,
            None => 3,
        };
        let promise = promises.iter().find(|p| Arc::ptr_eq(&p.term, found.last()));
        let fitted = match promise {
            Some(promise) => {
                // The first starts have had their climbs.
                let first = if has_begun(promise) {
                    SEARCH.first_starts
                } else {
                    0
                };
                let effort = Effort {
                    starts: first..most,
                    iterations: 12,
                };
                fit_promise(model, promise, &thetas, effort)?
            }
            None => None,
        };
        let carried = match &found.model {
            Some(m) => climb(&m.problem, &m.fitted.theta, SEARCH.carried)?
                .and_then(|fitted| m.refitted(fitted)),
            None => None,
        };
        let best = [fitted, carried].into_iter().flatten().reduce(|a, b| {
            match b.fitted.objective > a.fitted.objective {
                true => b,
                false => a,
            }
        });
        Ok::<_, FilterError>(best.map(Explanation::of))
    })?;
    for (own, better) in all.iter_mut().zip(better) {
        if let Some(better) = better.filter(|better| better.log_z > own.log_z) {
            *own = better;
        }
    }
    Ok(())
}

/// The terms of a model and one more.
fn beside(model: &Model, term: &Arc<Term>) -> Vec<Arc<Term>> {
    (model.terms.iter().chain([term])).cloned().collect()
}
