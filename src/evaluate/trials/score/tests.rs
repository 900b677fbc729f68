use super::*;
use crate::diagnose::Decision;
use crate::evaluate::trials::Kind;
use crate::evaluate::trials::answer::TrueShare;
use crate::evaluate::trials::answer::{NamedEffect, Outcome, Repeat};
use crate::evaluate::trials::fixture::{abstaining, card, failed, row};
use crate::evaluate::trials::row::{Fate, TrialRow};
use crate::evaluate::trials::truth::NearestEffect;

fn outcome(row: &mut TrialRow) -> &mut Outcome {
    row.answer.outcome.as_mut().unwrap()
}

/// The line of a breakdown whose label begins so.
fn line<'c>(card: &'c Scorecard, key: &str, label: &str) -> impl Fn(&str) -> Count + use<'c> {
    let breakdown = card.breakdown(key).unwrap();
    let is_it = |line: &&BreakdownLine| line.labels.values().next().unwrap() == label;
    let line = breakdown.lines.iter().find(is_it).unwrap();
    |key| breakdown.count(line, key).unwrap()
}

fn partial(mut row: TrialRow) -> TrialRow {
    outcome(&mut row).decision = Decision::Partial;
    row
}

/// A row whose nearest wrong effect leaves so many nats.
fn rivalled(mut row: TrialRow, nats: f64) -> TrialRow {
    row.truth.rival = Some(NearestEffect {
        effect: "r@s".into(),
        nats,
    });
    row
}

fn figure(card: &Scorecard, key: &str) -> Value {
    let figure = card.figures.iter().find(|figure| figure.key == key);
    figure.unwrap().value.clone()
}

fn count(count: u64, of: u64) -> Count {
    Count { count, of }
}

#[test]
fn every_answer_has_one_fate() {
    let mut unlisted = partial(row(Kind::Pair, &["a@s", "b@t"], &["a@s"], 0.9));
    unlisted.right[1].clear();
    let mut refused = abstaining(row(Kind::Listed, &["a@s"], &["a@s"], 0.4));
    outcome(&mut refused).accepted.clear();
    let mut class = row(Kind::Listed, &["a@s"], &["b@s"], 0.4);
    outcome(&mut class).decision = Decision::Class;
    outcome(&mut class).class.push("a@s".into());
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
        assert_eq!(
            row.fate(),
            fate,
            "{}: {}",
            row.truth_name(),
            row.answer_text()
        );
    }
}

#[test]
fn counts_have_the_denominators_that_they_name() {
    let mut coarse = row(Kind::None, &[], &["a@s"], 0.95);
    coarse.truth.step = 9.0;
    let again = |outcome| Repeat {
        change: "seed".into(),
        outcome,
    };
    let mut steady = row(Kind::Listed, &["a@s"], &["a@s"], 0.95);
    steady.answer.repeats = vec![again(steady.answer.outcome.clone()), again(None)];
    steady.answer.correlated = Some("s".into());
    let card = card(vec![
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
    ]);
    for (key, expected) in [
        ("false_alarms", count(1, 2)),
        ("coarse_called_structural", count(1, 1)),
        ("detected", count(6, 7)),
        ("precision.stated_90", count(1, 3)),
        ("precision.stated_70", count(1, 4)),
        ("precision.stated_50", count(1, 5)),
        ("precision.none_of_these", count(1, 2)),
        ("precision.no_gap", count(1, 2)),
        ("precision.where", count(4, 6)),
        ("coverage.nulls", count(1, 1)),
        ("coverage.delivered", count(2, 2)),
        ("failed", count(0, 10)),
    ] {
        assert_eq!(card.count(key), expected, "{key}");
    }
    assert_eq!(figure(&card, "redraws"), 10);
    let bins = card.breakdown("by_information").unwrap();
    assert_eq!(
        (bins.lines[0].label("low"), bins.lines.len()),
        (&10.0.into(), 2)
    );
    let (listed, random) = (
        line(&card, "by_information", "listed"),
        line(&card, "by_information", "random"),
    );
    assert_eq!(listed("delivered"), count(2, 5));
    assert_eq!(
        (listed("wrong_name"), listed("missed")),
        (count(1, 5), count(1, 5))
    );
    assert_eq!(
        (random("delivered"), random("wrong_name")),
        (count(1, 2), count(1, 2))
    );
    assert_eq!(line(&card, "steadiness", "seed")("same"), count(1, 2));
    assert_eq!(
        line(&card, "baselines", "always no gap")("verdict"),
        count(2, 9)
    );
    let most = line(&card, "baselines", "always the most frequent truth");
    assert_eq!((most("verdict"), most("right")), (count(7, 9), count(4, 9)));
    let correlation = line(&card, "baselines", "largest residual correlation");
    assert_eq!(correlation("where"), count(1, 7));
    let reliability = card.breakdown("reliability").unwrap();
    let tops = reliability.lines.iter().filter_map(|line| line.counts[0]);
    assert_eq!(tops.sum::<Count>().of, 6);
}

