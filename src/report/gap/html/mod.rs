//! The page of a diagnosis.

mod discovery;
mod explanations;
mod extent;
mod limits;
mod numbers;
mod place;
mod steps;

use crate::diagnose::{Diagnosis, Verdict};
use crate::report::digits::{probability, short};
use crate::report::gap::pictures;
use crate::report::gap::text::verdict_sentence;
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
        paragraph(&test(diagnosis))
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

/// The test behind the verdict.
fn test(diagnosis: &Diagnosis) -> String {
    let d = &diagnosis.detection;
    let validation = match d.log_e {
        Some(log_e) => format!(
            ", from simulations and from the validation record together (log E {})",
            short(log_e)
        ),
        None => ", from simulations".into(),
    };
    format!(
        "Structural test of the twin with its parameters refitted: {} at level {}{validation}.",
        probability(d.p_value),
        d.alpha
    )
}

/// Measured and twin.
fn runs(study: &Study, diagnosis: &Diagnosis) -> Section {
    let marked = if diagnosis.location.maps.notable().windows.is_empty() {
        String::new()
    } else {
        format!(
            " The strip below the axis marks windows where the twin deviates, with their shares of the gap: unbroken \
             frame and bold text p < {}, dashed frame p ≤ 0.1.",
            diagnosis.detection.alpha
        )
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
