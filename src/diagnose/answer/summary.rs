//! Summary of fits for a report.

use super::Answer;
use super::posterior::Posterior;
use crate::diagnose::outcome::{Decision, EffectFit, FittedParameter, Onset, Remains};
use crate::diagnose::search::Explanations;
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::thresholds::THRESHOLDS;
use crate::fit::Nuisance;
use crate::fit::follow::starts;
use crate::fit::posterior::FitIntervals;
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::search::model::Model;
use crate::hypothesis::set::TermSet;
use crate::hypothesis::term::{Part, Term};
use crate::likelihood::kalman::recoverable;
use crate::math::descending;
use crate::study::StudyError;
use crate::twin::{PRIOR_DEVIATION, Role};
use std::sync::Arc;

/// Listed effects as they are reported: the accepted ones first, then by probability.
pub(in crate::diagnose) fn effects(
    known: &Explanations,
    answer: &Answer,
    accepted: Option<&Model>,
) -> Vec<EffectFit> {
    let mut all: Vec<EffectFit> = (known.listed().into_iter())
        .filter_map(|e| {
            let probability = answer.posterior.name(&e.last().key());
            Some(fit_of(
                e.model.as_ref()?,
                e.last(),
                probability,
                known.gain(e),
            ))
        })
        .collect();
    // Of equal probabilities the larger evidence first.
    descending(&mut all, |fit| fit.log_evidence);
    descending(&mut all, |fit| fit.probability);
    if let Some(model) = accepted {
        let set = known.get(&answer.accepted.iter().cloned().collect());
        let gain = set.map_or(0.0, |e| known.gain(e));
        let mut first: Vec<EffectFit> = (model.terms.iter())
            .map(|term| {
                let probability = answer.posterior.name(&term.key());
                fit_of(model, term, probability, gain)
            })
            .collect();
        all.retain(|e| !answer.accepted.contains(&e.key()));
        first.append(&mut all);
        all = first;
    }
    all.truncate(THRESHOLDS.reported);
    all
}

/// Effects that absorb a parameter gap beside the twin within its prior, of this log Z.
pub(in crate::diagnose) fn absorbed(
    all: &[Explanation],
    within: f64,
    posterior: &Posterior,
) -> Vec<EffectFit> {
    (all.iter())
        .filter_map(|e| {
            let term = e.last();
            let probability = posterior.name(&term.key());
            let gain = e.log_z - within;
            Some(fit_of(e.model.as_ref()?, term, probability, gain))
        })
        .take(THRESHOLDS.reported)
        .collect()
}

/// One term of a fitted model.
fn fit_of(model: &Model, term: &Term, probability: f64, log_evidence: f64) -> EffectFit {
    let theta = model.theta();
    let space = model.problem.twin.parameters();
    let magnitudes = match &term.part {
        Part::Effect { effect, held, .. } => (effect.magnitudes().iter())
            .filter_map(|m| {
                let value = match held.get(m.name) {
                    Some(value) => *value,
                    None => theta[space.position(&effect.key().magnitude(m.name)).ok()?],
                };
                Some((m.name.to_owned(), value))
            })
            .collect(),
        Part::Disturbance { .. } | Part::Share { .. } | Part::Function(_) => vec![],
    };
    EffectFit {
        id: term.id.clone(),
        target: term.target.clone(),
        probability,
        magnitudes,
        log_evidence,
        also: term.also.iter().map(ToString::to_string).collect(),
    }
}

/// The twin's own parameters, with errors and intervals from posterior draws: what a record hardly knows is not normal.
pub(in crate::diagnose) fn parameters(
    model: &Model,
    alone: &[f64],
    settings: &DiagnoseSettings,
) -> Result<Vec<FittedParameter>, StudyError> {
    let noise = settings.noise().child("parameters");
    let level = THRESHOLDS.interval_level;
    let spread = FitIntervals::drawn(&model.problem, &model.fitted, level, noise)?;
    let theta = model.theta();
    let space = model.base.parameters();
    let all = (space.iter().enumerate())
        .filter(|(_, p)| p.role == Role::Parameter)
        .map(|(j, p)| FittedParameter {
            name: p.name.clone(),
            unit: p.unit.clone(),
            initial: settings.initial.as_ref().and_then(|i| i.get(j).copied()),
            alone: alone[j],
            refitted: theta[j],
            std_error: spread.errors[j],
            interval: [spread.low[j], spread.high[j]],
            identified: spread.errors[j] < PRIOR_DEVIATION * p.prior.width(),
            prior: p.prior,
            bounds: p.bounds,
        })
        .collect();
    Ok(all)
}

