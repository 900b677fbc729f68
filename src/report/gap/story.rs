//! The answer in a few sentences: which effect, how sure, how far, what next.

use super::headline::{SAID, headline};
use super::json::NEXT_INPUT;
use super::share::share_with_interval;
use super::step::step_setting;
use crate::diagnose::{Decision, Diagnosis, EffectFit, Verdict};
use crate::report::digits::{chance, percent, short, unit_suffix};
use crate::report::units::Units;

/// Effects that are told of.
const TOLD: usize = 2;

/// Headline and further sentences, at most 60 words together.
pub(super) fn story(units: &Units, diagnosis: &Diagnosis) -> (String, Vec<String>) {
    let mut sentences = effects(units, diagnosis);
    sentences.extend(how_sure(diagnosis));
    sentences.extend(how_far(diagnosis));
    sentences.push(next(diagnosis));
    (headline(diagnosis), sentences)
}

/// Sentences of the accepted effects.
pub(super) fn effects(units: &Units, diagnosis: &Diagnosis) -> Vec<String> {
    let cause = &diagnosis.cause;
    let accepted = cause
        .effects
        .iter()
        .filter(|effect| cause.accepted.contains(&effect.key()) && (effect.probability >= SAID));
    accepted
        .take(TOLD)
        .filter_map(|effect| sentence(units, effect))
        .collect()
}

/// The sentence of an effect, filled in.
pub(super) fn sentence(units: &Units, fit: &EffectFit) -> Option<String> {
    let effect = units.effect(&fit.id, &fit.target)?;
    let mut text = effect.sentence()?.to_owned();
    let place = match units.signal(&fit.target) {
        Some(("output", signal)) => format!("the sensor of {}", signal.name),
        Some((_, signal)) => format!("the actuator of {}", signal.name),
        None => fit.target.clone(),
    };
    let mut filled = vec![
        ("{place}".to_owned(), place),
        (
            "{other}".to_owned(),
            effect.other().unwrap_or("nothing").to_owned(),
        ),
    ];
    for (name, value) in &fit.magnitudes {
        let unit = units
            .of_magnitude(&fit.id, &fit.target, name)
            .unwrap_or_default();
        let written = match value.is_finite() {
            true => format!("{}{}", short(*value), unit_suffix(&unit)),
            false => "any value".to_owned(),
        };
        filled.push((format!("{{{name}}}"), written));
        filled.push((format!("{{%{name}}}"), percent(*value)));
    }
    for (name, value) in filled {
        text = text.replace(&name, &value);
    }
    let mut letters = text.chars();
    let first = letters.next()?;
    // A sentence begins with a large letter, but a state keeps its name.
    Some(match text.starts_with("the ") {
        true => format!("{}{}", first.to_uppercase(), letters.as_str()),
        false => text,
    })
}

/// The probability of the answer.
fn how_sure(diagnosis: &Diagnosis) -> Option<String> {
    let cause = &diagnosis.cause;
    let kinds = &cause.probabilities;
    if diagnosis.verdict == Verdict::NoGap {
        return Some(format!("Probability: {}.", chance(kinds.nothing)));
    }
    let p = match cause.decision {
        Decision::Named | Decision::Partial => (cause.effects.iter())
            .filter(|effect| cause.accepted.contains(&effect.key()))
            .map(|effect| effect.probability)
            .fold(1.0, f64::min),
        Decision::Class => kinds.listed,
        Decision::NoneOfThese => kinds.unknown,
        Decision::Absorbed | Decision::NotNeeded => return None,
    };
    Some(format!("Probability: {}.", chance(p)))
}

/// The share of the gap that closes.
fn how_far(diagnosis: &Diagnosis) -> Option<String> {
    let s = diagnosis.shrinkage.as_ref()?;
    if s.hidden_by_noise().is_some() {
        return Some("Noise hides how much of the gap closes.".to_owned());
    }
    let ahead = match s.horizon {
        Some(seconds) => format!("{} s ahead", short(seconds)),
        None => "of the free run".to_owned(),
    };
    Some(share_with_interval(s, &format!(" of the gap {ahead} closes"))? + ".")
}

/// Advice on what to do.
pub(super) fn next(diagnosis: &Diagnosis) -> String {
    if let Some(setting) = step_setting(diagnosis)
        && diagnosis.verdict != Verdict::StructuralGap
    {
        return format!("Next: set {setting}; the twin's own step is too long.");
    }
    let next = match (diagnosis.verdict, diagnosis.cause.decision) {
        (Verdict::NoGap, _) => "Next: use the twin, within the range of this record.",
        (Verdict::ParameterGap, _) => "Next: widen [prior] to these parameters.",
        (_, Decision::Named) => "Next: add it to the study and fit again.",
        (_, Decision::Partial) => "Next: add it to the study and diagnose again.",
        (_, Decision::Class) if diagnosis.cause.next_input.is_some() => {
            const { assert!(NEXT_INPUT.len() == 14) };
            "Next: measure next-input.csv, which can tell them apart."
        }
        (_, Decision::Class) => "Next: another record, with other inputs, may tell them apart.",
        _ => "Next: look at the system there, with the missing function in mind.",
    };
    next.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{diagnoses, made, oscillator};
    use crate::twin::Integrator;
    use crate::twins::CascadedTanks;

    #[test]
    fn the_first_screen_is_short() {
        let by_hand = [
            made::tanks_class(),
            made::oscillator_none(),
            made::rig_pair(),
        ];
        let units = Units::of(&oscillator());
        for diagnosis in diagnoses().iter().chain(&by_hand) {
            let (headline, sentences) = story(&units, diagnosis);
            let words = format!("{headline} {}", sentences.join(" "));
            assert!(words.split_whitespace().count() <= 60, "{words}");
            assert!(headline.chars().count() <= 140, "{headline}");
            assert!(!words.contains('{'), "{words}");
        }
    }

    #[test]
    fn a_step_that_is_too_long_comes_first() {
        let diagnosis = Diagnosis {
            integrator: Some(Integrator::RungeKutta4),
            substeps: Some(4),
            ..made::oscillator_no_gap()
        };
        let (_, sentences) = story(&Units::of(&oscillator()), &diagnosis);
        let last = sentences.last().unwrap();
        assert!(
            last.contains("set [record] integrator = \"runge-kutta-4\", substeps = 4;"),
            "{last}"
        );
    }

    #[test]
    fn a_ceiling_is_told_in_words() {
        use crate::study::{RecordPlan, Study};
        let plan = RecordPlan::levels(0.5, 100, 0.5, 3.0, 30);
        let study = Study::new("tanks", CascadedTanks, plan).unwrap();
        let fit = EffectFit {
            id: "state-ceiling".into(),
            target: "h1".into(),
            probability: 0.98,
            magnitudes: vec![("level".into(), 9.9), ("spill".into(), 0.4)],
            log_evidence: 60.0,
        };
        let told = sentence(&Units::of(&study), &fit).unwrap();
        assert_eq!(
            told,
            "h1 stops rising at 9.90 V; 40 % of what spills reaches h2."
        );
    }
}
