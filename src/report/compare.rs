//! Several studies on one record: a table and an overlay.

use super::chart::{Chart, Panel, Series, Style};
use super::digits::{short, unit_suffix};
use super::table::table;
use crate::fit::{Fit, FitScore, OutputErrors};
use crate::record::{Record, Signal};
use crate::study::Study;
use serde_json::{Value, json};

/// One study, fitted and scored.
pub(crate) struct Compared {
    /// Name: that of its file.
    pub name: String,
    pub study: Study,
    pub fit: Fit,
    /// On the validation record.
    pub score: FitScore,
}

/// Evidence over that of the first study, in nats.
fn gain(all: &[Compared], own: &Compared) -> Option<f64> {
    let of = |compared: &Compared| compared.fit.evidence.map(|e| e.log_evidence);
    Some(of(own)? - of(all.first()?)?)
}

/// The comparison as one JSON object, `truetwin.compare/1`: of each study its fit in short, log evidence over the first study on the
/// fitted records, and errors and log score on the validation record.
pub(crate) fn compare_json(all: &[Compared]) -> Value {
    let one = |own: &Compared| {
        json!({
            "study": own.name,
            "twin": own.study.name(),
            "parameters": own.fit.parameters,
            "noise": own.fit.noise,
            "converged": own.fit.convergence.converged,
            "log_evidence": own.fit.evidence.map(|e| e.log_evidence),
            "gain": gain(all, own),
            "log_score": own.score.log_score,
            "errors": own.score.errors,
            "warnings": own.fit.warnings,
        })
    };
    json!({
        "schema": "truetwin.compare/1",
        "studies": all.iter().map(one).collect::<Vec<_>>(),
    })
}

/// The comparison as a table, one study a line.
pub(crate) fn compare_text(all: &[Compared], what: &str) -> String {
    let head = [
        "study",
        "parameters",
        "evidence",
        "log score",
        "one step",
        "free run",
        "",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for own in all {
        rows.push(vec![
            own.name.clone(),
            own.fit.parameters.len().to_string(),
            gain(all, own).map_or("–".into(), signed),
            short(own.score.log_score),
            errors(&own.score.errors, |e| Some(e.one_step)),
            errors(&own.score.errors, |e| e.free_run),
            if own.fit.convergence.converged {
                ""
            } else {
                "not converged"
            }
            .into(),
        ]);
    }
    format!(
        "{}\nEvidence: log evidence over the first study, in nats. Log score (nats a row, higher is better) and errors: {what}.\n",
        table(&rows)
    )
}

fn signed(nats: f64) -> String {
    match nats > 0.0 {
        true => format!("+{}", short(nats)),
        false => short(nats),
    }
}

fn errors(all: &[OutputErrors], of: impl Fn(&OutputErrors) -> Option<f64>) -> String {
    let one = |e: &OutputErrors| {
        of(e).map_or("diverges".into(), |value| {
            format!("{}{}", short(value), unit_suffix(&e.unit))
        })
    };
    all.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// The validation record with the free run of each study over it, a panel an output.
pub(crate) fn compare_svg(all: &[Compared], record: &Record) -> String {
    let outputs = all
        .first()
        .map_or_else(Vec::new, |own| own.study.twin().signals().outputs);
    let timed = |values: &Signal, channel: usize| -> Vec<(f64, f64)> {
        let values = values.column(channel);
        (values.iter().enumerate())
            .map(|(k, v)| (record.drive().time(k), *v))
            .collect()
    };
    let panels = (outputs.iter().enumerate()).map(|(channel, output)| {
        let measured = timed(record.outputs(), channel);
        let mut lines = vec![Series::new("measured", Style::RECORD, measured)];
        for (own, style) in all.iter().zip(Style::OTHERS.iter().cycle()) {
            let Some(run) = &own.score.free_run else {
                continue;
            };
            lines.push(Series::new(&own.name, *style, timed(run, channel)));
        }
        let unit = match unit_suffix(&output.unit) {
            unit if unit.is_empty() => unit,
            unit => format!(" in{unit}"),
        };
        Panel::new(&format!("{}{unit}", output.name), lines)
    });
    let names: Vec<&str> = all.iter().map(|own| own.name.as_str()).collect();
    Chart {
        title: "Studies on one record".into(),
        description: format!("Measured outputs and free runs of {}.", names.join(", ")),
        x: "t in s".into(),
        panels: panels.collect(),
    }
    .svg()
}