/// Noise levels, magnitudes of the study's own effects, and the first states given the records; `noises` are the last parameters.
pub(in crate::diagnose) fn nuisance(
    model: &Model,
    noises: &[Arc<Term>],
) -> Result<Vec<Nuisance>, StudyError> {
    let errors = model.fitted.std_errors(&model.problem);
    let theta = model.theta();
    let space = model.base.parameters();
    let kinds: Vec<String> = noises.iter().flat_map(|term| noise_names(term)).collect();
    let own = space.len() - kinds.len();
    let mut all: Vec<Nuisance> = (space.iter().enumerate())
        .filter_map(|(j, p)| {
            let kind = j.checked_sub(own).map(|n| &kinds[n]);
            // Starts follow from the records, below.
            let role = match kind {
                Some(_) => Role::Noise,
                None => p.role,
            };
            if matches!(role, Role::Parameter | Role::Start) {
                return None;
            }
            Some(Nuisance {
                name: kind.map_or(p.target(), String::as_str).to_owned(),
                role,
                value: theta[j],
                std_error: errors[j],
            })
        })
        .collect();
    if model.problem.is_simulated() {
        let mut begun = vec![];
        // A black box has its own parameters for unknown starts, one set a record.
        for r in 0..model.problem.records.len() {
            let own = model.problem.of_record(r, &model.fitted.theta);
            let full = model.problem.of_record(r, &errors);
            for (j, p) in space
                .iter()
                .enumerate()
                .filter(|(_, p)| p.role == Role::Start)
            {
                begun.push(Nuisance {
                    name: match r {
                        0 => p.target().to_owned(),
                        r => format!("{} (record {})", p.target(), r + 1),
                    },
                    role: Role::Start,
                    value: own[j],
                    std_error: full[j],
                });
            }
        }
        begun.extend(all);
        return Ok(begun);
    }
    let begun = recoverable(model.problem.first_states(&model.fitted.theta))?.unwrap_or_default();
    all.extend(
        starts(&model.problem, &begun)
            .into_iter()
            .map(|start| Nuisance {
                name: match start.record {
                    1 => start.name,
                    r => format!("{} (record {r})", start.name),
                },
                role: Role::Start,
                value: start.value,
                std_error: start.std_error,
            }),
    );
    Ok(all)
}

/// Names of the magnitudes of a kind of noise.
fn noise_names(term: &Term) -> Vec<String> {
    match &term.part {
        Part::Effect { .. } => term.names(),
        Part::Disturbance { .. } | Part::Share { .. } | Part::Function(_) => vec![term.key()],
    }
}

/// The time of a change that was accepted.
pub(in crate::diagnose) fn onset(model: &Model) -> Option<Onset> {
    let theta = model.theta();
    let space = model.problem.twin.parameters();
    model.terms.iter().find_map(|term| {
        let Part::Effect { effect, .. } = &term.part else {
            return None;
        };
        let change = effect
            .magnitudes()
            .iter()
            .find(|m| m.shape == crate::effect::Shape::Time)?;
        let j = space.position(&effect.key().magnitude(change.name)).ok()?;
        Some(Onset {
            time: theta[j],
            parameter: term.target.clone(),
        })
    })
}

/// Unknown rest on top of the accepted effects, or else of the best single one: what a function adds.
pub(in crate::diagnose) fn remains(known: &Explanations, answer: &Answer) -> Option<Remains> {
    if answer.decision == Decision::NotNeeded {
        return None;
    }
    let set: TermSet = match answer.accepted.is_empty() {
        true => known.listed().first()?.set(),
        false => answer.accepted.iter().cloned().collect(),
    };
    let rest = known.beside(&set)?.into_iter().next()?;
    let added = (rest.log_z - known.get(&set)?.log_z).max(0.0);
    Some(Remains {
        place: rest.last().target.clone(),
        log_evidence: added,
        share: added / known.gain(rest).max(f64::MIN_POSITIVE),
    })
}
