//! Scores of all trials: lists of statistics over rows.

mod baselines;
mod breakdown;
mod probabilities;
mod statistics;

pub(crate) use breakdown::{Breakdown, BreakdownLine};

use super::Families;
use super::row::TrialRow;
use crate::diagnose::Ablation;
use crate::evaluate::Count;
use serde::Serialize;
use serde_json::Value;
use statistics::{FIGURES, SCORES};

/// Settings of trials, as far as the scorecard states them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Setup {
    pub twin: String,
    pub seed: u64,
    /// Half of the generator's families that random laws come from.
    pub families: Families,
    /// True if the true effects were taken out of the library.
    pub without: bool,
    /// True if each diagnosis had a validation record.
    pub validation: bool,
    /// True if inputs, length, step and gaps are those of a measured record.
    pub like: bool,
    /// True if each diagnosis ended with its verdict: nothing is named then.
    pub detection_only: bool,
    /// Parts taken out of the diagnosis.
    pub ablated: Vec<Ablation>,
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
        let mut breakdowns = breakdown::breakdowns(&rows);
        breakdowns.push(baselines::baselines(&rows));
        Self {
            trials: rows.len(),
            setup,
            scores: SCORES.iter().map(score).collect(),
            figures: FIGURES.iter().map(figure).collect(),
            breakdowns,
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
