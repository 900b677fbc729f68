//! Section on evidence and limits of the answer.

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

/// Returns the evidence.
fn sure(diagnosis: &Diagnosis) -> Vec<String> {
    let d = &diagnosis.detection;
    let mut items = vec![format!(
        "The test simulates records of the refitted twin, analyses them like the measured record, and ranks the measured record \
         among them ({}). False-alarm rate about {}.",
        probability(d.rank_p_value),
        percent(d.alpha)
    )];
    items.push(match d.log_e {
        Some(log_e) => format!(
            "Evidence from the validation record alone: log E {}; above {} it suffices without the rank.",
            short(log_e),
            short((2.0 / d.alpha).ln())
        ),
        None => "No validation record was given: an explanation that fits this record by chance is not detected.".into(),
    });
    if !diagnosis.cause.effects.is_empty() {
        items.push(
            "Probabilities compare the effects that were tested; 5 % are reserved for unlisted laws that a listed effect imitates. \
             Sealed trials measure how often they are right (docs/diagnosing-a-gap.md). p-values of effects are corrected for all \
             candidates."
                .into(),
        );
    }
    items
}

/// Returns the effects that were not tested.
fn untested(diagnosis: &Diagnosis) -> Vec<String> {
    let mut items = vec![format!(
        "{} explanations were tested, and combinations of up to three effects; laws outside the list only as disturbances.",
        diagnosis.candidates
    )];
    if !diagnosis.not_tested.is_empty() {
        items.push(format!(
            "Not tested (excluded by the call or the study, or without a filter model): {}.",
            diagnosis.not_tested.join(", ")
        ));
    }
    items
}

/// Returns the smallest detectable magnitudes.
fn power(units: &Units, diagnosis: &Diagnosis) -> String {
    if diagnosis.power.is_empty() {
        return String::new();
    }
    let hidden = diagnosis.power.iter().filter(|v| v.value.is_none()).count();
    let lead = match hidden {
        0 => "Every listed effect is detectable in this record if it is large enough.".into(),
        n => format!(
            "{n} of {} listed effects are not detectable in this record at any plausible size.",
            diagnosis.power.len()
        ),
    };
    let rows: Vec<Vec<String>> = diagnosis.power.iter().map(|v| row(units, v)).collect();
    let head = [
        ("effect", Text),
        ("magnitude", Text),
        ("smallest detectable", Number),
    ];
    let numbers = table(
        "The smallest magnitude that the test detects in 80 of 100 such records; smaller ones may be present.",
        &head,
        &rows,
    );
    [paragraph(&lead), folded("Detectable magnitudes", &numbers)].concat()
}

fn row(units: &Units, visible: &Visible) -> Vec<String> {
    let unit =
        (units.of_magnitude(&visible.id, &visible.target, &visible.magnitude)).unwrap_or_default();
    vec![
        crate::effect::EffectKey::new(&visible.id, &visible.target).to_string(),
        visible.magnitude.clone(),
        match visible.value {
            Some(value) => format!("{}{}", short(value), unit_suffix(&unit)),
            None => "not detectable".into(),
        },
    ]
}
