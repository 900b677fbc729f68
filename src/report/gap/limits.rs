//! Section on evidence and limits of the answer.

use super::cause::calibration;
use super::check::{outcome, table};
use super::statement::{capitalised, other_step};
use super::words::few;
use crate::diagnose::{Diagnosis, Maps, Visible};
use crate::effect::EffectKey;
use crate::report::digits::{short, with_unit};
use crate::report::document::Column::{Number, Text};
use crate::report::document::{Block, Section};
use crate::report::units::Units;

pub(super) fn section(units: &Units, diagnosis: &Diagnosis) -> Section {
    let mut brief = vec![];
    brief.extend(other_step(diagnosis).map(|[step, wrong]| {
        let text = format!("{wrong}; the diagnosis used {step}.");
        Block::Paragraph(capitalised(&text))
    }));
    brief.extend(match (diagnosis.interrupted, diagnosis.quick) {
        (true, _) => Some(
            "Interrupted before the search ended. Pairs, other noise or a finer step may not have been tried.",
        ),
        (false, true) => Some(
            "A quick look: effects one at a time, each from few starts. A whole diagnosis searches pairs, and its names are surer.",
        ),
        (false, false) => None,
    }
    .map(Block::paragraph));
    brief.push(Block::Paragraph(format!(
        "{} explanations, {} s.",
        diagnosis.candidates,
        short(diagnosis.seconds)
    )));
    let mut rest = vec![Block::List(items(diagnosis))];
    if few(&diagnosis.not_tested) != diagnosis.not_tested.join(", ") {
        let all = Block::List(diagnosis.not_tested.clone());
        rest.push(Block::folded("All effects not tested", vec![all]));
    }
    rest.extend(diagnosis.check.as_ref().map(table));
    rest.extend(power(units, &diagnosis.power));
    Section::new("limits", "How sure, and what was not tested", rest).brief(brief)
}

/// The meaning of evidence and probabilities, and what was not tested.
fn items(diagnosis: &Diagnosis) -> Vec<String> {
    let mut items = vec![
        "Evidence: log odds, in nats, that something is missing against that nothing is, prior odds even. The likelihood is averaged over \
         parameters, noise levels and magnitudes."
            .to_owned(),
        "Probabilities take prior odds of 1 to 20 for a gap: a gap is called where it is then more probable than none. They hold for the \
         explanations that were tested; unknown functions stand for laws outside the list. Sealed trials measure how often they are right \
         (docs/withheld.md)."
            .to_owned(),
        match calibration(&diagnosis.detection) {
            Some(p) => format!(
                "Calibration: the share of records simulated by the fitted twin with as much evidence is {p}."
            ),
            None => "The evidence was not calibrated on simulated records.".into(),
        },
    ];
    items.extend(outcome(diagnosis));
    if diagnosis.location.maps != Maps::default() {
        items.push(
            "Windows, ranges, lags and bands describe the residuals; they test nothing.".into(),
        );
    }
    if !diagnosis.not_tested.is_empty() {
        items.push(format!(
            "Not tested (excluded by the call or the study, or without a filter model): {}.",
            few(&diagnosis.not_tested)
        ));
    }
    items
}

/// The smallest detectable magnitudes.
fn power(units: &Units, all: &[Visible]) -> Vec<Block> {
    if all.is_empty() {
        return vec![];
    }
    let lead = match all.iter().filter(|v| v.value.is_none()).count() {
        0 => "Every listed effect is detectable in this record if it is large enough.".into(),
        n => format!(
            "{n} of {} listed effects are not detectable in this record at any plausible size.",
            all.len()
        ),
    };
    let row = |v: &Visible| {
        let unit = units
            .of_magnitude(&v.id, &v.target, &v.magnitude)
            .unwrap_or_default();
        let value = v.value.map(|value| with_unit(value, &unit));
        vec![
            EffectKey::new(&v.id, &v.target).to_string(),
            v.magnitude.clone(),
            value.unwrap_or_else(|| "not detectable".into()),
        ]
    };
    let head = [
        ("effect", Text),
        ("magnitude", Text),
        ("smallest detectable", Number),
    ];
    let caption = "The smallest magnitude that is detected in 80 of 100 such records; smaller ones may be present.";
    let table = Block::table(caption, &head, all.iter().map(row).collect());
    vec![
        Block::Paragraph(lead),
        Block::folded("Detectable magnitudes", vec![table]),
    ]
}
