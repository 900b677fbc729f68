use super::*;
use crate::diagnose::{Decision, Verdict};
use crate::evaluate::trials::{Named, Outcome};

/// A trial in which `truth` was there and these effects were accepted, the first with this probability.
fn row(kind: Kind, truth: &[&str], accepted: &[&str], probability: f64) -> Row {
    let keys = |names: &[&str]| -> Vec<String> { names.iter().map(|n| (*n).into()).collect() };
    let called = !accepted.is_empty();
    let target = |key: &&str| key.split('@').nth(1).unwrap_or_default().to_owned();
    let listed = kind.is_structural() && kind != Kind::Unlisted;
    Row {
        trial: 0,
        kind,
        truth: truth.join(" + "),
        right: if listed { keys(truth) } else { vec![] },
        effects: if listed { keys(truth) } else { vec![] },
        targets: truth.iter().map(target).collect(),
        strength: Some(0.5),
        gain: listed.then_some(20.0),
        added: None,
        shortfall: None,
        share: Some(0.8),
        outcome: Some(Outcome {
            verdict: match called {
                true => Verdict::StructuralGap,
                false => Verdict::NoGap,
            },
            p_value: 0.5,
            decision: match called {
                true => Decision::Named,
                false => Decision::NotNeeded,
            },
            target: accepted.first().map(target),
            effects: (accepted.iter())
                .map(|key| Named {
                    key: (*key).into(),
                    probability,
                    gain: 20.0,
                })
                .collect(),
            accepted: keys(accepted),
            class: keys(accepted),
            before: Some(1.0),
            floor: Some(0.1),
            closed: Some(0.75),
            interval: called.then_some([0.7, 0.79]),
        }),
        failure: None,
        seconds: 2.0,
    }
}

fn abstaining(mut row: Row) -> Row {
    if let Some(outcome) = &mut row.outcome {
        outcome.verdict = Verdict::StructuralGap;
        outcome.decision = Decision::NoneOfThese;
    }
    row
}

fn count(count: u64, of: u64) -> Count {
    Count { count, of }
}

#[test]
fn every_count_is_of_what_it_says() {
    let rows = vec![
        row(Kind::None, &[], &[], 0.0),
        row(Kind::Outside, &[], &["a@s"], 0.95),
        row(Kind::Absorbed, &["a@s"], &[], 0.0),
        row(Kind::Listed, &["a@s"], &["a@s"], 0.95),
        row(Kind::Listed, &["a@s"], &["b@s"], 0.65),
        row(Kind::Parametrised, &["a@s"], &[], 0.0),
        abstaining(row(Kind::Listed, &["a@s"], &[], 0.0)),
        abstaining(row(Kind::Unlisted, &["odd@s"], &[], 0.0)),
        row(Kind::Unlisted, &["odd@s"], &["a@s"], 0.62),
        row(Kind::Pair, &["a@s", "b@t"], &["b@t", "a@s"], 0.4),
    ];
    let card = Scorecard::new("twin", 1, 0.05, "seal", rows);
    assert_eq!(card.false_alarms, count(1, 2));
    assert_eq!(card.absorbed_called_structural, count(0, 1));
    assert_eq!(card.detected, count(6, 7));
    assert_eq!(card.clear_detected, count(4, 5));
    assert_eq!(card.top1, count(1, 3));
    assert_eq!(card.in_class, count(1, 3));
    assert_eq!(card.place, count(2, 3));
    assert_eq!(card.abstained, count(1, 2));
    assert_eq!(card.abstained_rightly, count(1, 2));
    assert_eq!(card.wrongly_abstained, count(1, 4));
    assert_eq!(card.pairs_accepted, count(1, 1));
    // Of the two right answers with an interval, which 0.8 lies outside of.
    assert_eq!(card.interval_covers, count(0, 2));
    assert_eq!(card.mean_class_size, Some(1.0));
    assert_eq!(card.failed, count(0, 10));
    let bins: Vec<Count> = card.reliability.iter().map(|bin| bin.right).collect();
    assert_eq!(bins, [count(0, 2), count(1, 2)]);
    assert!((card.reliability[0].stated - 0.635).abs() < 1e-12);
    let right: u64 = card.by_kind.iter().map(|k| k.right.count).sum();
    assert_eq!(right, 5);
    assert_eq!(card.by_gain.len(), 1);
    assert_eq!(card.by_gain[0].detected, count(4, 5));
}

/// Without its effect in the library, a trial is right when it abstains.
#[test]
fn what_is_left_out_is_abstained_from() {
    let mut left_out = abstaining(row(Kind::Listed, &["a@s"], &[], 0.0));
    left_out.right.clear();
    assert!(left_out.must_abstain() && left_out.is_right());
    let card = Scorecard::new("twin", 1, 0.05, "seal", vec![left_out]);
    assert_eq!((card.abstained, card.top1), (count(1, 1), count(0, 0)));
}

#[test]
fn intervals_are_clopper_and_pearsons() {
    let (low, high) = count(3, 10).interval();
    assert!((low - 0.066_739_5).abs() < 1e-6 && (high - 0.652_452_9).abs() < 1e-6);
    assert_eq!(count(0, 0).interval(), (0.0, 1.0));
    assert_eq!(count(0, 0).share(), None);
}
