//! Counts of right and wrong over all trials.

use super::{Kind, Row};
use crate::math::clopper_pearson;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// Level of the Clopper–Pearson intervals.
const LEVEL: f64 = 0.95;
/// Ends of the bins of strength.
const STRENGTHS: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
/// Ends of the bins of gain, in nats.
const GAINS: [f64; 8] = [
    f64::NEG_INFINITY,
    3.0,
    6.0,
    12.0,
    25.0,
    50.0,
    100.0,
    f64::INFINITY,
];
/// Ends of the bins of stated probability.
const STATED: [f64; 6] = [0.5, 0.6, 0.7, 0.8, 0.9, 1.0];

/// So many of so many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Count {
    /// So many …
    pub count: u64,
    /// … of so many.
    pub of: u64,
}

impl Serialize for Count {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Count", 3)?;
        object.serialize_field("count", &self.count)?;
        object.serialize_field("of", &self.of)?;
        object.serialize_field("interval", &self.interval())?;
        object.end()
    }
}

impl Count {
    /// Counts the rows in `of` that are in `count`, too.
    fn over<'r>(
        rows: impl IntoIterator<Item = &'r Row>,
        of: impl Fn(&Row) -> bool,
        count: impl Fn(&Row) -> bool,
    ) -> Self {
        let mut all = Self::default();
        for row in rows.into_iter().filter(|row| of(row)) {
            all.of += 1;
            all.count += u64::from(count(row));
        }
        all
    }

    /// The share; none of nothing.
    pub fn share(self) -> Option<f64> {
        (self.of > 0).then(|| self.count as f64 / self.of as f64)
    }

    /// Clopper–Pearson interval of the probability, at 95 %.
    pub fn interval(self) -> (f64, f64) {
        // A count is never more than what it is of.
        clopper_pearson(self.count, self.of, LEVEL).unwrap_or((0.0, 1.0))
    }
}

/// Detection within a range of a magnitude.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Range {
    /// From.
    pub low: f64,
    /// To.
    pub high: f64,
    /// Called structural.
    pub detected: Count,
}

/// The trials of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct KindScore {
    /// Kind.
    pub kind: Kind,
    /// Called structural.
    pub structural: Count,
    /// Right by the rule of the kind.
    pub right: Count,
}

/// Answers of about the same stated probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StatedBin {
    /// Mean of what was stated.
    pub stated: f64,
    /// Answers whose effect on top was a true one.
    pub right: Count,
}

/// A truth and an answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Confusion {
    /// As in [`Row::truth`].
    pub truth: String,
    /// As in [`Row::answer`].
    pub answer: String,
    /// Number of trials.
    pub count: u64,
}

