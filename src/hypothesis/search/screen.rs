//! Promise of a term beside a fitted model, before any refit.
//!
//! The innovations of the model with a little of the term give a direction; the gain along it, θ free to answer, is the promise of a
//! listed effect. An unknown function's coefficients have a score each, so that its evidence has a closed form.

use super::model::{Extended, Model};
use crate::fit::evidence::{Laplace, laplace};
use crate::fit::reference::Reference;
use crate::hypothesis::term::{Start, Term, marks};
use crate::likelihood::kalman::{FilterError, Filtered, recoverable};
use crate::math::descending;
use crate::parallel::{try_each, try_found};
use nalgebra::DVector;
use std::sync::Arc;

/// A term and its best starts.
pub(crate) struct Promise {
    pub term: Arc<Term>,
    /// Nats that the outputs themselves speak for it, beside what they speak for the model.
    pub mark: f64,
    /// Best first.
    pub starts: Vec<Beginning>,
}

/// Where a fit of a term may begin.
#[derive(Clone)]
pub(crate) struct Beginning {
    /// Gain to second order, in nats.
    pub nats: f64,
    /// Magnitudes.
    pub m: Vec<f64>,
    /// True where less of the first magnitude is less of the term.
    pub scales: bool,
    /// Answer of θ of the model to it, in φ.
    pub answer: DVector<f64>,
}

impl Promise {
    /// The best gain in nats, that of a mark on the outputs included.
    pub fn nats(&self) -> f64 {
        let best = self.starts.first().map_or(0.0, |start| start.nats);
        best + self.mark
    }
}

/// Promises of terms beside a model, best first; terms that nothing can be told of are left out.
pub(crate) fn scan(model: &Model, terms: &[Arc<Term>]) -> Result<Vec<Promise>, FilterError> {
    match model.reference()? {
        Some(reference) => scan_from(model, &reference, terms),
        None => Ok(vec![]),
    }
}

/// As [`scan`] with the innovations at hand.
pub(crate) fn scan_from(
    model: &Model,
    reference: &Reference,
    terms: &[Arc<Term>],
) -> Result<Vec<Promise>, FilterError> {
    let mut all = try_each(terms, |term| {
        let extended = model.extend(term)?;
        let found = looked(model, &extended, |look, filtered| {
            look.promise(model, reference, &extended, filtered)
        })?;
        let mut starts: Vec<Beginning> = found.into_iter().flatten().collect();
        descending(&mut starts, |a| a.nats);
        Ok::<_, FilterError>(Promise {
            term: term.clone(),
            mark: marks(model.terms.iter().chain([term])) - marks(&model.terms),
            starts,
        })
    })?;
    all.retain(|promise| !promise.starts.is_empty());
    descending(&mut all, |a| a.nats());
    Ok(all)
}

/// Calls `then` with what filters see of the last term of `extended` beside a model, from each start at which the twin works.
pub(crate) fn looked<T>(
    model: &Model,
    extended: &Extended,
    mut then: impl FnMut(&Look, &[Filtered]) -> T,
) -> Result<Vec<T>, FilterError> {
    let Some(term) = extended.terms.last() else {
        return Ok(vec![]);
    };
    let problem = &extended.problem;
    let looks: Vec<Look> = (term.starts.iter())
        .map(|start| Look::of(model, extended, start))
        .collect();
    // A little of what does nothing is told from nothing by its bits, which are others side by side.
    if looks.iter().any(|look| look.scales) {
        let mut all = vec![];
        for looks in looks.chunks(rayon::current_num_threads()) {
            let found = try_each(looks, |look| recoverable(problem.filtered(&look.theta)))?;
            let found = looks.iter().zip(found);
            all.extend(found.filter_map(|(look, filtered)| Some(then(look, &filtered?))));
        }
        return Ok(all);
    }
    let thetas: Vec<Vec<f64>> = looks.iter().map(|look| look.theta.clone()).collect();
    let found = problem.each_filtered(&thetas, |i, filtered| then(&looks[i], &filtered))?;
    Ok(found.into_iter().flatten().collect())
}

/// A little of a term beside a model, or another value where that has no size.
pub(crate) struct Look {
    /// Magnitudes.
    pub m: Vec<f64>,
    /// True where less of the first magnitude is less of the term.
    pub scales: bool,
    /// First magnitude of a little.
    step: f64,
    /// θ of the model with it.
    theta: Vec<f64>,
}

impl Look {
    /// From a start of the last term of `extended`.
    fn of(model: &Model, extended: &Extended, start: &Start) -> Self {
        let first = &extended.problem.axes[extended.entries[0]];
        let mut m = start.m.clone();
        let step = match first.small_size().filter(|_| start.scales) {
            Some(step) => {
                m[0] = step;
                step
            }
            None => 1.0,
        };
        Self {
            theta: model.beside(extended, &m),
            scales: start.scales,
            step,
            m,
        }
    }

    /// The gain of the start by what the filter saw there; `None` where there is none.
    fn promise(
        &self,
        model: &Model,
        reference: &Reference,
        extended: &Extended,
        filtered: &[Filtered],
    ) -> Option<Beginning> {
        let direction = reference.direction(filtered);
        let mut m = self.m.clone();
        if self.scales {
            let bounds = &extended.problem.axes[extended.entries[0]].bounds;
            let (low, high) = (bounds.low() / self.step, bounds.high() / self.step);
            let gain = reference.gain(&direction, (low.min(high), low.max(high)));
            m[0] = gain.alpha * self.step;
            return (gain.nats > 0.0).then(|| Beginning {
                nats: gain.nats,
                m,
                scales: true,
                answer: reference.answer(&direction, gain.alpha),
            });
        }
        let value: f64 = filtered.iter().map(|f| f.log_likelihood).sum();
        let gain = reference.gain(&direction, (0.0, 1.5));
        let better = value - model.fitted.log_likelihood;
        // Secants of noise promise hundreds of nats on records of the twin itself.
        let nats = match extended.terms.last().is_some_and(|term| term.is_noise()) {
            true => better,
            false => better.max(gain.nats),
        };
        Some(Beginning {
            nats,
            m,
            scales: false,
            answer: reference.answer(&direction, 1.0),
        })
    }
}

/// Evidence of an unknown function to second order, before any refit.
pub(crate) struct Linear {
    pub extended: Extended,
    /// Nats over the model.
    pub gain: f64,
    pub found: Laplace,
    pub theta: Vec<f64>,
}

/// Unknown functions beside a model, best first.
pub(crate) fn functions(model: &Model, terms: &[Arc<Term>]) -> Result<Vec<Linear>, FilterError> {
    let mut all: Vec<Linear> = try_found(terms, |term| {
        let extended = model.extend(term)?;
        let mut best: Option<(f64, Laplace, Vec<f64>)> = None;
        for start in &term.starts {
            let theta = model.beside(&extended, &start.m);
            let Some(fitted) = extended.at(&theta)? else {
                continue;
            };
            let Some((log_evidence, found)) = laplace(&extended.problem, &fitted, f64::INFINITY)
            else {
                continue;
            };
            let gain = log_evidence + marks(&model.terms) - model.log_evidence;
            if best.as_ref().is_none_or(|(b, ..)| gain > *b) {
                best = Some((gain, found, theta));
            }
        }
        Ok::<_, FilterError>(best.map(|(gain, found, theta)| Linear {
            extended,
            gain,
            found,
            theta,
        }))
    })?;
    descending(&mut all, |a| a.gain);
    Ok(all)
}
