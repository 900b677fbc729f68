//! The twin with θ within its prior: whether the record drives θ out of it, and what would keep it inside.

use super::thresholds::THRESHOLDS;
use crate::fit::axis::Axis;
use crate::fit::climb::{Fitted, climb, fit};
use crate::fit::problem::Problem;
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::search::model::Model;
use crate::hypothesis::search::{Before, Breadth, listed};
use crate::hypothesis::term::Term;
use crate::study::StudyError;
use crate::twin::Role;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::sync::Arc;

/// Iterations of a fit inside the prior.
const ITERATIONS: usize = 20;

/// The twin where its fit inside the prior ends, if its own has left that: what is missing may have driven it out. `None` for a black box,
/// whose fits cost too much.
pub(in crate::diagnose) fn inside(model: &Model) -> Result<Option<Model>, StudyError> {
    if model.problem.is_simulated() || beyond(model) == 0 {
        return Ok(None);
    }
    let Some(fitted) = fitted_inside(model)? else {
        return Ok(None);
    };
    let fitted = climb(&model.problem, &fitted.theta, 0)?;
    Ok(fitted.and_then(|fitted| model.refitted(fitted)))
}

/// The problem with the twin's own parameters held within their prior box.
fn boxed(problem: &Problem) -> Problem {
    let space = problem.twin.parameters();
    let axes = (space.iter().zip(&problem.axes))
        .map(|(p, axis)| match p.role {
            Role::Parameter => axis.clone().inside(p.prior),
            _ => axis.clone(),
        })
        .collect::<Vec<Axis>>();
    problem.with_twin(problem.twin.clone(), axes)
}

/// Number of the twin's own parameters outside their prior.
fn beyond(model: &Model) -> usize {
    let theta = model.theta();
    let space = model.problem.twin.parameters();
    (space.iter().zip(&theta))
        .filter(|(p, v)| p.role == Role::Parameter && !p.prior.contains(**v))
        .count()
}

/// The best fit with the twin's own parameters within their prior box.
fn fitted_inside(model: &Model) -> Result<Option<Fitted>, StudyError> {
    let boxed = boxed(&model.problem);
    let starts = [model.fitted.theta.clone(), boxed.centre()];
    Ok(fit(&boxed, &starts, ITERATIONS)?)
}

/// Tests whether θ lies outside its prior box: likelihood ratio of the best θ anywhere over the best inside. Returns the model inside as
/// well.
pub(in crate::diagnose) fn left_the_prior(
    model: &Model,
    alpha: f64,
) -> Result<(bool, Option<Model>), StudyError> {
    let beyond = beyond(model);
    if beyond == 0 {
        return Ok((false, None));
    }
    let within = fitted_inside(model)?;
    let ratio = within.as_ref().map_or(f64::INFINITY, |w| {
        2.0 * (model.fitted.log_likelihood - w.log_likelihood)
    });
    // As many bounds as bind are what chance can gain from.
    let limit =
        ChiSquared::new(beyond as f64).map_or(f64::INFINITY, |c| c.inverse_cdf(1.0 - alpha));
    let boxed = boxed(&model.problem);
    let within = within.and_then(|w| Model::bare(model.base.clone(), boxed, w, model.by_bic));
    Ok((ratio > limit, within))
}

/// Listed effects that explain a parameter gap with θ inside the prior, as well as θ outside does, and that are more probable there than
/// nothing: best first.
pub(in crate::diagnose) fn absorbing(
    free: &Model,
    within: &Model,
    terms: &[Arc<Term>],
) -> Result<Vec<Explanation>, StudyError> {
    let breadth = Breadth::of(within, false).of_all();
    let mut found = listed(within, terms, Before::default(), breadth)?;
    let best = free.fitted.log_likelihood - THRESHOLDS.absorbs;
    let is_as_good = |model: &Model| model.fitted.log_likelihood >= best;
    found.retain(|e| e.log_z > within.log_evidence && e.model.as_ref().is_some_and(is_as_good));
    Ok(found)
}
