//! Several estimates as one: JSON and text.

use super::estimate_json;
use crate::estimator::{INTERVAL_LEVEL, Together};
use crate::report::digits::{Digits, error, probability, short};
use crate::report::parameters::{Line, ParameterRow, parameter_rows};
use crate::report::table::table;
use crate::study::Study;
use crate::twin::Role;
use serde_json::{Value, json};

/// Level below which records are said to disagree.
const LEVEL: f64 = 0.01;
/// Parameters of each record that are shown.
const SHOWN: usize = 6;

/// One line of the shared table a parameter.
fn rows(study: &Study, all: &Together) -> Vec<(ParameterRow, Role)> {
    let space = study.twin().parameters();
    (all.names.iter().enumerate())
        .filter_map(|(a, name)| {
            let p = space.iter().find(|p| p.name == *name)?;
            let interval = [all.low[a], all.high[a]];
            let row = ParameterRow::new(p, all.theta[a], all.std_error[a], interval);
            Some((row, p.role))
        })
        .collect()
}

/// `truetwin.estimates/1`: what the records say together, and `records`, each as `truetwin.estimate/1` with its `file`.
pub fn together_json(study: &Study, all: &Together, files: &[String]) -> Value {
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
        "parameters": rows(study, all).into_iter().map(|(row, _)| row).collect::<Vec<_>>(),
        "agreement": {
            "statistic": all.disagreement,
            "degrees": all.degrees,
            "p_value": all.p_value,
            "agree": all.p_value >= LEVEL,
        },
        "records": records.collect::<Vec<_>>(),
    })
}

/// The shared table, then one line a record, then whether they agree, then the warnings of each.
pub fn together_text(study: &Study, all: &Together, files: &[String]) -> String {
    let level = format!("{:.0} % interval", 100.0 * INTERVAL_LEVEL);
    let shown: Vec<Line> = (rows(study, all).into_iter())
        .map(|(row, role)| (row.name.clone(), role, row, vec![]))
        .collect();
    let lines = parameter_rows(["value", &level], &[], &shown);
    let names: Vec<&String> = all.names.iter().take(SHOWN).collect();
    let mut head = vec!["record".to_owned()];
    head.extend(names.iter().map(|name| (*name).clone()));
    head.push("consistent".into());
    let mut each = vec![head];
    for (estimate, file) in all.records.iter().zip(files) {
        let mut row = vec![file.clone()];
        for name in &names {
            let j = estimate.names.iter().position(|own| own == *name);
            row.push(j.map_or_else(String::new, |j| {
                let (value, std_error) = (estimate.theta[j], estimate.std_error[j]);
                let digits = Digits::supported(value, std_error);
                format!("{} ± {}", digits.write(value), error(std_error))
            }));
        }
        row.push(
            if estimate.is_consistent() {
                "yes"
            } else {
                "no"
            }
            .into(),
        );
        each.push(row);
    }
    let (q, n, p) = (
        short(all.disagreement),
        all.degrees,
        probability(all.p_value),
    );
    let agreement = match all.p_value >= LEVEL {
        true => format!("The records agree (χ² = {q}, {n} degrees of freedom, {p})."),
        false => format!(
            "The records disagree (χ² = {q}, {n} degrees of freedom, {p}): the system has changed between them, or the twin lacks something. Next: truetwin diagnose."
        ),
    };
    let mut text = format!(
        "{}: {} records, each estimated, the answers weighed by their precision.\n\n{}\n{}\n{agreement}\n",
        study.name(),
        all.records.len(),
        table(&lines),
        table(&each),
    );
    for (estimate, file) in all.records.iter().zip(files) {
        for warning in &estimate.warnings {
            text.push_str(&format!(
                "warning: {file}: {}; {}\n",
                warning.what, warning.remedy
            ));
        }
    }
    text
}
