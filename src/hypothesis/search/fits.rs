//! Fits of terms together with θ and noise levels.

use super::model::{Extended, Model};
use super::screen::{Beginning, Linear, Promise};
use crate::fit::climb::{Fitted, Reached, climb, fit, reach, settling};
use crate::fit::evidence::{CREDIT, laplace};
use crate::fit::problem::Problem;
use crate::fit::spectral_starts;
use crate::fit::starts::{Care, search};
use crate::hypothesis::limits::SEARCH;
use crate::likelihood::kalman::FilterError;
use crate::parallel::try_found;
use crate::twin::Noise;
use std::ops::Range;

/// Shares of the step to the top of the quadratic that a function's fit may begin at.
const SHARES: [f64; 4] = [1.0, 0.5, 0.2, 0.0];

/// Effort of a fit.
#[derive(Clone)]
pub(crate) struct Effort {
    /// Starts of the term, by their places in its promise.
    pub starts: Range<usize>,
    pub iterations: usize,
}

/// Fits a promise beside a model from these of its starts, with θ as it answers them and with those given; `None` where it works at none.
pub(crate) fn fit_promise(
    model: &Model,
    promise: &Promise,
    thetas: &[Vec<f64>],
    effort: Effort,
) -> Result<Option<Model>, FilterError> {
    let extended = model.extend(&promise.term)?;
    let chosen = promise.starts.iter().take(effort.starts.end);
    let settled = settling_last(&extended.problem, &extended);
    let mut from: Vec<Vec<f64>> = (chosen.skip(effort.starts.start))
        .map(|start| {
            let theta = begin(model, &extended, start)?;
            Ok(if start.scales { settled(theta)? } else { theta })
        })
        .collect::<Result<_, FilterError>>()?;
    if let Some(first) = promise.starts.first() {
        let first = model.beside(&extended, &first.m);
        from.extend(thetas.iter().map(|own| extended.from(own, first.clone())));
    }
    let best = fit(&extended.problem, &from, effort.iterations)?;
    Ok(best.and_then(|fitted| extended.fitted(model.base.clone(), fitted)))
}

/// Returns what moves a start to where θ and the size of the last term have answered its times and delays.
pub(super) fn settling_last(
    problem: &Problem,
    extended: &Extended,
) -> impl Fn(Vec<f64>) -> Result<Vec<f64>, FilterError> + use<> {
    let shape = extended.entries.get(1..).unwrap_or_default();
    settling(problem, &|j| shape.contains(&j), SEARCH.held)
}

/// Fits a promise from the prior's centre with loud noise: the fit of the model alone may have gone where the term is of no use.
pub(crate) fn fit_afresh(model: &Model, promise: &Promise) -> Result<Option<Model>, FilterError> {
    let extended = model.extend(&promise.term)?;
    let problem = &extended.problem;
    let centre = problem.begin(&problem.centre());
    let starts = match promise.term.shape() {
        Some(_) => SEARCH.afresh_shapes,
        None => 1,
    };
    let settled = settling_last(problem, &extended);
    let from: Vec<Vec<f64>> = (promise.starts.iter().take(starts))
        .map(|start| settled(model.beside_at(&extended, &centre, &start.m)))
        .collect::<Result<_, _>>()?;
    let fitted = fit(problem, &from, SEARCH.afresh)?;
    Ok(fitted.and_then(|fitted| extended.fitted(model.base.clone(), fitted)))
}

/// Fits a sensor's law from where the twin without it follows the record unfolded: on each side of a fold on which the record may begin.
pub(super) fn fit_unfolded(model: &Model, promise: &Promise) -> Result<Option<Model>, FilterError> {
    let Some((m, sides)) = promise.term.unfolded(&model.base, &model.problem.records) else {
        return Ok(None);
    };
    let extended = model.extend(&promise.term)?;
    let mut from = vec![];
    for records in sides {
        let problem = model.problem.on(records);
        let mut initial = spectral_starts(&problem);
        initial.push(model.fitted.theta.clone());
        let noise = Noise::new(0, "unfolded", 0);
        let fits = search(&problem, &initial, noise, SEARCH.released, Care::Loud)?;
        let best = fits.first();
        from.extend(best.map(|fitted| model.beside_at(&extended, &fitted.theta, &m)));
    }
    let fitted = fit(&extended.problem, &from, SEARCH.released)?;
    Ok(fitted.and_then(|fitted| extended.fitted(model.base.clone(), fitted)))
}

/// The model with its noise held loud, θ fitted to that: predictions then hardly reach beyond a row, and the likelihood has no narrow
/// valleys.
pub(crate) fn loudly(model: &Model) -> Result<Option<Model>, FilterError> {
    let is_noise = |j: usize| model.problem.axes[j].begin.is_some();
    let problem = model.problem.holding(is_noise);
    let start = problem.begin(&model.fitted.theta);
    Ok(
        climb(&problem, &start, 2 * SEARCH.held)?.map(|fitted| Model {
            problem,
            fitted,
            ..model.clone()
        }),
    )
}

