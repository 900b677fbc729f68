//! How sure the answer is, and what it does not cover.

use crate::diagnose::{Diagnosis, Visible};
use crate::report::digits::{percent, probability, short, unit_suffix};
use crate::report::page::Column::{Number, Text};
use crate::report::page::{Section, folded, list, paragraph, table};
use crate::report::units::Units;

pub(super) fn section_of(units: &Units, diagnosis: &Diagnosis) -> Section {
    let body = [
        list(&sure(diagnosis)),
        list(&untested(diagnosis)),
        power(units, diagnosis),
    ]
    .concat();
    Section::new("limits", "How sure, and what was not tested", body)
}

/// What the numbers rest on.
fn sure(diagnosis: &Diagnosis) -> Vec<String> {
    let d = &diagnosis.detection;
    let mut items = vec![format!(
        "The test simulates records of the refitted twin, treats each as it treats the measured one, and ranks the measured one \
         among them ({}). It calls a right twin wrong in about {} of records.",
        probability(d.rank_p_value),
        percent(d.alpha)
    )];
    items.push(match d.log_e {
        Some(log_e) => format!(
            "The validation record, fitted by nobody, speaks for itself: log E {}; above {} it would be enough alone.",
            short(log_e),
            short((2.0 / d.alpha).ln())
        ),
        None => "No validation record was given: an explanation that fits this record by luck is not caught.".into(),
    });
    if !diagnosis.cause.effects.is_empty() {
        items.push(
            "Probabilities of effects compare what was looked at, 5 % kept for a law that is not listed and that one of these \
             imitates; sealed trials say how often they are right (docs/diagnosing-a-gap.md). p-values of effects are corrected for \
             all candidates."
                .into(),
        );
    }
    items
}

/// What was left out.
fn untested(diagnosis: &Diagnosis) -> Vec<String> {
    let mut items = vec![format!(
        "{} explanations were looked at, and up to three effects together, each beside the best; no law outside the list but \
         disturbances.",
        diagnosis.candidates
    )];
    if !diagnosis.not_tested.is_empty() {
        items.push(format!(
            "Not tested, left out by the call, by the study, or because no filter models them: {}.",
            diagnosis.not_tested.join(", ")
        ));
    }
    items
}

/// What would have been seen.
fn power(units: &Units, diagnosis: &Diagnosis) -> String {
    if diagnosis.power.is_empty() {
        return String::new();
    }
    let hidden = diagnosis.power.iter().filter(|v| v.value.is_none()).count();
    let lead = match hidden {
        0 => "Every listed effect would have been seen, had it been large enough.".into(),
        n => format!(
            "{n} of {} listed effects could not have been seen in such a record, however large within reach.",
            diagnosis.power.len()
        ),
    };
    let rows: Vec<Vec<String>> = diagnosis.power.iter().map(|v| row(units, v)).collect();
    let head = [
        ("effect", Text),
        ("magnitude", Text),
        ("smallest seen", Number),
    ];
    let numbers = table(
        "The smallest magnitude that 80 of 100 such records reveal. Smaller ones may be there and go unseen.",
        &head,
        &rows,
    );
    [
        paragraph(&lead),
        folded("What this record could have revealed", &numbers),
    ]
    .concat()
}

fn row(units: &Units, visible: &Visible) -> Vec<String> {
    let unit =
        (units.of_magnitude(&visible.id, &visible.target, &visible.magnitude)).unwrap_or_default();
    vec![
        format!("{}@{}", visible.id, visible.target),
        visible.magnitude.clone(),
        match visible.value {
            Some(value) => format!("{}{}", short(value), unit_suffix(&unit)),
            None => "none in reach".into(),
        },
    ]
}
