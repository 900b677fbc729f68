//! Simple answers to the same trials.

use super::breakdown::{Breakdown, BreakdownLine};
use crate::effect::EffectKey;
use crate::evaluate::Count;
use crate::evaluate::trials::row::{Fate, TrialRow};
use serde_json::json;
use std::collections::BTreeMap;

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
