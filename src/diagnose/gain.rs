//! Gain of a known effect: the yardstick of trials whose truth is known.

use crate::diagnose::context::Context;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::{elsewhere, explanations};
use crate::diagnose::explain::extended::extend;
use crate::diagnose::hypotheses::candidate::{Candidate, candidates};
use crate::diagnose::run::check;
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::fit::problem::Problem;
use crate::fit::starts::base_fit;
use crate::likelihood::ensemble::measured;
use crate::progress::Progress;
use crate::record::Record;
use crate::study::Study;
use crate::twin::Noise;

/// Returns the nats over the refitted twin that the listed effects `id@target` gain together on the records and, if there is one, on the
/// validation record, each fitted with θ as the explanations of a diagnosis are. `None` where the study does not list one of
/// them, or where the twin cannot be fitted.
///
/// An effect whose gain is a few nats cannot be told from noise, whoever looks.
///
/// # Errors
///
/// Those of [`diagnose`](super::diagnose).
pub fn gain_of(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    effects: &[String],
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Option<f64>, DiagnoseError> {
    check(study, records, validation, settings)?;
    let twin = measured(study.twin(), records)?;
    let named: Vec<Candidate> = (candidates(study, &settings.without)?.into_iter())
        .filter(|c| c.is_listed() && effects.contains(&c.key()))
        .collect();
    if !effects
        .iter()
        .all(|key| named.iter().any(|c| c.key() == *key))
    {
        return Ok(None);
    }
    let validation: Option<Vec<Record>> = validation.map(|v| vec![v.clone()]);
    let context = Context::new(study, &twin, records, validation.as_deref(), None);
    let problem = Problem::of_twin(context.twin, records);
    let noise = Noise::new(settings.seed, "diagnose", 0);
    let Some(fitted) = base_fit(&problem, settings.initial.as_deref(), noise)? else {
        return Ok(None);
    };
    let Some(mut model) = FittedTwin::new(context.twin, problem, fitted, &[], named)? else {
        return Ok(None);
    };
    let mut accepted = vec![];
    let mut gain = 0.0;
    let stage = progress.unseen();
    for left in (0..effects.len()).rev() {
        let Some(statistics) = model.own_statistics()? else {
            return Ok(None);
        };
        let explanations = explanations(&model, &statistics, context.validation, None, &stage)?;
        let Some(best) = explanations.first() else {
            return Ok(None);
        };
        gain += best.gain + best.validation.unwrap_or(0.0);
        if left > 0 {
            let Some(extended) = extend(&context, &model, &accepted, best, 1.0)? else {
                return Ok(None);
            };
            (model, accepted) = (extended.model, extended.accepted);
        }
    }
    Ok(Some(gain))
}

/// Returns the log-likelihood, in nats, of a held-out record: that of the twin fitted to the record, or with `listed` the best of the twin
/// with each listed effect. Unknown starts are refitted there. `None` where nothing can be fitted.
///
/// # Errors
///
/// Those of [`diagnose`](super::diagnose).
pub fn held_out_score(
    study: &Study,
    record: Record,
    held_out: Record,
    listed: bool,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Option<f64>, DiagnoseError> {
    let (records, held_out) = ([record], [held_out]);
    check(study, &records, Some(&held_out[0]), settings)?;
    let twin = measured(study.twin(), &records)?;
    let context = Context::new(study, &twin, &records, Some(&held_out), None);
    let problem = Problem::of_twin(context.twin, &records);
    let noise = Noise::new(settings.seed, "diagnose", 0);
    let Some(fitted) = base_fit(&problem, settings.initial.as_deref(), noise)? else {
        return Ok(None);
    };
    if !listed {
        return Ok(elsewhere(&problem.on(&held_out), &fitted.theta)?);
    }
    let mut all = candidates(study, &settings.without)?;
    all.retain(Candidate::is_listed);
    let Some(model) = FittedTwin::new(context.twin, problem, fitted, &[], all)? else {
        return Ok(None);
    };
    let Some(statistics) = model.own_statistics()? else {
        return Ok(None);
    };
    let stage = progress.unseen();
    let explanations = explanations(&model, &statistics, context.validation, None, &stage)?;
    Ok((explanations.iter())
        .filter_map(|e| e.validation_likelihood)
        .reduce(f64::max))
}
