//! Scores of all trials: lists of statistics over rows.

mod breakdown;
mod statistics;

pub(crate) use breakdown::{Breakdown, BreakdownLine};

use super::TrialSettings;
use super::row::TrialRow;
use crate::evaluate::Count;
use serde_json::Value;
use statistics::{FIGURES, SCORES};

/// Origin of a scorecard.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Setup {
    pub twin: String,
    pub settings: TrialSettings,
    /// SHA-256 of the key file.
    pub seal: String,
}

/// All scores; docs/withheld.md defines each.
#[derive(Debug, Clone, PartialEq)]
pub struct Scorecard {
    /// Number of trials.
    pub trials: usize,
    pub(crate) setup: Setup,
    /// Counts over all trials.
    pub(crate) scores: Vec<ScoreValue<Count>>,
    /// Other numbers over all trials; null of nothing.
    pub(crate) figures: Vec<ScoreValue<Value>>,
    /// Counts by groups of trials.
    pub(crate) breakdowns: Vec<Breakdown>,
    pub(crate) rows: Vec<TrialRow>,
}

/// A value with its path in the JSON and its name in reports.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ScoreValue<T> {
    pub key: &'static str,
    pub words: &'static str,
    pub value: T,
}

impl Scorecard {
    /// Scores of these trials.
    pub(crate) fn new(setup: Setup, rows: Vec<TrialRow>) -> Self {
        let score = |s: &'static statistics::Statistic| ScoreValue {
            key: s.key,
            words: s.words,
            value: s.over(&rows),
        };
        let figure = |f: &'static statistics::Figure| ScoreValue {
            key: f.key,
            words: f.words,
            value: (f.value)(&rows),
        };
        Self {
            trials: rows.len(),
            setup,
            scores: SCORES.iter().map(score).collect(),
            figures: FIGURES.iter().map(figure).collect(),
            breakdowns: breakdown::breakdowns(&rows),
            rows,
        }
    }

    /// The count with this key; of nothing for an unknown one.
    pub(crate) fn count(&self, key: &str) -> Count {
        let score = self.scores.iter().find(|score| score.key == key);
        score.map_or(Count::default(), |score| score.value)
    }

    /// The breakdown with this key.
    pub(crate) fn breakdown(&self, key: &str) -> Option<&Breakdown> {
        self.breakdowns.iter().find(|b| b.key == key)
    }
}

#[cfg(test)]
mod tests;
