//! Scores of withheld trials as JSON, `truetwin.scorecard/1`.

use crate::evaluate::trials::{Count, LEVEL, Range, Row, Scorecard};
use serde_json::{Value, json};

/// The scorecard as one JSON object, `truetwin.scorecard/1`.
///
/// Each score is `{ count, of, interval }`, the interval Clopper–Pearson's at `interval_level`. What each is of stands in
/// docs/withheld.md.
///
/// Beyond the contract: `interval`, `interval_level`, `clear_top1`, `clear_in_class`, `clear_where`, `unlisted_where`,
/// `clear_class_size`, `clear_abstained`,
/// `clear_pairs_accepted`, `abstained_rightly`
/// (the precision of abstaining), `failed`, `by_kind`, `by_strength`, `by_gain`, `confusion`, `list` (every trial).
///
/// All keys are always there; numbers that are not finite are null.
pub fn scorecard_json(card: &Scorecard) -> Value {
    let by_kind: Vec<Value> = (card.by_kind.iter())
        .map(|k| json!({ "kind": k.kind, "structural": count(k.structural), "right": count(k.right) }))
        .collect();
    let confusion: Vec<Value> = (card.confusion.iter())
        .map(|(truth, answer, count)| json!({ "truth": truth, "answer": answer, "count": count }))
        .collect();
    let reliability: Vec<Value> = (card.reliability.iter())
        .map(|bin| json!({ "stated": bin.stated, "right": count(bin.right) }))
        .collect();
    json!({
        "schema": "truetwin.scorecard/1",
        "twin": card.twin,
        "trials": card.rows.len(),
        "seed": card.seed,
        "alpha": card.alpha,
        "seal": card.seal,
        "interval_level": LEVEL,
        "false_alarms": count(card.false_alarms),
        "absorbed_called_structural": count(card.absorbed_called_structural),
        "detected": count(card.detected),
        "clear_detected": count(card.clear_detected),
        "top1": count(card.top1),
        "clear_top1": count(card.clear_top1),
        "in_class": count(card.in_class),
        "clear_in_class": count(card.clear_in_class),
        "mean_class_size": card.mean_class_size,
        "clear_class_size": card.clear_class_size,
        "where": count(card.place),
        "clear_where": count(card.clear_place),
        "unlisted_where": count(card.unlisted_place),
        "abstained": count(card.abstained),
        "clear_abstained": count(card.clear_abstained),
        "abstained_rightly": count(card.abstained_rightly),
        "wrongly_abstained": count(card.wrongly_abstained),
        "pairs_accepted": count(card.pairs_accepted),
        "clear_pairs_accepted": count(card.clear_pairs_accepted),
        "interval_covers": count(card.interval_covers),
        "reliability": reliability,
        "seconds_per_record": card.seconds_per_record,
        "failed": count(card.failed),
        "by_kind": by_kind,
        "by_strength": ranges(&card.by_strength),
        "by_gain": ranges(&card.by_gain),
        "confusion": confusion,
        "list": card.rows.iter().map(row).collect::<Vec<_>>(),
    })
}

fn count(count: Count) -> Value {
    let (low, high) = count.interval();
    json!({ "count": count.count, "of": count.of, "interval": [low, high] })
}

fn ranges(ranges: &[Range]) -> Vec<Value> {
    (ranges.iter())
        .map(|r| json!({ "low": r.low, "high": r.high, "detected": count(r.detected) }))
        .collect()
}

fn row(row: &Row) -> Value {
    let outcome = row.outcome.as_ref();
    let top = outcome.and_then(|o| o.top());
    json!({
        "trial": row.trial,
        "kind": row.kind,
        "truth": row.truth,
        "answer": row.answer(),
        "right": row.is_right(),
        "strength": row.strength,
        "added": row.added,
        "shortfall": row.shortfall,
        "gain": row.gain,
        "p_value": outcome.map(|o| o.p_value),
        "where": outcome.and_then(|o| o.target.as_ref()),
        "top": top.map(|top| &top.key),
        "probability": top.map(|top| top.probability),
        "class": outcome.map(|o| &o.class),
        "closed": outcome.and_then(|o| o.closed),
        "interval": outcome.and_then(|o| o.interval),
        "true_share": row.share,
        "failure": row.failure,
        "seconds": row.seconds,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{scorecards, validator};

    #[test]
    fn full_and_empty_scorecards_keep_to_the_contract() {
        for card in scorecards() {
            let read: Value = serde_json::from_str(&scorecard_json(&card).to_string()).unwrap();
            let complaints: Vec<String> = (validator("scorecard").iter_errors(&read))
                .map(|error| format!("{}: {error}", error.instance_path))
                .collect();
            assert!(complaints.is_empty(), "{complaints:?}");
        }
    }
}
