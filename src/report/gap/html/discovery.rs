//! Section on terms of the missing function: exploratory, no test.

use crate::diagnose::Diagnosis;
use crate::report::digits::percent;
use crate::report::gap::pictures;
use crate::report::page::{Section, figure, paragraph};
use crate::report::units::Units;
use crate::study::Study;

/// `None` where nothing was explored.
pub(super) fn section_of(study: &Study, diagnosis: &Diagnosis) -> Option<Section> {
    let d = diagnosis.discovery.as_ref()?;
    let mut body = paragraph(&format!(
        "Exploratory, not a test: simple terms are fitted to the missing function of {} at the {}. They explain {} of its variance. \
         They are hints, not findings.",
        d.variable,
        Units::of(study).place_name(&d.equation),
        percent(d.explained)
    ));
    match pictures::terms(study, diagnosis) {
        Some(svg) => body.push_str(&figure(
            &svg,
            "Share of draws of the function that include a term, and its factor. A term that is nearly always included, with an \
             interval away from zero, is worth trying as your own effect.",
        )),
        None => body.push_str(&paragraph("No term is included.")),
    }
    Some(Section::new(
        "discovery",
        "Candidates for the missing law",
        body,
    ))
}
