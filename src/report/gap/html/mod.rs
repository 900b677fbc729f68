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
use crate::report::gap::text::{evidence_sentence, verdict_sentence};
use crate::report::page::{Section, escaped, figure, page, paragraph};
use crate::report::units::Units;
use crate::study::Study;

/// Returns the diagnosis as a self-contained page for screen, phone and print.
///
/// Pictures are SVG inside the page with descriptions for screen readers; colour never carries information alone. The page
/// has no scripts and loads nothing.
pub fn gap_html(study: &Study, diagnosis: &Diagnosis) -> String {
    let units = Units::of(study);
    let verdict = escaped(&verdict_sentence(diagnosis));
    let lead = format!(
        "<p class=\"verdict\">{verdict}</p>\n{}",
        paragraph(&evidence(diagnosis))
    );
    let mut sections = vec![runs(study, diagnosis), place::section_of(study, diagnosis)];
    sections.push(explanations::section_of(&units, diagnosis));
    sections.extend(discovery::section_of(study, diagnosis));
    sections.extend([
        extent::section_of(diagnosis),
        steps::section_of(study, &units, diagnosis),
        limits::section_of(&units, diagnosis),
    ]);
    // Without a structural gap, the parameters are the answer.
    let parameters = match diagnosis.verdict {
        Verdict::StructuralGap => sections.len(),
        _ => 1,
    };
    sections.insert(parameters, numbers::section_of(&units, diagnosis));
    page(
        &format!("{}: what the twin lacks", diagnosis.twin),
        &lead,
        &sections,
    )
}

/// The evidence behind the verdict.
fn evidence(diagnosis: &Diagnosis) -> String {
    format!(
        "{} Nats are natural logarithms of odds: above 0, something is missing.",
        evidence_sentence(diagnosis)
    )
}

/// Measured and twin.
fn runs(study: &Study, diagnosis: &Diagnosis) -> Section {
    let marked = if diagnosis.location.maps.notable().windows.is_empty() {
        ""
    } else {
        " The strip below the axis marks windows that stand out from white noise, with their shares of the gap."
    };
    let caption = format!(
        "The twin runs from the inputs alone, without noise. Its parameters are fitted to this record.{marked}"
    );
    let mut body = String::new();
    if let Some(svg) = pictures::runs(study, diagnosis, false) {
        body.push_str(&figure(&svg, &caption));
    }
    if let Some(svg) = pictures::runs(study, diagnosis, true) {
        body.push_str(&figure(
            &svg,
            "The validation record; no parameter is fitted to it.",
        ));
    }
    Section::new("runs", "Measured against twin", body)
}

#[cfg(test)]
mod tests;
