//! Summary of fits for a report.

use crate::diagnose::explain::attribute::{Explanation, probabilities};
use crate::diagnose::explain::decide::Conclusion;
use crate::diagnose::explain::extended::magnitudes;
use crate::diagnose::outcome::{EffectFit, FittedNuisance, FittedParameter};
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::null::Test;
use crate::diagnose::thresholds::Thresholds;
use crate::twin::{PRIOR_DEVIATION, Parameter, Role};

/// Explanations as they are reported: the accepted ones first.
pub(in crate::diagnose) fn reported(
    model: &FittedTwin<'_>,
    explanations: &[Explanation],
    test: &Test,
    conclusion: &Conclusion,
) -> Vec<EffectFit> {
    let chances = probabilities(explanations);
    let mut all: Vec<EffectFit> = (explanations.iter().zip(chances))
        .filter(|(e, _)| model.candidate(e).is_listed())
        .map(|(e, probability)| {
            let candidate = model.candidate(e);
            EffectFit {
                id: candidate.id.clone(),
                target: candidate.target.clone(),
                probability,
                magnitudes: magnitudes(model, e),
                log_score_gain: e.gain + e.validation.unwrap_or(0.0),
                p_value: test.candidates.get(e.candidate).copied(),
            }
        })
        .collect();
    // Of several, magnitudes and gains are those of all together; what is left is any other one's alone.
    if conclusion.accepted.len() > 1 {
        let together: f64 = conclusion.accepted.iter().map(|a| a.probability).product();
        all.iter_mut().for_each(|e| e.probability *= 1.0 - together);
        for accepted in conclusion.accepted.iter().rev() {
            let at = all.iter().position(|e| e.key() == accepted.key());
            let mut effect = match at {
                Some(at) => all.remove(at),
                None => continue,
            };
            effect.magnitudes = accepted.magnitudes.clone();
            effect.log_score_gain = accepted.gain;
            effect.probability = accepted.probability;
            all.insert(0, effect);
        }
    }
    all.truncate(Thresholds::REPORTED);
    all
}

/// The twin's own parameters, and everything else that the study estimates.
pub(in crate::diagnose) fn fitted_parameters(
    space: &[&Parameter],
    model: &FittedTwin<'_>,
    settings: &DiagnoseSettings,
) -> (Vec<FittedParameter>, Vec<FittedNuisance>) {
    let errors = model.fitted.std_errors(&model.problem);
    let theta = &model.fitted.theta;
    let (mut own, mut nuisance) = (vec![], vec![]);
    for (j, p) in space.iter().enumerate() {
        if p.role == Role::Parameter {
            own.push(FittedParameter {
                name: p.name.clone(),
                unit: p.unit.clone(),
                initial: settings.initial.as_ref().and_then(|i| i.get(j).copied()),
                refitted: theta[j],
                std_error: errors[j],
                identified: errors[j] < PRIOR_DEVIATION * p.prior.width(),
                prior: p.prior,
            });
        } else {
            let role = match p.role {
                Role::Start => "start",
                Role::Noise => "noise",
                _ => "effect",
            };
            nuisance.push(FittedNuisance {
                name: p.target().to_owned(),
                role,
                value: theta[j],
                std_error: errors[j],
            });
        }
    }
    // Starts of further records stand behind everything else.
    let starts: Vec<&&Parameter> = space.iter().filter(|p| p.role == Role::Start).collect();
    let d = model.problem.twin.parameters().len();
    for (i, j) in (d..theta.len()).enumerate() {
        let (record, which) = (i / starts.len().max(1) + 2, i % starts.len().max(1));
        let name = starts[which].target();
        nuisance.push(FittedNuisance {
            name: format!("{name} (record {record})"),
            role: "start",
            value: theta[j],
            std_error: errors[j],
        });
    }
    (own, nuisance)
}
