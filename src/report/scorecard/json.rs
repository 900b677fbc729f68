//! Scores of withheld trials as JSON, `truetwin.scorecard/2`.

use crate::evaluate::LEVEL;
use crate::evaluate::trials::{Breakdown, BreakdownLine, Scorecard, TrialRow};
use serde_json::{Value, json};

/// The scorecard as one JSON object. Each count is `{ count, of, interval }`, the interval Clopper–Pearson's at `interval_level`;
/// docs/withheld.md defines each. All keys are always there; numbers that are not finite are null.
pub(super) fn scorecard_json(card: &Scorecard) -> Value {
    let (setup, settings) = (&card.setup, &card.setup.settings);
    let mut object = json!({
        "schema": "truetwin.scorecard/2",
        "twin": setup.twin,
        "seed": settings.seed,
        "families": settings.families,
        "without": settings.without,
        "validation": settings.validation,
        "like": settings.like.is_some(),
        "detection_only": settings.detection_only,
        "ablated": settings.ablated,
        "seal": setup.seal,
        "trials": card.trials,
        "interval_level": LEVEL,
    });
    let scores = card
        .scores
        .iter()
        .map(|score| (score.key, json!(score.value)));
    let figures = card
        .figures
        .iter()
        .map(|figure| (figure.key, figure.value.clone()));
    for (path, value) in scores.chain(figures) {
        match path.split_once('.') {
            Some((group, key)) => object[group][key] = value,
            None => object[path] = value,
        }
    }
    for breakdown in &card.breakdowns {
        object[breakdown.key] = lines(breakdown);
    }
    object["list"] = card.rows.iter().map(trial).collect();
    object
}

fn lines(breakdown: &Breakdown) -> Value {
    let line = |line: &BreakdownLine| {
        let mut object = line.labels.clone();
        let counts = breakdown.columns.iter().zip(&line.counts);
        object.extend(counts.map(|((key, _), count)| ((*key).into(), json!(count))));
        Value::Object(object)
    };
    breakdown.lines.iter().map(line).collect()
}

fn trial(row: &TrialRow) -> Value {
    let (truth, outcome) = (&row.truth, row.outcome());
    json!({
        "trial": truth.trial,
        "kind": truth.kind,
        "truth": row.truth_name(),
        "right": row.right,
        "rival": truth.rival,
        "targets": truth.targets,
        "places": truth.places,
        "information": truth.information,
        "held": row.held(),
        "step_information": truth.step,
        "nuisance": row.nuisance(),
        "answer": row.answer_text(),
        "fate": row.fate(),
        "stated": outcome.and_then(|o| o.stated()),
        "target": outcome.and_then(|o| o.target.as_ref()),
        "closed": outcome.and_then(|o| o.closed),
        "true_closed": row.true_share.and_then(|share| share.closed),
        "failure": row.answer.failure,
        "redraws": truth.redraws,
        "passes": outcome.map(|o| o.passes),
        "seconds": row.answer.seconds,
    })
}
