use super::*;
use crate::diagnose::{Decision, Verdict};
use crate::evaluate::trials::row::{Fate, Row};
use crate::evaluate::trials::truth::Rival;
use crate::evaluate::trials::{Families, Kind, Named, Outcome, Refitted, Repeat, TrueShare};

/// A trial in which `truth` was there and these effects were accepted, the first with this probability.
fn row(kind: Kind, truth: &[&str], accepted: &[&str], probability: f64) -> Row {
    let keys = |names: &[&str]| -> Vec<String> { names.iter().map(|n| (*n).into()).collect() };
    let called = !accepted.is_empty();
    let target = |key: &&str| key.split('@').nth(1).unwrap_or_default().to_owned();
    let right = |key: &&str| match kind {
        Kind::Random => vec![],
        _ => vec![(*key).to_owned()],
    };
    Row {
        trial: 0,
        kind,
        truth: match truth.is_empty() {
            true => "nothing".into(),
            false => truth.join(" + ").as_str().into(),
        },
        right: truth.iter().map(right).collect(),
        targets: truth.iter().map(target).collect(),
        information: (!truth.is_empty()).then_some(20.0),
        step: 0.1,
        nuisance: "none".into(),
        theta: vec![("k".into(), 1.0)],
        redraws: 1,
        outcome: Some(Outcome {
            verdict: match called {
                true => Verdict::StructuralGap,
                false => Verdict::NoGap,
            },
            p_value: Some(0.5),
            decision: match called {
                true => Decision::Named,
                false => Decision::NotNeeded,
            },
            target: accepted.first().map(target),
            target_probability: accepted.first().map(|_| probability),
            places: accepted.iter().map(target).collect(),
            effects: (accepted.iter())
                .map(|key| Named {
                    key: (*key).into(),
                    probability,
                })
                .collect(),
            accepted: keys(accepted),
            class: keys(accepted),
            parameters: vec![Refitted {
                name: "k".into(),
                value: 1.1,
                interval: [0.95, 1.25],
            }],
            closed: None,
            passes: 100,
        }),
        failure: None,
        seconds: 2.0,
        correlated: None,
        greedy: None,
        repeats: vec![],
        true_share: None,
    }
}

fn abstaining(mut row: Row) -> Row {
    if let Some(outcome) = &mut row.outcome {
        outcome.verdict = Verdict::StructuralGap;
        outcome.decision = Decision::NoneOfThese;
    }
    row
}

fn failed(kind: Kind, truth: &[&str]) -> Row {
    Row {
        outcome: None,
        failure: Some("no fit".into()),
        ..row(kind, truth, &[], 0.0)
    }
}

fn partial(mut row: Row) -> Row {
    row.outcome.as_mut().unwrap().decision = Decision::Partial;
    row
}

/// A row whose nearest wrong effect leaves so many nats.
fn rivalled(mut row: Row, nats: f64) -> Row {
    row.truth.rival = Some(Rival {
        effect: "r@s".into(),
        nats,
    });
    row
}

fn card(rows: Vec<Row>) -> Scorecard {
    let setup = Setup {
        twin: "twin".into(),
        seed: 1,
        families: Families::Open,
        without: false,
        validation: false,
        like: false,
        detection_only: false,
        ablated: vec![],
        seal: "seal".into(),
    };
    Scorecard::new(setup, rows)
}

fn count(count: u64, of: u64) -> Count {
    Count { count, of }
}

