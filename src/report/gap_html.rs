//! A diagnosis as one page that needs nothing else.

mod explanations;
mod extent;
mod limits;
mod numbers;
mod page;
mod place;
mod steps;

use super::digits::probability;
use super::gap_figures::gap_runs_svg;
use super::gap_text::verdict_sentence;
use super::units::Units;
use crate::diagnose::Diagnosis;
use crate::study::Study;
use page::{escaped, figure, paragraph, section};

/// The diagnosis as a self-contained page, readable on a phone and in print: the verdict, measured and twin before and after,
/// where, which, how far, parameters, what was not tested, what to do next.
///
/// Pictures are SVG inside the page, with words for those who cannot see them; nothing is told by colour alone. There are no
/// scripts, and nothing is loaded from elsewhere.
pub fn gap_html(study: &Study, found: &Diagnosis) -> String {
    let units = Units::of(study);
    let verdict = escaped(&verdict_sentence(found));
    let body = [
        format!("<p class=\"verdict\">{verdict}</p>\n"),
        paragraph(&test(found)),
        runs(study, found),
        place::section_of(study, found),
        explanations::section_of(&units, found),
        extent::section_of(found),
        numbers::section_of(&units, found),
        limits::section_of(found),
        steps::section_of(&units, found),
    ];
    page::page(
        &format!("{}: what the twin lacks", found.twin),
        &body.concat(),
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
fn runs(study: &Study, found: &Diagnosis) -> String {
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
    section("runs", "Measured and twin", &body)
}

#[cfg(test)]
mod tests;