/// All scores; docs/withheld.md defines each.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "schema", rename = "truetwin.scorecard/1")]
pub struct Scorecard {
    /// Name of the twin.
    pub twin: String,
    /// Number of trials.
    pub trials: usize,
    /// Random seed.
    pub seed: u64,
    /// Level of the structural test.
    pub alpha: f64,
    /// SHA-256 of the key file.
    pub seal: String,
    /// Level of the Clopper–Pearson intervals.
    pub interval_level: f64,
    /// Called structural, of kinds `none` and `outside`.
    pub false_alarms: Count,
    /// Called structural, of kind `absorbed`.
    pub absorbed_called_structural: Count,
    /// Called structural, of structural kinds.
    pub detected: Count,
    /// The same, of those whose true effects gain over 12 nats.
    pub clear_detected: Count,
    /// The true effect is on top, of detected kinds `listed` and `parametrised`.
    pub top1: Count,
    /// The same, of the clear ones.
    pub clear_top1: Count,
    /// The true effect is in the class, of detected `listed`, `parametrised` and `confounded`.
    pub in_class: Count,
    /// The same, of the clear ones.
    pub clear_in_class: Count,
    /// Mean size of classes of the same, where there is one.
    pub mean_class_size: Option<f64>,
    /// The same, of the clear ones.
    pub clear_class_size: Option<f64>,
    /// The place is right, of detected `listed` and `parametrised`.
    #[serde(rename = "where")]
    pub place: Count,
    /// The same, of the clear ones.
    #[serde(rename = "clear_where")]
    pub clear_place: Count,
    /// The place is right, of detected gaps that no effect of the library describes.
    #[serde(rename = "unlisted_where")]
    pub unlisted_place: Count,
    /// None of the listed effects, of detected ones that have none: recall.
    pub abstained: Count,
    /// The same, of those that no listed effect imitates within 6 held-out nats.
    pub clear_abstained: Count,
    /// Nothing listed was there, of all that were answered so: precision.
    pub abstained_rightly: Count,
    /// None of the listed effects, of detected ones that have one.
    pub wrongly_abstained: Count,
    /// Both effects accepted, of detected pairs.
    pub pairs_accepted: Count,
    /// The same, of pairs whose weaker effect adds over 12 nats to the other one.
    pub clear_pairs_accepted: Count,
    /// Intervals of the share closed that hold the true system's share, of right answers with an interval.
    pub interval_covers: Count,
    /// Stated probability of the effect on top against how often it is true, where an effect was accepted.
    pub reliability: Vec<StatedBin>,
    /// Mean wall-clock seconds of a diagnosis.
    pub seconds_per_record: Option<f64>,
    /// Diagnoses that ended in an error, of all.
    pub failed: Count,
    /// By kind of truth.
    pub by_kind: Vec<KindScore>,
    /// Detection by strength, from 0, hardly visible, to 1, obvious.
    pub by_strength: Vec<Range>,
    /// Detection by what the true effects gain, in nats.
    pub by_gain: Vec<Range>,
    /// Counts of each truth and answer.
    pub confusion: Vec<Confusion>,
    /// Every trial.
    #[serde(rename = "list")]
    pub rows: Vec<Row>,
}