#[test]
fn every_answer_has_one_fate() {
    let mut unlisted = partial(row(Kind::Pair, &["a@s", "b@t"], &["a@s"], 0.9));
    unlisted.right[1].clear();
    let mut refused = abstaining(row(Kind::Listed, &["a@s"], &["a@s"], 0.4));
    refused.outcome.as_mut().unwrap().accepted.clear();
    let mut class = row(Kind::Listed, &["a@s"], &["b@s"], 0.4);
    let outcome = class.outcome.as_mut().unwrap();
    outcome.decision = Decision::Class;
    outcome.class.push("a@s".into());
    for (row, fate) in [
        (class, Fate::InClass),
        (row(Kind::None, &[], &[], 0.0), Fate::Quiet),
        (row(Kind::Outside, &[], &["a@s"], 0.9), Fate::FalseAlarm),
        (row(Kind::Listed, &["a@s"], &["a@s"], 0.9), Fate::Delivered),
        (row(Kind::Listed, &["a@s"], &["b@s"], 0.9), Fate::WrongName),
        (
            row(Kind::Listed, &["a@s"], &["a@s", "b@s"], 0.9),
            Fate::WrongName,
        ),
        (row(Kind::Listed, &["a@s"], &[], 0.0), Fate::Missed),
        (
            abstaining(row(Kind::Listed, &["a@s"], &[], 0.0)),
            Fate::Abstained,
        ),
        (refused, Fate::Refused),
        (failed(Kind::Listed, &["a@s"]), Fate::Failed),
        (
            partial(row(Kind::Listed, &["a@s"], &["a@s"], 0.9)),
            Fate::Partial,
        ),
        (
            partial(row(Kind::Listed, &["a@s"], &["b@s"], 0.9)),
            Fate::WrongName,
        ),
        (
            partial(row(Kind::Pair, &["a@s", "b@t"], &["a@s"], 0.9)),
            Fate::Partial,
        ),
        // The other departure has no listed name: more is missing indeed.
        (unlisted, Fate::Delivered),
        (
            abstaining(row(Kind::Random, &["odd@s"], &[], 0.0)),
            Fate::Delivered,
        ),
        (
            row(Kind::Random, &["odd@s"], &["a@s"], 0.6),
            Fate::WrongName,
        ),
        (
            row(Kind::Pair, &["a@s", "b@t"], &["b@t", "a@s"], 0.4),
            Fate::Delivered,
        ),
        (
            row(Kind::Pair, &["a@s", "b@t"], &["b@t"], 0.4),
            Fate::Incomplete,
        ),
    ] {
        assert_eq!(row.fate(), fate, "{}: {}", row.truth.name, row.answer());
    }
}

#[test]
fn counts_have_the_denominators_that_they_name() {
    let coarse = Row {
        step: 9.0,
        ..row(Kind::None, &[], &["a@s"], 0.95)
    };
    let steady = Row {
        repeats: vec![
            Repeat {
                change: "seed".into(),
                outcome: row(Kind::Listed, &["a@s"], &["a@s"], 0.5).outcome,
            },
            Repeat {
                change: "seed".into(),
                outcome: None,
            },
        ],
        correlated: Some("s".into()),
        ..row(Kind::Listed, &["a@s"], &["a@s"], 0.95)
    };
    let rows = vec![
        row(Kind::None, &[], &[], 0.0),
        row(Kind::Outside, &[], &["a@s"], 0.95),
        coarse,
        steady,
        row(Kind::Listed, &["a@s"], &["b@s"], 0.65),
        row(Kind::Otherwise, &["a@s"], &[], 0.0),
        abstaining(row(Kind::Listed, &["a@s"], &[], 0.0)),
        abstaining(row(Kind::Random, &["odd@s"], &[], 0.0)),
        row(Kind::Random, &["odd@s"], &["a@s"], 0.75),
        row(Kind::Pair, &["a@s", "b@t"], &["b@t", "a@s"], 0.4),
    ];
    let card = card(rows);
    assert_eq!(card.false_alarms, count(1, 2));
    assert_eq!(card.coarse_called_structural, count(1, 1));
    assert_eq!(card.detected, count(6, 7));
    let precision = card.precision;
    assert_eq!(precision.stated_90, count(1, 3));
    assert_eq!(precision.stated_70, count(1, 4));
    assert_eq!(precision.stated_50, count(1, 5));
    assert_eq!(precision.none_of_these, count(1, 2));
    assert_eq!(precision.no_gap, count(1, 2));
    assert_eq!(precision.place, count(4, 6));
    let [listed, random] = &card.by_information[..] else {
        panic!("{:?}", card.by_information)
    };
    assert_eq!((listed.low, listed.high), (10.0, 30.0));
    assert_eq!(listed.delivered, count(2, 5));
    assert_eq!(
        (listed.wrong_name, listed.missed),
        (count(1, 5), count(1, 5))
    );
    assert_eq!(
        (random.delivered, random.wrong_name),
        (count(1, 2), count(1, 2))
    );
    assert_eq!(card.coverage.nulls, count(1, 1));
    assert_eq!(card.coverage.delivered, count(2, 2));
    assert_eq!(card.steadiness[0].same, count(1, 2));
    assert_eq!((card.failed, card.redraws), (count(0, 10), 10));
    let quiet = &card.baselines[3];
    assert_eq!((quiet.name, quiet.verdict), ("always no gap", count(2, 9)));
    let most = &card.baselines[4];
    assert_eq!((most.verdict, most.right), (count(7, 9), count(4, 9)));
    let correlation = &card.baselines[1];
    assert_eq!(correlation.place, Some(count(1, 7)));
    assert_eq!(
        card.reliability.iter().map(|bin| bin.right.of).sum::<u64>(),
        6
    );
}

