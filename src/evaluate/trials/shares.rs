//! A trial's true effects, fitted: the evidence that the record holds for them, and the share that they close, which must be 1.

use super::answer::Question;
use super::truth::Truth;
use crate::diagnose::true_fit;
use crate::storage::work::Piece;
use serde::{Deserialize, Serialize};

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
    pub(super) fn new(truth: &Truth, question: &Question<'_>) -> Self {
        let keys = &truth.effects;
        let is_listed = !keys.is_empty() && keys.len() == truth.departures.len();
        let Question {
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
