//! Answer of the diagnoser to one trial, from the record alone, and the fit of its true effects. Nothing else in the trials reads a diagnosis.

use super::truth::Truth;
use crate::diagnose::{Decision, DiagnoseSettings, Diagnosis, Verdict, diagnose, true_fit};
use crate::progress::{Cancelled, Progress};
use crate::record::Record;
use crate::storage::work::Piece;
use crate::study::{Study, StudyError};
use serde::{Deserialize, Serialize};

/// The answer of a trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TrialAnswer {
    /// From 0.
    pub trial: usize,
    /// Result; none where the diagnosis failed.
    pub outcome: Option<Outcome>,
    /// Reason for a missing result.
    pub failure: Option<String>,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Place of the largest residual correlation, if it stands out.
    pub correlated: Option<String>,
    /// Effects that forward selection by BIC adds; none of a black box, whose selection would cost as much as its diagnosis.
    pub greedy: Option<Vec<String>>,
    /// Answers to the same question, asked otherwise.
    pub repeats: Vec<Repeat>,
}

/// Answer to the same system under another seed, in other units, …
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Repeat {
    /// The change of the question.
    pub change: String,
    /// None where the diagnosis failed.
    pub outcome: Option<Outcome>,
}

/// A diagnosis, as far as it is scored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Outcome {
    /// Kind of gap.
    pub verdict: Verdict,
    /// p-value of the structural test, where there is one.
    pub p_value: Option<f64>,
    /// Answer about causes.
    pub decision: Decision,
    /// The place that it names.
    pub target: Option<String>,
    /// Probability of that place, given a gap.
    pub target_probability: Option<f64>,
    /// The place and those that it cannot tell from it.
    pub places: Vec<String>,
    /// Effects, best first.
    pub effects: Vec<NamedEffect>,
    /// Effects added to the twin, as `id@target`.
    pub accepted: Vec<String>,
    /// Rivals that the data cannot tell apart.
    pub class: Vec<String>,
    /// The twin's parameters, refitted.
    pub parameters: Vec<Refitted>,
    /// Share of the gap that the accepted effects close.
    pub closed: Option<f64>,
    /// Passes over a record that the diagnosis took.
    pub passes: u64,
}

/// An effect with its probability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NamedEffect {
    /// `id@target`.
    pub key: String,
    /// Among all explanations; what is left is that of none of these.
    pub probability: f64,
}

/// A refitted parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Refitted {
    pub name: String,
    pub value: f64,
    /// Interval of level 0.9.
    pub interval: [f64; 2],
}

/// Everything that a diagnosis is given.
#[derive(Clone)]
pub(super) struct TrialQuestion<'q> {
    pub study: &'q Study,
    pub record: &'q Record,
    pub validation: Option<&'q Record>,
    pub settings: DiagnoseSettings,
}

impl TrialQuestion<'_> {
    /// Diagnoses. A diagnosis that fails is an answer, too, with its reason; only a stop is an error.
    pub fn ask(&self, progress: &Progress) -> Result<Result<Outcome, String>, Cancelled> {
        let records = [self.record.clone()];
        let progress = progress.unshown();
        match diagnose(
            self.study,
            &records,
            self.validation,
            &self.settings,
            &progress,
        ) {
            Ok(found) => Ok(Ok(Outcome::of(&found))),
            Err(StudyError::Cancelled(stop)) => Err(stop),
            Err(error) => Ok(Err(error.to_string())),
        }
    }
}

impl Outcome {
    /// The class that a single accepted effect is stated to be of; empty where there is none.
    pub fn rivals(&self) -> &[String] {
        match self.decision == Decision::Class && self.accepted.len() == 1 {
            true => &self.class,
            false => &[],
        }
    }

    /// Everything of a diagnosis that is scored.
    fn of(found: &Diagnosis) -> Self {
        Self {
            verdict: found.verdict,
            p_value: found.detection.p_value,
            decision: found.cause.decision,
            target_probability: (found.location.targets.iter())
                .find(|t| Some(&t.target) == found.location.target.as_ref())
                .map(|t| t.probability),
            places: match found.location.class.is_empty() {
                true => found.location.target.iter().cloned().collect(),
                false => found.location.class.clone(),
            },
            target: found.location.target.clone(),
            effects: (found.cause.effects.iter())
                .map(|e| NamedEffect {
                    key: e.key(),
                    probability: e.probability,
                })
                .collect(),
            accepted: found.cause.accepted.clone(),
            class: found.cause.class.clone(),
            parameters: (found.parameters.iter())
                .map(|p| Refitted {
                    name: p.name.clone(),
                    value: p.refitted,
                    interval: p.interval,
                })
                .collect(),
            closed: found.shrinkage.as_ref().and_then(|share| share.closed),
            passes: found.passes,
        }
    }

    /// Returns true if a structural gap was found.
    pub fn is_structural(&self) -> bool {
        self.verdict == Verdict::StructuralGap
    }

    /// The effect on top: of an accepted pair, the first.
    pub fn top(&self) -> Option<&NamedEffect> {
        self.effects.first()
    }

    /// Probability that is stated of what was accepted: of several effects, the least.
    pub fn stated(&self) -> Option<f64> {
        (self.effects.iter())
            .filter(|e| self.accepted.contains(&e.key))
            .map(|e| e.probability)
            .reduce(f64::min)
    }

    /// Answer in one word or as `id@target`.
    pub fn text(&self) -> String {
        match self.accepted.is_empty() {
            _ if !self.is_structural() => self.verdict.id().into(),
            true => self.decision.id().into(),
            false => {
                let mut accepted = self.accepted.clone();
                accepted.sort();
                accepted.join(" + ")
            }
        }
    }
}

/// The true effects of one trial.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TrueShare {
    /// From 0.
    pub trial: usize,
    /// True if every departure of the trial is a listed effect.
    pub is_listed: bool,
    /// Log evidence of these effects over the twin alone, in nats, fitted whatever was answered.
    pub held: Option<f64>,
    /// Share that these effects close; none where it cannot be told from noise.
    pub closed: Option<f64>,
    /// Its 90 % interval.
    pub interval: Option<[f64; 2]>,
}

impl Piece for TrueShare {
    fn number(&self) -> usize {
        self.trial
    }
}

impl TrueShare {
    /// Fits a trial's true effects, where they are listed ones. A fit that fails tells nothing.
    pub(super) fn new(truth: &Truth, question: &TrialQuestion<'_>) -> Self {
        let keys = &truth.effects;
        let is_listed = !keys.is_empty() && keys.len() == truth.departures.len();
        let TrialQuestion {
            study,
            record,
            validation,
            settings,
        } = question;
        let fit = (is_listed)
            .then(|| true_fit(study, record, *validation, keys, settings))
            .and_then(|fit| fit.ok().flatten());
        let share = fit.as_ref().and_then(|fit| fit.share.as_ref());
        Self {
            trial: truth.trial,
            is_listed,
            held: fit.as_ref().map(|fit| fit.held),
            closed: share.and_then(|share| share.closed),
            interval: share.and_then(|share| share.interval),
        }
    }
}
