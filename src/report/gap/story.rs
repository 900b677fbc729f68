//! The answer in a few sentences: which effect, how sure, how far, what next.

use super::headline::{SAID, accepted_ids, headline, naming};
use super::json::NEXT_INPUT;
use super::share::share_with_interval;
use super::step::step_setting;
use crate::diagnose::{Decision, Diagnosis, EffectFit, Verdict};
use crate::report::digits::{chance, percent, short, unit_suffix};
use crate::report::units::Units;

/// Words of the story: with the heading and the caption of the first picture there are at most 60 on the first screen.
const WORDS: usize = 44;

/// Headline and further sentences, at most [`WORDS`] words together.
pub(super) fn story(units: &Units, diagnosis: &Diagnosis) -> (String, Vec<String>) {
    let headline = headline(units, diagnosis);
    let mut rest: Vec<String> = how_sure(diagnosis).into_iter().collect();
    rest.extend(how_far(diagnosis));
    rest.push(next(diagnosis));
    let mut left = WORDS.saturating_sub(words(&headline) + words(&rest.join(" ")));
    let mut sentences = effects(units, diagnosis);
    sentences.retain(|sentence| {
        let count = words(sentence);
        let has_room = count <= left;
        left -= if has_room { count } else { 0 };
        has_room
    });
    sentences.append(&mut rest);
    (headline, sentences)
}

/// Number of words; signs such as % are none.
fn words(text: &str) -> usize {
    let is_word = |word: &&str| word.contains(char::is_alphanumeric);
    text.split_whitespace().filter(is_word).count()
}

/// Sentences of the accepted effects that are more probable than not; none of a class, which is not told as a fact.
pub(super) fn effects(units: &Units, diagnosis: &Diagnosis) -> Vec<String> {
    let cause = &diagnosis.cause;
    if cause.decision == Decision::Class {
        return vec![];
    }
    let told = (cause.effects.iter())
        .filter(|effect| cause.accepted.contains(&effect.key()) && effect.probability >= SAID);
    told.filter_map(|effect| sentence(units, effect)).collect()
}

/// The sentence of an effect, filled in; of an effect without one, its name, its place and its magnitudes.
pub(super) fn sentence(units: &Units, fit: &EffectFit) -> Option<String> {
    let effect = units.effect(&fit.id, &fit.target)?;
    let Some(template) = effect.sentence() else {
        let named = super::words::effect(units, &fit.key());
        return Some(match units.magnitudes(fit).as_str() {
            "" => capitalised(&format!("{named} is missing.")),
            values => capitalised(&format!("{named} is missing: {values}.")),
        });
    };
    let mut text = template.to_owned();
    let other = effect.other().map(|other| units.in_words(other));
    let mut filled = vec![
        ("{place}".to_owned(), units.in_words(&fit.target)),
        (
            "{other}".to_owned(),
            other.unwrap_or_else(|| "nothing".into()),
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
    // A sentence begins with a large letter, but a state keeps its name.
    Some(match text.starts_with("the ") {
        true => capitalised(&text),
        false => text,
    })
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next();
    let first = first.map_or_else(String::new, |c| c.to_uppercase().collect());
    first + letters.as_str()
}

/// The probability of the answer; none where the headline has it.
fn how_sure(diagnosis: &Diagnosis) -> Option<String> {
    let cause = &diagnosis.cause;
    let kinds = &cause.probabilities;
    if diagnosis.verdict == Verdict::NoGap {
        return Some(format!("Probability: {}.", chance(kinds.nothing)));
    }
    let p = match cause.decision {
        Decision::Named | Decision::Partial if naming(cause).is_complete => (cause.effects.iter())
            .filter(|effect| cause.accepted.contains(&effect.key()))
            .map(|effect| effect.probability)
            .fold(1.0, f64::min),
        Decision::Class => kinds.listed,
        // Something unknown, alone or beside a listed effect.
        Decision::NoneOfThese => kinds.unknown + kinds.partial,
        _ => return None,
    };
    Some(format!("Probability: {}.", chance(p)))
}

/// The share of the gap that closes.
fn how_far(diagnosis: &Diagnosis) -> Option<String> {
    let s = diagnosis.shrinkage.as_ref()?;
    if s.hidden_by_noise().is_some() {
        return Some("Noise hides how much of the gap closes.".to_owned());
    }
    let share = share_with_interval(s, " of the gap")?;
    Some(match s.horizon {
        Some(seconds) => format!("Predictions {} s ahead: {share} closes.", short(seconds)),
        None => format!("Predictions from the start on: {share} closes."),
    })
}

/// Advice on what to do.
pub(super) fn next(diagnosis: &Diagnosis) -> String {
    if let Some(setting) = step_setting(diagnosis)
        && diagnosis.verdict != Verdict::StructuralGap
    {
        return format!("Next: set {setting}; the twin's own step is too long.");
    }
    let cause = &diagnosis.cause;
    let add = |then: &str| format!("Next: add {} to the study and {then}.", accepted_ids(cause));
    let next = match (diagnosis.verdict, cause.decision) {
        (Verdict::NoGap, _) => "Next: use the twin, within the range of this record.",
        (Verdict::ParameterGap, _) => "Next: widen [prior] to these parameters.",
        (_, Decision::Named) if naming(cause).is_complete => return add("fit again"),
        (_, Decision::Partial) if naming(cause).is_complete => return add("diagnose again"),
        (_, Decision::Class) if cause.next_input.is_some() => {
            const { assert!(NEXT_INPUT.len() == 14) };
            "Next: measure next-input.csv to tell them apart."
        }
        (_, Decision::Class | Decision::Named | Decision::Partial) => {
            "Next: another record, with other inputs, may tell them apart."
        }
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
            assert!(super::words(&words) <= WORDS, "{words}");
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
            also: vec![],
        };
        let told = sentence(&Units::of(&study), &fit).unwrap();
        assert_eq!(
            told,
            "The upper tank (h1) stops rising at 9.90 V; 40 % of what spills reaches the lower tank (h2)."
        );
    }
    /// An effect of a study's own has no sentence: its name, place and magnitudes make one.
    #[test]
    fn an_own_effect_is_told_in_words() {
        use crate::effect::{EffectKind, Magnitude};
        let kind = EffectKind::force("magnet", "strength", |m, at| m[0] * at.x)
            .magnitude(Magnitude::signed("pull", "state/s", &[1.0]));
        let study = oscillator().with_effects([kind]);
        let fit = EffectFit {
            id: "magnet".into(),
            target: "x1".into(),
            probability: 0.98,
            magnitudes: vec![("pull".into(), 0.5)],
            log_evidence: 60.0,
            also: vec![],
        };
        let told = sentence(&Units::of(&study), &fit).unwrap();
        assert_eq!(told, "A magnet at x1 is missing: pull 0.500 1/s.");
    }
}
