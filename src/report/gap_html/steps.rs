//! What to do next.

use super::page::{list, paragraph, preformatted, section};
use crate::diagnose::{Decision, Diagnosis, EffectFit, Verdict};
use crate::math::six_digits;
use crate::report::digits::short;
use crate::report::units::Units;
use crate::twin::Law;

pub(super) fn section_of(units: &Units, found: &Diagnosis) -> String {
    let mut body = list(&steps(found));
    let accepted = &found.which.accepted;
    if !accepted.is_empty() {
        let tables: Vec<String> = (found.which.effects.iter())
            .filter(|e| accepted.contains(&e.key()))
            .filter_map(|e| study_table(units, e))
            .collect();
        body.push_str(&paragraph(
            "For the study file; without magnitudes, they are estimated:",
        ));
        body.push_str(&preformatted(&tables.join("\n")));
    }
    section("next", "What to do next", &body)
}

fn steps(found: &Diagnosis) -> Vec<String> {
    let which = &found.which;
    let mut steps = Vec::new();
    match (found.verdict, which.decision) {
        (Verdict::NoGap, _) => steps.push("Use the twin with the refitted parameters.".into()),
        (Verdict::ParameterGap, Decision::Absorbed) => steps.push(format!(
            "Take the refitted parameters, or give a record with another input: it may tell them from {}.",
            which.class.join(", ")
        )),
        (Verdict::ParameterGap, _) => steps.push(
            "Take the refitted parameters, if they make sense; widen the prior in the study then, and pretrain again.".into(),
        ),
        (_, Decision::Named) => {
            steps.push(format!("Add {} to the twin.", which.accepted.join(" and ")));
        }
        (_, Decision::Class) => steps.push(format!(
            "Tell the rivals apart ({}): give a validation record, or a record whose input reaches further or changes faster; \
             docs/choosing-effects.md says what separates neighbours.",
            which.class.join(", ")
        )),
        _ => steps.extend(none_of_these(found)),
    }
    let left = which
        .unexplained_p_value
        .is_some_and(|p| p < found.detection.alpha);
    if left && which.decision == Decision::Named {
        steps.push("Something is left beside what was accepted: diagnose again with it added to the study.".into());
    }
    let vague: Vec<&str> = (found.parameters.iter())
        .filter(|p| !p.identified)
        .map(|p| p.name.as_str())
        .collect();
    if !vague.is_empty() {
        steps.push(format!(
            "This record knows no more of {} than the prior: fix what is known otherwise, or measure with a livelier input.",
            vague.join(", ")
        ));
    }
    if found.validation_runs.is_none() && found.verdict == Verdict::StructuralGap {
        steps
            .push("Measure a second record with another input and give it as --validation.".into());
    }
    steps
}

/// Where to look for a law that is not listed.
fn none_of_these(found: &Diagnosis) -> Vec<String> {
    let (place, maps) = (&found.place, found.place.maps.notable());
    let mut look = match &place.target {
        Some(target) => format!("Look at {target}"),
        None => "Look at the twin".into(),
    };
    if let Some(r) = maps.regions.first() {
        look.push_str(&format!(
            ", above all where {} is {} … {}",
            r.variable,
            short(r.low),
            short(r.high)
        ));
    }
    if let Some(w) = maps.windows.first() {
        look.push_str(&format!(
            ", and at {} to {} s",
            short(w.start),
            short(w.end)
        ));
    }
    vec![
        look + ".",
        "Write the law that you suspect as an effect of your own (examples/own_effect.rs) and diagnose again.".into(),
    ]
}

/// `[[effect]]` with its keys.
fn study_table(units: &Units, fit: &EffectFit) -> Option<String> {
    let effect = units.effect(fit)?;
    let other = effect.other().map_or(String::new(), |name| {
        let key = match effect.law() {
            Law::Limit => "to",
            _ => "from",
        };
        format!("{key} = \"{name}\"\n")
    });
    let finite = fit.magnitudes.iter().filter(|(_, value)| value.is_finite());
    let values: Vec<String> = finite
        .map(|(name, value)| format!("{name} = {:?}", six_digits(*value)))
        .collect();
    Some(format!(
        "[[effect]]\nid = \"{}\"\ntarget = \"{}\"\n{other}magnitudes = {{ {} }}\n",
        fit.id,
        fit.target,
        values.join(", ")
    ))
}
