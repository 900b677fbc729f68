//! Trust in statements: precision, probabilities, intervals of θ.

use super::count::Count;
use crate::evaluate::trials::Kind;
use crate::evaluate::trials::row::{Fate, Row};
use serde::Serialize;

/// Ends of the bins of stated probability.
const STATED: [f64; 7] = [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0];
/// A truth of probability 0 costs as much as one of this.
const LEAST: f64 = 1e-3;
/// Expected information that a diagnosis need not see.
const FAINT: f64 = 3.0;

/// Share of statements that are right. A failed diagnosis states nothing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Precision {
    /// Accepted answers whose stated probability is at least 0.9 and hold nothing false.
    pub stated_90: Count,
    /// The same from 0.7 on.
    pub stated_70: Count,
    /// The same from 0.5 on.
    pub stated_50: Count,
    /// "None of these", where nothing listed is right.
    pub none_of_these: Count,
    /// "No structural gap", where nothing is missing.
    pub no_gap: Count,
    /// "No structural gap", where nothing is missing or the departure has less than 3 nats.
    pub no_gap_or_faint: Count,
    /// Places of stated gaps that are true ones.
    #[serde(rename = "where")]
    pub place: Count,
    /// The same of places whose probability is at least 0.9.
    #[serde(rename = "where_90")]
    pub place_90: Count,
    /// Stated gaps of which a true place is the stated one or one of its rivals.
    #[serde(rename = "where_class")]
    pub place_class: Count,
}

/// Scores of the probabilities of the effects and of "none of these", over gaps with one departure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Probabilities {
    /// Number of trials.
    pub trials: usize,
    /// Mean logarithm of the probability of the truth, at least 0.001.
    pub log_score: Option<f64>,
    /// Mean squared error over all outcomes: 0 perfect, 2 certain and wrong.
    pub brier: Option<f64>,
}

/// Answers of about the same stated probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Reliability {
    /// Mean of what was stated.
    pub stated: f64,
    /// Effects on top that are right.
    pub right: Count,
}

/// 90 % intervals of the twin's parameters that hold the true values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Coverage {
    /// Where nothing is missing and nothing was said to be.
    pub nulls: Count,
    /// Where the answer is right and complete, and an effect was accepted.
    pub delivered: Count,
}

pub(super) fn precision(rows: &[Row]) -> Precision {
    let stated = |least: f64| {
        let of = |row: &Row| {
            let stated = row.outcome.as_ref().and_then(|o| o.stated());
            row.called() && stated.is_some_and(|p| p >= least)
        };
        Count::over(rows, of, |row| {
            matches!(
                row.fate(),
                Fate::Delivered | Fate::Partial | Fate::Incomplete
            )
        })
    };
    let quiet = |row: &Row| row.outcome.is_some() && !row.called() && !row.is_coarse();
    let placed = |least: f64| {
        move |row: &Row| {
            let probability = row.outcome.as_ref().and_then(|o| o.target_probability);
            row.called() && probability.is_some_and(|p| p >= least)
        }
    };
    let is_faint = |row: &Row| row.information.is_some_and(|nats| nats < FAINT);
    Precision {
        stated_90: stated(0.9),
        stated_70: stated(0.7),
        stated_50: stated(0.5),
        none_of_these: Count::over(
            rows,
            |row| row.called() && row.outcome.as_ref().is_some_and(|o| o.abstains()),
            Row::must_abstain,
        ),
        no_gap: Count::over(rows, quiet, Row::is_null),
        no_gap_or_faint: Count::over(rows, quiet, |row| row.is_null() || is_faint(row)),
        place: Count::over(rows, placed(0.0), Row::place_is_right),
        place_90: Count::over(rows, placed(0.9), Row::place_is_right),
        place_class: Count::over(rows, placed(0.0), Row::places_hold_it),
    }
}

/// Probability of the truth and Brier score of one trial; `None` where no effect has a probability.
fn scored(row: &Row) -> Option<(f64, f64)> {
    let outcome = row.outcome.as_ref().filter(|o| o.is_structural())?;
    if row.is_null() || row.kind == Kind::Pair || outcome.effects.is_empty() {
        return None;
    }
    let sum: f64 = outcome.effects.iter().map(|e| e.probability).sum();
    let scale = sum.max(1.0);
    let none = 1.0 - sum / scale;
    let right = |key: &str| row.is_right(key);
    let of_right: f64 = (outcome.effects.iter())
        .filter(|e| right(&e.key))
        .map(|e| e.probability / scale)
        .sum();
    let truth = match row.must_abstain() {
        true => none,
        false => of_right,
    };
    // Effects that are right answers alike are one outcome.
    let false_ones: f64 = (outcome.effects.iter())
        .filter(|e| !right(&e.key))
        .map(|e| (e.probability / scale).powi(2))
        .sum();
    let other_none = if row.must_abstain() { 0.0 } else { none * none };
    Some((truth, (1.0 - truth).powi(2) + false_ones + other_none))
}

pub(super) fn probabilities(rows: &[Row]) -> Probabilities {
    let scores: Vec<(f64, f64)> = rows.iter().filter_map(scored).collect();
    let logs: Vec<f64> = scores.iter().map(|(p, _)| p.max(LEAST).ln()).collect();
    let briers: Vec<f64> = scores.iter().map(|(_, brier)| *brier).collect();
    Probabilities {
        trials: scores.len(),
        log_score: mean(&logs),
        brier: mean(&briers),
    }
}

pub(super) fn reliability(rows: &[Row]) -> Vec<Reliability> {
    let named: Vec<(f64, bool)> = (rows.iter())
        .filter(|row| row.called())
        .filter_map(|row| row.outcome.as_ref()?.top().map(|top| (row, top)))
        .map(|(row, top)| (top.probability, row.is_right(&top.key)))
        .collect();
    let last = STATED.len() - 2;
    (STATED.iter().zip(&STATED[1..]).enumerate())
        .filter_map(|(i, (low, high))| {
            let inside = |p: f64| *low <= p && (p < *high || i == last);
            let within: Vec<&(f64, bool)> = named.iter().filter(|(p, _)| inside(*p)).collect();
            let stated: Vec<f64> = within.iter().map(|(p, _)| *p).collect();
            Some(Reliability {
                stated: mean(&stated)?,
                right: within.iter().map(|(_, right)| *right).collect(),
            })
        })
        .collect()
}

pub(super) fn coverage(rows: &[Row]) -> Coverage {
    let over = |of: &dyn Fn(&Row) -> bool| -> Count {
        (rows.iter().filter(|row| of(row) && !row.is_coarse()))
            .flat_map(|row| {
                let estimates = row.outcome.iter().flat_map(|o| &o.parameters);
                estimates.filter_map(|estimate| {
                    let (_, truth) = (row.theta.iter()).find(|(name, _)| *name == estimate.name)?;
                    let [low, high] = estimate.interval;
                    Some((low..=high).contains(truth))
                })
            })
            .collect()
    };
    let accepts = |row: &Row| row.outcome.as_ref().is_some_and(|o| !o.accepted.is_empty());
    Coverage {
        nulls: over(&|row| row.fate() == Fate::Quiet),
        delivered: over(&|row| row.fate() == Fate::Delivered && accepts(row)),
    }
}

pub(super) fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}