/// A truth of probability 0.6, its rival 0.3, and none of these 0.1: ln 0.6, and 0.16 + 0.09 + 0.01.
#[test]
fn probabilities_have_known_scores() {
    let mut row = row(Kind::Listed, &["a@s"], &["a@s"], 0.6);
    outcome(&mut row).effects.push(NamedEffect {
        key: "b@s".into(),
        probability: 0.3,
    });
    let card = card(vec![row]);
    for (key, expected) in [("log_score", 0.6f64.ln()), ("brier", 0.26)] {
        let score = figure(&card, &format!("probabilities.{key}"))
            .as_f64()
            .unwrap();
        assert!((score - expected).abs() < 1e-12, "{key}: {score}");
    }
}

/// Without its effect in the library, a trial is right when it abstains.
#[test]
fn what_is_left_out_is_abstained_from() {
    let mut left_out = abstaining(row(Kind::Listed, &["a@s"], &[], 0.0));
    left_out.right = vec![vec![]];
    assert!(left_out.must_abstain());
    let card = card(vec![left_out]);
    assert_eq!(
        line(&card, "by_information", "listed")("delivered"),
        count(1, 1)
    );
    assert_eq!(card.count("precision.none_of_these"), count(1, 1));
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
        outcome(&mut row).closed = closed;
        row
    };
    let card = card(vec![
        told(Kind::Listed, &["a@s"], Some(1.0), Some(0.95)),
        told(Kind::Listed, &["a@s"], Some(1.9), Some(0.8)),
        told(Kind::Listed, &["b@s"], Some(1.9), Some(1.05)),
        told(Kind::Listed, &[], None, None),
        told(Kind::Random, &[], None, None),
    ]);
    assert_eq!(card.count("closed.true_told"), count(3, 4));
    assert_eq!(figure(&card, "closed.true_median"), 0.95);
    assert_eq!(card.count("closed.true_holds_one"), count(2, 3));
    assert_eq!(card.count("closed.delivered_within"), count(1, 2));
    let held = card.breakdown("by_held").unwrap();
    assert_eq!(
        (held.lines[0].label("low"), held.lines.len()),
        (&10.0.into(), 1)
    );
    assert_eq!(line(&card, "by_held", "listed")("delivered"), count(2, 3));
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
    assert_eq!(card.count("false_alarms"), count(1, 2));
    assert_eq!(card.count("nulls_failed"), count(1, 3));
    assert_eq!(
        line(&card, "by_nuisance", "none")("false_alarms"),
        count(1, 2)
    );
    assert_eq!(card.count("detected"), count(1, 2));
    assert_eq!(card.count("failed"), count(2, 5));
    let none = line(&card, "by_kind", "none");
    assert_eq!((none("right"), none("failed")), (count(1, 3), count(1, 3)));
    assert_eq!(card.count("precision.no_gap"), count(1, 1));
}

/// Answers stay if effects and decision do; two failures agree about nothing.
#[test]
fn steadiness_compares_decisions_and_no_failures() {
    let again = |outcome| Repeat {
        change: "seed".into(),
        outcome,
    };
    let named = || row(Kind::Listed, &["a@s"], &["a@s"], 0.9);
    let same = named().answer.outcome;
    let other = partial(named()).answer.outcome;
    let (mut steady, mut lost) = (named(), failed(Kind::Listed, &["a@s"]));
    steady.answer.repeats = vec![again(same), again(other)];
    lost.answer.repeats = vec![again(None)];
    let card = card(vec![steady, lost]);
    assert_eq!(line(&card, "steadiness", "seed")("same"), count(1, 3));
}

/// Bins of clear records leave out those with a rival within 3 nats, and those of which that is not known.
#[test]
fn clear_records_have_bins_of_their_own() {
    let named = || row(Kind::Listed, &["a@s"], &["a@s"], 0.9);
    let mut coarse = rivalled(named(), 8.0);
    coarse.truth.step = 2.0;
    let card = card(vec![
        rivalled(row(Kind::Listed, &["a@s"], &["b@s"], 0.9), 0.5),
        named(),
        coarse,
        rivalled(partial(row(Kind::Random, &["odd@s"], &["a@s"], 0.6)), 9.0),
        rivalled(abstaining(row(Kind::Random, &["odd@s"], &[], 0.0)), 9.0),
        rivalled(row(Kind::Random, &["odd@s"], &["b@s"], 0.6), 9.0),
    ]);
    let bins = |key, truths| line(&card, key, truths);
    let (listed, random) = (
        bins("by_information", "listed"),
        bins("by_information", "random"),
    );
    assert_eq!(listed("delivered"), count(2, 3));
    assert_eq!(listed("coarse_delivered"), count(1, 1));
    assert_eq!(card.count("coarse_delivered"), count(1, 1));
    assert_eq!(listed("abstained_or_partial"), count(0, 0));
    assert_eq!(
        (random("delivered"), random("wrong_name")),
        (count(1, 3), count(2, 3))
    );
    // The partial answer names something false: it is a wrong name, and nothing else.
    assert_eq!(random("abstained_or_partial"), count(1, 3));
    assert_eq!(
        bins("clear_by_information", "listed")("delivered"),
        count(1, 1)
    );
    assert_eq!(
        bins("clear_by_information", "random")("delivered"),
        count(1, 3)
    );
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
