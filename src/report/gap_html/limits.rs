//! What the answer does not cover.

use super::page::{list, section};
use crate::diagnose::Diagnosis;

pub(super) fn section_of(found: &Diagnosis) -> String {
    let mut items = vec![format!(
        "{} explanations were looked at, and pairs of the best of them; not three effects at once, and no law outside the list \
         but disturbances.",
        found.candidates
    )];
    if !found.not_tested.is_empty() {
        items.push(format!(
            "Left out by the call, by the study, or because no filter models them: {}.",
            found.not_tested.join(", ")
        ));
    }
    if found.validation_runs.is_none() {
        items.push("No validation record was given: an explanation that fits this record by luck is not caught.".into());
    }
    section("limits", "What was not tested", &list(&items))
}
