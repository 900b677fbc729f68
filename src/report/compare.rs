//! Several studies on one record: a table and an overlay.

use super::chart::Style;
use super::digits::{short, with_unit};
use super::document::Column::{Number, Text};
use super::document::{Block, Document};
use super::record::{RecordPicture, Run};
use crate::fit::{Fit, FitScore, OutputErrors};
use crate::record::Record;
use crate::study::Study;
use serde_json::{Value, json};

/// One study, fitted and scored.
pub(crate) struct ComparedStudy {
    /// Name: that of its file.
    pub name: String,
    pub study: Study,
    pub fit: Fit,
    /// On the validation record.
    pub score: FitScore,
}

/// Evidence over that of the first study, in nats.
fn gain(all: &[ComparedStudy], own: &ComparedStudy) -> Option<f64> {
    let of = |compared: &ComparedStudy| compared.fit.evidence.map(|e| e.log_evidence);
    Some(of(own)? - of(all.first()?)?)
}

/// The comparison as one JSON object, `truetwin.compare/1`: of each study its fit in short, log evidence over the first study on the
/// fitted records, and errors and log score on the validation record.
pub(crate) fn compare_json(all: &[ComparedStudy]) -> Value {
    let one = |own: &ComparedStudy| {
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

/// The comparison for people: the best study, then a table, one study a line.
pub(crate) fn compare_document(all: &[ComparedStudy], what: &str) -> Document {
    let rows = all.iter().map(|own| {
        let evidence = gain(all, own).map_or("–".into(), |nats| match nats > 0.0 {
            true => format!("+{}", short(nats)),
            false => short(nats),
        });
        vec![
            own.name.clone(),
            own.fit.parameters.len().to_string(),
            evidence,
            short(own.score.log_score),
            errors(&own.score.errors, |e| Some(e.one_step)),
            errors(&own.score.errors, |e| e.free_run),
            match own.fit.convergence.converged {
                true => String::new(),
                false => "not converged".into(),
            },
        ]
    });
    let head = [
        ("study", Text),
        ("parameters", Number),
        ("evidence", Number),
        ("log score", Number),
        ("one step", Number),
        ("free run", Number),
        ("", Text),
    ];
    let highest = (all.iter().map(|own| own.score.log_score)).max_by(f64::total_cmp);
    // A difference that the table does not show is none.
    let is_best = |own: &&ComparedStudy| {
        highest.is_some_and(|highest| short(own.score.log_score) == short(highest))
    };
    let best: Vec<&str> = (all.iter().filter(is_best).map(|own| own.name.as_str())).collect();
    let headline = match &best[..] {
        [best] => format!("{best} predicts best: highest log score {what}."),
        tied => format!(
            "{} predict equally well: the same log score {what}.",
            tied.join(" and ")
        ),
    };
    Document {
        title: "Studies on one record".into(),
        answer: vec![
            Block::Headline(headline),
            Block::table("", &head, rows.collect()),
            Block::Paragraph(format!(
                "Evidence: log evidence over the first study, in nats. Log score (nats a row, higher is better) and errors: {what}."
            )),
        ],
        ..Document::default()
    }
}

fn errors(all: &[OutputErrors], of: impl Fn(&OutputErrors) -> Option<f64>) -> String {
    let one = |e: &OutputErrors| of(e).map_or("diverges".into(), |value| with_unit(value, &e.unit));
    all.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// The validation record with the free run of each study over it, and what each leaves.
pub(crate) fn compare_svg(all: &[ComparedStudy], record: &Record) -> String {
    let outputs = all
        .first()
        .map_or_else(Vec::new, |own| own.study.twin().signals().outputs);
    let runs = all.iter().zip(Style::OTHERS.iter().cycle());
    let runs =
        runs.filter_map(|(own, style)| Some(Run(&own.name, *style, own.score.free_run.as_ref()?)));
    RecordPicture {
        title: "Studies on one record".into(),
        outputs: &outputs,
        times: &record.drive().times(),
        measured: record.outputs(),
        runs: runs.collect(),
        spans: &|_| vec![],
        marks: vec![],
    }
    .svg()
}
