//! The kind of noise that the records of a fit ask for.

use super::model::Model;
use super::{Before, Breadth, listed};
use crate::effect::{TargetKind, targets};
use crate::fit::{Searched, fits};
use crate::hypothesis::limits::SEARCH;
use crate::hypothesis::noise::proportional;
use crate::hypothesis::shared;
use crate::hypothesis::term::Part;
use crate::likelihood::Measured;
use crate::likelihood::kalman::FilterError;
use crate::twin::Noise;

/// Searches with noise of outputs that grows with their signals, where the records ask for it. A pass for each output tells what it promises.
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
    while !terms.is_empty() {
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
