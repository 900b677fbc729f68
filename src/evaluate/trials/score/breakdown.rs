//! Statistics by information, kind, nuisance, stated probability, repetition; truths against answers; simple answers to the same trials.

use super::statistics::{BY_KIND, BY_NATS, BY_NUISANCE, Cases, Statistic};
use crate::effect::EffectKey;
use crate::evaluate::Count;
use crate::evaluate::trials::Kind;
use crate::evaluate::trials::row::{Fate, TrialRow};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Ends of the bins of information, in nats.
const NATS: [f64; 5] = [0.0, 3.0, 10.0, 30.0, f64::INFINITY];
/// Ends of the bins of stated probability.
const STATED: [f64; 7] = [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0];

/// A table of counts.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Breakdown {
    /// Key in the JSON.
    pub key: &'static str,
    /// Keys and words of the counts of a line.
    pub columns: Vec<(&'static str, &'static str)>,
    pub lines: Vec<BreakdownLine>,
}

impl Breakdown {
    /// The count of a line with this key.
    pub fn count(&self, line: &BreakdownLine, key: &str) -> Option<Count> {
        let mut counts = self.columns.iter().zip(&line.counts);
        let found = counts.find(|((known, _), _)| *known == key);
        found.and_then(|(_, count)| *count)
    }
}

/// One line of a table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BreakdownLine {
    /// Keys and values that name the line.
    pub labels: Map<String, Value>,
    /// In the order of the columns; `None` where the line has no such count.
    pub counts: Vec<Option<Count>>,
}

impl BreakdownLine {
    /// A line with these labels, an object.
    pub(super) fn new(labels: Value, counts: impl IntoIterator<Item = Option<Count>>) -> Self {
        let Value::Object(labels) = labels else {
            unreachable!("labels are written as objects");
        };
        let counts = counts.into_iter().collect();
        Self { labels, counts }
    }

    /// The text or number of a label.
    pub fn label(&self, key: &str) -> &Value {
        self.labels.get(key).unwrap_or(&Value::Null)
    }
}

/// Every breakdown.
pub(super) fn breakdowns(rows: &[TrialRow]) -> Vec<Breakdown> {
    vec![
        by_nats("by_information", rows, |row| row.truth.information),
        by_nats("clear_by_information", rows, |row| {
            row.truth.information.filter(|_| row.is_clear())
        }),
        by_nats("by_held", rows, TrialRow::held),
        by_kind(rows),
        by_nuisance(rows),
        reliability(rows),
        steadiness(rows),
        confusion(rows),
        baselines(rows),
    ]
}

/// One line a group of rows; groups without rows are left out.
fn grouped<'r>(
    key: &'static str,
    statistics: &'static [Statistic<Cases>],
    groups: impl Iterator<Item = (Value, Vec<&'r TrialRow>)>,
) -> Breakdown {
    let lines = groups
        .filter(|(_, rows)| !rows.is_empty())
        .map(|(labels, rows)| {
            let count = |s: &Statistic<Cases>| Some(rows.iter().copied().map(s.value).sum());
            BreakdownLine::new(labels, statistics.iter().map(count))
        });
    Breakdown {
        key,
        columns: statistics.iter().map(|s| (s.key, s.words)).collect(),
        lines: lines.collect(),
    }
}

/// Bins of listed truths, then of random ones, over the rows that have nats.
fn by_nats(
    key: &'static str,
    rows: &[TrialRow],
    nats: impl Fn(&TrialRow) -> Option<f64> + Copy,
) -> Breakdown {
    let bins = ["listed", "random"].into_iter().flat_map(|truths| {
        NATS.array_windows().map(move |[low, high]| {
            let is_inside = |row: &&TrialRow| {
                let is_random = row.truth.kind.is_random();
                let within = |nats: f64| (*low == 0.0 || *low <= nats) && nats < *high;
                !row.is_null() && is_random == (truths == "random") && nats(row).is_some_and(within)
            };
            let labels = json!({ "truths": truths, "low": low, "high": high });
            (labels, rows.iter().filter(is_inside).collect())
        })
    });
    grouped(key, BY_NATS, bins)
}

fn by_kind(rows: &[TrialRow]) -> Breakdown {
    let groups = Kind::ALL.into_iter().map(|kind| {
        let of_kind = rows.iter().filter(move |row| row.truth.kind == kind);
        (json!({ "kind": kind }), of_kind.collect())
    });
    grouped("by_kind", BY_KIND, groups)
}

fn by_nuisance(rows: &[TrialRow]) -> Breakdown {
    let mut groups: BTreeMap<String, Vec<&TrialRow>> = BTreeMap::new();
    for row in rows.iter().filter(|row| !row.is_coarse_null()) {
        let nuisance = row.nuisance();
        groups.entry(nuisance).or_default().push(row);
    }
    let groups = groups
        .into_iter()
        .map(|(name, rows)| (json!({ "nuisance": name }), rows));
    grouped("by_nuisance", BY_NUISANCE, groups)
}

/// The most probable effect of a stated gap: how often it is right, by its stated probability.
fn reliability(rows: &[TrialRow]) -> Breakdown {
    let tops: Vec<(f64, bool)> = (rows.iter().filter(|row| row.called()))
        .filter_map(|row| row.outcome()?.top().map(|top| (row, top)))
        .map(|(row, top)| (top.probability, row.is_right(&top.key)))
        .collect();
    let bins = STATED.array_windows().filter_map(|[low, high]| {
        let is_inside = |p: f64| *low <= p && (p < *high || *high == 1.0);
        let inside: Vec<_> = tops.iter().filter(|(p, _)| is_inside(*p)).collect();
        let stated = inside.iter().map(|(p, _)| p).sum::<f64>() / inside.len() as f64;
        let right = inside
            .iter()
            .map(|(_, right)| Count::case(true, *right))
            .sum();
        (!inside.is_empty()).then(|| BreakdownLine::new(json!({ "stated": stated }), [Some(right)]))
    });
    Breakdown {
        key: "reliability",
        columns: vec![("right", "right")],
        lines: bins.collect(),
    }
}

