//! Explanations by probability.

use crate::diagnose::{Decision, Diagnosis, EffectFit};
use crate::report::chart::{Bar, BarChart, BarGroup};
use crate::report::digits::{chance, short};

/// Explanations that are drawn.
const SHOWN: usize = 8;

/// Listed effects by probability, then the kinds of explanation; `None` where no effect was fitted.
pub fn explanations(diagnosis: &Diagnosis) -> Option<String> {
    let which = &diagnosis.cause;
    let first = which.effects.first()?;
    let bar = |effect: &EffectFit| {
        let (key, gain) = (effect.key(), short(effect.log_evidence));
        let note = format!("{}, {gain} nats", chance(effect.probability));
        Bar::new(&key, effect.probability, &note).clear(which.accepted.contains(&key))
    };
    let shown = || which.effects.iter().take(SHOWN);
    let has_class =
        which.decision != Decision::Absorbed && which.class.len() > which.accepted.len();
    let is_inside = |e: &&EffectFit| has_class && which.class.contains(&e.key());
    let inside: Vec<Bar> = shown().filter(is_inside).map(bar).collect();
    let others: Vec<Bar> = shown().filter(|e| !is_inside(e)).map(bar).collect();
    let p = &which.probabilities;
    let kinds = [
        ("listed effects only", p.listed),
        ("listed and unlisted", p.partial),
        ("unlisted only", p.unknown),
        ("nothing", p.nothing),
    ];
    let kinds = kinds.map(|(label, p)| Bar::new(label, p, &chance(p)));
    let (first_label, second_label) = match has_class {
        true => (
            "One class: not separated by this record",
            "Outside the class",
        ),
        false => ("", "Effects"),
    };
    let groups = [
        (first_label, inside),
        (second_label, others),
        ("Missing, all in all", kinds.to_vec()),
    ];
    let groups = (groups.into_iter())
        .filter(|(_, bars)| !bars.is_empty())
        .map(|(label, bars)| BarGroup::new(label, Some(1.0), bars))
        .collect();
    let chart = BarChart {
        title: "Explanations by probability".into(),
        description: format!(
            "Bars of the best explanations; the first is {} with {}.",
            first.key(),
            chance(first.probability)
        ),
        groups,
    };
    Some(chart.svg())
}
