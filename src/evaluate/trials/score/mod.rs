//! Scores of all trials: lists of statistics over rows.

mod breakdown;
mod statistics;

pub(crate) use breakdown::{Breakdown, BreakdownLine};

use super::TrialSettings;
use super::row::TrialRow;
use crate::evaluate::Count;
use serde_json::Value;
use statistics::{FIGURES, SCORES, Statistic};

/// Origin of a scorecard.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TrialSetup {
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
    pub(crate) setup: TrialSetup,
    /// Counts over all trials.
    pub(crate) scores: Vec<Statistic<Count>>,
    /// Other numbers over all trials; null of nothing.
    pub(crate) figures: Vec<Statistic<Value>>,
    /// Counts by groups of trials.
    pub(crate) breakdowns: Vec<Breakdown>,
    pub(crate) rows: Vec<TrialRow>,
}

impl Scorecard {
    /// Scores of these trials.
    pub(crate) fn new(setup: TrialSetup, rows: Vec<TrialRow>) -> Self {
        Self {
            trials: rows.len(),
            setup,
            scores: (SCORES.iter())
                .map(|score| score.with(rows.iter().map(score.value).sum()))
                .collect(),
            figures: (FIGURES.iter())
                .map(|figure| figure.with((figure.value)(&rows)))
                .collect(),
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
