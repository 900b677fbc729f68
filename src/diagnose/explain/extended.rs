//! A twin with accepted effects.

use crate::diagnose::context::Context;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::Explanation;
use crate::diagnose::hypotheses::candidate::{Addition, Candidate};
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::free_run::{Runner, closed};
use crate::diagnose::thresholds::Thresholds;
use crate::twin::Noise;

/// One accepted effect.
#[derive(Clone)]
pub(in crate::diagnose) struct Accepted {
    pub addition: Addition,
    pub id: String,
    pub target: String,
    pub magnitudes: Vec<(String, f64)>,
    /// Nats that it adds.
    pub gain: f64,
    /// Among all that was tried in its place.
    pub probability: f64,
}

impl Accepted {
    pub fn key(&self) -> String {
        crate::effect::EffectKey::new(&self.id, &self.target).to_string()
    }

    /// Returns true where only the noise changes, so that no free run moves.
    pub fn is_noise(&self) -> bool {
        self.addition.effect.law().is_noise()
    }
}

/// Effects that are added to the twin.
pub(in crate::diagnose) fn additions(accepted: &[Accepted]) -> Vec<Addition> {
    accepted.iter().map(|a| a.addition.clone()).collect()
}

/// A twin with accepted effects, fitted.
pub(in crate::diagnose) struct ExtendedTwin<'a> {
    pub model: FittedTwin<'a>,
    pub accepted: Vec<Accepted>,
    /// Score over the twin alone.
    pub score: f64,
}

/// The model of a twin with effects, whose fit is `explanation` on `model`, with its probability there.
pub(in crate::diagnose) fn extend<'a>(
    context: &Context<'a>,
    model: &FittedTwin<'a>,
    accepted: &[Accepted],
    explanation: &Explanation,
    probability: f64,
) -> Result<Option<ExtendedTwin<'a>>, DiagnoseError> {
    let Some(addition) = model.addition(explanation) else {
        return Ok(None);
    };
    let variant = &model.dictionary.variants[explanation.variant];
    let candidate = model.candidate(explanation);
    let mut all = accepted.to_vec();
    all.push(Accepted {
        addition,
        id: candidate.id.clone(),
        target: candidate.target.clone(),
        magnitudes: magnitudes(model, explanation),
        gain: explanation.gain + explanation.validation.unwrap_or(0.0),
        probability,
    });
    let additions = additions(&all);
    let left: Vec<Candidate> = (model.dictionary.candidates.iter())
        .filter(|c| !c.is_listed() || !all.iter().any(|a| a.key() == c.key()))
        .cloned()
        .collect();
    let problem = variant.problem(&model.problem);
    let Some(model) = FittedTwin::new(
        context.twin,
        problem,
        explanation.fitted.clone(),
        &additions,
        left,
    )?
    else {
        return Ok(None);
    };
    Ok(Some(ExtendedTwin {
        model,
        accepted: all,
        score: explanation.score(),
    }))
}

/// Names and values of an explanation's magnitudes, those held at their off values included.
pub(in crate::diagnose) fn magnitudes(
    model: &FittedTwin<'_>,
    explanation: &Explanation,
) -> Vec<(String, f64)> {
    let candidate = model.candidate(explanation);
    let variant = &model.dictionary.variants[explanation.variant];
    let problem = variant.problem(&model.problem);
    let theta = problem.of_record(0, &explanation.fitted.theta);
    let mut free = theta[theta.len() - variant.free.len()..].iter();
    (candidate.magnitudes().into_iter())
        .map(|m| {
            let value = (variant.held.get(m.name).copied())
                .unwrap_or_else(|| free.next().copied().unwrap_or(f64::NAN));
            (m.name.to_owned(), value)
        })
        .collect()
}

/// For a twin whose free run is to follow the record: returns true where the effects let it follow the validation record better than
/// those `before` by a good part, beyond chance. A real system is never explained to the last bit, and without process noise
/// nothing else would be accepted.
pub(in crate::diagnose) fn improves(
    context: &Context<'_>,
    (model, before): (&FittedTwin<'_>, &[Accepted]),
    extended: &ExtendedTwin<'_>,
    noise: Noise,
) -> Result<bool, DiagnoseError> {
    let Some(records) = context.validation.filter(|_| context.follows) else {
        return Ok(false);
    };
    let errors = |model: &FittedTwin<'_>, accepted: &[Accepted]| -> Result<_, DiagnoseError> {
        let additions = additions(accepted);
        let theta = model.theta();
        Ok(Runner::new(context.twin, &additions, theta)?.errors(&records[0], 0))
    };
    let (before, after) = (
        errors(model, before)?,
        errors(&extended.model, &extended.accepted)?,
    );
    Ok(before.zip(after).is_some_and(|(before, after)| {
        let (_, interval) = closed(&before, &after, 0.0, noise.child("improves"));
        interval.is_some_and(|[low, _]| low > Thresholds::GOOD_PART)
    }))
}
