//! The list of statistics: for each its key in the JSON, its words, the trials that it is of, and those that it counts.

use crate::diagnose::Decision;
use crate::evaluate::Count;
use crate::evaluate::trials::Kind;
use crate::evaluate::trials::answer::Outcome;
use crate::evaluate::trials::numbers::TRIAL;
use crate::evaluate::trials::row::{Fate, TrialRow};
use crate::math::quantile;
use serde_json::{Value, json};

/// Range of a share that is reported beside a right effect.
const WITHIN: std::ops::RangeInclusive<f64> = -0.1..=1.1;

/// A value over trials, or the way to it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Statistic<V> {
    /// Path in the JSON.
    pub key: &'static str,
    /// Name in reports, with the unit; empty for one that only the JSON has.
    pub words: &'static str,
    pub value: V,
}

impl<V> Statistic<V> {
    /// The same of another value.
    pub fn with<W>(&self, value: W) -> Statistic<W> {
        let (key, words) = (self.key, self.words);
        Statistic { key, words, value }
    }
}

/// The cases of one trial: mostly the trial itself, where it is among those that a count is of.
pub(super) type Cases = fn(&TrialRow) -> Count;
/// A number over all trials; null of nothing.
type Figure = fn(&[TrialRow]) -> Value;

const fn count(key: &'static str, words: &'static str, value: Cases) -> Statistic<Cases> {
    Statistic { key, words, value }
}

const fn figure(key: &'static str, words: &'static str, value: Figure) -> Statistic<Figure> {
    Statistic { key, words, value }
}

/// Statistics of all trials. docs/withheld.md defines each.
#[rustfmt::skip] // One row a statistic.
pub(super) const SCORES: &[Statistic<Cases>] = &[
    count("false_alarms", "nothing missing: gap stated", false_alarm),
    count("nulls_failed", "nothing missing: diagnosis failed", |r| case(r.is_fine_null(), !r.answered())),
    count("coarse_called_structural", "nothing missing but a finer step: gap stated", |r| case(r.is_coarse_null() && r.answered(), r.called())),
    count("detected", "something missing: gap stated", |r| case(!r.is_null(), r.called())),
    count("coarse_delivered", "something missing beside a coarse step: delivered", coarse_delivered),
    count("precision.stated_90", "stated at 0.9 or more: right", |r| stated(r, 0.9)),
    count("precision.stated_70", "stated at 0.7 or more: right", |r| stated(r, 0.7)),
    count("precision.stated_50", "stated at 0.5 or more: right", |r| stated(r, 0.5)),
    count("precision.none_of_these", "\"none of these\": right", |r| case(r.decides(Decision::NoneOfThese), r.must_abstain())),
    count("precision.no_gap", "\"no structural gap\": right", |r| case(says_no_gap(r), r.is_null())),
    count("precision.no_gap_or_faint", "\"no structural gap\": right, or below 3 nats", |r| case(says_no_gap(r), r.is_null() || is_faint(r))),
    count("precision.where", "stated place: right", |r| case(states_place(r, 0.0), r.place_is_right())),
    count("precision.where_90", "stated place at 0.9 or more: right", |r| case(states_place(r, 0.9), r.place_is_right())),
    count("precision.where_class", "stated place or one of its rivals: right", |r| case(states_place(r, 0.0), r.places_hold_it())),
    count("coverage.nulls", "90 % intervals of θ that hold it, nothing missing", |r| held_intervals(r, r.fate() == Fate::Quiet)),
    count("coverage.delivered", "90 % intervals of θ that hold it, beside a right effect", |r| held_intervals(r, r.accepts() && r.fate() == Fate::Delivered)),
    count("closed.true_told", "shares that the true effects close: can be told", |r| {
        let share = r.true_share.filter(|share| share.is_listed);
        case(share.is_some(), share.is_some_and(|share| share.closed.is_some()))
    }),
    count("closed.true_holds_one", "90 % intervals of these shares: hold 1", |r| {
        let interval = r.true_share.filter(|share| share.closed.is_some()).and_then(|share| share.interval);
        case(interval.is_some(), interval.is_some_and(|[low, high]| (low..=high).contains(&1.0)))
    }),
    count("closed.delivered_within", "share closed beside a right effect: −0.1 to 1.1", |r| {
        let closed = r.outcome().and_then(|o| o.closed).filter(|_| r.fate() == Fate::Delivered);
        case(closed.is_some(), closed.is_some_and(|share| WITHIN.contains(&share)))
    }),
    count("failed", "diagnoses that failed", failed),
];

