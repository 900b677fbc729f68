//! What the missing term may be: exploratory, no test.

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
        "Exploratory, not a test: no listed effect is accepted, so what the {equation} lacks is smoothed from the record and \
         regressed on states and inputs. The terms below explain {} of its variance. They say where to look, not what is true.",
        percent(d.explained)
    ));
    match pictures::terms(study, diagnosis) {
        Some(svg) => body.push_str(&figure(
            &svg,
            "In how many resampled records the regression includes a term, and its factor there. A term that is nearly always in, \
             with an interval away from zero, is worth writing down as an effect of your own.",
        )),
        None => body.push_str(&paragraph("No term is included.")),
    }
    if let Some(svg) = pictures::missing(study, diagnosis) {
        body.push_str(&figure(
            &svg,
            "Where the regression leaves the band, the terms do not say enough.",
        ));
    }
    Some(Section::new(
        "discovery",
        "What the missing law may be",
        body,
    ))
}
