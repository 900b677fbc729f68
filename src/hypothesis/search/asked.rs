//! The kind of noise that the records of a fit ask for.

use super::model::Model;
use super::{Before, Breadth, listed};
use crate::effect::{TargetKind, targets};
use crate::fit::{Searched, fits};
use crate::hypothesis::limits::SEARCH;
use crate::hypothesis::noise::proportional;
use crate::hypothesis::shared;
use crate::hypothesis::term::{Part, Term};
use crate::likelihood::Measured;
use crate::likelihood::kalman::FilterError;
use crate::twin::Noise;
use std::sync::Arc;

/// Searches with noise of outputs that grows with their signals, where the records ask for it. A score for each output tells what it promises.
pub(crate) fn with_asked_noise(
    measured: &Measured,
    searched: Searched,
    noise: Noise,
) -> Result<Searched, FilterError> {
    let best = searched.fits.first().cloned();
    let is_simulated = searched.problem.is_simulated();
    let Some(best) = best.filter(|_| !is_simulated) else {
        return Ok(searched);
    };
    let signals = measured.twin.signals();
    let sensors = targets(TargetKind::Sensor, None, &signals);
    let is_fitted = |j: usize| {
        let output = &signals.outputs[j].name;
        let mut levels = measured.levels.iter();
        levels.any(|level| !level.is_process && level.parameter.target() == output)
    };
    let fitted: Vec<String> = (sensors.iter().enumerate())
        .filter(|(j, _)| is_fitted(*j))
        .map(|(_, sensor)| sensor.clone())
        .collect();
    let mut terms = shared(proportional(&sensors, &fitted).collect());
    let problem = searched.problem.clone();
    let Some(mut model) = Model::bare(measured.twin.clone(), problem, best, false) else {
        return Ok(searched);
    };
    let breadth = Breadth::of(&model, false).of_all();
    loop {
        let mut promising = vec![];
        for term in terms {
            if promised(&model, &term)? >= SEARCH.noise_promise {
                promising.push(term);
            }
        }
        terms = promising;
        if terms.is_empty() {
            break;
        }
        let found = listed(&model, &terms, Before::default(), breadth)?;
        let least = model.log_evidence + SEARCH.asked_noise;
        let likelier = found.into_iter().filter(|e| e.log_z > least);
        let Some(better) = likelier.filter_map(|e| e.model).next() else {
            break;
        };
        let is_other = |part: &Part| match (part, better.terms.last().map(|term| &term.part)) {
            (Part::Share { output: own }, Some(Part::Share { output })) => own != output,
            _ => true,
        };
        terms.retain(|term| is_other(&term.part));
        model = better;
    }
    if model.terms.is_empty() {
        return Ok(searched);
    }
    Ok(Searched {
        fits: fits(&model.problem, &[model.fitted.theta], noise)?,
        problem: model.problem,
        ..searched
    })
}

/// Nats that a little of a term promises beside a model, θ free to answer: what the slopes of both gain over those of θ alone.
fn promised(model: &Model, term: &Arc<Term>) -> Result<f64, FilterError> {
    let extended = model.extend(term)?;
    let own = extended.entries[0];
    let step = extended.problem.axes[own].small_size();
    let theta = model.beside(&extended, &[step.unwrap_or_default()]);
    let Some(at) = extended.at(&theta)? else {
        return Ok(0.0);
    };
    let c = &extended.problem.coordinates;
    let free = |j: &usize| !extended.problem.axes[*j].held;
    let all: Vec<usize> = (0..at.gradient.len()).filter(free).collect();
    let others: Vec<usize> = all.iter().copied().filter(|j| *j != own).collect();
    let newton = |entries: &[usize]| {
        let gradient = at.gradient.select_rows(entries);
        let information = at.information.select_rows(entries);
        let factor = information.select_columns(entries).cholesky()?;
        let step = factor.solve(&gradient);
        Some((0.5 * gradient.dot(&step), step))
    };
    // Without slopes, a fit alone can tell.
    let Some(((with, step), (without, _))) = newton(&all).zip(newton(&others)) else {
        return Ok(f64::INFINITY);
    };
    let moved = (all.iter().zip(step.iter())).find(|(j, _)| **j == own);
    let leaves = moved.is_some_and(|(_, step)| c.of(&theta)[own] + step < c.lower()[own]);
    Ok(if leaves { 0.0 } else { with - without })
}
