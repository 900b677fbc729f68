//! Additions of the opened key to a trial: how clear the true effect is, and how far it closes the gap.

use super::answer::Outcome;
use super::truth::{Truth, TruthSampler};
use crate::diagnose::{DiagnoseError, DiagnoseSettings, gain_of, held_out_from, held_out_score};
use crate::evaluate::EvaluateError;
use crate::progress::Progress;
use crate::record::Record;
use crate::twin::Noise;
use serde::{Deserialize, Serialize};

/// The true effect on the trial's record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Opened {
    pub trial: usize,
    /// Nats that the true effects gain when the diagnoser fits them; none where they are not listed or cannot be fitted.
    pub gain: Option<f64>,
    /// For a pair: nats that the weaker effect adds to the other one.
    pub added: Option<f64>,
    /// (before − after)/(before − floor) of the held-out data, `after` being the free run of the world itself; none where
    /// the diagnosis gave no share.
    pub share: Option<f64>,
    /// For a gap that no effect of the trial's library describes: held-out nats by which the best listed effect falls short of
    /// what the twin scores without the departure, the same noise given; none where that was not looked at.
    pub shortfall: Option<f64>,
}

impl Opened {
    /// Fits the true effects to the records, and runs the world without noise beside the held-out one. `noise` is the trial's,
    /// `settings` those of its diagnosis.
    pub fn of(
        sampler: &TruthSampler<'_>,
        truth: &Truth,
        outcome: Option<&Outcome>,
        (record, validation): (Record, Option<Record>),
        noise: Noise,
        settings: &DiagnoseSettings,
        progress: &Progress,
    ) -> Result<Self, EvaluateError> {
        let validation = validation.as_ref();
        let share = match outcome {
            Some(outcome) => share(sampler, truth, outcome, &record, validation)?,
            None => None,
        };
        let records = [record];
        let with_all = DiagnoseSettings {
            without: vec![],
            ..settings.clone()
        };
        let gain_of = |effects: &[String]| match gain_of(
            sampler.study(),
            &records,
            validation,
            effects,
            &with_all,
            progress,
        ) {
            Ok(gain) => Ok(gain),
            Err(error @ DiagnoseError::Cancelled(_)) => Err(EvaluateError::from(error)),
            // Said of the answer already.
            Err(_) => Ok(None),
        };
        let mut gain = None;
        let mut added = None;
        if truth.kind.is_structural() && !truth.effects.is_empty() {
            gain = gain_of(&truth.effects)?;
            if let ([_, _], Some(both)) = (&truth.effects[..], gain) {
                let mut alone = f64::NEG_INFINITY;
                for effect in &truth.effects {
                    let one = gain_of(std::slice::from_ref(effect))?;
                    alone = alone.max(one.unwrap_or(f64::NEG_INFINITY));
                }
                added = Some(both - alone).filter(|v| v.is_finite());
            }
        }
        let abstains = truth.kind.is_structural()
            && (truth.right.iter()).all(|key| settings.without.contains(&key.as_str().into()));
        let shortfall = if abstains && !settings.detection_only {
            shortfall(
                sampler,
                truth,
                validation.is_some(),
                noise,
                settings,
                progress,
            )?
        } else {
            None
        };
        Ok(Self {
            trial: truth.trial,
            gain,
            added,
            share,
            shortfall,
        })
    }
}

/// The share that the world's own free run closes, on the data that the diagnosis held out.
fn share(
    sampler: &TruthSampler<'_>,
    truth: &Truth,
    outcome: &Outcome,
    record: &Record,
    validation: Option<&Record>,
) -> Result<Option<f64>, EvaluateError> {
    let (Some(before), Some(floor), Some(_)) = (outcome.before, outcome.floor, outcome.interval)
    else {
        return Ok(None);
    };
    let (held_out, from) = match validation {
        Some(record) => (record, 0),
        None => (record, held_out_from(record.samples())),
    };
    let free = sampler.record(truth, held_out.drive().clone(), Noise::OFF)?;
    Ok(free.map(|free| {
        let (y, free) = (held_out.outputs(), free.outputs());
        let squares: f64 = (from..y.nrows())
            .map(|k| (y[[k, 0]] - free[[k, 0]]).powi(2))
            .sum();
        let after = (squares / (y.nrows() - from) as f64).sqrt() / y.std(0.0);
        (before - after) / (before - floor)
    }))
}

/// Distance by which the best listed effect stays behind the generator's own law on a held-out record. The law itself cannot be filtered;
/// what it would score is what the twin scores on the same record without the departure.
fn shortfall(
    sampler: &TruthSampler<'_>,
    truth: &Truth,
    validation: bool,
    noise: Noise,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Option<f64>, EvaluateError> {
    let Some([own, held_out]) = sampler.paired(truth, validation, noise)? else {
        return Ok(None);
    };
    let score = |record, held_out, listed| match held_out_score(
        sampler.study(),
        record,
        held_out,
        listed,
        settings,
        progress,
    ) {
        Err(error @ DiagnoseError::Cancelled(_)) => Err(EvaluateError::from(error)),
        other => Ok(other.ok().flatten()),
    };
    let law = score(own.plain, held_out.plain, false)?;
    let best = score(own.perturbed, held_out.perturbed, true)?;
    Ok(law.zip(best).map(|(law, best)| law - best))
}
