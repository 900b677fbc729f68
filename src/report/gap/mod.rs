//! A diagnosis as JSON, document and pictures.
//!
//! | file | holds |
//! |---|---|
//! | `statement.rs` | the answer in words, and the next step |
//! | `place.rs`, `cause.rs`, `extent.rs`, `next.rs`, `limits.rs` | a section each |
//! | `check.rs` | the predictive check |
//! | `pictures/` | the pictures |

mod cause;
mod check;
mod extent;
mod limits;
mod next;
mod pictures;
mod place;
mod share;
mod statement;
#[cfg(test)]
mod tests;
mod words;

pub(super) use pictures::gap_pictures;

use super::document::{Block, Document, Picture, Section};
use super::parameters::{ParameterRow, priors, values};
use super::residuals::{Left, residual_blocks};
use super::units::Units;
use crate::diagnose::{Diagnosis, THRESHOLDS, Verdict};
use crate::report::digits::with_error;
use crate::report::document::Column::{Number, Text};
use crate::setting::own_unit;
use crate::study::Study;
use serde_json::Value;

/// File of the record to measure next, beside the report.
pub const NEXT_INPUT: &str = "next-input.csv";

/// The diagnosis as one JSON object, `truetwin.gap/2`.
///
/// | key | holds |
/// |---|---|
/// | `verdict`, `detection` | kind of gap, and the evidence for it |
/// | `check` | predictive check of an all-clear: `p_value`, `simulations`, `statistics`, the `disturbance` that fitted noise hides |
/// | `parameters`, `nuisance` | θ beside the accepted effects; all other estimates |
/// | `where` | places by probability, missing functions, maps of the residuals, time of a change |
/// | `which` | effects with probabilities, the accepted ones first, and those that do the same in this twin (`also`); rivals, what remains, the next input |
/// | `shrinkage` | prediction errors on held-out data over several horizons, the share closed, controls |
/// | `discovery` | exploratory law of the missing function |
/// | `correlated_noise`, `proportional_noise`, `outliers`, `integrator`, `substeps` | noise and step that the diagnosis used in place of the twin's |
/// | `power`, `not_tested`, `candidates` | smallest detectable magnitudes; effects left out; explanations tested |
/// | `warnings` | `code`, `what`, `remedy` of everything that makes the result doubtful |
/// | `quick`, `interrupted`, `seconds` | extent of the search |
///
/// All keys are always there; what was skipped is null, and so are numbers that are not finite.
pub(super) fn gap_json(diagnosis: &Diagnosis) -> Value {
    // Fails for keys that are no strings; there are none.
    serde_json::to_value(diagnosis).unwrap_or_default()
}

/// The diagnosis for people.
pub(super) fn gap_document(study: &Study, diagnosis: &Diagnosis) -> Document {
    let units = Units::of(study);
    let details = statement::details(&units, diagnosis).join(" ");
    let mut sections = vec![place::section(study, diagnosis)];
    sections.extend(validation(study, diagnosis));
    sections.push(cause::section(&units, diagnosis));
    sections.extend(cause::discovery(study, diagnosis));
    sections.extend([
        extent::section(diagnosis),
        next::section(study, &units, diagnosis),
        limits::section(&units, diagnosis),
    ]);
    sections.extend(residuals(study, diagnosis));
    // Without a structural gap, the parameters are the answer.
    let at = match diagnosis.verdict {
        Verdict::StructuralGap => sections.len(),
        _ => 0,
    };
    sections.insert(at, parameters(&units, diagnosis));
    Document {
        title: format!("{}: diagnosis", diagnosis.twin),
        answer: vec![
            Block::Headline(statement::headline(&units, diagnosis)),
            Block::Paragraph(details),
            Block::Paragraph(statement::next(diagnosis)),
            Block::Doubts(diagnosis.warnings.clone()),
        ],
        picture: pictures::runs(study, diagnosis, false).map(|svg| Picture {
            svg,
            caption: "The twin runs from the inputs alone; below, record − twin.".into(),
        }),
        sections,
        ..Document::default()
    }
}

/// The validation record and twin.
fn validation(study: &Study, diagnosis: &Diagnosis) -> Option<Section> {
    let svg = pictures::runs(study, diagnosis, true)?;
    let caption = "No parameter is fitted to the validation record.";
    let rest = vec![Block::picture(svg, caption)];
    Some(Section::new("validation", "The validation record", rest))
}

/// Parameters, starts and noise levels.
fn parameters(units: &Units, diagnosis: &Diagnosis) -> Section {
    let section = Section::new("parameters", "Parameters", vec![]);
    if diagnosis.parameters.is_empty() {
        let none = Block::paragraph("The twin has no parameters of its own.");
        return section.brief(vec![none]);
    }
    let rows: Vec<ParameterRow> = (diagnosis.parameters.iter())
        .map(|p| ParameterRow::diagnosed(p).stages(vec![p.initial, Some(p.alone)]))
        .collect();
    let caption = match diagnosis.cause.accepted.is_empty() {
        true => "",
        false => "The twin's own parameters, beside the accepted effects.",
    };
    let others = (diagnosis.nuisance.iter())
        .map(|n| {
            // A start of a further record is named `h1 (record 2)`.
            let name = n.name.split(' ').next().unwrap_or(&n.name);
            let role = n.role.nuisance().unwrap_or_default().to_owned();
            let [value, error] = with_error(n.value, n.std_error);
            let unit = own_unit(units.variable(name)).to_owned();
            vec![n.name.clone(), role, value, error, unit]
        })
        .collect();
    let head = [
        ("name", Text),
        ("role", Text),
        ("value", Number),
        ("± std error", Number),
        ("unit", Text),
    ];
    let mut rest = vec![priors(&["first estimate", "twin alone"], &rows)];
    if !diagnosis.nuisance.is_empty() {
        rest.push(Block::table("Other estimated quantities.", &head, others));
    }
    Section { rest, ..section }.brief(vec![values(caption, THRESHOLDS.interval_level, &rows)])
}

/// Residuals of the accepted twin, folded.
fn residuals(study: &Study, diagnosis: &Diagnosis) -> Option<Section> {
    let all: Vec<Left<'_>> = (diagnosis.residuals.iter())
        .map(|r| (r.drive().inputs(), r.outputs()))
        .collect();
    if all.is_empty() {
        return None;
    }
    let of_what = match diagnosis.cause.accepted.is_empty() {
        true => "one-step prediction errors of the refitted twin, over their standard deviation",
        false => {
            "one-step prediction errors of the twin with the accepted effects, over their standard deviation"
        }
    };
    let blocks = residual_blocks(study, of_what, true, &all);
    let rest = vec![Block::folded("Correlations and quantiles", blocks)];
    Some(Section::new("residuals", "Residuals", rest))
}
