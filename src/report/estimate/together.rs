//! Several estimates as one: JSON and document.

use super::estimate_json;
use crate::estimator::{INTERVAL_LEVEL, Together};
use crate::fit::Warning;
use crate::report::digits::{SHOWN, probability, short, with_error};
use crate::report::document::Column::{Number, Text};
use crate::report::document::{Block, Document, Section};
use crate::report::parameters::{ParameterRow, values};
use crate::setting::count;
use crate::study::Study;
use serde_json::{Value, json};

/// One line of the shared table a parameter.
fn rows(study: &Study, all: &Together) -> Vec<ParameterRow> {
    let space = study.twin().parameters();
    (all.names.iter().enumerate())
        .filter_map(|(a, name)| {
            let p = space.iter().find(|p| p.name == *name)?;
            let interval = [all.low[a], all.high[a]];
            Some(ParameterRow::new(
                p,
                all.theta[a],
                all.std_error[a],
                interval,
            ))
        })
        .collect()
}

/// `truetwin.estimates/1`: what the records say together, and `records`, each as `truetwin.estimate/1` with its `file`.
pub(crate) fn together_json(study: &Study, all: &Together, files: &[String]) -> Value {
    let records = (all.records.iter().zip(files)).map(|(estimate, file)| {
        let mut one = estimate_json(study, estimate);
        one["file"] = json!(file);
        one
    });
    json!({
        "schema": "truetwin.estimates/1",
        "twin": study.name(),
        "names": all.names,
        "theta": all.theta,
        "std_error": all.std_error,
        "interval": { "level": INTERVAL_LEVEL, "low": all.low, "high": all.high },
        "parameters": rows(study, all),
        "agreement": {
            "statistic": all.disagreement,
            "degrees": all.degrees,
            "p_value": all.p_value,
            "agree": all.p_value >= SHOWN.disagreement,
        },
        "records": records.collect::<Vec<_>>(),
    })
}

/// Agreement of the records, the shared table, then one line a record, and the warnings of each.
pub(crate) fn together_document(study: &Study, all: &Together, files: &[String]) -> Document {
    let names: Vec<&String> = all.names.iter().take(SHOWN.of_record).collect();
    let mut head = vec![("record", Text)];
    head.extend(names.iter().map(|name| (name.as_str(), Number)));
    head.push(("consistent", Text));
    let mut each = vec![];
    let mut doubts = vec![];
    for (estimate, file) in all.records.iter().zip(files) {
        let mut row = vec![file.clone()];
        row.extend(names.iter().map(|name| {
            let j = estimate.names.iter().position(|own| own == *name);
            j.map_or_else(String::new, |j| {
                with_error(estimate.theta[j], estimate.std_error[j]).join(" ± ")
            })
        }));
        let consistent = ["no", "yes"][usize::from(estimate.is_consistent())];
        row.push(consistent.into());
        each.push(row);
        doubts.extend(estimate.warnings.iter().map(|w| Warning {
            what: format!("{file}: {}", w.what),
            ..w.clone()
        }));
    }
    let (q, n, p) = (
        short(all.disagreement),
        all.degrees,
        probability(all.p_value),
    );
    let agree = all.p_value >= SHOWN.disagreement;
    let [word, why, next] = match agree {
        true => [
            "agree",
            "",
            "Next: use the twin, within the range of these records.",
        ],
        false => [
            "disagree",
            ": the system has changed between them, or the twin lacks something",
            "Next: diagnose what the twin lacks.",
        ],
    };
    Document {
        title: format!("{}: {} records", study.name(), all.records.len()),
        answer: vec![
            Block::Headline(format!(
                "The records {word} (χ² = {q}, {} of freedom, {p}){why}.",
                count(n, "degree")
            )),
            values("", INTERVAL_LEVEL, &rows(study, all)),
            Block::paragraph("Each record is estimated, the answers weighed by their precision."),
            Block::paragraph(next),
        ],
        sections: vec![
            Section::new("records", "Each record", vec![])
                .brief(vec![Block::table("", &head, each), Block::Doubts(doubts)]),
        ],
        ..Document::default()
    }
}
