//! The page of a diagnosis.

mod discovery;
mod explanations;
mod extent;
mod limits;
mod numbers;
mod place;
mod steps;

use crate::diagnose::{Diagnosis, Verdict};
use crate::report::gap::pictures;
use crate::report::gap::story::story;
use crate::report::page::{Section, escaped, figure, folded, page, paragraph};
use crate::report::residuals::{Left, residual_figures};
use crate::report::units::Units;
use crate::study::Study;

/// Returns the diagnosis as a self-contained page for screen, phone and print.
///
/// Pictures are SVG inside the page with descriptions for screen readers; colour never carries information alone. The page
/// has no scripts and loads nothing.
pub(crate) fn gap_html(study: &Study, diagnosis: &Diagnosis) -> String {
    let units = Units::of(study);
    let (headline, sentences) = story(&units, diagnosis);
    let told = format!(
        "<p class=\"verdict\">{}</p>\n{}",
        escaped(&headline),
        paragraph(&sentences.join(" "))
    );
    let lead = format!(
        "<div class=\"first\">\n<div>\n{told}</div>\n{}</div>\n",
        record(study, diagnosis)
    );
    let mut sections = vec![place::section_of(study, diagnosis)];
    sections.extend(validation(study, diagnosis));
    sections.push(explanations::section_of(&units, diagnosis));
    sections.extend(discovery::section_of(study, diagnosis));
    sections.extend([
        extent::section_of(diagnosis),
        steps::section_of(study, &units, diagnosis),
        limits::section_of(&units, diagnosis),
    ]);
    sections.extend(residuals(study, diagnosis));
    // Without a structural gap, the parameters are the answer.
    let parameters = match diagnosis.verdict {
        Verdict::StructuralGap => sections.len(),
        _ => 0,
    };
    sections.insert(parameters, numbers::section_of(&units, diagnosis));
    page(&format!("{}: diagnosis", diagnosis.twin), &lead, &sections)
}

/// Measured and twin, as a figure.
fn record(study: &Study, diagnosis: &Diagnosis) -> String {
    let marked = if diagnosis.location.maps.notable().windows.is_empty() {
        ""
    } else {
        " Strip: shares of prediction errors."
    };
    let caption = format!("The twin runs from the inputs alone.{marked}");
    let svg = pictures::runs(study, diagnosis, false);
    svg.map_or_else(String::new, |svg| figure(&svg, &caption))
}

/// Residuals of the accepted twin, folded.
fn residuals(study: &Study, diagnosis: &Diagnosis) -> Option<Section> {
    let all: Vec<Left<'_>> = (diagnosis.residuals.iter())
        .map(|r| Left {
            inputs: r.drive().inputs(),
            outputs: r.outputs(),
        })
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
    let figures = residual_figures(study, of_what, true, &all);
    let body = folded("Correlations and quantiles", &figures);
    Some(Section::new("residuals", "Residuals", body))
}

/// The validation record and twin.
fn validation(study: &Study, diagnosis: &Diagnosis) -> Option<Section> {
    let svg = pictures::runs(study, diagnosis, true)?;
    let body = figure(&svg, "No parameter is fitted to the validation record.");
    Some(Section::new("validation", "The validation record", body))
}

#[cfg(test)]
mod tests;
