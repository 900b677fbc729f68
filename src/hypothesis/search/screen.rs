//! Promise of a term beside a fitted model, before any refit.
//!
//! The innovations of the model with a little of the term give a direction; the gain along it, θ free to answer, is the promise of a
//! listed effect. An unknown function's coefficients have a score each, so that its evidence has a closed form.

use super::model::{Extended, Model};
use crate::fit::evidence::{Laplace, laplace};
use crate::fit::reference::Reference;
use crate::hypothesis::term::{Start, Term, marks};
use crate::likelihood::kalman::{FilterError, recoverable};
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
        let start = |start| promise(model, reference, &extended, start);
        let mut starts: Vec<Beginning> = try_found(&term.starts, start)?;
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

/// The gain of one start, and its magnitudes.
fn promise(
    model: &Model,
    reference: &Reference,
    extended: &Extended,
    start: &Start,
) -> Result<Option<Beginning>, FilterError> {
    let problem = &extended.problem;
    let first = &problem.axes[extended.entries[0]];
    let mut m = start.m.clone();
    let step = match first.small_size().filter(|_| start.scales) {
        Some(step) => {
            m[0] = step;
            step
        }
        None => 1.0,
    };
    let theta = model.beside(extended, &m);
    let Some(filtered) = recoverable(problem.filtered(&theta))? else {
        return Ok(None);
    };
    let direction = reference.direction(&filtered);
    if start.scales {
        let (low, high) = (first.bounds.low() / step, first.bounds.high() / step);
        let gain = reference.gain(&direction, (low.min(high), low.max(high)));
        m[0] = gain.alpha * step;
        return Ok((gain.nats > 0.0).then(|| Beginning {
            nats: gain.nats,
            m,
            scales: true,
            answer: reference.answer(&direction, gain.alpha),
        }));
    }
    let value: f64 = filtered.iter().map(|f| f.log_likelihood).sum();
    let gain = reference.gain(&direction, (0.0, 1.5));
    let better = value - model.fitted.log_likelihood;
    // Secants of noise promise hundreds of nats on records of the twin itself.
    let nats = match extended.terms.last().is_some_and(|term| term.is_noise()) {
        true => better,
        false => better.max(gain.nats),
    };
    Ok(Some(Beginning {
        nats,
        m,
        scales: false,
        answer: reference.answer(&direction, 1.0),
    }))
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
