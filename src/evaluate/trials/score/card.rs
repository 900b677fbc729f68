//! The scorecard.

use super::baselines::{Baseline, baselines};
use super::bins::{Bin, bins};
use super::closed::{Closed, closed};
use super::count::{Count, LEVEL};
use super::said::{
    Coverage, Precision, Probabilities, Reliability, coverage, mean, precision, probabilities,
    reliability,
};
use crate::diagnose::Ablation;
use crate::evaluate::trials::answer::Outcome;
use crate::evaluate::trials::row::{Fate, Row};
use crate::evaluate::trials::{Families, Kind};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// The trials of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct KindScore {
    pub kind: Kind,
    pub called_structural: Count,
    /// Delivered, or rightly quiet.
    pub right: Count,
    /// Diagnoses that ended in an error.
    pub failed: Count,
}

/// The trials under one nuisance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct NuisanceScore {
    pub nuisance: String,
    /// Called structural, of nulls with an answer.
    pub false_alarms: Count,
    /// Delivered, of gaps.
    pub delivered: Count,
}

/// Answers that stay what they were when the question is asked otherwise: accepted effects and decision.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Steadiness {
    pub change: String,
    pub same: Count,
}

/// A truth and an answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Confusion {
    pub truth: String,
    pub answer: String,
    /// Number of trials.
    pub count: u64,
}

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

impl Setup {
    /// Parts that the diagnosis does without, as a sentence goes on; empty where it has all.
    pub fn taken_out(&self) -> String {
        let parts: Vec<&str> = self.ablated.iter().map(|part| part.id()).collect();
        match parts.is_empty() {
            true => String::new(),
            false => format!(", diagnosed without {}", parts.join(", ")),
        }
    }
}

/// All scores; docs/withheld.md defines each.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "schema", rename = "truetwin.scorecard/2")]
pub struct Scorecard {
    /// Settings of the trials.
    #[serde(flatten)]
    pub(crate) setup: Setup,
    /// Number of trials.
    pub trials: usize,
    /// Level of the Clopper–Pearson intervals.
    pub interval_level: f64,
    /// Called structural, of trials in which nothing is missing. A failed diagnosis is neither called nor right: it is left out here.
    pub(crate) false_alarms: Count,
    /// Diagnoses that failed, of trials in which nothing is missing.
    pub(crate) nulls_failed: Count,
    /// Called structural, of trials in which nothing is missing but whose twin takes a step so coarse that it shows.
    pub(crate) coarse_called_structural: Count,
    /// Called structural, of trials with a gap. A failed diagnosis is not called.
    pub(crate) detected: Count,
    /// Delivered, of gaps of a twin whose step is so coarse that it shows, too.
    pub(crate) coarse_delivered: Count,
    /// By expected information.
    pub(crate) by_information: Vec<Bin>,
    /// The same of trials whose record decides: every wrong listed effect leaves more than 3 nats.
    pub(crate) clear_by_information: Vec<Bin>,
    /// By the evidence that the record holds for its true effect, a listed one.
    pub(crate) by_held: Vec<Bin>,
    /// By kind of truth.
    pub(crate) by_kind: Vec<KindScore>,
    /// By nuisance.
    pub(crate) by_nuisance: Vec<NuisanceScore>,
    /// Statements that are right.
    pub(crate) precision: Precision,
    /// Scores of probabilities.
    pub(crate) probabilities: Probabilities,
    /// Stated probability of the effect on top against how often it is right.
    pub(crate) reliability: Vec<Reliability>,
    /// Coverage of θ.
    pub(crate) coverage: Coverage,
    /// Shares of the gap that are told to close.
    pub(crate) closed: Closed,
    /// Mean number of members of a class.
    pub(crate) mean_class_size: Option<f64>,
    /// Mean number of places that a stated gap is told to be at, one or several.
    pub(crate) mean_places: Option<f64>,
    /// Answers that stay.
    pub(crate) steadiness: Vec<Steadiness>,
    /// The diagnosis beside simple answers.
    pub(crate) baselines: Vec<Baseline>,
    /// Mean number of passes over a record of a diagnosis that did not fail.
    pub(crate) passes_per_record: Option<f64>,
    /// Mean wall-clock seconds of a diagnosis.
    pub(crate) seconds_per_record: Option<f64>,
    /// Diagnoses that ended in an error, of all.
    pub(crate) failed: Count,
    /// Draws of truths that were given up: diverged, or did not show.
    pub(crate) redraws: u64,
    /// Counts of each truth and answer.
    pub(crate) confusion: Vec<Confusion>,
    /// Every trial.
    #[serde(rename = "list")]
    pub(crate) rows: Vec<Row>,
}