impl Scorecard {
    /// Scores of these trials, the structural test at level `alpha`.
    pub fn new(twin: &str, seed: u64, alpha: f64, seal: &str, rows: Vec<Row>) -> Self {
        let over =
            |of: &dyn Fn(&Row) -> bool, count: &dyn Fn(&Row) -> bool| Count::over(&rows, of, count);
        let structural = |row: &Row| row.kind.is_structural();
        let single = |row: &Row| row.called() && row.is_single();
        let with_class =
            |row: &Row| row.called() && !row.right.is_empty() && row.kind != Kind::Pair;
        let clear_single = |row: &Row| single(row) && row.is_clear();
        let sizes = |clear: bool| -> Vec<f64> {
            (rows.iter().filter(|row| with_class(row)))
                .filter(|row| !clear || row.is_clear())
                .filter_map(|row| row.outcome.as_ref())
                .map(|o| o.class.len() as f64)
                .filter(|size| *size > 0.0)
                .collect()
        };
        let seconds: Vec<f64> = rows.iter().map(|row| row.seconds).collect();
        Self {
            twin: twin.into(),
            trials: rows.len(),
            seed,
            alpha,
            seal: seal.into(),
            interval_level: LEVEL,
            false_alarms: over(
                &|row| matches!(row.kind, Kind::None | Kind::Outside),
                &Row::called,
            ),
            absorbed_called_structural: over(&|row| row.kind == Kind::Absorbed, &Row::called),
            detected: over(&structural, &Row::called),
            clear_detected: over(&|row| structural(row) && row.is_clear(), &Row::called),
            top1: over(&single, &Row::top_is_right),
            clear_top1: over(&clear_single, &Row::top_is_right),
            in_class: over(&with_class, &Row::class_is_right),
            clear_in_class: over(
                &|row| with_class(row) && row.is_clear(),
                &Row::class_is_right,
            ),
            mean_class_size: mean(&sizes(false)),
            clear_class_size: mean(&sizes(true)),
            place: over(&single, &Row::place_is_right),
            clear_place: over(&clear_single, &Row::place_is_right),
            unlisted_place: over(
                &|row| row.called() && row.must_abstain(),
                &Row::place_is_right,
            ),
            abstained: over(&|row| row.called() && row.must_abstain(), &Row::abstained),
            clear_abstained: over(&|row| row.called() && row.nothing_fits(), &Row::abstained),
            wrongly_abstained: over(
                &|row| row.called() && !row.right.is_empty(),
                &Row::abstained,
            ),
            abstained_rightly: over(&Row::abstained, &Row::must_abstain),
            pairs_accepted: over(
                &|row| row.called() && row.kind == Kind::Pair && !row.right.is_empty(),
                &Row::accepted_are_right,
            ),
            clear_pairs_accepted: over(
                &|row| row.called() && row.is_clear_pair() && !row.right.is_empty(),
                &Row::accepted_are_right,
            ),
            interval_covers: over(&|row| row.interval().is_some(), &|row| {
                row.interval()
                    .is_some_and(|([low, high], share)| (low..=high).contains(&share))
            }),
            reliability: reliability(&rows),
            seconds_per_record: mean(&seconds),
            failed: over(&|_| true, &|row| row.failure.is_some()),
            by_kind: (Kind::ALL.into_iter())
                .map(|kind| KindScore {
                    kind,
                    structural: over(&|row| row.kind == kind, &Row::called),
                    right: over(&|row| row.kind == kind, &Row::is_right),
                })
                .filter(|score| score.right.of > 0)
                .collect(),
            by_strength: ranges(&rows, &STRENGTHS, |row| {
                row.strength.filter(|_| row.kind.is_structural())
            }),
            by_gain: ranges(&rows, &GAINS, |row| row.gain),
            confusion: confusion(&rows),
            rows,
        }
    }
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Detection in each bin; the last one holds its upper end.
fn ranges(rows: &[Row], ends: &[f64], value: impl Fn(&Row) -> Option<f64>) -> Vec<Range> {
    (bins(ends))
        .map(|(low, high, inside)| Range {
            low,
            high,
            detected: Count::over(rows, |row| value(row).is_some_and(&inside), Row::called),
        })
        .filter(|range| range.detected.of > 0)
        .collect()
}

/// Bins between these ends, and whether a value lies in each.
fn bins(ends: &[f64]) -> impl Iterator<Item = (f64, f64, impl Fn(f64) -> bool)> {
    let last = ends.last().copied().unwrap_or(f64::NAN);
    (ends.iter().zip(ends.iter().skip(1))).map(move |(&low, &high)| {
        (low, high, move |v: f64| {
            low <= v && (v < high || (v == high && high == last))
        })
    })
}

fn reliability(rows: &[Row]) -> Vec<StatedBin> {
    let named: Vec<(f64, bool)> = (rows.iter())
        .filter_map(|row| {
            let outcome = row.outcome.as_ref().filter(|o| !o.accepted.is_empty())?;
            Some((outcome.top()?.probability, row.top_is_right()))
        })
        .collect();
    bins(&STATED)
        .filter_map(|(_, _, inside)| {
            let within: Vec<(f64, bool)> =
                named.iter().copied().filter(|(p, _)| inside(*p)).collect();
            let stated: Vec<f64> = within.iter().map(|(p, _)| *p).collect();
            Some(StatedBin {
                stated: mean(&stated)?,
                right: Count {
                    count: within.iter().filter(|(_, right)| *right).count() as u64,
                    of: within.len() as u64,
                },
            })
        })
        .collect()
}

fn confusion(rows: &[Row]) -> Vec<Confusion> {
    let mut counts = BTreeMap::new();
    for row in rows {
        *counts.entry((row.truth.clone(), row.answer())).or_insert(0) += 1;
    }
    (counts.into_iter())
        .map(|((truth, answer), count)| Confusion {
            truth,
            answer,
            count,
        })
        .collect()
}

#[cfg(test)]
mod tests;
