//! Section on the missing term: exploratory, no test.

use crate::diagnose::Diagnosis;
use crate::report::digits::percent;
use crate::report::gap::pictures;
use crate::report::page::{Section, figure, paragraph};
use crate::report::units::Units;
use crate::study::Study;

/// `None` where nothing was explored.
pub(super) fn section_of(study: &Study, diagnosis: &Diagnosis) -> Option<Section> {
    let d = diagnosis.discovery.as_ref()?;
    let equation = Units::of(study).equation_name(&d.equation);
    let mut body = paragraph(&format!(
        "Exploratory, not a test: no listed effect is accepted, so the missing term of the {equation} is smoothed from the record \
         and regressed on states and inputs. The terms below explain {} of its variance. They are hints, not findings.",
        percent(d.explained)
    ));
    match pictures::terms(study, diagnosis) {
        Some(svg) => body.push_str(&figure(
            &svg,
            "Share of resampled records whose regression includes a term, and its factor. A term that is nearly always included, with \
             an interval away from zero, is worth trying as your own effect.",
        )),
        None => body.push_str(&paragraph("No term is included.")),
    }
    if let Some(svg) = pictures::missing(study, diagnosis) {
        body.push_str(&figure(
            &svg,
            "Where the regression leaves the band, the terms do not suffice.",
        ));
    }
    Some(Section::new(
        "discovery",
        "Candidates for the missing law",
        body,
    ))
}