/// Fits a promise beside the loud model from its best starts, the noise let down half-way to that of the model.
pub(crate) fn anneal(
    model: &Model,
    loud: &Model,
    promise: &Promise,
    starts: usize,
) -> Result<Vec<Reached>, FilterError> {
    let held = loud.extend(&promise.term)?;
    let c = &held.problem.coordinates;
    let quiet = (model.problem.coordinates).of(&model.fitted.theta);
    let loudest = (loud.problem.coordinates).of(&loud.fitted.theta);
    try_found(promise.starts.iter().take(starts), |start| {
        let mut theta = begin(loud, &held, start)?;
        let mut last = None;
        for share in [0.0, 0.5] {
            let mut phi = c.of(&theta);
            for (j, axis) in loud.problem.axes.iter().enumerate() {
                if axis.begin.is_some() {
                    phi[j] = (1.0 - share) * loudest[j] + share * quiet[j];
                }
            }
            let Some(end) = reach(&held.problem, &c.theta(&phi), SEARCH.held)? else {
                return Ok(None);
            };
            theta.clone_from(&end.theta);
            last = Some(end);
        }
        Ok(last)
    })
}

/// Fits a promise from where its noise was let down half-way, noise free.
pub(crate) fn release(
    model: &Model,
    promise: &Promise,
    begun: &[Reached],
) -> Result<Option<Model>, FilterError> {
    let free = model.extend(&promise.term)?;
    let from: Vec<Vec<f64>> = begun.iter().map(|end| end.theta.clone()).collect();
    let best = fit(&free.problem, &from, SEARCH.released)?;
    Ok(best.and_then(|fitted| free.fitted(model.base.clone(), fitted)))
}

/// The likeliest point on the way from the model to a start: all of it, or less where the quadratic promised too much.
fn begin(model: &Model, extended: &Extended, start: &Beginning) -> Result<Vec<f64>, FilterError> {
    let c = &model.problem.coordinates;
    let phi = c.of(&model.fitted.theta);
    let points = SHARES.map(|share| {
        let moved: Vec<f64> = phi
            .iter()
            .zip(&start.answer)
            .map(|(phi, step)| phi + share * step)
            .collect();
        let theta = model.problem.clamp(&c.theta(&moved));
        let mut m = start.m.clone();
        if start.scales {
            m[0] *= share.max(SHARES[SHARES.len() - 2]);
        }
        model.beside_at(extended, &theta, &m)
    });
    let best = likeliest(&extended.problem, points)?;
    Ok(best.unwrap_or_else(|| model.beside(extended, &start.m)))
}

/// The point of the largest objective, the first of equal ones; `None` where the filter works at none.
fn likeliest(
    problem: &Problem,
    points: [Vec<f64>; SHARES.len()],
) -> Result<Option<Vec<f64>>, FilterError> {
    let mut best: Option<(f64, Vec<f64>)> = None;
    for (value, theta) in problem.log_posteriors(&points)?.into_iter().zip(points) {
        if let Some(value) = value
            && best.as_ref().is_none_or(|(b, _)| value > *b)
        {
            best = Some((value, theta));
        }
    }
    Ok(best.map(|(_, theta)| theta))
}

/// Fits an unknown function's coefficients under the prior that is most probable, and once more if that moved.
pub(crate) fn fit_function(
    model: &Model,
    linear: Linear,
    iterations: usize,
) -> Result<Option<Model>, FilterError> {
    let Linear {
        mut extended,
        found,
        theta,
        ..
    } = linear;
    let mut problem = extended.with_sizes(&found);
    // From the top of the quadratic, or nearer where that is too far.
    let c = &extended.problem.coordinates;
    let phi = c.of(&theta);
    let points = SHARES.map(|share| {
        let mut moved = phi.clone();
        for (a, &j) in found.free.iter().enumerate() {
            moved[j] += share * (found.centre[a] - phi[j]);
        }
        problem.clamp(&c.theta(&moved))
    });
    let Some(mut start) = likeliest(&problem, points)? else {
        return Ok(None);
    };
    let mut kept: Option<(f64, Fitted, _)> = None;
    for _ in 0..2 {
        let Some(fitted) = climb(&problem, &start, iterations)? else {
            break;
        };
        let Some((value, found)) = laplace(&problem, &fitted, CREDIT) else {
            break;
        };
        if kept.as_ref().is_some_and(|(k, ..)| value <= *k + 0.1) {
            break;
        }
        start.clone_from(&fitted.theta);
        kept = Some((value, fitted, problem.clone()));
        problem = extended.with_sizes(&found);
    }
    Ok(kept.and_then(|(_, fitted, problem)| {
        extended.problem = problem;
        extended.fitted(model.base.clone(), fitted)
    }))
}