/// A truth of probability 0.6, its rival 0.3, and none of these 0.1: ln 0.6, and 0.16 + 0.09 + 0.01.
#[test]
fn probabilities_have_known_scores() {
    let mut row = row(Kind::Listed, &["a@s"], &["a@s"], 0.6);
    row.outcome.as_mut().unwrap().effects.push(Named {
        key: "b@s".into(),
        probability: 0.3,
    });
    let scores = card(vec![row]).probabilities;
    assert!((scores.log_score.unwrap() - 0.6f64.ln()).abs() < 1e-12);
    assert!((scores.brier.unwrap() - 0.26).abs() < 1e-12);
}

/// Without its effect in the library, a trial is right when it abstains.
#[test]
fn what_is_left_out_is_abstained_from() {
    let mut left_out = abstaining(row(Kind::Listed, &["a@s"], &[], 0.0));
    left_out.right = vec![vec![]];
    assert!(left_out.must_abstain());
    let card = card(vec![left_out]);
    assert_eq!(card.by_information[0].delivered, count(1, 1));
    assert_eq!(card.precision.none_of_these, count(1, 1));
}

/// An effect elsewhere that imitates the true one is a right answer, and its place a true one.
#[test]
fn the_place_of_a_right_answer_is_a_true_one() {
    let mut imitated = row(Kind::Listed, &["a@s"], &["b@t"], 0.9);
    assert!(!imitated.place_is_right());
    imitated.right[0].push("b@t".into());
    assert!(imitated.place_is_right() && imitated.places_hold_it());
    assert!(!imitated.is_true_place("u"));
}

/// Shares of the true effects that are told count whatever was answered, those of answers only where they are right; trials whose true
/// effect was fitted have bins by its evidence.
#[test]
fn shares_are_those_of_the_truth_and_of_right_answers() {
    let told = |kind, accepted: &[&str], closed, of_truth: Option<f64>| {
        let mut row = row(kind, &["a@s"], accepted, 0.9);
        row.true_share = Some(TrueShare {
            trial: 0,
            is_listed: kind == Kind::Listed,
            held: of_truth.map(|share| 20.0 * share),
            closed: of_truth,
            interval: Some([-0.1, 0.1].map(|off| of_truth.unwrap_or(1.0) + off)),
        });
        row.outcome.as_mut().unwrap().closed = closed;
        row
    };
    let card = card(vec![
        told(Kind::Listed, &["a@s"], Some(1.0), Some(0.95)),
        told(Kind::Listed, &["a@s"], Some(1.9), Some(0.8)),
        told(Kind::Listed, &["b@s"], Some(1.9), Some(1.05)),
        told(Kind::Listed, &[], None, None),
        told(Kind::Random, &[], None, None),
    ]);
    let closed = card.closed;
    assert_eq!(closed.true_told, count(3, 4));
    assert_eq!(closed.true_median, Some(0.95));
    assert_eq!(closed.true_holds_one, count(2, 3));
    assert_eq!(closed.delivered_within, count(1, 2));
    let [held] = &card.by_held[..] else {
        panic!("{:?}", card.by_held)
    };
    assert_eq!((held.low, held.delivered), (10.0, count(2, 3)));
}

