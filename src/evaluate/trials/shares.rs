//! The share of a gap that a trial's true effects close: the measure of a share must give them 1.

use super::truth::Truth;
use crate::diagnose::{DiagnoseSettings, share_of};
use crate::record::Record;
use crate::storage::work::Piece;
use crate::study::Study;
use serde::{Deserialize, Serialize};

/// The share of one trial.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TrueShare {
    /// From 0.
    pub trial: usize,
    /// True if every departure of the trial is a listed effect.
    pub is_listed: bool,
    /// Share that these effects close, fitted whatever was answered; none where it cannot be told from noise.
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
    /// Fits a trial's true effects, where they are listed ones. A fit that fails has no share.
    pub(super) fn of(
        truth: &Truth,
        study: &Study,
        (record, validation): (&Record, Option<&Record>),
        settings: &DiagnoseSettings,
    ) -> Self {
        let keys = &truth.effects;
        let is_listed = !keys.is_empty() && keys.len() == truth.departures.len();
        let found = (is_listed)
            .then(|| share_of(study, record, validation, keys, settings))
            .and_then(|found| found.ok().flatten());
        Self {
            trial: truth.trial,
            is_listed,
            closed: found.as_ref().and_then(|share| share.closed),
            interval: found.and_then(|share| share.interval),
        }
    }
}
