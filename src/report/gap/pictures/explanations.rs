//! Explanations by probability.

use crate::diagnose::{Decision, Diagnosis, EffectFit};
use crate::report::chart::{Bar, BarChart, BarGroup};
use crate::report::digits::{chance, short};

/// Explanations that are drawn.
const SHOWN: usize = 8;

/// Listed effects by probability, then everything else together; `None` where none was fitted.
pub fn explanations(diagnosis: &Diagnosis) -> Option<String> {
    let which = &diagnosis.cause;
    let first = which.effects.first()?;
    let bar = |effect: &EffectFit| {
        let (key, gain) = (effect.key(), short(effect.log_score_gain));
        let note = format!("{}, {gain} nats", chance(effect.probability));
        Bar::new(&key, effect.probability, &note).clear(which.accepted.contains(&key))
    };
    let shown = || which.effects.iter().take(SHOWN);
    let is_rival =
        |e: &&EffectFit| which.decision == Decision::Class && which.class.contains(&e.key());
    let rivals: Vec<Bar> = shown().filter(is_rival).map(bar).collect();
    let mut others: Vec<Bar> = shown().filter(|e| !is_rival(e)).map(bar).collect();
    // Effects that absorb a parameter gap are compared with no others.
    if which.decision != Decision::Absorbed {
        let listed: f64 = shown().map(|e| e.probability).sum();
        let rest = (1.0 - listed).max(0.0);
        others.push(Bar::new(
            "all others, including unlisted",
            rest,
            &chance(rest),
        ));
    }
    let groups = if rivals.is_empty() {
        vec![BarGroup::new("", Some(1.0), others)]
    } else {
        vec![
            BarGroup::new("One class: not separated by this record", Some(1.0), rivals),
            BarGroup::new("Outside the class", Some(1.0), others),
        ]
    };
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