/// Answers that keep accepted effects and decision when the question is asked otherwise. Two failures agree about nothing.
fn steadiness(rows: &[TrialRow]) -> Breakdown {
    let mut changes: BTreeMap<&str, Vec<Count>> = BTreeMap::new();
    for row in rows {
        for repeat in &row.answer.repeats {
            let same = (repeat.outcome.as_ref().zip(row.outcome()))
                .is_some_and(|(a, b)| (a.text(), a.decision) == (b.text(), b.decision));
            changes
                .entry(&repeat.change)
                .or_default()
                .push(Count::case(true, same));
        }
    }
    let lines = changes.into_iter().map(|(change, same)| {
        BreakdownLine::new(json!({ "change": change }), [Some(same.into_iter().sum())])
    });
    Breakdown {
        key: "steadiness",
        columns: vec![("same", "same answer")],
        lines: lines.collect(),
    }
}

/// Number of trials of each truth and answer.
fn confusion(rows: &[TrialRow]) -> Breakdown {
    let mut counts: BTreeMap<(String, String), u64> = BTreeMap::new();
    for row in rows {
        *counts
            .entry((row.truth_name(), row.answer_text()))
            .or_default() += 1;
    }
    let lines = counts.into_iter().map(|((truth, answer), count)| {
        BreakdownLine::new(
            json!({ "truth": truth, "answer": answer, "count": count }),
            [],
        )
    });
    Breakdown {
        key: "confusion",
        columns: vec![],
        lines: lines.collect(),
    }
}

/// An answer to one trial: whether it states a gap, its worth, its place where answers of its kind have one.
type Claim<'r> = (bool, Fate, Option<Option<&'r str>>);

/// The diagnosis and the simple answers that it is compared with. A null whose twin steps too coarsely is left out.
pub(super) fn baselines(rows: &[TrialRow]) -> Breakdown {
    let commonest = commonest(rows);
    let always: Vec<String> = (commonest.iter())
        .filter(|truth| truth.parse::<EffectKey>().is_ok())
        .cloned()
        .collect();
    let is_gap = commonest.as_deref().is_some_and(|truth| truth != "nothing");
    let naming = |row: &TrialRow, structural: bool, accepted: &[String]| {
        (structural, row.fate_of(structural, accepted))
    };
    let unplaced = |(structural, fate)| (structural, fate, None);
    let lines = vec![
        line("diagnosis", rows, |row| {
            let place = row.outcome().filter(|_| row.called());
            let place = place.and_then(|o| o.target.as_deref());
            (row.called(), row.fate(), Some(place))
        }),
        line("largest residual correlation", rows, |row| {
            let place = row.answer.correlated.as_deref();
            let (structural, fate) = naming(row, place.is_some(), &[]);
            (structural, fate, Some(place))
        }),
        line("forward selection by BIC, declared noise", rows, |row| {
            let selected = row.answer.greedy.as_deref().unwrap_or_default();
            unplaced(naming(row, !selected.is_empty(), selected))
        }),
        line("always no gap", rows, |row| {
            unplaced(naming(row, false, &[]))
        }),
        line("always the most frequent truth", rows, |row| {
            unplaced(naming(row, is_gap, &always))
        }),
    ];
    Breakdown {
        key: "baselines",
        columns: vec![
            ("verdict", "verdict right"),
            ("right", "answer right"),
            ("where", "place right"),
        ],
        lines,
    }
}

/// Verdicts and answers that are right, of all trials; places that are right, of trials with a gap.
fn line<'r>(
    name: &str,
    rows: &'r [TrialRow],
    claim: impl Fn(&'r TrialRow) -> Claim<'r>,
) -> BreakdownLine {
    let claims: Vec<(&TrialRow, Claim<'_>)> = rows.iter().map(|row| (row, claim(row))).collect();
    let sum = |case: &dyn Fn(&TrialRow, &Claim<'_>) -> Count| -> Count {
        claims.iter().map(|(row, claim)| case(row, claim)).sum()
    };
    let verdict = sum(&|row, (structural, fate, _)| {
        let is_right = *fate != Fate::Failed && *structural != row.is_null();
        Count::case(!row.is_coarse_null(), is_right)
    });
    let right = sum(&|row, (_, fate, _)| {
        Count::case(
            !row.is_coarse_null(),
            matches!(fate, Fate::Delivered | Fate::Quiet),
        )
    });
    let place = sum(&|row, (.., place)| {
        let is_right = place
            .flatten()
            .is_some_and(|place| row.is_true_place(place));
        Count::case(place.is_some() && !row.is_null(), is_right)
    });
    let has_place = claims.iter().any(|(_, (.., place))| place.is_some());
    let counts = [
        Some(verdict),
        Some(right),
        Some(place).filter(|_| has_place),
    ];
    BreakdownLine::new(json!({ "name": name }), counts)
}

/// The truth of most trials.
fn commonest(rows: &[TrialRow]) -> Option<String> {
    let mut counts: BTreeMap<String, u64> = BTreeMap::new();
    for row in rows.iter().filter(|row| !row.is_coarse_null()) {
        *counts.entry(row.truth_name()).or_default() += 1;
    }
    let most = counts.into_iter().max_by_key(|(_, count)| *count);
    most.map(|(truth, _)| truth)
}