/// A failed diagnosis improves no rate: of nulls it is left out and stated beside, of gaps it is not detected.
#[test]
fn failures_are_no_right_answers() {
    let card = card(vec![
        row(Kind::None, &[], &["a@s"], 0.9),
        row(Kind::None, &[], &[], 0.0),
        failed(Kind::None, &[]),
        failed(Kind::Listed, &["a@s"]),
        row(Kind::Listed, &["a@s"], &["a@s"], 0.9),
    ]);
    assert_eq!(card.false_alarms, count(1, 2));
    assert_eq!(card.nulls_failed, count(1, 3));
    assert_eq!(card.by_nuisance[0].false_alarms, count(1, 2));
    assert_eq!(card.detected, count(1, 2));
    assert_eq!(card.failed, count(2, 5));
    let none = card.by_kind[0];
    assert_eq!((none.right, none.failed), (count(1, 3), count(1, 3)));
    assert_eq!(card.precision.no_gap, count(1, 1));
}

/// Answers stay if effects and decision do; two failures agree about nothing.
#[test]
fn steadiness_compares_decisions_and_no_failures() {
    let again = |outcome| Repeat {
        change: "seed".into(),
        outcome,
    };
    let named = || row(Kind::Listed, &["a@s"], &["a@s"], 0.9);
    let steady = Row {
        repeats: vec![again(named().outcome), again(partial(named()).outcome)],
        ..named()
    };
    let lost = Row {
        repeats: vec![again(None)],
        ..failed(Kind::Listed, &["a@s"])
    };
    assert_eq!(card(vec![steady, lost]).steadiness[0].same, count(1, 3));
}

/// Bins of clear records leave out those with a rival within 3 nats, and those of which that is not known.
#[test]
fn clear_records_have_bins_of_their_own() {
    let named = || row(Kind::Listed, &["a@s"], &["a@s"], 0.9);
    let coarse = Row {
        step: 2.0,
        ..rivalled(named(), 8.0)
    };
    let card = card(vec![
        rivalled(row(Kind::Listed, &["a@s"], &["b@s"], 0.9), 0.5),
        named(),
        coarse,
        rivalled(partial(row(Kind::Random, &["odd@s"], &["a@s"], 0.6)), 9.0),
        rivalled(abstaining(row(Kind::Random, &["odd@s"], &[], 0.0)), 9.0),
        rivalled(row(Kind::Random, &["odd@s"], &["b@s"], 0.6), 9.0),
    ]);
    let [listed, random] = &card.by_information[..] else {
        panic!("{:?}", card.by_information)
    };
    assert_eq!(listed.delivered, count(2, 3));
    assert_eq!(listed.coarse_delivered, count(1, 1));
    assert_eq!(card.coarse_delivered, count(1, 1));
    assert_eq!(listed.abstained_or_partial, count(0, 0));
    assert_eq!(random.abstained_or_partial, count(2, 3));
    assert_eq!(
        (random.delivered, random.wrong_name),
        (count(1, 3), count(2, 3))
    );
    let clear = &card.clear_by_information;
    assert_eq!(clear[0].delivered, count(1, 1));
    assert_eq!(clear[1].delivered, count(1, 3));
}

/// A place that means the same as that of the departure is a true one; effects there are no right answers for that.
#[test]
fn places_of_the_same_meaning_are_true_ones() {
    let mut elsewhere = row(Kind::Listed, &["a@k"], &["b@x"], 0.9);
    assert!(!elsewhere.place_is_right());
    elsewhere.truth.places = vec!["k".into(), "x".into()];
    assert!(elsewhere.place_is_right());
    assert_eq!(elsewhere.fate(), Fate::WrongName);
}
