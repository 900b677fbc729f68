//! Trials written down by hand, for tests of scores and reports.

use super::answer::TrueShare;
use super::answer::{NamedEffect, Outcome, Refitted, Repeat, TrialAnswer};
use super::row::TrialRow;
use super::score::{Scorecard, TrialSetup};
use super::truth::Truth;
use super::world::Conditions;
use super::{Kind, TrialSettings};
use crate::diagnose::{Decision, Verdict};

fn target(key: &str) -> String {
    key.split('@').nth(1).unwrap_or_default().to_owned()
}

/// A trial in which `truth` was there and these effects were accepted, each with this probability.
pub(crate) fn row(kind: Kind, truth: &[&str], accepted: &[&str], probability: f64) -> TrialRow {
    let keys = |names: &[&str]| -> Vec<String> { names.iter().map(|n| (*n).into()).collect() };
    let called = !accepted.is_empty();
    let right = |key: &&str| match kind {
        _ if kind.is_random() => vec![],
        _ => keys(&[key]),
    };
    let named = |key: &&str| NamedEffect {
        key: (*key).into(),
        probability,
    };
    let truth = Truth {
        trial: 0,
        kind,
        theta: vec![1.0],
        conditions: Conditions::declared(),
        departures: vec![],
        labels: keys(truth),
        formulas: vec![],
        effects: keys(truth),
        right: truth.iter().map(right).collect(),
        rival: None,
        targets: truth.iter().map(|key| target(key)).collect(),
        places: vec![],
        information: (!truth.is_empty()).then_some(20.0),
        step: 0.1,
        redraws: 1,
    };
    let outcome = Outcome {
        verdict: match called {
            true => Verdict::StructuralGap,
            false => Verdict::NoGap,
        },
        p_value: Some(0.5),
        decision: match called {
            true => Decision::Named,
            false => Decision::NotNeeded,
        },
        target: accepted.first().map(|key| target(key)),
        target_probability: accepted.first().map(|_| probability),
        places: accepted.iter().map(|key| target(key)).collect(),
        effects: accepted.iter().map(named).collect(),
        accepted: keys(accepted),
        class: keys(accepted),
        parameters: vec![Refitted {
            name: "k".into(),
            value: 1.1,
            interval: [0.95, 1.25],
        }],
        closed: None,
        passes: 100,
    };
    let answer = TrialAnswer {
        trial: 0,
        outcome: Some(outcome),
        failure: None,
        seconds: 2.0,
        correlated: None,
        greedy: None,
        repeats: vec![],
    };
    TrialRow::new(truth, answer, None, ["k".to_owned()].into(), false)
}

/// The same with a gap stated and nothing accepted.
pub(crate) fn abstaining(mut row: TrialRow) -> TrialRow {
    if let Some(outcome) = &mut row.answer.outcome {
        outcome.verdict = Verdict::StructuralGap;
        outcome.decision = Decision::NoneOfThese;
    }
    row
}

/// The trial of a diagnosis that ended in an error.
pub(crate) fn failed(kind: Kind, truth: &[&str]) -> TrialRow {
    let mut row = row(kind, truth, &[], 0.0);
    row.answer.outcome = None;
    row.answer.failure = Some("no fit".into());
    row
}

pub(crate) fn card(rows: Vec<TrialRow>) -> Scorecard {
    let setup = TrialSetup {
        twin: "twin".into(),
        settings: TrialSettings::default(),
        seal: "seal".into(),
    };
    Scorecard::new(setup, rows)
}

/// A scorecard with a right answer and a failure, and one of no trials.
pub(crate) fn scorecards() -> [Scorecard; 2] {
    let key = "sensor-lag@sensor";
    let mut named = row(Kind::Listed, &[key], &[key], 0.9);
    let outcome = named.answer.outcome.clone();
    named.answer.repeats = vec![Repeat {
        change: "seed".into(),
        outcome,
    }];
    named.true_share = Some(TrueShare {
        trial: 0,
        is_listed: true,
        held: Some(41.0),
        closed: Some(0.98),
        interval: Some([0.9, 1.1]),
    });
    [vec![named, failed(Kind::None, &[])], vec![]].map(card)
}

/// Sealed trials of several kinds, most of them answered rightly.
pub(crate) fn many() -> Scorecard {
    let keys = [
        "sensor-lag@sensor",
        "state-ceiling@h1",
        "power-law@h1",
        "actuator-dead-zone@actuator",
        "cross-coupling@h2",
    ];
    let one = |trial: usize| {
        let kind = [Kind::Listed, Kind::None, Kind::Listed, Kind::Random][trial % 4];
        let strength = (trial % 10) as f64 / 10.0;
        let gap = kind != Kind::None;
        let seen = gap && strength > 0.15;
        let (key, other) = (trial / 4 % keys.len(), (trial + 1) % keys.len());
        let key = &keys[key..=key];
        let said = match trial.is_multiple_of(9) {
            true => &keys[other..=other],
            false => key,
        };
        let truth = if gap { key } else { &[] };
        let mut row = match (seen, kind) {
            (true, Kind::Listed) => row(kind, truth, said, 0.5 + 0.05 * (trial % 10) as f64),
            (true, _) => abstaining(row(kind, truth, &[], 0.0)),
            _ if trial == 13 => failed(kind, truth),
            _ => row(kind, truth, &[], 0.0),
        };
        row.truth.information = gap.then_some(120.0 * strength * strength);
        row
    };
    card((0..120).map(one).collect())
}
