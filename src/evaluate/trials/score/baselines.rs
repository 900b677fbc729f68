//! Simple answers to the same trials.

use super::count::Count;
use crate::effect::EffectKey;
use crate::evaluate::trials::row::{Fate, Row};
use serde::Serialize;
use std::collections::BTreeMap;

/// Scores of one way to answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Baseline {
    pub name: &'static str,
    /// Verdicts that are right, of all trials.
    pub verdict: Count,
    /// Answers that are right and complete, or rightly quiet, of all trials.
    pub right: Count,
    /// Places that are right, of trials with a gap; none for a way that states no place.
    #[serde(rename = "where")]
    pub place: Option<Count>,
}

fn is_right(fate: Fate) -> bool {
    matches!(fate, Fate::Delivered | Fate::Quiet)
}

/// The diagnosis, and what it is to be held against. A null whose twin steps too coarsely is left out.
pub(super) fn baselines(rows: &[Row]) -> Vec<Baseline> {
    let over = |count: &dyn Fn(&Row) -> bool| Count::over(rows, |row| !row.is_coarse(), count);
    let gaps = |count: &dyn Fn(&Row) -> bool| Count::over(rows, |row| !row.is_null(), count);
    let constant = |name, structural: bool, accepted: &[String]| Baseline {
        name,
        verdict: over(&|row| structural != row.is_null()),
        right: over(&|row| is_right(row.fate_of(structural, accepted, || false))),
        place: None,
    };
    let commonest = commonest(rows);
    let accepted: Vec<String> = (commonest.iter())
        .filter(|truth| truth.parse::<EffectKey>().is_ok())
        .cloned()
        .collect();
    let is_gap = commonest.as_deref().is_some_and(|truth| truth != "nothing");
    let correlated = |row: &Row| {
        let place = row.correlated.as_ref();
        place.is_some_and(|place| row.is_true_place(place))
    };
    vec![
        Baseline {
            name: "diagnosis",
            verdict: over(&|row| row.outcome.is_some() && row.called() != row.is_null()),
            right: over(&|row| is_right(row.fate())),
            place: Some(gaps(&|row| row.called() && row.place_is_right())),
        },
        Baseline {
            name: "largest residual correlation",
            verdict: over(&|row| row.correlated.is_some() != row.is_null()),
            right: over(&|row| is_right(row.fate_of(row.correlated.is_some(), &[], || false))),
            place: Some(gaps(&correlated)),
        },
        Baseline {
            name: "forward selection by BIC, declared noise",
            verdict: over(&|row| selected(row).is_empty() == row.is_null()),
            right: over(&|row| {
                is_right(row.fate_of(!selected(row).is_empty(), selected(row), || false))
            }),
            place: None,
        },
        constant("always no gap", false, &[]),
        constant("always the most frequent truth", is_gap, &accepted),
    ]
}

/// Effects that forward selection added; none where it failed or was not asked.
fn selected(row: &Row) -> &[String] {
    row.greedy.as_deref().unwrap_or_default()
}

/// The truth of most trials.
fn commonest(rows: &[Row]) -> Option<String> {
    let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
    for row in rows.iter().filter(|row| !row.is_coarse()) {
        *counts.entry(&row.truth.name).or_default() += 1;
    }
    let most = counts.iter().max_by_key(|(_, count)| **count);
    most.map(|(truth, _)| (*truth).to_owned())
}
