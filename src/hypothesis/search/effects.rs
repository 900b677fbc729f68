//! A fit with the effects of a study: of the twin without them, then with one more at a time, the one that explains most first.

use super::frequencies::frequencies;
use super::model::Model;
use super::{Before, Breadth, listed};
use crate::effect::{Effect, Magnitude};
use crate::fit::axis::Axis;
use crate::fit::problem::Problem;
use crate::fit::{Passes, Searched, WithoutEffects, fits};
use crate::hypothesis::limits::{SEARCH, TERM};
use crate::hypothesis::listed::Library;
use crate::hypothesis::scales::Scales;
use crate::hypothesis::shared;
use crate::hypothesis::term::{Part, Term};
use crate::likelihood::Measured;
use crate::likelihood::kalman::FilterError;
use crate::record::Record;
use crate::twin::{Noise, ParameterSpace, Role};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Fits a twin whose θ holds the free magnitudes of effects; passes are added to these.
pub(crate) fn searched(
    measured: &Measured,
    effects: &[Effect],
    records: Arc<[Record]>,
    noise: Noise,
    passes: &Passes,
) -> Result<Searched, FilterError> {
    let plain = Problem::of_measured(measured, records).counted_with(passes);
    let space = measured.twin.parameters();
    if space.iter().all(|p| p.role != Role::Magnitude) {
        return Searched::alone(plain, noise);
    }
    let off = switched_off(&plain, effects);
    let base = fits(&off, &[], noise)?.into_iter().next();
    let model = base
        .clone()
        .and_then(|base| Model::bare(measured.twin.clone(), off.clone(), base, false));
    let Some((base, model)) = base.zip(model) else {
        return Searched::alone(plain, noise);
    };
    let terms = shared(own_terms(&model, effects)?);
    let (problem, magnitudes) = opened(&model, &terms);
    let mut all_off = model.fitted.theta.clone();
    for (j, value) in all_off.iter_mut().enumerate().take(space.len()) {
        *value = (magnitudes.get(&space[j].name).and_then(|m| m.off)).unwrap_or(*value);
    }
    let initial: Vec<Vec<f64>> = (grown(model, terms, noise)?.into_iter())
        .chain([all_off])
        .map(|theta| problem.clamp(&theta))
        .collect();
    Ok(Searched {
        fits: fits(&problem, &initial, noise)?,
        problem,
        without: Some(WithoutEffects {
            problem: off,
            fitted: base,
            magnitudes,
        }),
    })
}

/// The problem with every effect held where it is off.
fn switched_off(problem: &Problem, effects: &[Effect]) -> Problem {
    with_axes(problem, |axes, space| {
        for effect in effects {
            for (name, m) in effect.named_magnitudes() {
                if let Ok(j) = space.position(&name) {
                    let off = m.off.unwrap_or(space[j].prior.centre());
                    axes[j].centre = space[j].bounds.clamp(off);
                    axes[j].held = true;
                }
            }
        }
    })
}

/// The effects of the study as terms that the twin has already.
fn own_terms(model: &Model, effects: &[Effect]) -> Result<Vec<Term>, FilterError> {
    let theta = model.theta();
    let scales = Scales::new(&model.base, &theta, &model.problem, model.states()?);
    let (dt, duration) = (scales.dt(), scales.duration());
    let dense = (SEARCH.highest_frequency / dt * duration * TERM.frequencies_per_cycle) as usize;
    let dense = (2..=dense.clamp(2, SEARCH.most_frequencies))
        .map(|i| i as f64 / (TERM.frequencies_per_cycle * duration));
    let mut all: Vec<f64> = frequencies(model)?.into_iter().chain(dense).collect();
    all.sort_unstable_by(f64::total_cmp);
    let library = Library {
        twin: &model.base,
        theta: &theta,
        scales: &scales,
        frequencies: &all,
    };
    let terms = effects.iter().map(|effect| library.own(effect));
    terms.filter_map(Result::transpose).collect()
}

/// The problem with all magnitudes free, and those of them that readings do not show.
fn opened(model: &Model, terms: &[Arc<Term>]) -> (Problem, BTreeMap<String, Magnitude>) {
    let mut free = BTreeMap::new();
    let problem = with_axes(&model.problem, |axes, space| {
        for term in terms {
            let Part::Effect { effect, .. } = &term.part else {
                continue;
            };
            let entries = term.entries.iter().flatten();
            for (&j, axis) in entries.zip(&term.axes) {
                axes[j] = axis.clone();
            }
            let is_free = |name: &String| space.position(name).is_ok_and(|j| !axes[j].held);
            let named = (effect.named_magnitudes()).map(|(name, m)| (name, m.clone()));
            free.extend(named.filter(|(name, _)| is_free(name)));
        }
    });
    (problem, free)
}

/// Ends of fits with one effect more at a time, as long as one can be fitted, the last one first; beside each of them, those with another
/// effect in the place of the one that explains most.
fn grown(
    mut model: Model,
    mut terms: Vec<Arc<Term>>,
    noise: Noise,
) -> Result<Vec<Vec<f64>>, FilterError> {
    let breadth = Breadth::of(&model, false).thorough();
    let mut others = vec![];
    while !terms.is_empty() {
        let found = listed(&model, &terms, Before::default(), breadth)?;
        let mut fitted =
            (found.into_iter()).filter_map(|found| Some((found.last().clone(), found.model?)));
        let Some((term, better)) = fitted.next() else {
            break;
        };
        others.extend(fitted.map(|(_, other)| other.fitted.theta));
        terms.retain(|other| !Arc::ptr_eq(other, &term));
        model = better;
        if !terms.is_empty() {
            // As thorough as if these effects were all, and a start of what follows: with one effect more no fit is worse.
            let fits = fits(&model.problem, &[model.fitted.theta.clone()], noise)?;
            let best = fits.into_iter().next();
            model = (best.and_then(|best| model.refitted(best))).unwrap_or(model);
            others.push(model.fitted.theta.clone());
        }
    }
    others.insert(0, model.fitted.theta);
    Ok(others)
}

/// The problem with other axes of the twin's parameters.
fn with_axes(problem: &Problem, change: impl FnOnce(&mut [Axis], &ParameterSpace)) -> Problem {
    let space = problem.twin.parameters();
    let mut axes = problem.axes[..space.len()].to_vec();
    change(&mut axes, &space);
    problem.with_twin(problem.twin.clone(), axes)
}
