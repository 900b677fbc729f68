//! A diagnosis as one page that needs nothing else.

mod discovery;
mod explanations;
mod extent;
mod limits;
mod numbers;
mod place;
mod steps;

use super::digits::probability;
use super::gap_figures::gap_runs_svg;
use super::gap_text::verdict_sentence;
use super::page::{Section, escaped, figure, page, paragraph};
use super::units::Units;
use crate::diagnose::{Diagnosis, Verdict};
use crate::study::Study;

/// The diagnosis as a self-contained page, readable on a phone and in print: the verdict, measured and twin before and after,
/// where, which, how far, what to do next, how sure and what was not tested, parameters.
///
/// Pictures are SVG inside the page, with words for those who cannot see them; nothing is told by colour alone. There are no
/// scripts, and nothing is loaded from elsewhere.
pub fn gap_html(study: &Study, found: &Diagnosis) -> String {
    let units = Units::of(study);
    let verdict = escaped(&verdict_sentence(found));
    let lead = format!(
        "<p class=\"verdict\">{verdict}</p>\n{}",
        paragraph(&test(found))
    );
    let mut sections = vec![runs(study, found), place::section_of(study, found)];
    sections.push(explanations::section_of(&units, found));
    sections.extend(discovery::section_of(study, found));
    sections.extend([
        extent::section_of(found),
        steps::section_of(study, &units, found),
        limits::section_of(&units, found),
    ]);
    // Where nothing else is to be said, the parameters are the answer.
    let parameters = match found.verdict {
        Verdict::StructuralGap => sections.len(),
        _ => 1,
    };
    sections.insert(parameters, numbers::section_of(&units, found));
    page(
        &format!("{}: what the twin lacks", found.twin),
        &lead,
        &sections,
    )
}

/// The test behind the verdict.
fn test(found: &Diagnosis) -> String {
    let d = &found.detection;
    let validation = match d.log_e {
        Some(log_e) => format!(
            ", from simulations and from the validation record together (log E {})",
            super::digits::short(log_e)
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
fn runs(study: &Study, found: &Diagnosis) -> Section {
    let marked = match found.place.maps.notable().windows.is_empty() {
        true => String::new(),
        false => format!(
            " The strip below the axis marks windows in which the twin does not follow, with their shares of the gap: unbroken \
             frame and bold text p < {}, dashed frame p ≤ 0.1.",
            found.detection.alpha
        ),
    };
    let caption = format!(
        "The twin sees the inputs of the record alone and runs without noise. Its parameters are fitted to this record.{marked}"
    );
    let mut body = String::new();
    if let Some(svg) = gap_runs_svg(study, found, false) {
        body.push_str(&figure(&svg, &caption));
    }
    if let Some(svg) = gap_runs_svg(study, found, true) {
        body.push_str(&figure(
            &svg,
            "The same on the validation record; no parameter is fitted to it.",
        ));
    }
    Section::new("runs", "Measured against twin", body)
}

#[cfg(test)]
mod tests;