/// Statistics of the trials of about as many nats.
#[rustfmt::skip] // One row a statistic.
pub(super) const BY_NATS: &[Statistic<Cases>] = &[
    count("called_structural", "gap stated", called),
    count("delivered", "delivered", |r| fate(r, Fate::Delivered)),
    count("partial", "partial", |r| fate(r, Fate::Partial)),
    count("incomplete", "incomplete", |r| fate(r, Fate::Incomplete)),
    count("in_class", "in class", |r| fate(r, Fate::InClass)),
    count("wrong_name", "wrong name", |r| fate(r, Fate::WrongName)),
    count("refused", "refused", |r| fate(r, Fate::Refused)),
    count("abstained", "abstained", |r| fate(r, Fate::Abstained)),
    count("missed", "", |r| fate(r, Fate::Missed)),
    count("failed", "", failed),
    // A partial answer that names something false leaves no room for the unknown: it fills it with a wrong name.
    count("abstained_or_partial", "unknown, rightly", |r| case(r.must_abstain(), r.says_unknown() && r.fate() == Fate::Delivered)),
    count("coarse_delivered", "", coarse_delivered),
    count("where", "place right", |r| case(true, r.called() && r.place_is_right())),
];

/// Statistics of the trials of one kind.
pub(super) const BY_KIND: &[Statistic<Cases>] = &[
    count("called_structural", "gap stated", called),
    count("right", "right", |r| {
        case(true, matches!(r.fate(), Fate::Delivered | Fate::Quiet))
    }),
    count("failed", "failed", failed),
];

/// Statistics of the trials under one nuisance.
pub(super) const BY_NUISANCE: &[Statistic<Cases>] = &[
    count("false_alarms", "nothing missing: gap stated", false_alarm),
    count("delivered", "something missing: delivered", |r| {
        case(!r.is_null(), r.fate() == Fate::Delivered)
    }),
];

/// Numbers over all trials. docs/withheld.md defines each.
#[rustfmt::skip] // One row a figure.
pub(super) const FIGURES: &[Statistic<Figure>] = &[
    figure("probabilities.trials", "Gaps with stated probabilities", |rows| json!(rows.iter().filter_map(log_score).count())),
    figure("probabilities.log_score", "Mean log score of the truth, nats", |rows| mean(rows, log_score)),
    figure("probabilities.brier", "Mean Brier score", |rows| mean(rows, brier)),
    figure("mean_class_size", "Mean size of a class", |rows| mean(rows, |r| size(r, |outcome| &outcome.class))),
    figure("mean_places", "Mean number of stated places", |rows| mean(rows, |r| size(r, |outcome| &outcome.places))),
    figure("closed.true_median", "Median share that the true effects close", |rows| {
        let shares: Vec<f64> = rows.iter().filter_map(|r| r.true_share?.closed).collect();
        json!(quantile(&shares, 0.5).ok())
    }),
    figure("passes_per_record", "Mean number of passes of a diagnosis", |rows| mean(rows, |r| r.outcome().map(|o| o.passes as f64))),
    figure("seconds_per_record", "Mean time of a diagnosis, s", |rows| mean(rows, |r| Some(r.answer.seconds))),
    figure("redraws", "Rejected draws of truths", |rows| json!(rows.iter().map(|r| r.truth.redraws).sum::<u64>())),
];

fn case(of: bool, counts: bool) -> Count {
    Count::case(of, counts)
}

fn false_alarm(row: &TrialRow) -> Count {
    case(row.is_fine_null() && row.answered(), row.called())
}

