//! The kind of noise that the records of a fit ask for.

use super::model::Model;
use crate::effect::{TargetKind, targets};
use crate::fit::climb::climb;
use crate::fit::{Searched, fits};
use crate::hypothesis::limits::SEARCH;
use crate::hypothesis::noise::proportional;
use crate::hypothesis::shared;
use crate::hypothesis::term::{Part, Term};
use crate::likelihood::Measured;
use crate::likelihood::kalman::FilterError;
use crate::parallel::try_found;
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
    loop {
        let fits = try_found(&terms, |term| fitted_with(&model, term))?;
        let last = fits.iter().filter_map(|fitted| fitted.terms.last());
        terms = last.cloned().collect();
        let least = model.log_evidence + SEARCH.asked_noise;
        let likelier = fits.into_iter().filter(|f| f.log_evidence > least);
        let Some(better) = likelier.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence)) else {
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

/// Fit of a model with a term that promises enough; `None` where it does not. The promise is what the slopes of the term and of θ gain over those of θ
/// alone, from a little of the term.
fn fitted_with(model: &Model, term: &Arc<Term>) -> Result<Option<Model>, FilterError> {
    let extended = model.extend(term)?;
    let own = extended.entries[0];
    let little = extended.problem.axes[own].small_size().unwrap_or_default();
    let theta = model.beside(&extended, &[little]);
    let Some(at) = extended.at(&theta)? else {
        return Ok(None);
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
    let mut phi = c.of(&theta);
    // Without slopes, a fit alone can tell.
    if let Some(((with, step), (without, _))) = newton(&all).zip(newton(&others)) {
        all.iter().zip(&step).for_each(|(&j, step)| phi[j] += step);
        if phi[own] < c.lower()[own] || with - without < SEARCH.noise_promise {
            return Ok(None);
        }
    }
    let fitted = climb(&extended.problem, &c.theta(&phi), SEARCH.to_the_end)?;
    Ok(fitted.and_then(|fitted| extended.fitted(model.base.clone(), fitted)))
}
