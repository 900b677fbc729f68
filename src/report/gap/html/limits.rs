//! Section on evidence and limits of the answer.

use crate::diagnose::{Diagnosis, Maps, Visible};
use crate::report::digits::{short, unit_suffix};
use crate::report::gap::text::{calibration, quick_sentence, step_sentence};
use crate::report::gap::words::few;
use crate::report::page::Column::{Number, Text};
use crate::report::page::{Section, folded, list, paragraph, table};
use crate::report::units::Units;

pub(super) fn section_of(units: &Units, diagnosis: &Diagnosis) -> Section {
    let body = [
        warnings(diagnosis),
        list(&sure(diagnosis)),
        list(&untested(diagnosis)),
        all_untested(diagnosis),
        power(units, diagnosis),
    ]
    .concat();
    Section::new("limits", "How sure, and what was not tested", body)
}

/// Returns the meaning of the evidence.
fn sure(diagnosis: &Diagnosis) -> Vec<String> {
    let mut items = vec![
        "Evidence: log odds that something is missing against that nothing is, prior odds even. The likelihood is averaged over \
         parameters, noise levels and magnitudes."
            .to_owned(),
    ];
    items.push(match calibration(&diagnosis.detection) {
        Some(p) => format!(
            "Calibration: the share of records simulated by the fitted twin with as much evidence is {p}."
        ),
        None => "The evidence was not calibrated on simulated records; --calibrate does that.".into(),
    });
    items.extend(step_sentence(diagnosis));
    items.extend(quick_sentence(diagnosis));
    if !diagnosis.cause.effects.is_empty() {
        items.push(
            "Probabilities hold for the explanations that were tested; unknown functions stand for laws outside the list. Sealed \
             trials measure how often they are right (docs/withheld.md)."
                .into(),
        );
    }
    if diagnosis.location.maps != Maps::default() {
        items.push(
            "Windows, ranges, lags and bands describe the residuals; they test nothing.".into(),
        );
    }
    items
}

/// Returns the effects that were not tested.
fn untested(diagnosis: &Diagnosis) -> Vec<String> {
    let mut items = vec![format!(
        "{} explanations were tested: listed effects and unknown functions; then combinations of the best.",
        diagnosis.candidates
    )];
    if !diagnosis.not_tested.is_empty() {
        items.push(format!(
            "Not tested (excluded by the call or the study, or without a filter model): {}.",
            few(&diagnosis.not_tested)
        ));
    }
    items
}

/// Returns all effects that were not tested, where a sentence has no room for them.
fn all_untested(diagnosis: &Diagnosis) -> String {
    match few(&diagnosis.not_tested) == diagnosis.not_tested.join(", ") {
        true => String::new(),
        false => folded("All effects not tested", &list(&diagnosis.not_tested)),
    }
}

/// Returns everything that makes the result doubtful.
fn warnings(diagnosis: &Diagnosis) -> String {
    let all: Vec<String> = (diagnosis.warnings.iter())
        .map(|warning| format!("Warning: {}; {}.", warning.what, warning.remedy))
        .collect();
    match all.is_empty() {
        true => String::new(),
        false => list(&all),
    }
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
        "The smallest magnitude that is detected in 80 of 100 such records; smaller ones may be present.",
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
