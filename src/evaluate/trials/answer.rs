//! Answer of the diagnoser to one trial, from the record alone.

use crate::diagnose::{Decision, DiagnoseError, DiagnoseSettings, Diagnosis, Verdict, diagnose};
use crate::progress::Progress;
use crate::record::Record;
use crate::study::Study;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// The answer of a trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answer {
    /// From 0.
    pub trial: usize,
    /// Result; none where the diagnosis failed.
    pub outcome: Option<Outcome>,
    /// Reason for a missing result.
    pub failure: Option<String>,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// A diagnosis, as far as it is scored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// Kind of gap.
    pub verdict: Verdict,
    /// p-value of the structural test.
    pub p_value: f64,
    /// Answer about causes.
    pub decision: Decision,
    /// The place that it names.
    pub target: Option<String>,
    /// Effects, best first.
    pub effects: Vec<Named>,
    /// Effects added to the twin, as `id@target`.
    pub accepted: Vec<String>,
    /// Rivals that the data cannot tell apart.
    pub class: Vec<String>,
    /// Free-run NRMSE of the refitted twin on held-out data; none where another metric is used.
    pub before: Option<f64>,
    /// Remainder under noise alone.
    pub floor: Option<f64>,
    /// The share of the gap that closes.
    pub closed: Option<f64>,
    /// 90 % interval of it.
    pub interval: Option<[f64; 2]>,
}

/// An effect that was named.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Named {
    /// `id@target`.
    pub key: String,
    /// Among listed effects and catch-alls.
    pub probability: f64,
    /// Nats over the twin.
    pub gain: f64,
}

impl Answer {
    /// Diagnoses a trial. A diagnosis that fails is an answer, too; only a stop is an error.
    pub(super) fn of(
        trial: usize,
        study: &Study,
        record: Record,
        validation: Option<&Record>,
        settings: &DiagnoseSettings,
        progress: &Progress,
    ) -> Result<Self, DiagnoseError> {
        let clock = Instant::now();
        let found = diagnose(study, &[record], validation, settings, &progress.unshown());
        let (outcome, failure) = match found {
            Ok(found) => (Some(Outcome::of(&found)), None),
            Err(error @ DiagnoseError::Cancelled(_)) => return Err(error),
            Err(error) => (None, Some(error.to_string())),
        };
        Ok(Self {
            trial,
            outcome,
            failure,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }
}

impl Outcome {
    fn of(found: &Diagnosis) -> Self {
        let free_run = (found.shrinkage.as_ref()).filter(|s| s.metric == "free-run NRMSE");
        Self {
            verdict: found.verdict,
            p_value: found.detection.p_value,
            decision: found.cause.decision,
            target: found.location.target.clone(),
            effects: (found.cause.effects.iter())
                .map(|e| Named {
                    key: e.key(),
                    probability: e.probability,
                    gain: e.log_score_gain,
                })
                .collect(),
            accepted: found.cause.accepted.clone(),
            class: found.cause.class.clone(),
            before: free_run.map(|s| s.before),
            floor: free_run.and_then(|s| s.floor),
            closed: free_run.and_then(|s| s.closed),
            interval: free_run.and_then(|s| s.interval),
        }
    }

    /// Returns true if a structural gap was found.
    pub fn is_structural(&self) -> bool {
        self.verdict == Verdict::StructuralGap
    }

    /// Returns true if a structural gap was found, and no listed effect for it.
    pub fn abstains(&self) -> bool {
        self.decision == Decision::NoneOfThese
    }

    /// The effect on top: of an accepted pair, the first.
    pub fn top(&self) -> Option<&Named> {
        self.effects.first()
    }
}