fn is_faint(row: &TrialRow) -> bool {
    row.truth
        .information
        .is_some_and(|nats| nats < TRIAL.faint_gap)
}

fn called(row: &TrialRow) -> Count {
    case(true, row.called())
}

fn failed(row: &TrialRow) -> Count {
    case(true, !row.answered())
}

fn fate(row: &TrialRow, fate: Fate) -> Count {
    case(true, row.fate() == fate)
}

fn coarse_delivered(row: &TrialRow) -> Count {
    let is_coarse_gap = !row.is_null() && row.is_coarse();
    case(is_coarse_gap, row.fate() == Fate::Delivered)
}

/// An accepted answer whose least probability is at least this; it counts if it holds nothing false.
fn stated(row: &TrialRow, least: f64) -> Count {
    let stated = row.outcome().and_then(|o| o.stated());
    let is_stated = row.called() && stated.is_some_and(|p| p >= least);
    let right = [Fate::Delivered, Fate::Partial, Fate::Incomplete];
    case(is_stated, right.contains(&row.fate()))
}

fn says_no_gap(row: &TrialRow) -> bool {
    row.answered() && !row.called() && !row.is_coarse_null()
}

fn states_place(row: &TrialRow, least: f64) -> bool {
    let probability = row.outcome().and_then(|o| o.target_probability);
    row.called() && probability.is_some_and(|p| p >= least)
}

/// 90 % intervals of the twin's parameters, counted where they hold the true value.
fn held_intervals(row: &TrialRow, of: bool) -> Count {
    let is_of = of && !row.is_coarse_null();
    let outcome = row.outcome().filter(|_| is_of);
    (outcome.into_iter().flat_map(|o| &o.parameters))
        .filter_map(|estimate| {
            let j = row
                .parameters
                .iter()
                .position(|name| *name == estimate.name)?;
            let [low, high] = estimate.interval;
            Some(case(true, (low..=high).contains(row.truth.theta.get(j)?)))
        })
        .sum()
}

/// Number of members of a stated gap's list; `None` of an empty one.
fn size(row: &TrialRow, members: fn(&Outcome) -> &Vec<String>) -> Option<f64> {
    let members = row.outcome().filter(|_| row.called()).map(members)?;
    (!members.is_empty()).then_some(members.len() as f64)
}

/// Mean over the rows that have a value; null of nothing.
fn mean(rows: &[TrialRow], value: impl Fn(&TrialRow) -> Option<f64>) -> Value {
    let values: Vec<f64> = rows.iter().filter_map(value).collect();
    match values.len() {
        0 => Value::Null,
        n => json!(values.iter().sum::<f64>() / n as f64),
    }
}

/// Logarithm of the probability of the truth, at least ln 0.001.
pub(super) fn log_score(row: &TrialRow) -> Option<f64> {
    scores(row).map(|(truth, _)| truth.max(TRIAL.least_probability).ln())
}

/// Squared error over all outcomes: 0 perfect, 2 certain and wrong.
pub(super) fn brier(row: &TrialRow) -> Option<f64> {
    scores(row).map(|(_, brier)| brier)
}

/// Probability of the truth and Brier score of one trial; `None` where no effect has a probability.
fn scores(row: &TrialRow) -> Option<(f64, f64)> {
    let outcome = row.outcome().filter(|o| o.is_structural())?;
    if row.is_null() || row.truth.kind == Kind::Pair || outcome.effects.is_empty() {
        return None;
    }
    let stated: f64 = outcome.effects.iter().map(|e| e.probability).sum();
    let scale = stated.max(1.0);
    let none = 1.0 - stated / scale;
    // Effects that are right answers alike are one outcome.
    let (mut right, mut false_squares) = (0.0, 0.0);
    for effect in &outcome.effects {
        let probability = effect.probability / scale;
        match row.is_right(&effect.key) {
            true => right += probability,
            false => false_squares += probability.powi(2),
        }
    }
    let (truth, other) = match row.must_abstain() {
        true => (none, 0.0),
        false => (right, none),
    };
    Some((truth, (1.0 - truth).powi(2) + false_squares + other.powi(2)))
}