impl Scorecard {
    /// Scores of these trials.
    pub(crate) fn new(setup: Setup, rows: Vec<Row>) -> Self {
        let over =
            |of: &dyn Fn(&Row) -> bool, count: &dyn Fn(&Row) -> bool| Count::over(&rows, of, count);
        let mean_size = |size: fn(&Outcome) -> usize| {
            let sizes: Vec<f64> = (rows.iter())
                .filter(|row| row.called())
                .filter_map(|row| row.outcome.as_ref())
                .map(|o| size(o) as f64)
                .filter(|size| *size > 0.0)
                .collect();
            mean(&sizes)
        };
        let passes: Vec<f64> = (rows.iter().filter_map(|row| row.outcome.as_ref()))
            .map(|outcome| outcome.passes as f64)
            .collect();
        let seconds: Vec<f64> = rows.iter().map(|row| row.seconds).collect();
        let right = |row: &Row| matches!(row.fate(), Fate::Delivered | Fate::Quiet);
        let is_fine = |row: &Row| row.is_null() && !row.is_coarse();
        Self {
            setup,
            trials: rows.len(),
            interval_level: LEVEL,
            false_alarms: over(&|row| is_fine(row) && answered(row), &Row::called),
            nulls_failed: over(&is_fine, &|row| !answered(row)),
            coarse_called_structural: over(&|row| row.is_coarse() && answered(row), &Row::called),
            detected: over(&|row| !row.is_null(), &Row::called),
            coarse_delivered: over(&Row::is_coarse_gap, &|row| row.fate() == Fate::Delivered),
            by_information: bins(&rows, |row| row.information),
            clear_by_information: bins(&rows, |row| row.information.filter(|_| row.is_clear())),
            by_held: bins(&rows, Row::held),
            by_kind: (Kind::ALL.into_iter())
                .map(|kind| KindScore {
                    kind,
                    called_structural: over(&|row| row.kind == kind, &Row::called),
                    right: over(&|row| row.kind == kind, &right),
                    failed: over(&|row| row.kind == kind, &|row| !answered(row)),
                })
                .filter(|score| score.right.of > 0)
                .collect(),
            by_nuisance: by_nuisance(&rows),
            precision: precision(&rows),
            probabilities: probabilities(&rows),
            reliability: reliability(&rows),
            coverage: coverage(&rows),
            closed: closed(&rows),
            mean_class_size: mean_size(|o| o.class.len()),
            mean_places: mean_size(|o| o.places.len()),
            steadiness: steadiness(&rows),
            baselines: baselines(&rows),
            passes_per_record: mean(&passes),
            seconds_per_record: mean(&seconds),
            failed: over(&|_| true, &|row| !answered(row)),
            redraws: rows.iter().map(|row| row.redraws).sum(),
            confusion: confusion(&rows),
            rows,
        }
    }
}

/// Returns true if the diagnosis ended without an error.
fn answered(row: &Row) -> bool {
    row.outcome.is_some()
}

fn by_nuisance(rows: &[Row]) -> Vec<NuisanceScore> {
    let all: BTreeSet<&str> = rows.iter().map(|row| row.nuisance.as_str()).collect();
    (all.into_iter())
        .map(|nuisance| {
            let with = |row: &Row| row.nuisance == nuisance && !row.is_coarse();
            NuisanceScore {
                nuisance: nuisance.into(),
                false_alarms: Count::over(
                    rows,
                    |row| with(row) && row.is_null() && answered(row),
                    Row::called,
                ),
                delivered: Count::over(
                    rows,
                    |row| with(row) && !row.is_null(),
                    |row| row.fate() == Fate::Delivered,
                ),
            }
        })
        .collect()
}

fn steadiness(rows: &[Row]) -> Vec<Steadiness> {
    let mut changes: BTreeMap<&str, Vec<bool>> = BTreeMap::new();
    for row in rows {
        for repeat in &row.repeats {
            // Two failures agree about nothing.
            let same = (repeat.outcome.as_ref().zip(row.outcome.as_ref()))
                .is_some_and(|(a, b)| (a.text(), a.decision) == (b.text(), b.decision));
            changes.entry(&repeat.change).or_default().push(same);
        }
    }
    (changes.into_iter())
        .map(|(change, same)| Steadiness {
            change: change.into(),
            same: same.into_iter().collect(),
        })
        .collect()
}

fn confusion(rows: &[Row]) -> Vec<Confusion> {
    let mut counts = BTreeMap::new();
    for row in rows {
        *counts
            .entry((row.truth.name.clone(), row.answer()))
            .or_insert(0) += 1;
    }
    (counts.into_iter())
        .map(|((truth, answer), count)| Confusion {
            truth,
            answer,
            count,
        })
        .collect()
}
